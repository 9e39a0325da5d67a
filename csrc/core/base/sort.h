/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_BASE_SORT_H
#define HS_BASE_SORT_H

#include "../../halfshell.h"
#include "base.h"

/*
 * sort.h: sorting of numbers: by digits where there are many, by insertion in short rows; and the
 * starts of parts from their lengths.
 */

/* Whatever the keys are, sorting takes time in proportion to how many there are; equal ones keep
 * their order. */

/* All four arrays are borrowed and equally long; the spare ones hold nothing between calls. */
typedef struct hs_keys {
    int64_t          *keys; /* not negative */
    int32_t          *ids;  /* travel with their keys */
    int64_t          *spare_keys;
    int32_t          *spare_ids;
    const hs_options *options; /* polled */
    int64_t           work;    /* keys moved since the last poll */
} hs_keys;

/* Sorts places [first, end) ascending. HS_OK or HS_ERR_INTERRUPTED. */
hs_status hs_keys_sort(hs_keys *sort, int64_t first, int64_t end);

/* Sorts n numbers by their bits from `from` on, 0 to 63; those that agree in these keep their
 * order. `spare` has room for as many. */
void hs_sort_numbers(uint64_t *numbers, int64_t n, int from, uint64_t *spare);

/* Bits up to the highest one that is set; 0 for 0. */
int hs_count_bits(uint64_t number);

/*
 * Where the parts of an array begin, of which first the lengths are counted: that of part k in
 * starts[k + 1], with 0 in front. Filling part k moves starts[k] to its end, which is where part
 * k + 1 began.
 */

/* From lengths to beginnings; the last of the n numbers becomes the length of the array. n > 0. */
HS_ALWAYS_INLINE void
hs_starts_of_lengths(int64_t *starts, int64_t n)
{
    for (int64_t k = 1; k < n; k++) {
        starts[k] += starts[k - 1];
    }
}

/* From ends, once all parts are filled, back to beginnings. n > 0. */
HS_ALWAYS_INLINE void
hs_starts_of_ends(int64_t *starts, int64_t n)
{
    memmove(starts + 1, starts, (size_t)(n - 1) * sizeof *starts);
    starts[0] = 0;
}

#endif
