/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * sparse_build.c: sorting the points of a sparse grid. By the index along the last axis first, then
 * each run of equal ones by the axis before it, down to the first axis: a run of equal indices
 * along all others is a row. Indices are computed where they are compared, not stored.
 */
#include "../base/radix_sort.h"
#include "../base/poll.h"
#include "sparse_rows.h"

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
        const bool begins_row = keys[si] < 0;
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
    sparse->row_index = hs_alloc(account, HS_FOR_CELLS, sparse->n_rows * (sparse->ndim - 1),
                                 sizeof(int64_t));
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
