/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * want.h: the quantities of a pair, in the order of their HS_WANT_ bits: how many bytes each takes
 * and which purpose these bytes are counted under. The one place that knows.
 */
#ifndef HS_WANT_H
#define HS_WANT_H

#include "../../halfshell.h"

#define HS_QUANTITIES 7 /* one for each HS_WANT_ bit */

/* Every HS_WANT_ bit that needs no other options. */
#define HS_WANT_ALL (2u * HS_WANT_BOTH - 1u)

/* Bytes of one pair in the column of this HS_WANT_ bit. index_bytes: 4 or 8, of i and j. */
size_t hs_want_width(unsigned bit, int ndim, int index_bytes);

/* Bytes of one pair in the columns of all bits of `want`. */
int64_t hs_want_bytes(unsigned want, int ndim, int index_bytes);

/* The number of a bit, from 0 on; HS_QUANTITIES for what is not one bit of them. */
int hs_want_number(unsigned bit);

/* What the bytes of quantity number k are counted as. */
hs_purpose hs_want_purpose(int k);

#endif
