/* SPDX-License-Identifier: BSD-3-Clause */
/* estimate.c: see estimate.h. */
#include "estimate.h"

#include <math.h>

#define SAMPLES 64         /* points that are counted; the error of the mean is then some per cent */
#define SAMPLE_WORK 4.0e6  /* candidates and rows that sampling may cost, some milliseconds */
#define MANY_IMAGES 1000   /* rows of images from which on the density decides: sampling would be slow */
#define DENSITY_MARGIN 2.0 /* counts of images scatter less than this around their volume */
#define SURE_ERRORS 3.0    /* standard errors below the mean at which a refusal is sure enough */

/*
 * A bound on the number of pairs. Each stencil offset pairs every cell with at most one other, so
 * by the Cauchy-Schwarz inequality it contributes at most the sum of squared occupancies.
 */
static double
bound_pairs(const hs_search *search)
{
    double squares = 0.0, offsets = 0.0;
    for (int64_t c = 0; c < search->grid.n_cells; c++) {
        const double n = search->bins.start[c + 1] - search->bins.start[c];
        squares += n * n;
    }
    for (int64_t s = 0; s < search->stencil.n_rows; s++) {
        offsets += (double)search->stencil.rows[s].last - search->stencil.rows[s].first + 1.0;
    }
    return squares * offsets;
}

double
hs_bytes_per_pair(const hs_options *options, int ndim)
{
    const unsigned want = options->want;
    double         stored = 0.0, returned = 0.0;
    for (unsigned bit = HS_WANT_I; bit <= HS_WANT_J; bit <<= 1) {
        stored += want & bit ? sizeof(int32_t) : 0.0;
        returned += want & bit ? options->index_bytes : 0.0;
    }
    const double measures = (want & HS_WANT_DISTANCE ? sizeof(double) : 0.0) +
                            (want & HS_WANT_VECTOR ? sizeof(double) * ndim : 0.0) +
                            (want & HS_WANT_SHIFT ? sizeof(int32_t) * ndim : 0.0);
    /* Sorting holds the merged pairs and their order while it writes. */
    return returned + measures + (options->sorted ? stored + measures + sizeof(int64_t) : 0.0);
}

static hs_status
refuse(const hs_search *search, double pairs, double bytes_per_pair, hs_failure *failure)
{
    failure->expected_pairs = pairs;
    failure->expected_bytes = pairs * bytes_per_pair;
    failure->limit_bytes = search->account.limit;
    return HS_ERR_MEMORY;
}

hs_status
hs_estimate_by_density(hs_search *search, hs_failure *failure)
{
    const double bytes_per_pair = hs_bytes_per_pair(&search->options, search->scene.ndim);
    const double pairs = search->grid.expected_pairs;
    const double images = hs_stencil_bound(&search->grid);
    if (!search->grid.expectation_is_sure || images < MANY_IMAGES) {
        return HS_OK;
    }
    if (pairs > 0x1p62) {
        failure->value = pairs;
        return bytes_per_pair > 0.0 ? refuse(search, pairs, bytes_per_pair, failure)
                                    : HS_ERR_TOO_MANY;
    }
    if (!hs_account_allows(&search->account, pairs * bytes_per_pair / DENSITY_MARGIN)) {
        return refuse(search, pairs, bytes_per_pair, failure);
    }
    return HS_OK;
}

static hs_status
add_hits(void *context, hs_search *search, int32_t si, int32_t n_hits)
{
    (void)search;
    (void)si;
    *(double *)context += n_hits;
    return HS_OK;
}

hs_status
hs_estimate_by_sample(hs_search *search, hs_failure *failure)
{
    const double  bytes_per_pair = hs_bytes_per_pair(&search->options, search->scene.ndim);
    const int64_t n = search->bins.n;
    const double  bound = bound_pairs(search);
    if (n == 0 || hs_account_allows(&search->account, bound * bytes_per_pair)) {
        return HS_OK;
    }
    /* Points are sampled evenly over the cells; each counts its forward half, so the mean over points
     * times n estimates the pairs without bias. */
    int64_t samples = n < SAMPLES ? n : SAMPLES;
    double  sum = 0.0, squares = 0.0, work = 0.0;
    int64_t taken = 0;
    for (; taken < samples && work < SAMPLE_WORK; taken++) {
        const int64_t si = (2 * taken + 1) * n / (2 * samples);
        const int64_t before = search->n_candidates;
        double        hits = 0.0;
        const hs_status status = hs_search_point(search, (int32_t)si, add_hits, &hits);
        if (status != HS_OK) {
            return status;
        }
        sum += hits;
        squares += hits * hits;
        work += (double)(search->n_candidates - before) + 8.0 * (double)search->stencil.n_rows;
    }
    const double mean = sum / (double)taken;
    const double variance = fmax(0.0, squares / (double)taken - mean * mean);
    const double error = taken < n ? sqrt(variance / (double)taken) : 0.0;
    const double least = (mean - SURE_ERRORS * error) * (double)n;
    if (hs_account_allows(&search->account, least * bytes_per_pair)) {
        return HS_OK;
    }
    return refuse(search, mean * (double)n, bytes_per_pair, failure);
}
