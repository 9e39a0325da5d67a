/* SPDX-License-Identifier: BSD-3-Clause */
#include "search.h"
#include "../base/status.h"
#include "walk.h"
#include "choice.h"

/* search.c: begins a search, sets what follows from its parts, and frees them; and says how many
 * pairs to expect: by the density of the points, then by counting the neighbours of a sample. */

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
#define EVEN                 1.5    /* times the candidates of an even scene: crowds meet more */
#define LARGE_RESULT         0x1p23 /* bytes, by candidates: room for more is better foreseen */
#define BYTES_OF_INDICES     16.0   /* a pair of more than these takes its time to write anyway */

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

void
hs_shortage_add(const hs_sets *sets, const hs_box *box, double cutoff, hs_shortage *shortage)
{
    const hs_points *points = sets->points;
    const double     n = (double)points->n, all = 0.5 * n * (n - 1.0);
    const double     n_asking = sets->queries != NULL ? (double)sets->queries->n : n;
    hs_lattice       lattice;
    double           lower[HS_MAX_DIM], upper[HS_MAX_DIM];
    hs_failure       ignored;
    if (points->n == 0 || !(cutoff >= 0.0) || hs_box_check(box, &ignored) != HS_OK) {
        return;
    }
    hs_lattice_init(box, points->ndim, hs_scale_of(0), &lattice);
    hs_points_range(points, lower, upper);
    /* Of the periodic part, times the extents along the coordinate axes that have none. */
    double volume = hs_lattice_volume(&lattice, 0);
    for (int k = 0; k < points->ndim; k++) {
        volume *= lattice.row_of_axis[k] >= 0 ? 1.0 : hs_larger(upper[k] - lower[k], cutoff);
    }
    const double pairs = 0.5 * n * n * hs_ball_volume(points->ndim, cutoff) / volume;
    /* Numbers near the ends of the range leave no volume: all pairs then. */
    shortage->pairs += (box == NULL && !(pairs < all) ? all
                        : isfinite(pairs)             ? pairs
                                                      : all) *
                       (sets->is_full && !sets->is_once ? 2.0 * n_asking / n : 1.0);
    shortage->bytes += n * (BYTES_PER_POINT + BYTES_PER_COORDINATE * points->ndim);
}

void
hs_shortage_tell(const hs_shortage *shortage, const hs_options *options, int ndim,
                 hs_failure *failure)
{
    if (failure->expected_bytes == 0.0) {
        failure->expected_pairs = hs_larger(shortage->pairs, failure->expected_pairs);
        failure->expected_bytes = failure->expected_pairs * bytes_per_pair_of(options, ndim);
        failure->search_bytes = hs_larger(shortage->bytes + BYTES_OF_WALK, failure->search_bytes);
    }
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
 * Before any work: HS_ERR_MEMORY when even the least number of pairs passes the limit,
 * HS_ERR_TOO_MANY when int64 cannot count it. Along the open axes no two points are further apart
 * than the diagonal of what the points span there; what is left of the radius spans a ball in the
 * space of the periodic axes. One of radius R holds at least as many lattice points as copies of
 * the cell cover a ball of radius R less the cell's diameter.
 */
static hs_status
estimate_by_density(hs_search *search, hs_failure *failure)
{
    const hs_scene   *scene = &search->scene;
    const hs_lattice *lattice = &scene->lattice;
    const double      n = (double)scene->n;
    const double      bytes_per_pair =
        search->keeps_none ? 0.0 : bytes_per_pair_of(&search->call->options, scene->ndim);
    double diameter = 0.0, across = 0.0;
    if (search->limits != NULL ||   /* the cutoff is that of few pairs */
        lattice->n_periodic == 0) { /* nothing tells the density; a scene without points has no
                                     * box either */
        return HS_OK;
    }
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
        return HS_OK;
    }
    const double ball = hs_ball_volume(lattice->n_periodic, radius);
    const double around = n * ball / hs_lattice_volume(lattice, 0); /* points in that ball */
    /* Half a pair of each point would be the one with itself. */
    const double least =
        0.5 * n * (around - (search->has_queries ? 0.0 : 1.0)) * search->pairs_per_half;
    if (bytes_per_pair == 0.0 && least > MOST_PAIRS) {
        failure->value = least;
        return HS_ERR_TOO_MANY;
    }
    if (!(least > 0.0) || hs_account_allows(&search->call->account, least * bytes_per_pair)) {
        return HS_OK;
    }
    const bool   has_density = lattice->n_periodic == scene->ndim;
    const double dense = search->grid.expected_pairs * search->pairs_per_half;
    return refuse(search, has_density ? dense : least, bytes_per_pair, failure);
}

/* What some points have found: the sum of their counts, of the squares, and how many they are. */
typedef struct sample {
    double  sum, squares;
    int64_t taken;
    bool    is_cut; /* not all of them were taken, or the last one not to its end */
} sample;

/*
 * At most `most` points, a power of two, are sampled evenly over the cells, every `step`th of them;
 * each counts its forward half, so the mean over points times n estimates the pairs without bias.
 * Stopping early leaves a count too small: an estimate from below, which is the safe side here.
 */
static hs_status
take_sample(hs_search *search, int64_t most, int64_t step, sample *taken)
{
    const int64_t n = hs_search_asking(search)->n, samples = n < most ? n : most;
    double        work = 0.0;
    hs_walker     walker;
    *taken = (sample){0.0, 0.0, 0, false};
    hs_status status = hs_walker_init(search, HS_BLOCK_COUNTS, NULL, NULL, NULL, &walker);
    if (status != HS_OK) {
        return status;
    }
    for (; status == HS_OK && taken->taken < samples && work < SAMPLE_WORK; taken->taken++) {
        const int64_t s = samples == n ? taken->taken : taken->taken * step % samples;
        const int64_t before = walker.scanner.n_gathered;
        walker.scanner.n_found = 0;
        walker.scanner.gather_limit = before + (int64_t)SAMPLE_WORK;
        status = hs_walk_point(&walker, (int32_t)((2 * s + 1) * n / (2 * samples)));
        HS_ASSERT(status != HS_ERR_SHIFT_RANGE); /* counting needs no S */
        taken->sum += (double)walker.scanner.n_found;
        taken->squares += (double)walker.scanner.n_found * (double)walker.scanner.n_found;
        work += (double)(walker.scanner.n_gathered - before) +
                WORK_OF_ROW * (double)search->stencil.n_rows;
    }
    hs_walker_close(search, &walker);
    taken->is_cut = status == HS_STOPPED || taken->taken < samples;
    return status == HS_STOPPED ? HS_OK : status;
}

hs_status
hs_estimate_pairs(hs_search *search, double *pairs)
{
    sample          taken;
    const hs_status status = take_sample(search, MANY_SAMPLES, SAMPLE_STEP, &taken);
    *pairs = 0.0;
    if (status == HS_OK && taken.taken > 0) {
        *pairs = taken.sum / (double)taken.taken * (double)hs_search_asking(search)->n;
    }
    if (status == HS_OK && taken.is_cut) {
        *pairs = hs_larger(*pairs, search->grid.expected_pairs * search->pairs_per_half);
    }
    return status;
}

/* The part of what is free that a result may seem to need: its density may be off by a third. */
#define SEEMS_SMALL 0.75

hs_status
hs_estimate_by_sample(hs_search *search, hs_failure *failure)
{
    hs_account       *account = &search->call->account;
    const hs_lattice *lattice = &search->scene.lattice;
    const double      bytes_per_pair =
        search->keeps_none ? 0.0 : bytes_per_pair_of(&search->call->options, search->scene.ndim);
    const int64_t n = hs_search_asking(search)->n;
    /* At least as many pairs as there are: of each two points, those images that the range along
     * all axes holds at once, and no more than all candidates. */
    double most = (double)search->bins.n * (double)n;
    most *= search->is_half && !search->has_queries ? 0.5 : 1.0;
    for (int k = 0; k < search->scene.ndim; k++) {
        if (lattice->row_of_axis[k] >= 0) {
            most *= floor(2.0 * search->grid.range[k] / lattice->period[k]) + 1.0;
        }
    }
    most = most > 0.0 ? hs_smaller(hs_search_candidates(search), most) : 0.0;
    const double bound = most * bytes_per_pair;
    const double by_density = search->grid.expected_pairs * search->pairs_per_half;
    const bool   is_uneven = search->is_sparse || hs_search_crowd(search) > EVEN;
    const bool   foresees = is_uneven && bytes_per_pair > BYTES_OF_INDICES && bound > LARGE_RESULT;
    sample       taken;
    /* The limit is looked up, which takes longer than a sample, unless the result may be too large
     * to do without and does not seem to be. */
    const bool samples_first = account->find_limit != NULL && bound > HS_LIMIT_FREE &&
                               by_density * bytes_per_pair < SEEMS_SMALL * HS_LIMIT_FREE;
    const bool fits = n == 0 || (!samples_first && hs_account_allows(account, bound));
    if (fits && !foresees) {
        return HS_OK;
    }
    const hs_status status = take_sample(search, SAMPLES, 1, &taken);
    if (status != HS_OK) {
        return status;
    }
    const double many = (double)taken.taken;
    const double mean = taken.sum / many;
    if (foresees && !taken.is_cut) { /* as many are foreseen as there are */
        search->grid.expected_pairs = mean * (double)n / search->pairs_per_half;
    }
    if (fits) {
        return HS_OK;
    }
    const double variance = fmax(0.0, taken.squares / many - mean * mean);
    const double error = taken.taken < n ? sqrt(variance / many) : 0.0;
    const double least = (mean - SURE_ERRORS * error) * (double)n;
    /* a sample may say more than is possible */
    if (hs_account_allows(account, hs_smaller(least * bytes_per_pair, bound))) {
        return HS_OK;
    }
    return refuse(search, mean * (double)n, bytes_per_pair, failure);
}

/* Distances have an error of 1 ulp, or less than 2^-1073 below the normal numbers; the band around
 * an edge is some times as wide, which costs nothing. */

/* Times a number: 4 ulp of it or more. */
#define BAND 0x1p-50

/* Eight of the smallest numbers there are. */
#define LEAST_BAND 0x1p-1071

/* Cells of an edge, and of all edges at most: some 16 kB. */
#define CELLS_PER_EDGE 8
#define MOST_CELLS     4096

/* The cell of a distance, which may be beyond the cutoff. */
HS_ALWAYS_INLINE int64_t
cell_of(const hs_shells *shells, double distance)
{
    const double at = distance * shells->per_length;
    return at < (double)shells->last ? (int64_t)at : shells->last;
}

hs_status
hs_shells_open(hs_account *account, const hs_scene *scene, const hs_options *options,
               hs_shells *shells)
{
    const int64_t n = options->n_shells - 1;
    const int64_t last = CELLS_PER_EDGE * n < MOST_CELLS ? CELLS_PER_EDGE * n : MOST_CELLS;
    const double  per_length = (double)last / options->cutoff;
    hs_parts      parts;
    *shells = (hs_shells){.inclusive = options->inclusive};
    hs_parts_begin(&parts);
    hs_parts_add(&parts, (void **)&shells->edge, n, sizeof(double));
    hs_parts_add(&parts, (void **)&shells->at, n, sizeof(double));
    hs_parts_add(&parts, (void **)&shells->low, n + 1, sizeof(double));
    hs_parts_add(&parts, (void **)&shells->high, n + 1, sizeof(double));
    hs_parts_add(&parts, (void **)&shells->start, last + 1, sizeof(int32_t));
    shells->memory = hs_parts_alloc(account, HS_FOR_CANDIDATES, &parts);
    if (shells->memory == NULL) {
        return HS_ERR_MEMORY;
    }
    shells->n = n;
    shells->last = last;
    shells->per_length = isfinite(per_length) ? per_length : 0.0;
    for (int64_t k = 0; k < n; k++) { /* in both units, and their bands */
        const double edge = options->shells[k], width = edge * BAND + LEAST_BAND;
        shells->edge[k] = edge;
        shells->at[k] = scene->extreme ? edge : hs_scale_apply(scene->scale, edge);
        shells->low[k] = edge - width;
        shells->high[k] = edge + width;
    }
    shells->low[n] = shells->high[n] = INFINITY;
    for (int64_t c = 0, k = 0; c <= last; c++) {
        while (k < n && cell_of(shells, shells->high[k]) < c) {
            k++;
        }
        shells->start[c] = (int32_t)k;
    }
    return HS_OK;
}

bool
hs_shells_find(const hs_shells *shells, const double *distance, int32_t n, int32_t *shell)
{
    bool is_open = false;
    for (int32_t h = 0; h < n; h++) {
        int32_t k = shells->start[cell_of(shells, distance[h])];
        k += shells->high[k] < distance[h];
        shell[h] = k;
        is_open |= shells->low[k] <= distance[h];
    }
    return is_open;
}

void
hs_shells_range(const hs_shells *shells, double distance, int32_t *low, int32_t *high)
{
    while (shells->high[*low] < distance) {
        ++*low;
    }
    for (*high = *low; shells->low[*high] <= distance; ++*high) {
    }
}

double
hs_shells_keep(const hs_shells *shells, int64_t k, double distance)
{
    if (k > 0) {
        const double below = shells->edge[k - 1];
        distance = hs_larger(distance, shells->inclusive ? nextafter(below, INFINITY) : below);
    }
    return k < shells->n ? hs_keep_within(distance, shells->edge[k], shells->inclusive) : distance;
}

/* Sets, from the sets, which points ask and whether lists are full. */
static void
search_set_asking(const hs_sets *sets, hs_search *search)
{
    const int64_t n = sets->points->n;
    search->has_queries = sets->queries != NULL;
    search->keeps_none = sets->keeps_none;
    HS_ASSERT(sets->is_full || !search->has_queries);
    search->is_full = sets->is_full;
    search->is_half = !sets->is_full || sets->is_once;
    search->n_in_all = search->has_queries ? sets->queries->n : n;
    search->pairs_per_half = search->is_half ? 1.0
                             : n == 0        ? 0.0
                                             : 2.0 * (double)search->n_in_all / (double)n;
}

bool
hs_search_repeats_images(const hs_search *search)
{
    const hs_lattice *lattice = &search->scene.lattice;
    for (int k = 0; k < lattice->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0 && 2.0 * search->grid.range[k] >= lattice->period[k]) {
            return true;
        }
    }
    return false;
}

void
hs_search_begin(hs_call *call, hs_search *search)
{
    memset((char *)search + offsetof(hs_search, call), 0,
           sizeof *search - offsetof(hs_search, call));
    search->scene.cloud.block = search->scene.beside = NULL; /* freed also when never set */
    search->call = call;
}

/* Each stencil offset pairs every cell with at most one other, so by the Cauchy-Schwarz inequality
 * it contributes at most the sum of squared occupancies; for two sets, the root of the product of
 * both sums. */
double
hs_search_candidates(const hs_search *search)
{
    double squares = search->bins.squares, offsets = 0.0;
    if (search->has_queries) {
        squares = sqrt(squares * search->query_bins.squares);
    }
    for (int64_t s = 0; s < search->stencil.n_rows; s++) {
        offsets += (double)search->stencil.rows[s].last - search->stencil.rows[s].first + 1.0;
    }
    return squares * offsets;
}

double
hs_search_crowd(const hs_search *search)
{
    const double n = (double)search->bins.n;
    return n > 0.0 ? (search->bins.squares / n - 1.0) * (double)search->grid.n_cells / n : 0.0;
}

hs_status
hs_search_halve(hs_search *search)
{
    hs_call *call = search->call;
    HS_ASSERT(!search->has_queries);
    search->is_full = false;
    search->is_half = true;
    search->pairs_per_half = 1.0;
    hs_free(&call->account, search->stencil.rows);
    return hs_stencil_build(&call->account, &call->options, &search->scene, &search->grid, false,
                            &search->stencil);
}

void
hs_search_close(hs_search *search)
{
    hs_account *account = &search->call->account;
    hs_free(account, search->stencil.rows);
    hs_free(account, search->shells.memory);
    search->stencil.rows = NULL;
    search->shells.memory = NULL;
    if (!search->is_borrowed) {
        hs_scene_free(account, &search->scene);
        hs_bins_free(account, &search->bins);
    }
    if (search->has_queries) {
        hs_bins_free(account, &search->query_bins);
    }
}

/*
 * Chooses the grid. HS_ALL_PAIRS and HS_HASH say which. Else it is the dense one, with cells as
 * wide as the caller wants them or as is quickest; or where points crowd in few of its cells, one
 * that stores occupied cells only, unless the dense one has the caller's width, or the caller wants
 * all cells.
 */
static hs_status
choose_grid(hs_search *search, hs_failure *failure)
{
    const hs_options  *options = &search->call->options;
    const hs_algorithm algorithm = options->algorithm;
    const hs_scene    *scene = &search->scene;
    const bool         is_dense = algorithm == HS_GRID;
    hs_grid           *grid = &search->grid;
    hs_status          status = HS_TRY_OTHER;
    double             width = 0.0; /* of the cells of a sparse grid */
    bool               may_be_sparse = true;
    if (algorithm == HS_ALL_PAIRS || algorithm == HS_HASH) {
        status = hs_grid_init(scene, HS_GRID_SINGLE, grid, failure);
        if (status == HS_OK && algorithm == HS_HASH) {
            width = hs_sparse_choose(scene, grid, true);
        }
    } else {
        if (options->cell_size > 0.0) {
            status = hs_grid_init_wide(scene, hs_scale_apply(scene->scale, options->cell_size),
                                       grid, &may_be_sparse, failure);
        }
        if (status == HS_TRY_OTHER) {
            status = hs_grid_init(scene, is_dense ? HS_GRID_CELLS : HS_GRID_ANY, grid, failure);
        }
        if (status == HS_OK && may_be_sparse && !is_dense) {
            width = hs_sparse_choose(scene, grid, false);
        }
    }
    search->is_sparse = width > 0.0;
    if (search->is_sparse) {
        const hs_grid dense = *grid;
        hs_sparse_grid(scene, &dense, width, grid);
    }
    return status;
}

/* Sorts points, or queries, into the cells of the grid; their scene gives up its arrays. */
static hs_status
build_bins(hs_search *search, bool of_queries, hs_scene *scene)
{
    hs_call *call = search->call;
    hs_grid  counted = search->grid; /* occupied cells of queries are counted by themselves */
    return hs_bins_build(&call->account, call->team, &call->options, scene,
                         of_queries ? &counted : &search->grid, of_queries,
                         of_queries ? &search->query_bins : &search->bins);
}

/* What a grid, chosen or narrowed, is followed by: bounds, an estimate, and the stencil. */
static hs_status
build_stencil(hs_search *search, hs_failure *failure)
{
    search->filter_error =
        search->scene.x_error + search->grid.shift_error + search->scene.formula_error;
    hs_status status = estimate_by_density(search, failure);
    if (status == HS_OK) {
        status = hs_stencil_build(&search->call->account, &search->call->options, &search->scene,
                                  &search->grid, search->is_full, &search->stencil);
        if (status == HS_ERR_MEMORY) {
            failure->search_bytes = hs_stencil_bytes(&search->grid, search->is_full);
        }
    }
    return status;
}

hs_status
hs_search_build(const hs_sets *sets, const hs_box *box, hs_search *search, hs_failure *failure)
{
    hs_call       *call = search->call;
    hs_scene       queries, *asking = sets->queries != NULL ? &queries : NULL;
    const unsigned want = call->options.want;
    if (call->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    search_set_asking(sets, search);
    if (call->choice != NULL && hs_choice_compares(call->choice, call->options.cutoff)) {
        call->options.want |= HS_WANT_SHIFT; /* to compare images of all pairs */
    }
    hs_status status = hs_scene_make(&call->account, call->team, sets, box, &call->options,
                                     &search->scene, asking, failure);
    call->options.want = want;
    if (status == HS_OK) {
        if (sets->narrowing != NULL) {
            status = hs_scene_narrow(&search->scene, sets->narrowing);
        }
        status = status == HS_OK ? choose_grid(search, failure) : status;
        if (status == HS_ERR_BOX_SKEWED) {
            hs_scene_name_outlier(&search->scene, asking, failure);
        }
        status = status == HS_OK ? build_stencil(search, failure) : status;
        status = status == HS_OK ? build_bins(search, false, &search->scene) : status;
        if (status == HS_OK && asking != NULL) {
            status = build_bins(search, true, asking);
        }
        if (asking != NULL) {
            hs_scene_free(&call->account, asking);
        }
    }
    return status;
}

/* Scaled cutoffs as small as this keep all their digits. */
#define SMALLEST_CUTOFF 0x1p-500

/* Whether the scale of the cells keeps all digits of a length up to theirs. */
static bool
keeps_digits(const hs_search *built, double length)
{
    return length == 0.0 || hs_scale_apply(built->scene.scale, length) >= SMALLEST_CUTOFF;
}

/* Whether cells for one cutoff serve another, and a least one where there are several. What is kept
 * of the points depends on the precision that they were meant for. */
static bool
serves(const hs_search *built, const hs_options *options, double least_cutoff)
{
    const double before = built->call->options.cutoff, cutoff = options->cutoff;
    if (options->precision != built->call->options.precision || built->scene.in_one_cell) {
        return false;
    }
    if (built->scene.extreme) { /* digits are lost, and kept beside */
        return cutoff == before;
    }
    return keeps_digits(built, least_cutoff) &&
           (cutoff == before || (cutoff >= 0.0 && cutoff < before && keeps_digits(built, cutoff)));
}

hs_status
hs_search_reuse(const hs_sets *sets, hs_call *call, hs_search *search, hs_failure *failure)
{
    const hs_search *built = sets->built;
    const int64_t    n_asking = sets->queries != NULL ? sets->queries->n : sets->points->n;
    if (!serves(built, &call->options, sets->least_cutoff)) {
        return HS_REBUILD;
    }
    hs_search_begin(call, search);
    search->scene = built->scene;
    search->scene.is_untested = sets->is_untested;
    search->grid = built->grid;
    search->bins = built->bins;
    search->is_sparse = built->is_sparse;
    search->is_borrowed = true; /* not to be freed */
    hs_call_gather(call, n_asking);
    hs_status status = call->kernel == NULL ? HS_ERR_KERNEL : HS_OK;
    if (status == HS_OK && call->options.cutoff != built->call->options.cutoff) {
        hs_scene_set_cutoff(&search->scene, &call->options);
        status =
            hs_grid_narrow(&search->scene, search->is_sparse, built->scene.cutoff, &search->grid);
    }
    if (status == HS_OK) {
        hs_scene_init_metric(&search->scene, &call->options);
        search_set_asking(sets, search);
        status = build_stencil(search, failure);
    }
    if (status == HS_OK && sets->queries != NULL) {
        hs_scene asking;
        status = hs_scene_from_kept(&call->account, call->team, &search->scene, sets->queries,
                                    &call->options, false, &asking, failure);
        if (status == HS_OK) {
            status = build_bins(search, true, &asking);
            hs_scene_free(&call->account, &asking);
        }
    }
    if (status != HS_OK) {
        hs_search_close(search);
        if (status == HS_REBUILD) {
            hs_call_restart(call);
            failure->in_queries = false;
        }
    }
    return status;
}

hs_status
hs_search_open(const hs_sets *sets, const hs_box *box, hs_call *call, hs_search *search,
               hs_failure *failure)
{
    hs_status status = HS_REBUILD;
    if (sets->built != NULL) {
        status = hs_search_reuse(sets, call, search, failure);
    }
    if (status == HS_REBUILD) {
        const int64_t n_queries = sets->queries != NULL ? sets->queries->n : 0;
        hs_search_begin(call, search);
        hs_call_gather(call, sets->points->n + n_queries);
        status = hs_search_build(sets, box, search, failure);
    }
    if (status == HS_OK && (call->options.want & HS_WANT_SHELL)) {
        status = hs_shells_open(&call->account, &search->scene, &call->options, &search->shells);
    }
    if (status != HS_OK) {
        hs_search_close(search);
        return status;
    }
    /* Threads for the walk, where points alone were not worth them. */
    hs_call_gather_for(call, hs_search_asking(search)->n,
                       search->grid.expected_pairs * search->pairs_per_half, search->is_borrowed);
    return HS_OK;
}
