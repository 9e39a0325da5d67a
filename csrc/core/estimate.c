/* SPDX-License-Identifier: BSD-3-Clause */
/* estimate.c: see estimate.h. */
#include "estimate.h"

#include "output.h"
#include "walk.h"

#include <math.h>

#define SAMPLES 64         /* points that are counted: an error of some per cent */
#define SAMPLE_WORK 4.0e6  /* candidates and rows that sampling may cost, some milliseconds */
#define MOST_PAIRS 0x1p62  /* more than int64 should be asked to count */
#define SURE_ERRORS 3.0    /* standard errors below the mean at which a refusal is sure enough */

static double
sum_of_squares(const hs_bins *bins, int64_t n_cells)
{
    double squares = 0.0;
    for (int64_t c = 0; c < n_cells; c++) {
        const double n = bins->start[c + 1] - bins->start[c];
        squares += n * n;
    }
    return squares;
}

/*
 * A bound on the number of pairs. Each stencil offset pairs every cell with at most one other, so
 * by the Cauchy-Schwarz inequality it contributes at most the sum of squared occupancies; for two
 * sets, the root of the product of both sums.
 */
static double
bound_pairs(const hs_search *search)
{
    double squares = sum_of_squares(&search->bins, search->grid.n_cells), offsets = 0.0;
    if (search->has_queries) {
        const int64_t n_cells =
            search->is_sparse ? search->query_sparse.n_cells : search->grid.n_cells;
        squares = sqrt(squares * sum_of_squares(&search->query_bins, n_cells));
    }
    for (int64_t s = 0; s < search->stencil.n_rows; s++) {
        offsets += (double)search->stencil.rows[s].last - search->stencil.rows[s].first + 1.0;
    }
    return squares * offsets;
}

/* Bytes that one pair of the result takes at the worst moment: the caller's arrays, and what the
 * search still holds beside them. 0 when nothing is wanted but the count. */
static double
find_bytes_per_pair(const hs_options *options, int ndim)
{
    int64_t   bytes = 0;
    hs_output columns;
    if (options->out == NULL) {
        hs_output_init(NULL, ndim, options->want, options->index_bytes, &columns);
        bytes += hs_output_bytes_per_pair(&columns);
    }
    if (options->sorted) { /* it holds the pairs as found, and their order, while it writes */
        hs_output_init(NULL, ndim, options->want & ~(unsigned)HS_WANT_BOTH, sizeof(int32_t),
                       &columns);
        bytes += hs_output_bytes_per_pair(&columns) + (int64_t)sizeof(int64_t);
    }
    return (double)bytes;
}

static hs_status
refuse(const hs_search *search, double pairs, double bytes_per_pair, hs_failure *failure)
{
    failure->expected_pairs = pairs;
    failure->expected_bytes = pairs * bytes_per_pair;
    failure->limit_bytes = search->account.limit;
    return HS_ERR_MEMORY;
}

/*
 * Pairs that a fully periodic box must have: a ball of radius R holds at least as many lattice
 * points as copies of the cell cover a ball of radius R less the cell's diameter.
 */
static double
least_pairs(const hs_search *search)
{
    const hs_scene *scene = &search->scene;
    const double    n = (double)scene->n;
    double          diameter = 0.0;
    for (int r = 0; r < scene->lattice.n_periodic; r++) {
        double square = 0.0;
        for (int k = 0; k < scene->ndim; k++) {
            square += scene->lattice.rows[r][k] * scene->lattice.rows[r][k];
        }
        diameter += sqrt(square);
    }
    const double covered = hs_larger(1.0 - diameter / scene->cutoff, 0.0);
    double       least = search->grid.expected_pairs;
    for (int k = 0; k < scene->ndim; k++) {
        least *= covered;
    }
    /* Half a pair of each point would be the one with itself. */
    return (least - (search->has_queries ? 0.0 : 0.5 * n)) * search->pairs_per_half;
}

hs_status
hs_estimate_by_density(hs_search *search, hs_failure *failure)
{
    const double bytes_per_pair = find_bytes_per_pair(&search->options, search->scene.ndim);
    if (search->scene.lattice.n_periodic < search->scene.ndim || search->scene.n == 0) {
        return HS_OK;
    }
    const double least = least_pairs(search);
    if (bytes_per_pair == 0.0 && least > MOST_PAIRS) {
        failure->value = least;
        return HS_ERR_TOO_MANY;
    }
    if (!(least > 0.0) || hs_account_allows(&search->account, least * bytes_per_pair)) {
        return HS_OK;
    }
    return refuse(search, search->grid.expected_pairs * search->pairs_per_half, bytes_per_pair,
                  failure);
}

/* What a few points have found: the sum of their counts, of the squares, and how many. */
typedef struct sample {
    double  sum, squares;
    int64_t taken;
} sample;

/*
 * Points are sampled evenly over the cells; each counts its forward half, so the mean over points
 * times n estimates the pairs without bias. Stopping early leaves a count too small: an estimate
 * from below, which is the safe side here.
 */
static hs_status
take_sample(hs_walker *walker, int64_t n, sample *taken)
{
    const int64_t samples = n < SAMPLES ? n : SAMPLES;
    const double  row_work = 8.0 * (double)walker->search->stencil.n_rows;
    double        work = 0.0;
    *taken = (sample){0.0, 0.0, 0};
    for (; taken->taken < samples && work < SAMPLE_WORK; taken->taken++) {
        const int64_t si = (2 * taken->taken + 1) * n / (2 * samples);
        const int64_t before = walker->n_candidates;
        walker->n_found = 0;
        walker->candidate_limit = before + (int64_t)SAMPLE_WORK;
        const hs_status status = hs_walk_point(walker, (int32_t)si);
        if (status != HS_OK && status != HS_STATUS_END) {
            return status;
        }
        taken->sum += (double)walker->n_found;
        taken->squares += (double)walker->n_found * (double)walker->n_found;
        work += (double)(walker->n_candidates - before) + row_work;
    }
    return HS_OK;
}

hs_status
hs_estimate_by_sample(hs_search *search, hs_failure *failure)
{
    const double  bytes_per_pair = find_bytes_per_pair(&search->options, search->scene.ndim);
    const int64_t n = hs_search_asking(search)->n;
    hs_walker     walker;
    sample        taken;
    if (n == 0 ||
        hs_account_allows(&search->account, bound_pairs(search) * bytes_per_pair)) {
        return HS_OK;
    }
    hs_status status = hs_walker_init(search, HS_BLOCK_COUNTS, NULL, NULL, &walker);
    if (status == HS_OK) {
        status = take_sample(&walker, n, &taken);
        if (status == HS_ERR_SHIFT_RANGE) {
            failure->row = walker.failed_point;
            failure->in_queries = search->has_queries;
        }
        hs_walker_close(search, &walker);
    }
    if (status != HS_OK) {
        return status;
    }
    const double many = (double)taken.taken;
    const double mean = taken.sum / many;
    const double variance = fmax(0.0, taken.squares / many - mean * mean);
    const double error = taken.taken < n ? sqrt(variance / many) : 0.0;
    const double least = (mean - SURE_ERRORS * error) * (double)n;
    if (hs_account_allows(&search->account, least * bytes_per_pair)) {
        return HS_OK;
    }
    return refuse(search, mean * (double)n, bytes_per_pair, failure);
}
