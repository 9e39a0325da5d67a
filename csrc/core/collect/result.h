/* SPDX-License-Identifier: BSD-3-Clause */
/* result.h: what a finished search is, for the functions of api/ that make one. */
#ifndef HS_RESULT_H
#define HS_RESULT_H

#include "columns.h"
#include "../threads/call.h"

struct hs_pairs {
    hs_call   call; /* which has ended: kept for its account */
    hs_output output;
    hs_output offsets; /* int64, where the rows of hs_neighbors_find begin; else nothing */
};

/* An empty result, whose call must be begun next. NULL when memory is short. */
hs_pairs *hs_pairs_new(void);

/* An empty output of the columns that the call wants, or the caller's arrays. */
void hs_pairs_open(hs_pairs *pairs, int ndim);

/* n offsets, of which none is set, charged to `account`; *offsets is their array. HS_OK or
 * HS_ERR_MEMORY; the output of offsets can be freed either way. */
hs_status hs_pairs_open_offsets(hs_account *account, int64_t n, hs_pairs *pairs, int64_t **offsets);

/* Leaves the call, which found n_pairs pairs. *result becomes the object, or that is freed. Returns
 * the status. */
hs_status hs_pairs_finish(hs_pairs *pairs, hs_status status, int64_t n_pairs, hs_pairs **result);

/* When a search ends with this status: arrays also where there are no pairs; HS_ERR_CAPACITY where
 * those of the caller had no room for all. */
hs_status hs_pairs_conclude(hs_output *output, hs_status status, hs_failure *failure);

#endif
