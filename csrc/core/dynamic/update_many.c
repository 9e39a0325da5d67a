/* SPDX-License-Identifier: BSD-3-Clause */
/* update_many.c: many points at once. First each cell gets room for all that comes into it, as if
 * all were new; then each point is put where it belongs. */
#include "update.h"

#include <stdlib.h>

#include "cell_room.h"
#include "fill.h"
#include "put_point.h"
#include "rows.h"
#include "../memory/account.h"

/* Rows are few where there are more than so many cells for each: these are not all looked at. */
#define FEW_ROWS 16

/* Room for `coming` more entries in each cell, in the order of the cells, so that the blocks of
 * neighbours lie side by side. */
static bool
reserve_in_cells(hs_dynamic *list, const uint32_t *coming)
{
    for (int64_t c = 0; c < list->cells.n; c++) {
        const int64_t count = (int64_t)list->cells.cell[c].count + coming[c];
        if (coming[c] > 0 && !hs_cell_reserve(list, (uint32_t)c, count)) {
            return false;
        }
    }
    return true;
}

static int
compare_cells(const void *one, const void *other)
{
    const uint32_t a = *(const uint32_t *)one, b = *(const uint32_t *)other;
    return (a > b) - (a < b);
}

/* The same for few rows among many cells: the numbers of their cells, which are sorted. */
static bool
reserve_in_some(hs_dynamic *list, uint32_t *numbers, int64_t n)
{
    qsort(numbers, (size_t)n, sizeof *numbers, compare_cells);
    for (int64_t i = 0; i < n;) {
        const int64_t begin = i;
        while (i < n && numbers[i] == numbers[begin]) {
            i++;
        }
        const int64_t count = (int64_t)list->cells.cell[numbers[begin]].count + (i - begin);
        if (!hs_cell_reserve(list, numbers[begin], count)) {
            return false;
        }
    }
    return true;
}

/* Room in each cell for all rows that go there, as if they were all new. numbers: n, scratch. */
static hs_status
reserve_rows(hs_dynamic *list, int64_t n, double *const *x, uint32_t *numbers, hs_failure *failure)
{
    double    given[HS_MAX_DIM];
    hs_placed placed;
    uint32_t *coming = NULL;
    bool      fits;
    for (int64_t i = 0; i < n; i++) {
        (void)hs_rows_place(list, x, i, given, &placed, failure); /* it can be had: hs_rows_reach */
        numbers[i] = hs_cell_table_add(&list->cells, &list->entries, placed.index);
    }
    if (n < list->cells.n / FEW_ROWS) {
        return reserve_in_some(list, numbers, n) ? HS_OK : HS_ERR_MEMORY;
    }
    coming = hs_alloc(NULL, HS_FOR_CELLS, list->cells.n, sizeof *coming);
    fits = coming != NULL;
    if (fits) {
        memset(coming, 0, (size_t)list->cells.n * sizeof *coming);
        for (int64_t i = 0; i < n; i++) {
            coming[numbers[i]]++;
        }
        fits = reserve_in_cells(list, coming);
    }
    hs_free(NULL, coming);
    return fits ? HS_OK : HS_ERR_MEMORY;
}

/* Gives back the blocks of those of these cells that are empty. */
static void
release_empty(hs_dynamic *list, const uint32_t *numbers, int64_t n)
{
    for (int64_t i = 0; i < n; i++) {
        const uint32_t c = numbers[i];
        if (list->cells.cell[c].count == 0 && list->cells.size[c] != HS_NO_BLOCK) {
            hs_entries_give(&list->entries, list->cells.size[c], list->cells.cell[c].start);
            list->cells.size[c] = HS_NO_BLOCK;
        }
    }
}

/* numbers: receives the cells that the points were in, or are in if they are new. */
static void
put_rows(hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t n, double *const *x,
         uint32_t *numbers, hs_failure *failure)
{
    double    given[HS_MAX_DIM];
    hs_placed placed;
    list->keeps_blocks = true;
    for (int64_t i = 0; i < n; i++) {
        const hs_key   key = {ids[i], tags != NULL ? tags[i] : 0};
        const uint32_t place = hs_key_map_find(&list->map, &list->entries, key);
        (void)hs_rows_place(list, x, i, given, &placed, failure);
        numbers[i] = hs_cell_table_find(&list->cells, placed.index);
        if (place == HS_NO_PLACE) {
            hs_put_new(list, key, numbers[i], &placed);
        } else {
            const uint32_t number = numbers[i];
            numbers[i] = hs_entry_tail_at(&list->entries, place)->cell;
            hs_put_again(list, key, place, number, &placed);
        }
    }
    list->keeps_blocks = false;
}

hs_status
hs_update_insert_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags, int64_t n,
                      double *const *x, hs_failure *failure)
{
    if (n == 0) {
        return HS_OK;
    }
    if (list->map.n == 0) {
        const hs_status status = hs_fill(list, ids, tags, n, x, failure);
        list->changes += status == HS_OK;
        return status;
    }
    hs_status status = hs_rows_reach(list, n, x, failure);
    if (status != HS_OK) {
        return status;
    }
    uint32_t *numbers = hs_alloc(NULL, HS_FOR_CELLS, n, sizeof *numbers);
    if (numbers == NULL || !hs_key_map_reserve(&list->map, list->map.n + n) ||
        !(list->cells.dense || hs_cell_table_reserve(&list->cells, &list->entries, n))) {
        hs_free(NULL, numbers);
        return HS_ERR_MEMORY;
    }
    status = reserve_rows(list, n, x, numbers, failure);
    if (status == HS_OK) {
        put_rows(list, ids, tags, n, x, numbers, failure);
        list->changes++;
    }
    release_empty(list, numbers, n);
    hs_free(NULL, numbers);
    return status;
}
