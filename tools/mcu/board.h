/* What the benchmark programs may ask of the emulated board. */
#ifndef BOARD_H
#define BOARD_H
#include <stdint.h>

void print_text(const char *text);
void print_hex(uint32_t value);
void paint_stack(void);
uint32_t deepest_stack(void);

/* What lies between these two is counted. */
void step_begins(void);
void step_ends(void);

#endif
