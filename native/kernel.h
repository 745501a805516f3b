/* One compiled kernel, as the extension knows it. */
#ifndef H2NAV_KERNEL_H
#define H2NAV_KERNEL_H

#include <stddef.h>
#include <stdint.h>

struct kernel {
    /* returns the bits of the last sample */
    int32_t (*run)(void *state, void *workspace, const void *gains, const void *samples,
                   size_t rows, void *results);
    size_t state_size;
    size_t workspace_size; /* 0 for a kernel that needs none */
    size_t gains_size;
    size_t sample_size;
    size_t number_size; /* of a double or of a 32-bit integer */
};

#endif
