/* SPDX-License-Identifier: BSD-3-Clause */
/* partners.h: excluded pairs of the caller as rows: the partners of each asking point. */
#ifndef HS_PARTNERS_H
#define HS_PARTNERS_H

#include "../../halfshell.h"
#include "../memory/account.h"

/* Those of row r are number[first[r]] to number[first[r + 1]], ascending. Arrays are owned. */
typedef struct hs_partners {
    int64_t *first; /* NULL: no pairs are excluded */
    int32_t *number;
} hs_partners;

/* HS_OK, or HS_ERR_ARGUMENT for numbers that are no point's (failure->row). */
hs_status hs_partners_check(const hs_selection *selection, int64_t n_asking, int64_t n_points,
                            hs_failure *failure);

/*
 * Each way round, or from queries to points alone. Any status of hs_partners_check, or
 * HS_ERR_MEMORY. To be freed on failure as well.
 */
hs_status hs_partners_open(const hs_selection *selection, int64_t n_asking, int64_t n_points,
                           bool has_queries, hs_account *account, hs_partners *partners,
                           hs_failure *failure);

/* Harmless twice. */
void hs_partners_free(hs_account *account, hs_partners *partners);

#endif
