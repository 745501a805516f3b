/* Bare-metal start of an emulated Cortex-M with semihosting for output and exit. */
#include "board.h"

extern uint32_t data_begin[], data_end[], data_load[], bss_begin[], bss_end[], stack_top[];
int main(void);
void reset_handler(void);

static uint32_t semihosting(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void print_text(const char *text)
{
    semihosting(0x04u, text);
}

void print_hex(uint32_t value)
{
    char text[10];
    for (int i = 0; i < 8; i++)
        text[i] = "0123456789abcdef"[(value >> (28 - 4 * i)) & 15u];
    text[8] = '\n';
    text[9] = '\0';
    print_text(text);
}

int32_t open_file(const char *name)
{
    uint32_t length = 0;
    while (name[length] != 0)
        length++;
    const uint32_t arguments[3] = {(uint32_t)name, 1u /* to read bytes */, length};
    return (int32_t)semihosting(0x01u, arguments);
}

uint32_t read_file(int32_t file, void *to, uint32_t size)
{
    const uint32_t arguments[3] = {(uint32_t)file, (uint32_t)to, size};
    return size - semihosting(0x06u, arguments); /* which returns what is missing */
}

#define STACK_WORDS 1024u
#define STACK_PATTERN 0x5aa5c33cu

void paint_stack(void)
{
    volatile uint32_t *word = stack_top - STACK_WORDS;
    const volatile uint32_t here = 0;
    while (word < &here - 32)
        *word++ = STACK_PATTERN;
}

uint32_t deepest_stack(void)
{
    const uint32_t *word = stack_top - STACK_WORDS;
    while (*word == STACK_PATTERN)
        word++;
    return (uint32_t)(stack_top - word) * 4u;
}

/* The counting plugin knows the addresses of both. */
void step_begins(void)
{
    __asm__ volatile("" ::: "memory");
}

void step_ends(void)
{
    __asm__ volatile("" ::: "memory");
}

void reset_handler(void)
{
#if defined(__ARM_FP)
    *(volatile uint32_t *)0xe000ed88u |= 0xf00000u; /* allow the floating-point unit */
    __asm__ volatile("dsb\n isb");
#endif
    for (uint32_t *to = data_begin, *from = data_load; to < data_end;)
        *to++ = *from++;
    for (uint32_t *to = bss_begin; to < bss_end;)
        *to++ = 0;
    main();
    semihosting(0x18u, (const void *)0x20026u); /* application exit */
    for (;;) {
    }
}

__attribute__((section(".vectors"), used)) const void *const vectors[2] = {stack_top,
                                                                           (void *)reset_handler};
