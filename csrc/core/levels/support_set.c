/* SPDX-License-Identifier: BSD-3-Clause */
/* support_set.c: the lower triangle of each matrix, once the upper one is seen to be the same. */
#include "support_set.h"

#include <math.h>

/* The lower triangle, each number of the matrix read once. False if one is not finite or differs
 * from its mirror image, which is *wrong then; NaN differs. */
static bool
read_entries(const double *matrix, int ndim, double *entries, double *wrong)
{
    bool right = true;
    for (int k = 0; k < ndim; k++) {
        for (int l = 0; l <= k; l++) {
            const double lower = matrix[k * ndim + l] + 0.0; /* and no -0 */
            const double upper = l < k ? matrix[l * ndim + k] : lower;
            entries[hs_support_at(k, l)] = lower;
            if (right && (!isfinite(lower) || lower != upper)) {
                *wrong = isfinite(lower) ? upper : lower;
                right = false;
            }
        }
    }
    return right;
}

static hs_status
refuse(hs_status status, int64_t row, double value, hs_failure *failure)
{
    failure->row = row;
    failure->value = value;
    return status;
}

static hs_status
read_one(const double *matrix, int64_t row, int ndim, double extent, double *numbers, double *reach,
         hs_failure *failure)
{
    double wrong = 0.0;
    if (!read_entries(matrix, ndim, numbers, &wrong)) {
        return refuse(HS_ERR_SUPPORTS, row, wrong, failure);
    }
    numbers[hs_support_entries(ndim)] = hs_support_size(ndim, numbers);
    switch (hs_support_reach(ndim, numbers, extent, reach)) {
    case HS_SUPPORT_FITS: return HS_OK;
    case HS_SUPPORT_NOT_DEFINITE: return refuse(HS_ERR_SUPPORTS, row, numbers[0], failure);
    default: return refuse(HS_ERR_SUPPORT_REACH, row, extent, failure);
    }
}

hs_status
hs_support_set_read(hs_account *account, const hs_options *options, const double *supports,
                    int64_t n, int ndim, double extent, hs_support_set *set, double *reaches,
                    hs_failure *failure)
{
    const int64_t each = hs_support_numbers(ndim);
    hs_status     status = HS_OK;
    set->first = 0;
    set->numbers = hs_alloc(account, HS_FOR_SUPPORTS, n * each, sizeof *set->numbers);
    if (set->numbers == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t i = 0; status == HS_OK && i < n; i++) {
        status = read_one(supports + i * ndim * ndim, i, ndim, extent, set->numbers + i * each,
                          &reaches[i], failure);
        if (status == HS_OK && (i + 1) % HS_POLL_SUPPORTS == 0) {
            status = hs_poll(options, 0.0);
        }
    }
    if (status != HS_OK) {
        hs_support_set_free(account, set);
    }
    return status;
}

void
hs_support_set_free(hs_account *account, hs_support_set *set)
{
    hs_free(account, set->numbers);
    set->numbers = NULL;
}
