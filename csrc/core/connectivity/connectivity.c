/* SPDX-License-Identifier: BSD-3-Clause */
/* connectivity.c: three results of one call. */
#include "connectivity.h"

#include "node_pairs.h"
#include "node_rows.h"
#include "row_pairs.h"
#include "row_split.h"

#include <string.h>

hs_connectivity *
hs_connectivity_new(void)
{
    hs_connectivity *made = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *made);
    if (made == NULL) {
        return NULL;
    }
    memset(made, 0, sizeof *made);
    hs_pairs **parts[] = {&made->rows, &made->nodes, &made->lists};
    for (int k = 0; k < 3; k++) {
        hs_pairs *part = hs_pairs_new();
        if (part == NULL) {
            hs_connectivity_free(made);
            return NULL;
        }
        memset(&part->call, 0, sizeof part->call);
        *parts[k] = part;
    }
    return made;
}

hs_status
hs_connectivity_fill(hs_connectivity *made, const hs_node_lists *lists, int64_t n,
                     const hs_output *half, hs_failure *failure)
{
    hs_node_map map;
    hs_account *account = &made->call.account;
    hs_status   status = hs_node_map_make(account, lists, n, &map);
    if (status != HS_OK) {
        return status;
    }
    status = hs_node_rows_fill(&made->call, &map, half, made->rows, failure);
    if (status == HS_OK && !lists->rows_only) {
        status = hs_node_pairs_fill(&made->call, &map, lists->ghost_pairs, half, made->nodes,
                                    made->lists);
    }
    hs_node_map_free(account, &map);
    return status;
}

/* Whether rows of points are those of nodes: of one list, all of which have rows. */
static bool
needs_no_split(const hs_node_map *map)
{
    return map->is_plain && map->n_lists == 1 && map->n_rows == map->n;
}

/* The rows that have been filled, as a caller would give them. */
static hs_list_rows
rows_of(const hs_pairs *rows, int32_t n_lists)
{
    return (hs_list_rows){.n = n_lists > 0 ? hs_pairs_rows(rows) / n_lists : 0,
                          .n_lists = n_lists,
                          .offsets = hs_pairs_offsets(rows),
                          .n_indices = hs_pairs_length(rows),
                          .indices = hs_output_column(&rows->output, HS_WANT_J),
                          .shift = hs_output_column(&rows->output, HS_WANT_SHIFT),
                          .ndim = rows->output.ndim};
}

/* Pairs of points in any order, or of rows that are not those of all. */
static hs_status
fill_pairs(hs_connectivity *made, const hs_node_map *map, const hs_node_lists *lists,
           const hs_rows_view *view)
{
    hs_output half;
    hs_status status = hs_row_split_half(&made->call, map->n, view, &half);
    if (status == HS_OK) {
        status = hs_node_pairs_fill(&made->call, map, lists->ghost_pairs, &half, made->nodes,
                                    made->lists);
    }
    hs_output_free(&half);
    return status;
}

static hs_status
fill_rows(hs_connectivity *made, const hs_node_map *map, const hs_node_lists *lists,
          hs_pairs **found)
{
    const hs_output   *output = &(*found)->output;
    const int64_t     *offsets = hs_pairs_offsets(*found);
    const hs_rows_view view = {.first = offsets,
                               .end = offsets + 1,
                               .index = hs_output_column(output, HS_WANT_J),
                               .shift = hs_output_column(output, HS_WANT_SHIFT),
                               .ndim = output->ndim};
    const bool         has_all = map->is_plain && map->n_rows == map->n;
    hs_status          status = HS_OK;
    if (!lists->rows_only && !has_all) {
        status = fill_pairs(made, map, lists, &view);
    }
    if (status == HS_OK && needs_no_split(map)) {
        hs_pairs_free(made->rows);
        made->rows = *found;
        *found = NULL;
    } else if (status == HS_OK) {
        status = hs_row_split_fill(&made->call, map, &view, made->rows);
    }
    if (status == HS_OK && !lists->rows_only && has_all) {
        const hs_list_rows rows = rows_of(made->rows, map->n_lists);
        status = hs_row_pairs_fill(&made->call, map, lists->ghost_pairs, &rows, made->nodes,
                                   made->lists);
    }
    return status;
}

hs_status
hs_connectivity_fill_rows(hs_connectivity *made, const hs_node_lists *lists, hs_pairs **found)
{
    hs_node_map map;
    hs_account *account = &made->call.account;
    hs_status   status = hs_node_map_make(account, lists, hs_pairs_rows(*found), &map);
    if (status == HS_OK) {
        status = fill_rows(made, &map, lists, found);
        hs_node_map_free(account, &map);
    }
    return status;
}

hs_status
hs_connectivity_fill_pairs(hs_connectivity *made, const hs_node_lists *lists, int64_t n,
                           const hs_list_rows *rows)
{
    hs_node_map map;
    hs_account *account = &made->call.account;
    hs_status   status = hs_node_map_make(account, lists, n, &map);
    if (status == HS_OK) {
        status = map.is_plain && map.n_rows == n && rows->n == n && rows->n_lists == map.n_lists
                     ? hs_row_pairs_fill(&made->call, &map, lists->ghost_pairs, rows, made->nodes,
                                         made->lists)
                     : HS_ERR_ARGUMENT;
        hs_node_map_free(account, &map);
    }
    return status;
}

hs_pairs *
hs_connectivity_rows(hs_connectivity *connectivity)
{
    return connectivity != NULL ? connectivity->rows : NULL;
}

hs_pairs *
hs_connectivity_pairs(hs_connectivity *connectivity)
{
    return connectivity != NULL ? connectivity->nodes : NULL;
}

hs_pairs *
hs_connectivity_lists(hs_connectivity *connectivity)
{
    return connectivity != NULL ? connectivity->lists : NULL;
}

void
hs_connectivity_free(hs_connectivity *connectivity)
{
    if (connectivity == NULL) {
        return;
    }
    hs_pairs_free(connectivity->rows);
    hs_pairs_free(connectivity->nodes);
    hs_pairs_free(connectivity->lists);
    hs_account_close(&connectivity->call.account);
    hs_free(NULL, connectivity);
}
