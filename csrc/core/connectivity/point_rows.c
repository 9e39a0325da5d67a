/* SPDX-License-Identifier: BSD-3-Clause */
/* point_rows.c: lengths are counted and added up; entries then come in ascending order. */
#include "point_rows.h"

#include "../base/starts.h"

#include <string.h>

static hs_status
allocate(hs_account *account, int64_t n, hs_point_rows *rows)
{
    *rows = (hs_point_rows){.n = n};
    rows->first = hs_alloc(account, HS_FOR_SORTING, n + 1, sizeof *rows->first);
    if (rows->first == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(rows->first, 0, (size_t)(n + 1) * sizeof *rows->first);
    return HS_OK;
}

static hs_status
allocate_index(hs_account *account, int64_t n, hs_point_rows *rows)
{
    rows->index = hs_alloc(account, HS_FOR_SORTING, n, sizeof *rows->index);
    return rows->index != NULL ? HS_OK : HS_ERR_MEMORY;
}

/* Copies the row of point i, which has `length` entries, and adds i; false where it is no row. */
static bool
copy_row(const int32_t *from, int64_t length, int64_t i, int64_t n, int32_t *to)
{
    int32_t before = -1;
    bool    has_own = false;
    for (int64_t e = 0; e < length; e++) {
        const int32_t j = from[e];
        if (j <= before || j == i || j >= n) {
            return false;
        }
        if (!has_own && j > i) {
            *to++ = (int32_t)i;
            has_own = true;
        }
        *to++ = before = j;
    }
    if (!has_own) {
        *to = (int32_t)i;
    }
    return true;
}

/* Copies offsets, with room for one number more in each row. */
static bool
copy_offsets(const hs_index_rows *given, hs_point_rows *rows)
{
    int64_t before = 0;
    for (int64_t i = 0; i <= given->n; i++) {
        const int64_t first = given->offsets[i];
        if (first < before || (i == 0 && first != 0)) {
            return false;
        }
        rows->first[i] = first + i;
        before = first;
    }
    return before == given->n_indices;
}

hs_status
hs_point_rows_copy(hs_account *account, const hs_index_rows *given, hs_point_rows *rows)
{
    hs_status status = HS_ERR_ARGUMENT;
    *rows = (hs_point_rows){.n = 0};
    if (given->n >= 0 && given->n <= INT32_MAX && given->offsets != NULL &&
        (given->indices != NULL || given->n_indices == 0)) {
        status = allocate(account, given->n, rows);
    }
    if (status == HS_OK && !copy_offsets(given, rows)) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = allocate_index(account, rows->first[rows->n], rows);
    }
    for (int64_t i = 0; status == HS_OK && i < rows->n; i++) {
        const int64_t at = rows->first[i], length = rows->first[i + 1] - at - 1;
        if (!copy_row(given->indices + (at - i), length, i, rows->n, rows->index + at)) {
            status = HS_ERR_ARGUMENT;
        }
    }
    if (status != HS_OK) {
        hs_point_rows_free(account, rows);
    }
    return status;
}

hs_status
hs_point_rows_turn(hs_account *account, const hs_point_rows *from, const int32_t *order,
                   const int32_t *place, hs_point_rows *rows)
{
    const int64_t n_entries = from->first[from->n];
    hs_status     status = allocate(account, from->n, rows);
    if (status == HS_OK) {
        status = allocate_index(account, n_entries, rows);
    }
    if (status != HS_OK) {
        hs_point_rows_free(account, rows);
        return status;
    }
    for (int64_t e = 0; e < n_entries; e++) {
        rows->first[place[from->index[e]] + 1]++;
    }
    hs_starts_of_lengths(rows->first, rows->n + 1);
    for (int64_t p = 0; p < from->n; p++) {
        const int32_t i = order[p];
        for (int64_t e = from->first[i]; e < from->first[i + 1]; e++) {
            rows->index[rows->first[place[from->index[e]]]++] = (int32_t)p;
        }
    }
    hs_starts_of_ends(rows->first, rows->n + 1);
    return HS_OK;
}

hs_status
hs_point_rows_of(hs_account *account, const hs_output *half, int64_t n, hs_point_rows *rows)
{
    const hs_half_columns pairs = hs_half_list_columns(half);
    hs_status             status = allocate(account, n, rows);
    if (status == HS_OK) {
        status = allocate_index(account, 2 * pairs.n, rows);
    }
    if (status != HS_OK) {
        hs_point_rows_free(account, rows);
        return status;
    }
    for (int64_t e = 0; e < pairs.n; e++) {
        rows->first[pairs.i[e] + 1]++;
        rows->first[pairs.j[e] + 1]++;
    }
    hs_starts_of_lengths(rows->first, rows->n + 1);
    for (int64_t e = 0; e < pairs.n; e++) {
        rows->index[rows->first[pairs.i[e]]++] = pairs.j[e];
        rows->index[rows->first[pairs.j[e]]++] = pairs.i[e];
    }
    hs_starts_of_ends(rows->first, rows->n + 1);
    return HS_OK;
}

void
hs_point_rows_free(hs_account *account, hs_point_rows *rows)
{
    hs_free(account, rows->first);
    hs_free(account, rows->index);
    *rows = (hs_point_rows){.n = 0};
}
