/* SPDX-License-Identifier: BSD-3-Clause */
/* sparse_rows.c: sorts the points into rows of cells; finds rows, windows and groups by steps that
 * double, then by halves. */
#include "sparse_rows.h"

#include "sparse_grid.h"
#include "../base/radix_sort.h"

void
hs_sparse_free(hs_account *account, hs_sparse *sparse)
{
    hs_free(account, sparse->row_index);
    hs_free(account, sparse->row_cell);
    hs_free(account, sparse->cell_x);
    *sparse = (hs_sparse){.ndim = sparse->ndim};
}

/* Does the row come before these indices? */
HS_ALWAYS_INLINE bool
row_is_before(const hs_sparse *sparse, int64_t row, const int64_t *index)
{
    const int64_t *own = sparse->row_index + row * (sparse->ndim - 1);
    for (int k = sparse->ndim - 1; k >= 1; k--) {
        if (own[k - 1] != index[k]) {
            return own[k - 1] < index[k];
        }
    }
    return false;
}

/* The first row that does not come before these indices, by steps that double, then by halves. */
static int64_t
seek_row(const hs_sparse *sparse, const int64_t *index, int64_t hint)
{
    int64_t low = 0, high = sparse->n_rows, step = 1; /* the answer is in [low, high] */
    if (hint < high && row_is_before(sparse, hint, index)) {
        for (low = hint + 1; low + step <= high && row_is_before(sparse, low + step - 1, index);
             step *= 2) {
            low += step;
        }
        high = low + step - 1 < high ? low + step - 1 : high;
    } else {
        for (high = hint; high - step >= low && !row_is_before(sparse, high - step, index);
             step *= 2) {
            high -= step;
        }
        low = high - step >= low ? high - step + 1 : low;
    }
    while (low < high) {
        const int64_t middle = low + (high - low) / 2;
        if (row_is_before(sparse, middle, index)) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

int64_t
hs_sparse_find_row(const hs_sparse *sparse, const int64_t *index, int64_t *hint)
{
    const int64_t row = *hint = seek_row(sparse, index, *hint);
    if (row == sparse->n_rows) {
        return -1;
    }
    const int64_t *own = sparse->row_index + row * (sparse->ndim - 1);
    for (int k = 1; k < sparse->ndim; k++) {
        if (own[k - 1] != index[k]) {
            return -1;
        }
    }
    return row;
}

/* The first of cells [low, high) at x or beyond, or high; by steps that double, then by halves. */
static int32_t
seek_cell(const int64_t *cell_x, int32_t low, int32_t high, int32_t hint, int64_t x)
{
    int64_t step = 1;
    hint = hint < low ? low : hint > high ? high : hint;
    if (hint < high && cell_x[hint] < x) {
        for (low = hint + 1; low + step <= high && cell_x[low + step - 1] < x; step *= 2) {
            low += (int32_t)step;
        }
        high = low + step - 1 < high ? low + (int32_t)step - 1 : high;
    } else {
        for (high = hint; high - step >= low && cell_x[high - step] >= x; step *= 2) {
            high -= (int32_t)step;
        }
        low = high - step >= low ? high - (int32_t)step + 1 : low;
    }
    while (low < high) {
        const int32_t middle = low + (high - low) / 2;
        if (cell_x[middle] < x) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

void
hs_sparse_window(const hs_sparse *sparse, int64_t row, int64_t x_first, int64_t x_last,
                 hs_sparse_cursor *cursor, int32_t *first, int32_t *end)
{
    const int32_t low = sparse->row_cell[row], high = sparse->row_cell[row + 1];
    cursor->low = seek_cell(sparse->cell_x, low, high, cursor->low, x_first);
    cursor->high = seek_cell(sparse->cell_x, cursor->low, high, cursor->high, x_last + 1);
    *first = sparse->cell_start[cursor->low];
    *end = sparse->cell_start[cursor->high];
}

void
hs_sparse_first_group(const hs_sparse *sparse, int64_t row, hs_sparse_group *group)
{
    const int32_t cell = sparse->row_cell[row], first = sparse->cell_start[cell];
    *group = (hs_sparse_group){.first = first, .last = first, .cell = cell};
}

bool
hs_sparse_next_group(const hs_sparse *sparse, int64_t row, int32_t most, hs_sparse_group *group)
{
    const int32_t *start = sparse->cell_start;
    const int32_t  row_end = sparse->row_cell[row + 1];
    int32_t        cell = group->cell;
    cell += cell < row_end && start[cell + 1] == group->last; /* begin where the last one ended */
    if (cell == row_end) {
        return false;
    }
    group->first = group->last;
    group->x_first = sparse->cell_x[cell];
    while (cell + 1 < row_end && start[cell + 1] - group->first < most &&
           sparse->cell_x[cell + 1] < group->x_first + HS_SPARSE_SPLIT) {
        cell++;
    }
    group->last = start[cell + 1] - group->first < most ? start[cell + 1] : group->first + most;
    group->x_last = sparse->cell_x[cell];
    group->cell = cell;
    return true;
}

/*
 * Sorting the points of a sparse grid. By the index along the last axis first, then each range of
 * equal ones by the axis before it, down to the first axis: points with equal indices along all
 * others are a row. Indices are computed where they are compared, not stored.
 */

typedef struct build {
    hs_account       *account;
    const hs_options *options;
    const hs_scene   *scene;
    const hs_grid    *grid;
    hs_keys           sort; /* ids: bins->order; keys end as indices along the first axis */
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

/* bins->order, sorted; keys as sort_by_axis leaves them. */
static hs_status
sort_points(build *b, hs_bins *bins)
{
    const int64_t n = bins->n;
    b->sort.spare_keys = (int64_t *)(void *)b->scene->cloud.spare;
    b->sort.spare_ids = hs_alloc(b->account, HS_FOR_ORDER, n, sizeof(int32_t));
    if (b->sort.spare_ids == NULL) {
        return HS_ERR_MEMORY;
    }
    b->sort.ids = bins->order;
    b->sort.options = b->options;
    for (int64_t i = 0; i < n; i++) {
        bins->order[i] = (int32_t)i;
    }
    const hs_status status = n > 0 ? sort_by_axis(b, 0, n, b->scene->ndim - 1) : HS_OK;
    hs_free(b->account, b->sort.spare_ids);
    return status;
}

/* keys: indices along the first axis, complemented where a row begins. */
static void
count_cells(const int64_t *keys, int64_t n, hs_sparse *sparse)
{
    for (int64_t si = 0; si < n; si++) {
        const bool begins_row = keys[si] < 0;
        sparse->n_rows += begins_row;
        sparse->n_cells += begins_row || (keys[si] != keys[si - 1] && keys[si] != ~keys[si - 1]);
    }
}

/* Lists rows and cells, and shortens the keys to one for each cell. */
static void
list_cells(const build *b, int64_t n, int32_t *start, hs_sparse *sparse)
{
    int64_t *keys = sparse->cell_x; /* read ahead of where it is written */
    int64_t  row = 0, cell = 0, x = 0;
    for (int64_t si = 0; si < n; si++) {
        const bool    begins_row = keys[si] < 0;
        const int64_t own = begins_row ? ~keys[si] : keys[si];
        if (begins_row) {
            const int64_t i = b->sort.ids[si];
            for (int k = 1; k < sparse->ndim; k++) {
                sparse->row_index[row * (sparse->ndim - 1) + k - 1] = index_of(b, i, k);
            }
            sparse->row_cell[row++] = (int32_t)cell;
        }
        if (begins_row || own != x) {
            x = own;
            start[cell] = (int32_t)si;
            keys[cell++] = x;
        }
    }
    sparse->row_cell[row] = (int32_t)cell;
    start[cell] = (int32_t)n;
}

static hs_status
make_rows(build *b, hs_sparse *sparse, hs_bins *bins)
{
    hs_account *account = b->account;
    count_cells(sparse->cell_x, bins->n, sparse);
    sparse->row_index =
        hs_alloc(account, HS_FOR_CELLS, sparse->n_rows * (sparse->ndim - 1), sizeof(int64_t));
    sparse->row_cell = hs_alloc(account, HS_FOR_CELLS, sparse->n_rows + 1, sizeof(int32_t));
    bins->start = hs_alloc(account, HS_FOR_CELLS, sparse->n_cells + 1, sizeof(int32_t));
    if (sparse->row_index == NULL || sparse->row_cell == NULL || bins->start == NULL) {
        return HS_ERR_MEMORY;
    }
    sparse->cell_start = bins->start;
    list_cells(b, bins->n, bins->start, sparse);
    return HS_OK;
}

hs_status
hs_sparse_build(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
                hs_grid *grid, hs_sparse *sparse, hs_bins *bins)
{
    build b = {.account = account, .options = options, .scene = scene, .grid = grid};
    *sparse = (hs_sparse){.ndim = scene->ndim};
    hs_status status = HS_OK;
    hs_bins_take(scene, bins);
    sparse->cell_x = hs_alloc(account, HS_FOR_CELLS, scene->n, sizeof(int64_t));
    if (sparse->cell_x == NULL) {
        status = HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        b.sort.keys = sparse->cell_x;
        status = sort_points(&b, bins);
    }
    if (status == HS_OK) {
        status = make_rows(&b, sparse, bins);
    }
    if (status == HS_OK) {
        status = hs_bins_arrange(account, team, options, scene, bins);
    }
    grid->n_cells = sparse->n_cells;
    if (status != HS_OK) {
        hs_sparse_free(account, sparse);
        hs_bins_free(account, bins);
    }
    return status;
}
