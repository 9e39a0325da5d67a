/* SPDX-License-Identifier: BSD-3-Clause */
#include "bins.h"
#include "../base/sort.h"

/*
 * bins.c: a stable counting sort, O(n + cells).
 *
 * The point numbers are sorted first, then the columns are gathered in their order. While the
 * numbers are sorted the spare column holds the cell of every point.
 *
 * With a team the points are cut into strips, each with counts of its own. Cell after cell, the
 * strips' points follow each other in the order of the strips, which is that of the points: the
 * result does not depend on the number of strips.
 */

/* Points whose cells are found together: their coordinates stay in the first-level cache. */
#define TILE 512
/* Points for which a strip of its own pays. */
#define STRIP_POINTS 16384
/* Queries whose numbers are sorted one by one, as pairs of cell and number: counting would take
 * longer for all the cells, of which there are at least so many times more. */
#define FEW_QUERIES   HS_POLL_POINTS
#define CELLS_PER_FEW 8

typedef struct sorting {
    const hs_grid    *grid;
    const hs_lattice *lattice;
    const hs_bins    *bins;
    double *const    *x;
    uint32_t         *cells; /* cell of every point */
    int               n_strips;
    int32_t          *counts[HS_SLABS]; /* of each strip: points in each cell, then the place of
                                          * its next point there */
} sorting;

/* id += the part of the cell id that axis k gives, by the steps of hs_grid_index. Cell ids and
 * strides are below 2^32, indices below 2^31. */
static void
add_index(const hs_grid *grid, int k, const double *HS_RESTRICT t, int64_t n,
          uint32_t *HS_RESTRICT id)
{
    const double   lower = grid->lower[k], cells_per_length = grid->cells_per_length[k];
    const double   last = (double)(grid->shape[k] - 1);
    const uint32_t stride = (uint32_t)grid->stride[k];
    for (int64_t i = 0; i < n; i++) {
        const double place = (t[i] - lower) * cells_per_length;
        const double below = place < last ? place : last;
        const double inside = below > 0.0 ? below : 0.0;
        id[i] += (uint32_t)(int32_t)inside * stride;
    }
}

/* Cells of n points, at most TILE, from `begin` on. */
static void
find_cells(const sorting *sort, int64_t begin, int64_t n)
{
    uint32_t     *id = sort->cells + begin;
    const double *from[HS_MAX_DIM];
    double        t[TILE];
    for (int k = 0; k < sort->grid->ndim; k++) {
        from[k] = sort->x[k] + begin;
    }
    memset(id, 0, (size_t)n * sizeof *id);
    for (int k = 0; k < sort->grid->ndim; k++) {
        if (sort->grid->shape[k] == 1) {
            continue;
        }
        if (sort->lattice->aligned) {
            add_index(sort->grid, k, from[k], n, id);
        } else {
            hs_fold_coordinates(sort->lattice, k, from, n, t);
            add_index(sort->grid, k, t, n, id);
        }
    }
}

static hs_status
count_strip(void *context, int strip, int64_t first, int64_t last)
{
    const sorting *sort = context;
    int32_t       *counts = sort->counts[strip];
    for (int64_t begin = first; begin < last; begin += TILE) {
        const int64_t n = last - begin < TILE ? last - begin : TILE;
        find_cells(sort, begin, n);
        for (int64_t i = begin; i < begin + n; i++) {
            counts[sort->cells[i]]++;
        }
    }
    return HS_OK;
}

static hs_status
order_strip(void *context, int strip, int64_t first, int64_t last)
{
    const sorting       *sort = context;
    int32_t *HS_RESTRICT next = sort->counts[strip];
    const uint32_t      *cells = sort->cells;
    int32_t *HS_RESTRICT order = sort->bins->order;
    for (int64_t i = first; i < last; i++) {
        order[next[cells[i]]++] = (int32_t)i;
    }
    return HS_OK;
}

/* A column on its way to cell order. */
typedef struct moving {
    const int32_t *order;
    const void    *from;
    void          *to;
    size_t         size; /* 4 or 8 bytes an entry */
} moving;

static hs_status
gather_slab(void *context, int slab, int64_t first, int64_t last)
{
    const moving              *move = context;
    const int32_t *HS_RESTRICT order = move->order;
    (void)slab;
    if (move->size == sizeof(double)) {
        const uint64_t *HS_RESTRICT from = move->from;
        uint64_t *HS_RESTRICT       to = move->to;
        for (int64_t si = first; si < last; si++) {
            to[si] = from[order[si]];
        }
    } else {
        const uint32_t *HS_RESTRICT from = move->from;
        uint32_t *HS_RESTRICT       to = move->to;
        for (int64_t si = first; si < last; si++) {
            to[si] = from[order[si]];
        }
    }
    return HS_OK;
}

/* Gathers a column into the free one, and leaves its own place free. */
static hs_status
gather_column(hs_team *team, const hs_options *options, const hs_bins *bins, size_t size,
              void **column, void **free_column)
{
    moving move = {bins->order, *column, *free_column, size};
    *free_column = *column;
    *column = move.to;
    return hs_walk_points(team, options, bins->n, 0, gather_slab, &move);
}

hs_status
hs_bins_arrange(hs_account *account, hs_team *team, const hs_options *options,
                const hs_scene *scene, hs_bins *bins)
{
    /* In the order in which they lie behind the free column, the wide ones before the narrow ones.
     * Where originals are kept they lie behind the free column, and X apart. */
    double  **first = bins->keeps_originals ? bins->originals : bins->x;
    void     *free_column = scene->cloud.spare;
    const int n = bins->keeps_originals ? 2 * bins->ndim : bins->ndim;
    hs_status status = HS_OK;
    for (int c = 0; c < n && status == HS_OK; c++) {
        double **at = c < bins->ndim ? &first[c] : &bins->x[c - bins->ndim];
        void    *column = *at;
        status = gather_column(team, options, bins, sizeof(double), &column, &free_column);
        *at = column;
    }
    for (int r = 0; bins->turns.known && r < bins->n_periodic && status == HS_OK; r++) {
        const bool   narrow = bins->turns.narrow[r] != NULL;
        const size_t size = narrow ? sizeof(int32_t) : sizeof(int64_t);
        void        *column = narrow ? (void *)bins->turns.narrow[r] : bins->turns.wide[r];
        status = gather_column(team, options, bins, size, &column, &free_column);
        bins->turns.narrow[r] = narrow ? column : NULL;
        bins->turns.wide[r] = narrow ? NULL : column;
    }
    if (status == HS_OK) { /* the free column lies behind all that is still needed */
        char *last = bins->beside != NULL ? bins->beside : bins->points;
        hs_trim(account, last, (size_t)((char *)free_column - last) + HS_COLUMN_PADDING);
    }
    return status;
}

/* Sorts few numbers into bins->order, and fills bins->cells. numbers: the spare column. */
static hs_status
sort_few(hs_account *account, const sorting *sort, uint64_t *numbers, hs_bins *bins)
{
    const int64_t n = bins->n;
    uint64_t     *spare = hs_alloc(account, HS_FOR_ORDER, n, sizeof *spare);
    if (spare == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t begin = 0; begin < n; begin += TILE) {
        find_cells(sort, begin, n - begin < TILE ? n - begin : TILE);
    }
    for (int64_t i = 0; i < n; i++) {
        numbers[i] = (uint64_t)sort->cells[i] << 32 | (uint64_t)i;
    }
    hs_sort_numbers(numbers, n, 32, spare);
    hs_free(account, spare);
    for (int64_t si = 0, run = 0; si < n; si++) {
        bins->order[si] = (int32_t)(uint32_t)numbers[si];
        bins->cells[si] = (uint32_t)(numbers[si] >> 32);
        run = si > 0 && bins->cells[si] == bins->cells[si - 1] ? run + 1 : 0;
        bins->squares += (double)(2 * run + 1);
    }
    return HS_OK;
}

/* Sorts the point numbers into bins->order, and fills `start`; of queries bins->cells. */
static hs_status
sort_many(hs_account *account, hs_team *team, const hs_options *options, sorting *sort,
          hs_bins *bins)
{
    const int64_t n_cells = sort->grid->n_cells, n = bins->n;
    int32_t      *others = NULL, *start = bins->start;
    if (start == NULL) {
        start = hs_alloc(account, HS_FOR_CELLS, n_cells + 1, sizeof *start);
        if (start == NULL) {
            return HS_ERR_MEMORY;
        }
    }
    sort->n_strips = hs_strips_for(team, n, STRIP_POINTS, n_cells);
    if (sort->n_strips > 1) {
        others = hs_alloc(account, HS_FOR_CELLS, (sort->n_strips - 1) * n_cells, sizeof *others);
        sort->n_strips = others == NULL ? 1 : sort->n_strips;
    }
    memset(start, 0, (size_t)n_cells * sizeof *start);
    sort->counts[0] = start;
    for (int strip = 1; strip < sort->n_strips; strip++) {
        sort->counts[strip] = others + (strip - 1) * n_cells;
        memset(sort->counts[strip], 0, (size_t)n_cells * sizeof *others);
    }
    hs_status status = hs_walk_points(team, options, n, sort->n_strips, count_strip, sort);
    if (status == HS_OK) {
        /* From numbers of points to places: cell by cell, and in each cell strip by strip. */
        int64_t squares = 0;
        int32_t place = 0;
        for (int64_t c = 0; c < n_cells; c++) {
            const int64_t before = place;
            for (int strip = 0; strip < sort->n_strips; strip++) {
                const int32_t count = sort->counts[strip][c];
                sort->counts[strip][c] = place;
                place += count;
            }
            squares += (place - before) * (place - before);
        }
        bins->squares = (double)squares;
        status = hs_walk_points(team, options, n, sort->n_strips, order_strip, sort);
    }
    if (bins->start != NULL) {
        /* The last strip's place in a cell has moved up to where the next cell starts. */
        memmove(start + 1, sort->counts[sort->n_strips - 1], (size_t)n_cells * sizeof *start);
        start[0] = 0;
    } else {
        moving move = {bins->order, sort->cells, bins->cells, sizeof *bins->cells};
        hs_free(account, start);
        if (status == HS_OK) {
            status = hs_walk_points(team, options, n, 0, gather_slab, &move);
        }
    }
    hs_free(account, others);
    return status;
}

void
hs_bins_take(hs_scene *scene, hs_bins *bins)
{
    *bins = (hs_bins){.n = scene->n, .ndim = scene->ndim, .n_periodic = scene->lattice.n_periodic};
    bins->points = scene->cloud.block;
    bins->beside = scene->beside;
    bins->order = scene->cloud.order;
    bins->turns = scene->turns;
    bins->keeps_originals = scene->keeps_originals;
    memcpy(bins->x, scene->cloud.x, sizeof bins->x);
    memcpy(bins->originals, scene->originals, sizeof bins->originals);
    scene->cloud.block = NULL;
    scene->beside = NULL;
}

void
hs_bins_free(hs_account *account, hs_bins *bins)
{
    hs_free(account, bins->row_index);
    hs_free(account, bins->row_cell);
    hs_free(account, bins->cell_x);
    hs_free(account, bins->points);
    hs_free(account, bins->beside);
    hs_free(account, bins->start);
    hs_free(account, bins->cells);
    bins->points = bins->beside = NULL;
    bins->start = bins->row_cell = NULL;
    bins->row_index = bins->cell_x = NULL;
    bins->cells = NULL;
}

/*
 * Cells whose number has no limit, and whether they are worth it.
 *
 * Why the reach holds at any distance. A place is (t - lower) c with c cells per length: two
 * roundings, so it is within 2^-52 of itself (and 2^-106), and it is a monotone function of t. The
 * cells follow each other without a gap and none is narrower than 1 (in places); so if two indices
 * are s >= 1 apart, s - 1 whole cells lie between the places. For two points within a range of each
 * other the places are at most range c + 2^-51 p apart, p being the larger one.
 *     p < 2^49: hs_sparse_grid makes range c + 2^-51 p at most the reach r, so s - 1 < r.
 *     2^e <= p < 2^(e + 1), e >= 49: cells are w = 2^(e - 48) >= 2 wide and rounding moves places
 *     by at most 2^(e - 50) = w / 4, so range c >= w (s - 1) - w / 4 > s - 1 for s >= 2. Again
 *     s <= r.
 * Where p is just beyond 2^49, some of the cells between may be those before it, 1 wide; rounding
 * is 1/4 there as well, and the first case holds.
 *
 * Places are counted from the number in the points' range that is nearest to 0, which is where
 * float64 is finest: a cell wider than wanted holds at most 32 numbers to a side.
 */

/* More than the 1e-5 cells by which grid.c widens windows, so that these end at the reach. */
#define LEAST_MARGIN 0x1p-16
/* Relative error of a place: 2^-51 for two roundings, times 4/3 for e <= 1/4 in 1 / (1 - e),
 * rounded up. */
#define PLACE_ERROR 0x1p-50
/* No place passes 2^1000, also where the range is 0. */
#define SMALLEST_PITCH 0x1p-1000
/* Indices along periodic axes: their places need no other numbering. */
#define MOST_PER_PERIOD 0x1p31

void
hs_sparse_grid(const hs_scene *scene, const hs_grid *dense, double width, hs_grid *grid)
{
    *grid = *dense;
    grid->n_cells = 0;
    for (int k = 0; k < scene->ndim; k++) {
        const double extent = scene->upper[k] - scene->lower[k];
        const double range = grid->range[k], split = k == 0 ? HS_SPARSE_SPLIT / width : 1.0 / width;
        const double places = split * extent < HS_SPARSE_LINEAR * range ? split * extent / range
                                                                        : HS_SPARSE_LINEAR;
        const double margin = LEAST_MARGIN + PLACE_ERROR * places;
        const double pitch =
            fmax(range * (1.0 + margin) / split, SMALLEST_PITCH * fmax(extent, 1.0));
        grid->stride[k] = 0;
        grid->skipped[k] = 0;
        if (scene->lattice.row_of_axis[k] >= 0) {
            const double count = floor(fmin(extent / pitch, MOST_PER_PERIOD));
            /* Cells are range / 4 wide or more, or there is one: then its reach is at most that of
             * the dense grid, which has one or more. */
            const hs_status status = hs_grid_set_axis(scene, k, fmax(count, 1.0), grid);
            HS_ASSERT(status == HS_OK);
            (void)status;
            continue;
        }
        const double  lower = scene->lower[k], upper = scene->upper[k];
        const int64_t reach = k == 0 && HS_SPARSE_SPLIT > width ? (int64_t)(HS_SPARSE_SPLIT / width)
                                                                : 1;
        grid->lower[k] = lower > 0.0 ? lower : upper < 0.0 ? upper : 0.0;
        grid->cell_size[k] = pitch;
        grid->cells_per_length[k] = 1.0 / pitch;
        grid->skipped[k] = hs_sparse_number((lower - grid->lower[k]) * grid->cells_per_length[k]);
        grid->shape[k] = INT64_MAX;
        grid->shape[k] = hs_sparse_index(grid, k, upper) + 1;
        grid->reach[k] = reach < grid->shape[k] ? reach : grid->shape[k] - 1;
    }
}

/*
 * Dense or sparse, and how wide the cells. Both grids are judged by how many other points the cell
 * of an average point holds, which a sample tells: samples are compared with each other, so their
 * number grows with the square root of n, and a cell that holds enough of the points to matter
 * holds a few dozen of the samples, for any n.
 */

/* How much larger than wanted a dense cell must be before anything is counted. */
#define WORTH_A_LOOK 4.0
/* Other points in a point's dense cell, below which nothing better is looked for: half as many
 * tests take as long as the sparse grid's longer sort, some 80 ns a point. */
#define CROWDED 800.0
/* Tests that take as long as gathering one neighbourhood, some 150 ns, and as finding a row of
 * cells for it, some 75: a test takes 0.2 to 0.4 ns. So they are in 2 to 6 dimensions. */
#define TESTS_PER_GROUP 600.0
#define TESTS_PER_ROW   300.0
/* In cells so much wider than the cutoff float32 does not tell neighbours from others where a group
 * has points of several clusters, and pairs are decided one by one: some 12 ns each. */
#define FILTER_FAILS       0x1p20
#define TESTS_PER_DECISION 40.0
#define WIDEST             256.0 /* ranges */
#define MOST_SAMPLES       4096  /* 32 kB of stack */

/* A bijection of 64 bits that spreads every bit over all others (the finaliser of MurmurHash3). */
static uint64_t
mix(uint64_t bits)
{
    bits = (bits ^ bits >> 33) * UINT64_C(0xff51afd7ed558ccd);
    bits = (bits ^ bits >> 33) * UINT64_C(0xc4ceb9fe1a85ec53);
    return bits ^ bits >> 33;
}

/* Other points in the cell of an average point, from how often samples share a cell. The short
 * cells of a sparse grid count together, as cubes. */
static double
mean_company(const hs_scene *scene, const hs_grid *grid, bool sparse)
{
    uint64_t      names[MOST_SAMPLES];
    const double  wanted = fmin(2.0 * sqrt((double)scene->n), MOST_SAMPLES);
    const int64_t samples = (int64_t)fmin(wanted, (double)scene->n), stride = scene->n / samples;
    double        shared = 0.0;
    for (int64_t s = 0; s < samples; s++) {
        /* One point of each range, not always at the same place in it: inputs have patterns. */
        const int64_t i = s * stride + (int64_t)(mix((uint64_t)s) % (uint64_t)stride);
        names[s] = 0;
        for (int k = 0; k < scene->ndim; k++) {
            const double t = hs_scene_coordinate(scene, i, k);
            int64_t      index = sparse ? hs_sparse_index(grid, k, t) : hs_grid_index(grid, k, t);
            index /= sparse && k == 0 ? HS_SPARSE_SPLIT : 1;
            names[s] = mix(names[s] ^ (uint64_t)index);
        }
    }
    hs_sort_numbers(names, samples, 0, (uint64_t *)(void *)scene->cloud.spare);
    for (int64_t s = 1, run = 0; s < samples; s++) {
        run = names[s] == names[s - 1] ? run + 1 : 0;
        shared += 2.0 * (double)run;
    }
    return shared / ((double)samples * (double)(samples - 1)) * (double)scene->n;
}

double
hs_sparse_choose(const hs_scene *scene, const hs_grid *dense, bool always)
{
    double larger = 1.0, widest = 1.0, best = 1.0, least = INFINITY, crowd = INFINITY;
    if ((double)scene->n < (always ? 2.0 : CROWDED)) {
        return always ? best : 0.0;
    }
    for (int k = 0; k < scene->ndim; k++) {
        if (dense->cell_size[k] > dense->range[k]) {
            const double wider = fmin(dense->cell_size[k] / dense->range[k], 0x1p100);
            larger *= wider;
            widest = fmax(widest, wider);
        }
    }
    if (!always) {
        if (!(larger > WORTH_A_LOOK)) {
            return 0.0;
        }
        /* At least half of a point's company is tested, whatever its neighbours hold. */
        const double of_each = widest > FILTER_FAILS ? TESTS_PER_DECISION : 1.0;
        crowd = of_each * mean_company(scene, dense, false);
        if (!(crowd > CROWDED)) {
            return 0.0;
        }
    }
    for (double width = 1.0; width <= WIDEST; width *= 2.0) {
        hs_grid grid;
        hs_sparse_grid(scene, dense, width, &grid);
        const double company = mean_company(scene, &grid, true);
        /* Tests per point, all costs counted as tests. Of the cells around a point half are
         * visited, in half of the rows. Points in clumps have fewer full ones: 2^d of 3^d / 2. */
        const double rows = 0.5 * pow(3.0, scene->ndim - 1);
        const double cost = ldexp(company, scene->ndim) +
                            (TESTS_PER_GROUP + TESTS_PER_ROW * rows) / (1.0 + company);
        if (cost < least) {
            least = cost;
            best = width;
        } else if (company > 1.0) { /* wider only gets worse */
            break;
        }
    }
    return 0.5 * crowd > least ? best : 0.0;
}

/* Does the row come before these indices? */
HS_ALWAYS_INLINE bool
row_is_before(const hs_bins *bins, int64_t row, const int64_t *index)
{
    const int64_t *own = bins->row_index + row * (bins->ndim - 1);
    for (int k = bins->ndim - 1; k >= 1; k--) {
        if (own[k - 1] != index[k]) {
            return own[k - 1] < index[k];
        }
    }
    return false;
}

/* Does the cell come before this index along the first axis? */
HS_ALWAYS_INLINE bool
cell_is_before(const hs_bins *bins, int64_t cell, const int64_t *x)
{
    return bins->cell_x[cell] < *x;
}

/* The first row or cell of [low, high) that does not come before what is sought, or high: from
 * `hint` on, which is at most high, by steps that double, then by halves. */
HS_ALWAYS_INLINE int64_t
seek(const hs_bins *bins, bool (*is_before)(const hs_bins *, int64_t, const int64_t *),
     const int64_t *sought, int64_t low, int64_t high, int64_t hint)
{
    int64_t step = 1; /* the answer is in [low, high] */
    hint = hint < low ? low : hint;
    if (hint < high && is_before(bins, hint, sought)) {
        for (low = hint + 1; low + step <= high && is_before(bins, low + step - 1, sought);
             step *= 2) {
            low += step;
        }
        high = low + step - 1 < high ? low + step - 1 : high;
    } else {
        for (high = hint; high - step >= low && !is_before(bins, high - step, sought); step *= 2) {
            high -= step;
        }
        low = high - step >= low ? high - step + 1 : low;
    }
    while (low < high) {
        const int64_t middle = low + (high - low) / 2;
        if (is_before(bins, middle, sought)) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

int64_t
hs_sparse_find_row(const hs_bins *bins, const int64_t *index, int64_t *hint)
{
    const int64_t row = seek(bins, row_is_before, index, 0, bins->n_rows, *hint);
    *hint = row;
    if (row == bins->n_rows) {
        return -1;
    }
    const int64_t *own = bins->row_index + row * (bins->ndim - 1);
    for (int k = 1; k < bins->ndim; k++) {
        if (own[k - 1] != index[k]) {
            return -1;
        }
    }
    return row;
}

void
hs_sparse_window(const hs_bins *bins, int64_t row, int64_t x_first, int64_t x_last,
                 hs_sparse_cursor *cursor, int32_t *first, int32_t *end)
{
    const int32_t low = bins->row_cell[row], high = bins->row_cell[row + 1];
    const int64_t beyond = x_last + 1;
    cursor->low = (int32_t)seek(bins, cell_is_before, &x_first, low, high, cursor->low);
    cursor->high = (int32_t)seek(bins, cell_is_before, &beyond, cursor->low, high, cursor->high);
    *first = bins->start[cursor->low];
    *end = bins->start[cursor->high];
}

bool
hs_sparse_next_group(const hs_bins *bins, int64_t row, int32_t most, hs_sparse_group *group)
{
    const int32_t *start = bins->start;
    const int32_t  row_end = bins->row_cell[row + 1];
    int32_t        cell = group->cell;
    cell += cell < row_end && start[cell + 1] == group->last; /* begin where the last one ended */
    if (cell == row_end) {
        return false;
    }
    group->first = group->last;
    group->x_first = bins->cell_x[cell];
    while (cell + 1 < row_end && start[cell + 1] - group->first < most &&
           bins->cell_x[cell + 1] < group->x_first + HS_SPARSE_SPLIT) {
        cell++;
    }
    group->last = start[cell + 1] - group->first < most ? start[cell + 1] : group->first + most;
    group->x_last = bins->cell_x[cell];
    group->cell = cell;
    return true;
}

/*
 * Sorting the points of a sparse grid. By the index along the last axis first, then each range of
 * equal ones by the axis before it, down to the first axis: points with equal indices along all
 * others are a row. Indices are computed where they are compared, not stored.
 */

typedef struct build {
    const hs_scene *scene;
    const hs_grid  *grid;
    hs_keys         sort; /* ids: bins->order; keys end as indices along the first axis */
} build;

static int64_t
index_of(const build *b, int64_t i, int k)
{
    return hs_sparse_index(b->grid, k, hs_scene_coordinate(b->scene, i, k));
}

/* Sorts points [first, end), which agree along the axes after k. The first key of each row is left
 * complemented, to be told from the others. */
static hs_status
sort_by_axis(build *b, int64_t first, int64_t end, int k)
{
    int64_t   *keys = b->sort.keys;
    const bool alone = end - first == 1;
    k = alone ? 0 : k;
    for (int64_t si = first; si < end; si++) {
        keys[si] = index_of(b, b->sort.ids[si], k);
    }
    hs_status status = alone ? HS_OK : hs_keys_sort(&b->sort, first, end);
    for (int64_t run = first, next; k > 0 && status == HS_OK && run < end; run = next) {
        for (next = run + 1; next < end && keys[next] == keys[run]; next++) {
        }
        status = sort_by_axis(b, run, next, k - 1);
    }
    if (k == 0) {
        keys[first] = ~keys[first];
    }
    return status;
}

/* Sorts the point numbers of a sparse grid into bins->order, and fills all that tells its rows and
 * cells. */
static hs_status
sort_sparse(hs_account *account, const hs_options *options, const hs_scene *scene, hs_grid *grid,
            hs_bins *bins)
{
    const int64_t n = scene->n;
    build         b = {.scene = scene, .grid = grid};
    hs_status     status = HS_ERR_MEMORY;
    grid->n_cells = 0;
    bins->cell_x = hs_alloc(account, HS_FOR_CELLS, n, sizeof(int64_t));
    int32_t *spare_ids = hs_alloc(account, HS_FOR_ORDER, n, sizeof *spare_ids);
    b.sort = (hs_keys){bins->cell_x, bins->order, (int64_t *)(void *)scene->cloud.spare,
                       spare_ids,    options,     0};
    if (bins->cell_x != NULL && spare_ids != NULL) {
        for (int64_t i = 0; i < n; i++) {
            bins->order[i] = (int32_t)i;
        }
        status = n > 0 ? sort_by_axis(&b, 0, n, scene->ndim - 1) : HS_OK;
    }
    hs_free(account, spare_ids);
    if (status == HS_OK) {
        const int64_t *keys = bins->cell_x; /* complemented where a row begins */
        for (int64_t si = 0; si < n; si++) {
            const bool begins_row = keys[si] < 0;
            bins->n_rows += begins_row;
            grid->n_cells += begins_row || (keys[si] != keys[si - 1] && keys[si] != ~keys[si - 1]);
        }
        bins->row_index =
            hs_alloc(account, HS_FOR_CELLS, bins->n_rows * (bins->ndim - 1), sizeof(int64_t));
        bins->row_cell = hs_alloc(account, HS_FOR_CELLS, bins->n_rows + 1, sizeof(int32_t));
        bins->start = hs_alloc(account, HS_FOR_CELLS, grid->n_cells + 1, sizeof(int32_t));
        if (bins->row_index == NULL || bins->row_cell == NULL || bins->start == NULL) {
            status = HS_ERR_MEMORY;
        }
    }
    if (status == HS_OK) {
        int64_t *keys = bins->cell_x; /* shortened to one for each cell, read ahead of that */
        int64_t  row = 0, cell = 0, x = 0;
        for (int64_t si = 0; si < n; si++) {
            const bool    begins_row = keys[si] < 0;
            const int64_t own = begins_row ? ~keys[si] : keys[si];
            for (int k = 1; begins_row && k < bins->ndim; k++) {
                bins->row_index[row * (bins->ndim - 1) + k - 1] = index_of(&b, b.sort.ids[si], k);
            }
            if (begins_row) {
                bins->row_cell[row++] = (int32_t)cell;
            }
            if (begins_row || own != x) {
                x = own;
                bins->start[cell] = (int32_t)si;
                keys[cell++] = x;
            }
        }
        bins->row_cell[row] = (int32_t)cell;
        bins->start[cell] = (int32_t)n;
        for (int64_t c = 0; c < grid->n_cells; c++) {
            const double here = bins->start[c + 1] - bins->start[c];
            bins->squares += here * here;
        }
    }
    return status;
}

hs_status
hs_bins_build(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
              hs_grid *grid, bool of_queries, hs_bins *bins)
{
    const int64_t n = scene->n;
    const bool    is_sparse = grid->stride[0] == 0;
    hs_status     status = HS_OK;
    hs_bins_take(scene, bins);
    if (is_sparse) {
        status = sort_sparse(account, options, scene, grid, bins);
    } else if (of_queries) {
        bins->cells = hs_alloc(account, HS_FOR_CELLS, n, sizeof *bins->cells);
    } else {
        bins->start = hs_alloc(account, HS_FOR_CELLS, grid->n_cells + 1, sizeof *bins->start);
    }
    if (bins->start == NULL && bins->cells == NULL) {
        return status == HS_OK ? HS_ERR_MEMORY : status;
    }
    if (!is_sparse && grid->n_cells == 1) {
        bins->squares = (double)n * (double)n;
        for (int64_t i = 0; i < n; i++) {
            bins->order[i] = (int32_t)i;
        }
        if (of_queries) {
            memset(bins->cells, 0, (size_t)n * sizeof *bins->cells);
        } else {
            bins->start[0] = 0;
            bins->start[1] = (int32_t)n;
        }
        return HS_OK;
    }
    if (!is_sparse) {
        const bool is_few = n <= FEW_QUERIES && n <= grid->n_cells / CELLS_PER_FEW;
        void      *spare = scene->cloud.spare;
        sorting    sort = {.grid = grid, .lattice = &scene->lattice, .bins = bins, .x = bins->x};
        sort.cells = of_queries && is_few ? bins->cells : spare;
        status = of_queries && is_few ? sort_few(account, &sort, spare, bins)
                                      : sort_many(account, team, options, &sort, bins);
    }
    return status == HS_OK ? hs_bins_arrange(account, team, options, scene, bins) : status;
}
