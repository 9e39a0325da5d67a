/* SPDX-License-Identifier: BSD-3-Clause */
/* bin_columns.c: see bin_columns.h. */
#include "bin_columns.h"

#include "../threads/passes.h"

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
    return hs_walk_slabs(team, options, bins->n, gather_slab, &move);
}

static hs_status
gather_doubles(hs_team *team, const hs_options *options, const hs_bins *bins,
               double *columns[HS_MAX_DIM], void **free_column)
{
    hs_status status = HS_OK;
    for (int k = 0; k < bins->ndim && status == HS_OK; k++) {
        void *column = columns[k];
        status = gather_column(team, options, bins, sizeof(double), &column, free_column);
        columns[k] = column;
    }
    return status;
}

hs_status
hs_columns_gather(hs_team *team, const hs_options *options, bool x_is_beside, hs_bins *bins,
                  void *free_column, char **end)
{
    double  **first = x_is_beside ? bins->originals : bins->x;
    double  **second = x_is_beside ? bins->x : bins->originals;
    hs_status status = gather_doubles(team, options, bins, first, &free_column);
    if (status == HS_OK && bins->keeps_originals) {
        status = gather_doubles(team, options, bins, second, &free_column);
    }
    for (int r = 0; bins->turns.known && r < bins->n_periodic && status == HS_OK; r++) {
        const bool   narrow = bins->turns.narrow[r] != NULL;
        const size_t size = narrow ? sizeof(int32_t) : sizeof(int64_t);
        void        *column = narrow ? (void *)bins->turns.narrow[r] : bins->turns.wide[r];
        status = gather_column(team, options, bins, size, &column, &free_column);
        bins->turns.narrow[r] = narrow ? column : NULL;
        bins->turns.wide[r] = narrow ? NULL : column;
    }
    *end = free_column;
    return status;
}
