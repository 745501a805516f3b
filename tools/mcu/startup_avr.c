/* Output, exit and counting of cycles on an emulated AVR; avr-libc starts the program.
 *
 * Text leaves through the serial port. The end of `main` prints its result and sleeps with
 * interrupts off, which ends the simulation.
 */
#include "board.h"
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#define CYCLES_BETWEEN_OVERFLOWS 65536
#define COARSE_CYCLES 1024

static uint16_t fine_begin, coarse_begin;
static uint32_t least = UINT32_MAX, most, total;

void print_text(const char *text)
{
    UCSR0B = _BV(TXEN0);
    for (; *text != '\0'; text++) {
        loop_until_bit_is_set(UCSR0A, UDRE0);
        UDR0 = (uint8_t)*text;
    }
}

void print_hex(uint32_t value)
{
    char text[10];
    for (uint8_t i = 0; i < 8; i++) {
        text[i] = "0123456789abcdef"[(value >> (28 - 4 * i)) & 15u];
    }
    text[8] = '\n';
    text[9] = '\0';
    print_text(text);
}

/* Timer 1 counts cycles, timer 3 every 1024th: together they count further than 16 bits. */
void step_begins(void)
{
    TCCR1B = _BV(CS10);
    TCCR3B = _BV(CS32) | _BV(CS30);
    coarse_begin = TCNT3;
    fine_begin = TCNT1;
}

void step_ends(void)
{
    const uint16_t fine = TCNT1 - fine_begin;
    const uint16_t coarse = TCNT3 - coarse_begin;
    const int32_t rest = (int32_t)coarse * COARSE_CYCLES - fine + CYCLES_BETWEEN_OVERFLOWS / 2;
    const uint32_t cycles = (uint32_t)(rest & -CYCLES_BETWEEN_OVERFLOWS) + fine;
    least = cycles < least ? cycles : least;
    most = cycles > most ? cycles : most;
    total += cycles;
}

#define STACK_BYTES 2048
#define STACK_PATTERN 0x5au

void paint_stack(void)
{
    for (volatile uint8_t *byte = (uint8_t *)RAMEND - STACK_BYTES; byte < (uint8_t *)SP - 16;
         byte++) {
        *byte = STACK_PATTERN;
    }
}

uint32_t deepest_stack(void)
{
    const uint8_t *byte = (const uint8_t *)RAMEND - STACK_BYTES;
    while (*byte == STACK_PATTERN) {
        byte++;
    }
    return (uint32_t)((const uint8_t *)RAMEND + 1 - byte);
}

/* The C library's start comes here when `main` has returned: cycles counted, then the result. */
void exit(int status)
{
    print_hex(least);
    print_hex(most);
    print_hex(total);
    print_hex((uint32_t)status);
    cli();
    sleep_enable();
    sleep_cpu();
    for (;;) {
    }
}
