/* SPDX-License-Identifier: BSD-3-Clause */
/* estimate.c: see estimate.h. */
#include "estimate.h"

#include "walk.h"

#include <math.h>

#define SAMPLES 64         /* points that are counted: an error of some per cent */
#define SAMPLE_WORK 4.0e6  /* candidates and rows that sampling may cost, some milliseconds */
#define MOST_PAIRS 0x1p62  /* more than int64 should be asked to count */
#define ROUNDING 1e-9      /* relative; far more than the coordinates along the axes are rounded */
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
    returned += want & HS_WANT_BOTH ? 2.0 * options->index_bytes : 0.0;
    const double measures = (want & HS_WANT_DISTANCE ? sizeof(double) : 0.0) +
                            (want & HS_WANT_VECTOR ? sizeof(double) * ndim : 0.0) +
                            (want & HS_WANT_SHIFT ? sizeof(int32_t) * ndim : 0.0);
    /* Sorting holds the merged pairs and their order while it writes. */
    const double sorting = options->sorted ? stored + measures + sizeof(int64_t) : 0.0;
    return options->out != NULL ? sorting : returned + measures + sorting;
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
 * Pairs that a periodic box must have. Along the open axes no two points are further apart than the
 * diagonal of what the points span there; what is left of the radius spans a ball in the space of
 * the periodic axes. One of radius R holds at least as many lattice points as copies of the cell
 * cover a ball of radius R less the cell's diameter.
 */
static double
least_pairs(const hs_search *search)
{
    const hs_scene   *scene = &search->scene;
    const hs_lattice *lattice = &scene->lattice;
    const double      n = (double)scene->n;
    double            diameter = 0.0, across = 0.0;
    for (int r = 0; r < lattice->n_periodic; r++) {
        double square = 0.0;
        for (int k = 0; k < scene->ndim; k++) {
            square += lattice->rows[r][k] * lattice->rows[r][k];
        }
        diameter += sqrt(square);
    }
    for (int k = 0; k < scene->ndim; k++) {
        if (lattice->row_of_axis[k] < 0) {
            const double extent = (scene->upper[k] - scene->lower[k]) / scene->cutoff;
            across += extent * extent * (1.0 + ROUNDING);
        }
    }
    const double radius = sqrt(hs_larger(1.0 - across, 0.0)) * scene->cutoff - diameter;
    if (!(radius > 0.0)) {
        return 0.0;
    }
    const double ball = hs_ball_volume(lattice->n_periodic, radius);
    return 0.5 * n * (n * ball / hs_lattice_volume(lattice, 0) - 1.0);
}

hs_status
hs_estimate_by_density(hs_search *search, hs_failure *failure)
{
    const double bytes_per_pair = hs_bytes_per_pair(&search->options, search->scene.ndim);
    if (search->scene.lattice.n_periodic == 0 || search->scene.n == 0) {
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
    const bool has_density = search->scene.lattice.n_periodic == search->scene.ndim;
    return refuse(search, has_density ? search->grid.expected_pairs : least, bytes_per_pair,
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
    const double  bytes_per_pair = hs_bytes_per_pair(&search->options, search->scene.ndim);
    const int64_t n = search->bins.n;
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
