/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * support_set.h: the supports of a set of points, read once and checked: what is decided with, and
 * how far each reaches.
 */
#ifndef HS_SUPPORT_SET_H
#define HS_SUPPORT_SET_H

#include "../base/poll.h"
#include "../exact/support.h"
#include "../memory/account.h"

/* Supports that are read, or looked at, between two polls: some milliseconds. */
#define HS_POLL_SUPPORTS (HS_POLL_POINTS / 16)

/* hs_support_numbers for each point. */
typedef struct hs_support_set {
    double *numbers; /* owned; one support after the other, in the caller's order; NULL: none */
    int64_t first;   /* the number of the first */
} hs_support_set;

/* supports: n * ndim * ndim, numbered from 0. reaches: receives n. HS_OK; HS_ERR_MEMORY;
 * HS_ERR_INTERRUPTED; HS_ERR_SUPPORTS or HS_ERR_SUPPORT_REACH with the row of the failure. On
 * failure holds nothing. */
hs_status hs_support_set_read(hs_account *account, const hs_options *options,
                              const double *supports, int64_t n, int ndim, double extent,
                              hs_support_set *set, double *reaches, hs_failure *failure);

/* The numbers of the support of this number. */
HS_ALWAYS_INLINE const double *
hs_support_set_at(const hs_support_set *set, int ndim, int64_t number)
{
    return set->numbers + (number - set->first) * (hs_support_entries(ndim) + 1);
}

/* Harmless twice. */
void hs_support_set_free(hs_account *account, hs_support_set *set);

#endif
