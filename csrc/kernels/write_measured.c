/* SPDX-License-Identifier: BSD-3-Clause */
/* write_measured.c: d and D of one pair that a writer is not sure of. */
#include "kernel.h"

#include <string.h>

/* S and image of a candidate, over the rows. */
static void
find_shift(const hs_write *write, int32_t t, int64_t place, int64_t *S, int64_t *image)
{
    for (int r = 0; r < write->metric->n_rows; r++) {
        image[r] = write->image != NULL ? write->image[place * HS_RECORD + r] : 0;
        S[r] = write->few != NULL ? write->few[place * HS_RECORD + r] : image[r];
        S[r] += write->turns[r] != NULL ? write->turns[r][t] : 0;
    }
}

/* Whether it is listed the other way round. */
static bool
is_flipped(const hs_write *write, int64_t number, int32_t point, const int64_t *S)
{
    int r = 0;
    if (!write->is_half || number != point) {
        return write->is_half && number < point;
    }
    while (r < write->metric->n_rows && S[r] == 0) {
        r++;
    }
    return r < write->metric->n_rows && S[r] < 0;
}

void
hs_write_measured(const hs_write *write, const struct hs_hits *hits, int32_t h)
{
    const int64_t place = hits->label[h];
    int32_t       t = 0;
    const double *q = write->q + place * HS_RECORD;
    double        p[HS_WRITE_MOST_DIM], D[HS_WRITE_MOST_DIM];
    int64_t       S[HS_WRITE_MOST_DIM], image[HS_WRITE_MOST_DIM], number;
    while (hits->end[t] <= h) {
        t++;
    }
    for (int k = 0; k < write->ndim; k++) {
        p[k] = write->p[k][t];
    }
    memcpy(&number, &q[HS_RECORD - 1], sizeof number);
    find_shift(write, t, place, S, image);
    const double found = hs_metric_measure(write->metric, p, q, write->by_S ? S : image, D);
    const double d = found * write->first * write->second;
    const double sign = is_flipped(write, number, hits->point[t], S) ? -1.0 : 1.0;
    if (write->distance != NULL) {
        write->distance[h] = d < write->cutoff ? d : write->largest;
    }
    for (int k = 0; write->vector != NULL && k < write->ndim; k++) {
        /* Plus zero: a zero has no sign, which would tell where the search met the pair. */
        write->vector[(int64_t)h * write->ndim + k] =
            sign * D[k] * write->first * write->second + 0.0;
    }
}
