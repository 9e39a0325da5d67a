/* SPDX-License-Identifier: BSD-3-Clause */
#include "status.h"

#include <math.h>

/* status.c: one sentence for each status; the version of the core; the options by default. */

int
hs_version(void)
{
    return HS_VERSION;
}

hs_options
hs_options_default(void)
{
    return (hs_options){.inclusive = true,
                        .want = HS_WANT_I | HS_WANT_J,
                        .index_bytes = 8,
                        .threads = 1,
                        .memory_limit = INFINITY};
}

const char *
hs_status_text(hs_status status)
{
    switch (status) {
    case HS_OK: return "success";
    case HS_ERR_MEMORY: return "not enough memory";
    case HS_ERR_CUTOFF: return "cutoff must be finite and not negative";
    case HS_ERR_NOT_FINITE: return "points must be finite";
    case HS_ERR_BOX_FINITE: return "box must be finite";
    case HS_ERR_BOX_DEPENDENT: return "periodic box vectors must be linearly independent";
    case HS_ERR_BOX_SKEWED:
        return "the box is too skewed or too long for float64, or a point too far from it";
    case HS_ERR_TOO_MANY: return "too many points, systems or pairs";
    case HS_ERR_SHIFT_RANGE: return "a shift does not fit its integer type";
    case HS_ERR_ROUNDING: return "too far from the box for precision=\"double\"";
    case HS_ERR_KERNEL: return "no such kernel on this CPU, or not compiled as it must be";
    case HS_ERR_FAR: return "queries, or points from each other, lie too far away for cells";
    case HS_ERR_CAPACITY: return "the given arrays are too small";
    case HS_ERR_EDGES: return "edges must be finite, not negative and ascending";
    case HS_ERR_TYPES: return "types must be from 0 on and below the number of types";
    case HS_ERR_WEIGHTS: return "weights must be finite";
    case HS_ERR_INTERRUPTED: return "interrupted";
    case HS_ERR_RADII: return "a radius is negative, not finite, or out of range";
    case HS_ERR_SUPPORTS: return "a support is not symmetric and positive definite";
    case HS_ERR_SUPPORT_REACH: return "a support reaches too far";
    case HS_ERR_EXTENT: return "the extent of supports is negative, NaN or infinite";
    case HS_ERR_KEY: return "a key is missing, repeated, or has no position";
    case HS_ERR_ARGUMENT: return "an argument is out of its range, or an array is missing";
    case HS_STATUS_END: break;
    }
    return "unknown status";
}

/* Bytes of one pair: a fixed number of entries, or one for each axis. */
typedef struct quantity {
    hs_purpose purpose;
    size_t     entry_bytes; /* 0: index_bytes */
    int        n_entries;   /* 0: one for each axis */
} quantity;

static const quantity quantities[HS_QUANTITIES] = {
    {HS_FOR_INDICES, 0, 1},                /* HS_WANT_I */
    {HS_FOR_INDICES, 0, 1},                /* HS_WANT_J */
    {HS_FOR_DISTANCES, sizeof(double), 1}, /* HS_WANT_DISTANCE */
    {HS_FOR_VECTORS, sizeof(double), 0},   /* HS_WANT_VECTOR */
    {HS_FOR_SHIFTS, sizeof(int32_t), 0},   /* HS_WANT_SHIFT */
    {HS_FOR_INDICES, 0, 2},                /* HS_WANT_BOTH */
    {HS_FOR_INDICES, sizeof(int32_t), 1},  /* HS_WANT_SHELL */
};

int
hs_want_number(unsigned bit)
{
    int k = 0;
    while (k < HS_QUANTITIES && bit != 1u << k) {
        k++;
    }
    return k;
}

int64_t
hs_want_bytes(unsigned want, int ndim, int index_bytes)
{
    size_t bytes = 0;
    for (int k = 0; k < HS_QUANTITIES; k++) {
        const quantity *of = &quantities[k];
        if (want >> k & 1u) {
            bytes += (of->entry_bytes != 0 ? of->entry_bytes : (size_t)index_bytes) *
                     (size_t)(of->n_entries != 0 ? of->n_entries : ndim);
        }
    }
    return (int64_t)bytes;
}

hs_purpose
hs_want_purpose(int k)
{
    return quantities[k].purpose;
}
