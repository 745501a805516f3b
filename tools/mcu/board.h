/* What the benchmark programs may ask of the emulated board. */
#ifndef BOARD_H
#define BOARD_H
#include <stdint.h>

void print_text(const char *text);
void print_hex(uint32_t value);
void paint_stack(void);
uint32_t deepest_stack(void);

/* A file of the computer that emulates the board: its handle, < 0 if there is none; how many of
 * the bytes wanted were read.
 */
int32_t open_file(const char *name);
uint32_t read_file(int32_t file, void *to, uint32_t size);

/* What lies between these two is counted. */
void step_begins(void);
void step_ends(void);

#endif
