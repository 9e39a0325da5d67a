/* SPDX-License-Identifier: BSD-3-Clause */
/* half_list.c: one pass copies, a second one compares each pair with the one before. */
#include "half_list.h"

#include <string.h>

hs_half_columns
hs_half_list_columns(const hs_output *half)
{
    return (hs_half_columns){.n = half->n_pairs,
                             .ndim = half->ndim,
                             .i = hs_output_column(half, HS_WANT_I),
                             .j = hs_output_column(half, HS_WANT_J),
                             .shift = hs_output_column(half, HS_WANT_SHIFT)};
}

/* Sign of the first component that differs from that of `other`, or from 0. */
static int
compare_shifts(const int32_t *shift, const int32_t *other, int ndim)
{
    for (int k = 0; k < ndim; k++) {
        const int32_t with = other != NULL ? other[k] : 0;
        if (shift[k] != with) {
            return shift[k] < with ? -1 : 1;
        }
    }
    return 0;
}

/* Whether pair e is one of n points and comes behind the one before. */
static bool
is_right(const hs_half_columns *half, int64_t e, int64_t n)
{
    const int32_t  i = half->i[e], j = half->j[e];
    const int32_t *shift = half->shift != NULL ? half->shift + e * half->ndim : NULL;
    if (i < 0 || j < i || j >= n ||
        (i == j && (shift == NULL || compare_shifts(shift, NULL, half->ndim) <= 0))) {
        return false;
    }
    if (e == 0 || half->i[e - 1] < i || (half->i[e - 1] == i && half->j[e - 1] < j)) {
        return true;
    }
    return half->i[e - 1] == i && half->j[e - 1] == j && shift != NULL &&
           compare_shifts(shift, shift - half->ndim, half->ndim) > 0;
}

static hs_status
check(const hs_half_columns *half, int64_t n, hs_failure *failure)
{
    for (int64_t e = 0; e < half->n; e++) {
        if (!is_right(half, e, n)) {
            failure->row = e;
            return HS_ERR_ARGUMENT;
        }
    }
    return HS_OK;
}

hs_status
hs_half_list_copy(hs_account *account, const hs_half_list *pairs, int64_t n, hs_output *copy,
                  hs_failure *failure)
{
    const unsigned shift = pairs->shift != NULL ? HS_WANT_SHIFT : 0;
    const int      ndim = pairs->shift != NULL ? pairs->ndim : 1;
    hs_output_init(account, ndim, HS_WANT_I | HS_WANT_J | shift, 4, copy);
    if (pairs->n < 0 || ndim < 1 || ndim > HS_MAX_DIM ||
        (pairs->n > 0 && (pairs->i == NULL || pairs->j == NULL))) {
        return HS_ERR_ARGUMENT;
    }
    const hs_status status = hs_output_reserve(copy, pairs->n, 0.0);
    if (status != HS_OK) {
        return status;
    }
    copy->n_pairs = pairs->n;
    if (pairs->n > 0) {
        const size_t bytes = (size_t)pairs->n * sizeof(int32_t);
        memcpy(hs_output_column(copy, HS_WANT_I), pairs->i, bytes);
        memcpy(hs_output_column(copy, HS_WANT_J), pairs->j, bytes);
        if (shift != 0) {
            memcpy(hs_output_column(copy, HS_WANT_SHIFT), pairs->shift, (size_t)ndim * bytes);
        }
    }
    const hs_half_columns half = hs_half_list_columns(copy);
    return check(&half, n, failure);
}
