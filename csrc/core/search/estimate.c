/* SPDX-License-Identifier: BSD-3-Clause */
/* estimate.c: first by the density of the points, then by counting the neighbours of a sample. */
#include "estimate.h"

#include "../base/outcome.h"
#include "../base/want.h"
#include "walk.h"

#include <math.h>

/* What a search takes, about: order, cells and keys; a column and the copy that sorting makes; one
 * neighbourhood. */
#define BYTES_PER_POINT      24.0
#define BYTES_PER_COORDINATE 8.0
#define BYTES_OF_WALK        4e5
#define SAMPLES              64    /* points that are counted: an error of some per cent */
#define SAMPLE_WORK          4.0e6 /* candidates and rows that sampling may cost: milliseconds */
#define MANY_SAMPLES         1024  /* a power of two; more of them, for a number that is told */
#define SAMPLE_STEP          633   /* odd: they are taken here and there, for work may end early */
#define WORK_OF_ROW          8.0
#define MOST_PAIRS           0x1p62 /* close to the most that int64 counts */
#define ROUNDING             1e-9   /* relative; far more than coordinates along axes are rounded */
#define SURE_ERRORS          3.0    /* standard errors below the mean: sure enough to refuse */

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
        const int64_t n_cells = search->is_sparse ? search->query_sparse.n_cells
                                                  : search->grid.n_cells;
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
bytes_per_pair_of(const hs_options *options, int ndim)
{
    int64_t bytes = 0;
    if (options->out == NULL) {
        bytes += hs_want_bytes(options->want, ndim, options->index_bytes);
    }
    if (options->sorted) { /* it holds the pairs as found, and their order, while it writes */
        bytes += hs_want_bytes(options->want & ~(unsigned)HS_WANT_BOTH, ndim, sizeof(int32_t)) +
                 (int64_t)sizeof(int64_t);
    }
    return (double)bytes;
}

/* Bytes that one pair of this search's result takes, or 0 when none is kept. */
static double
find_bytes_per_pair(const hs_search *search)
{
    return search->keeps_none ? 0.0 : bytes_per_pair_of(&search->call->options, search->scene.ndim);
}

/* Volume of the space that a search covers: of the periodic part, times the extents along the
 * coordinate axes that have none. */
static double
occupied_volume(const hs_points *points, const hs_box *box, double cutoff)
{
    hs_lattice lattice;
    double     lower[HS_MAX_DIM], upper[HS_MAX_DIM];
    hs_lattice_init(box, points->ndim, hs_scale_of(0), &lattice);
    hs_points_range(points, lower, upper);
    double volume = hs_lattice_volume(&lattice, 0);
    for (int k = 0; k < points->ndim; k++) {
        volume *= lattice.row_of_axis[k] >= 0 ? 1.0 : hs_larger(upper[k] - lower[k], cutoff);
    }
    return volume;
}

void
hs_shortage_add(const hs_points *points, const hs_box *box, double cutoff, hs_shortage *shortage)
{
    const double n = (double)points->n, all = 0.5 * n * (n - 1.0);
    hs_failure   ignored;
    if (points->n == 0 || !(cutoff >= 0.0) || hs_box_check(box, &ignored) != HS_OK) {
        return;
    }
    const double volume = occupied_volume(points, box, cutoff);
    const double pairs = 0.5 * n * n * hs_ball_volume(points->ndim, cutoff) / volume;
    /* Numbers near the ends of the range leave no volume: all pairs then. */
    shortage->pairs += box == NULL && !(pairs < all) ? all : isfinite(pairs) ? pairs : all;
    shortage->bytes += n * (BYTES_PER_POINT + BYTES_PER_COORDINATE * points->ndim);
}

void
hs_shortage_tell(const hs_shortage *shortage, const hs_options *options, int ndim, double limit,
                 hs_failure *failure)
{
    failure->limit_bytes = limit;
    if (failure->expected_bytes == 0.0) {
        failure->expected_pairs = hs_larger(shortage->pairs, failure->expected_pairs);
        failure->expected_bytes = failure->expected_pairs * bytes_per_pair_of(options, ndim);
        failure->search_bytes = hs_larger(shortage->bytes + BYTES_OF_WALK, failure->search_bytes);
    }
}

void
hs_shortage_of_search(const hs_points *points, const hs_box *box, const hs_search *search,
                      hs_failure *failure)
{
    hs_shortage shortage = {0.0, 0.0};
    hs_shortage_add(points, box, search->call->options.cutoff, &shortage);
    if (search->is_full) {
        shortage.pairs *= search->pairs_per_half;
    }
    hs_shortage_tell(&shortage, &search->call->options, points->ndim, search->call->account.limit,
                     failure);
}

static hs_status
refuse(const hs_search *search, double pairs, double bytes_per_pair, hs_failure *failure)
{
    failure->expected_pairs = pairs;
    failure->expected_bytes = pairs * bytes_per_pair;
    failure->limit_bytes = search->call->account.limit;
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
    const double around = n * ball / hs_lattice_volume(lattice, 0); /* points in that ball */
    /* Half a pair of each point would be the one with itself. */
    return 0.5 * n * (around - (search->has_queries ? 0.0 : 1.0)) * search->pairs_per_half;
}

hs_status
hs_estimate_by_density(hs_search *search, hs_failure *failure)
{
    const double bytes_per_pair = find_bytes_per_pair(search);
    if (search->limits != NULL ||                /* the cutoff is that of few pairs */
        search->scene.lattice.n_periodic == 0) { /* nothing tells the density; a scene without
                                                  * points has no box either */
        return HS_OK;
    }
    const double least = least_pairs(search);
    if (bytes_per_pair == 0.0 && least > MOST_PAIRS) {
        failure->value = least;
        return HS_ERR_TOO_MANY;
    }
    if (!(least > 0.0) || hs_account_allows(&search->call->account, least * bytes_per_pair)) {
        return HS_OK;
    }
    const bool   has_density = search->scene.lattice.n_periodic == search->scene.ndim;
    const double dense = search->grid.expected_pairs * search->pairs_per_half;
    return refuse(search, has_density ? dense : least, bytes_per_pair, failure);
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
    const double  row_work = WORK_OF_ROW * (double)walker->search->stencil.n_rows;
    double        work = 0.0;
    *taken = (sample){0.0, 0.0, 0};
    for (; taken->taken < samples && work < SAMPLE_WORK; taken->taken++) {
        const int64_t si = (2 * taken->taken + 1) * n / (2 * samples);
        const int64_t before = walker->scanner.n_candidates;
        walker->scanner.n_found = 0;
        walker->scanner.candidate_limit = before + (int64_t)SAMPLE_WORK;
        const hs_status status = hs_walk_point(walker, (int32_t)si);
        if (status != HS_OK && status != HS_STOPPED) {
            return status;
        }
        taken->sum += (double)walker->scanner.n_found;
        taken->squares += (double)walker->scanner.n_found * (double)walker->scanner.n_found;
        work += (double)(walker->scanner.n_candidates - before) + row_work;
    }
    return HS_OK;
}

hs_status
hs_estimate_pairs(hs_search *search, double *pairs)
{
    const int64_t n = hs_search_asking(search)->n;
    const int64_t samples = n < MANY_SAMPLES ? n : MANY_SAMPLES;
    const double  by_density = search->grid.expected_pairs * search->pairs_per_half;
    double        work = 0.0, sum = 0.0;
    int64_t       taken = 0;
    hs_walker     walker;
    *pairs = 0.0;
    hs_status status = hs_walker_init(search, HS_BLOCK_COUNTS, NULL, NULL, &walker);
    if (status != HS_OK) {
        return status;
    }
    for (; status == HS_OK && taken < samples && work < SAMPLE_WORK; taken++) {
        const int64_t s = samples == n ? taken : taken * SAMPLE_STEP % samples;
        const int64_t before = walker.scanner.n_candidates;
        walker.scanner.n_found = 0;
        walker.scanner.candidate_limit = before + (int64_t)SAMPLE_WORK;
        status = hs_walk_point(&walker, (int32_t)((2 * s + 1) * n / (2 * samples)));
        sum += (double)walker.scanner.n_found;
        work += (double)(walker.scanner.n_candidates - before) +
                WORK_OF_ROW * (double)search->stencil.n_rows;
    }
    hs_walker_close(search, &walker);
    if (taken > 0) {
        *pairs = sum / (double)taken * (double)n;
    }
    if (status == HS_STOPPED || taken < samples) {
        *pairs = hs_larger(*pairs, by_density);
    }
    return status == HS_STOPPED ? HS_OK : status;
}

/* The part of what is free that a result may seem to need: its density may be off by a third. */
#define SEEMS_SMALL 0.75

/* Whether to take a sample before the limit is looked up, which takes longer: the result may be too
 * large to do without, and does not seem to be. */
static bool
samples_first(const hs_search *search, double bytes_per_pair, double bound)
{
    const double by_density = search->grid.expected_pairs * search->pairs_per_half;
    return search->call->account.find_limit != NULL && bound > HS_LIMIT_FREE &&
           by_density * bytes_per_pair < SEEMS_SMALL * HS_LIMIT_FREE;
}

hs_status
hs_estimate_by_sample(hs_search *search, hs_failure *failure)
{
    hs_account   *account = &search->call->account;
    const double  bytes_per_pair = find_bytes_per_pair(search);
    const int64_t n = hs_search_asking(search)->n;
    const double  bound = n > 0 ? bound_pairs(search) * bytes_per_pair : 0.0;
    hs_walker     walker;
    sample        taken;
    if (n == 0 ||
        (!samples_first(search, bytes_per_pair, bound) && hs_account_allows(account, bound))) {
        return HS_OK;
    }
    hs_status status = hs_walker_init(search, HS_BLOCK_COUNTS, NULL, NULL, &walker);
    if (status == HS_OK) {
        status = take_sample(&walker, n, &taken);
        HS_ASSERT(status != HS_ERR_SHIFT_RANGE); /* counting needs no S */
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
    /* a sample may say more than is possible */
    if (hs_account_allows(account, hs_smaller(least * bytes_per_pair, bound))) {
        return HS_OK;
    }
    return refuse(search, mean * (double)n, bytes_per_pair, failure);
}
