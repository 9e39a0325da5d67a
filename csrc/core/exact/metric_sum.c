/* SPDX-License-Identifier: BSD-3-Clause */
/* metric_sum.c: a sum that is no float64 lies between two neighbouring ones, and so does nearly
 * no distance. */
#include "metric_sum.h"

#include "metric_integer.h"

void
hs_metric_set_cutoff(double cutoff, hs_metric *metric)
{
    hs_metric_init(metric, metric->ndim, metric->n_rows, (const double(*)[HS_MAX_DIM])metric->rows,
                   cutoff, metric->inclusive);
}

bool
hs_metric_within_sum(const hs_metric *metric, hs_dw limit, const double *p, const double *q,
                     const int64_t *shift, hs_stages *stages)
{
    hs_metric side = *metric;
    HS_ASSERT(limit.hi >= 0.0 && limit.hi + limit.lo == limit.hi);
    if (limit.lo == 0.0) {
        hs_metric_set_cutoff(limit.hi, &side);
        return hs_metric_within(&side, p, q, shift, stages);
    }
    hs_stages unused = {0, 0, 0}, first = *stages; /* a pair counts once */
    side.inclusive = true;
    hs_metric_set_cutoff(limit.lo < 0.0 ? hs_next_down(limit.hi) : limit.hi, &side);
    if (hs_metric_within(&side, p, q, shift, &first)) {
        *stages = first;
        return true;
    }
    side.inclusive = false;
    hs_metric_set_cutoff(limit.lo < 0.0 ? limit.hi : hs_next_up(limit.hi), &side);
    if (!hs_metric_within(&side, p, q, shift, &unused)) {
        *stages = first;
        return false;
    }
    stages->by_integers++;
    const int sign = hs_integer_compare_sum(metric, limit, p, q, shift);
    return sign < 0 || (sign == 0 && metric->inclusive);
}
