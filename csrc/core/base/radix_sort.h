/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * radix_sort.h: a stable sort of point numbers by integer keys, quick whatever the keys are: its
 * cost follows the digits in which they differ, not their range.
 */
#ifndef HS_RADIX_SORT_H
#define HS_RADIX_SORT_H

#include "../../halfshell.h"
#include "base.h"

/* All four arrays are borrowed and equally long; the spare ones hold nothing between calls. */
typedef struct hs_keys {
    int64_t          *keys; /* not negative */
    int32_t          *ids;  /* travel with their keys */
    int64_t          *spare_keys;
    int32_t          *spare_ids;
    const hs_options *options; /* polled */
    int64_t           work;    /* keys moved since the last poll */
} hs_keys;

/* Sorts places [first, end) ascending; equal keys keep their order. HS_OK or HS_ERR_INTERRUPTED. */
hs_status hs_keys_sort(hs_keys *sort, int64_t first, int64_t end);

#endif
