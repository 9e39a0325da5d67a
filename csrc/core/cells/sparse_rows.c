/* SPDX-License-Identifier: BSD-3-Clause */
/* sparse_rows.c: finding rows, windows and groups. See sparse_rows.h; sparse_build.c makes them. */
#include "sparse_rows.h"

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

/* The first of cells [low, high) at x or beyond, or high; found as above. */
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
