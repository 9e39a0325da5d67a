/* SPDX-License-Identifier: BSD-3-Clause */
/* write_measured.c: coordinates in halves; d and D of one pair that a writer is not sure of. */
#include "kernel.h"

#include <math.h>

hs_halving
hs_write_halving(double cutoff)
{
    int E;
    (void)frexp(cutoff, &E);
    return (hs_halving){
        .grid = ldexp(1.5, E + 26), .fine = ldexp(1.5, E - 20), .farthest = ldexp(1.0, E + 23)};
}

bool
hs_write_move(const hs_metric *metric, hs_halving by, const int32_t *shift, hs_moved *moved)
{
    double turns = 0.0, total = 0.0;
    *moved = (hs_moved){.is_fine = true};
    for (int l = 0; l < metric->n_rows; l++) {
        turns += fabs((double)shift[l]);
        for (int k = 0; k < metric->ndim && shift[l] != 0; k++) {
            const double entry = metric->rows[l][k], large = (entry + by.grid) - by.grid;
            const double small = entry - large;
            moved->large[k] += shift[l] * large;
            moved->small[k] += shift[l] * small;
            moved->is_fine = moved->is_fine && (small + by.fine) - by.fine == small;
            total += fabs(shift[l] * entry);
        }
    }
    if (turns <= HS_WRITE_MOST_TURNS && total <= 0.5 * by.farthest) {
        return true;
    }
    moved->large[0] = NAN;
    return false;
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
    const int32_t place = hits->label[h], number = write->candidates[place].number;
    int32_t       t = 0;
    double        p[HS_WRITE_MOST_DIM], q[HS_WRITE_MOST_DIM], D[HS_WRITE_MOST_DIM];
    int64_t       S[HS_WRITE_MOST_DIM], shift[HS_WRITE_MOST_DIM];
    while (hits->end[t] <= h) {
        t++;
    }
    for (int k = 0; k < write->ndim; k++) {
        p[k] = write->p[k][t];
        q[k] = hs_write_coordinate(write, place, k);
    }
    for (int r = 0; r < write->metric->n_rows; r++) {
        S[r] = hs_write_S(write, t, place, r);
        shift[r] = hs_write_shift(write, t, place, r);
    }
    const double found = hs_metric_measure(write->metric, p, q, shift, D);
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
