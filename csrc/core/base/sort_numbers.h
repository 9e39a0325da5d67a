/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * sort_numbers.h: sorts short arrays of 64-bit numbers, many one after the other: the rows of a
 * table, whose numbers are spread evenly as a rule. Whatever they are, time is in proportion to how
 * many there are.
 */
#ifndef HS_SORT_NUMBERS_H
#define HS_SORT_NUMBERS_H

#include "base.h"

/* Sorts n numbers ascending; `spare` has room for as many. */
void hs_sort_numbers(uint64_t *numbers, int64_t n, uint64_t *spare);

/* Bits up to the highest one that is set; 0 for 0. */
int hs_count_bits(uint64_t number);

#endif
