/* SPDX-License-Identifier: BSD-3-Clause */
/* record.c: all columns at once if the writer can; else i and j by the kernel, then what is
 * measured in batches. */
#include "record.h"

#include "record_measures.h"
#include "record_write.h"
#include "record_shells.h"
#include "../search/choice.h"

#define INDICES (HS_WANT_I | HS_WANT_J | HS_WANT_BOTH)

/* i and j side by side. */
static void
put_both(const hs_recorder *recorder, const hs_kernel *kernel, const hs_hits *hits)
{
    const hs_output *output = recorder->output;
    int32_t         *i = recorder->ends[0], *j = recorder->ends[1];
    const int32_t    n = hits->end[hits->n - 1];
    void            *both = hs_output_next(output, HS_WANT_BOTH);
    kernel->emit_int32(hits, i, j);
    for (int32_t h = 0; h < n; h++) {
        if (output->index_bytes == 8) {
            ((int64_t *)both)[2 * h] = i[h];
            ((int64_t *)both)[2 * h + 1] = j[h];
        } else {
            ((int32_t *)both)[2 * h] = i[h];
            ((int32_t *)both)[2 * h + 1] = j[h];
        }
    }
}

static void
put_index(void *column, int bytes, int64_t at, int32_t number)
{
    if (column != NULL && bytes == 8) {
        ((int64_t *)column)[at] = number;
    } else if (column != NULL) {
        ((int32_t *)column)[at] = number;
    }
}

/* The asking point to i and what it met to j, whatever their numbers are. */
static void
put_directed(const hs_recorder *recorder, const hs_hits *hits)
{
    const hs_output *output = recorder->output;
    const int        bytes = output->index_bytes;
    void            *i = hs_output_next(output, HS_WANT_I), *j = hs_output_next(output, HS_WANT_J);
    void            *both = hs_output_next(output, HS_WANT_BOTH);
    for (int32_t t = 0, h = 0; t < hits->n; t++) {
        for (; h < hits->end[t]; h++) {
            put_index(i, bytes, h, hits->point[t]);
            put_index(j, bytes, h, hits->label[h]);
            put_index(both, bytes, 2 * (int64_t)h, hits->point[t]);
            put_index(both, bytes, 2 * (int64_t)h + 1, hits->label[h]);
        }
    }
}

static void
put_indices(const hs_recorder *recorder, const hs_search *search, const hs_hits *hits)
{
    const hs_kernel *kernel = search->call->kernel;
    const hs_output *output = recorder->output;
    if (!search->is_half) {
        put_directed(recorder, hits);
        return;
    }
    const hs_emit_fn emit = output->index_bytes == 8 ? kernel->emit_int64 : kernel->emit_int32;
    if (recorder->columns & (HS_WANT_I | HS_WANT_J)) {
        emit(hits, hs_output_next(output, HS_WANT_I), hs_output_next(output, HS_WANT_J));
    }
    if (recorder->columns & HS_WANT_BOTH) {
        put_both(recorder, kernel, hits);
    }
}

/* All columns of hits. */
static hs_status
put_places(hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    const int32_t  n = hits->end[hits->n - 1];
    const int32_t *id = scanner->block.id;
    hs_hits        by_id = *hits;
    bool           written;
    hs_status      status = hs_write_hits(recorder, scanner, first, hits, &written);
    if (status != HS_OK) {
        return status;
    }
    if (written) {
        return hs_put_shells(recorder, scanner, first, hits);
    }
    if (scanner->search->is_half || (recorder->columns & INDICES)) {
        for (int32_t h = 0; h < n; h++) {
            recorder->ids[h] = id[hits->label[h]];
        }
        by_id.label = recorder->ids;
        put_indices(recorder, scanner->search, &by_id);
    }
    status = hs_put_measures(recorder, scanner, first, hits);
    return status == HS_OK ? hs_put_shells(recorder, scanner, first, hits) : status;
}

/* Distances of pairs that are this far apart or further are not below that. */
static void
keep_apart(const hs_output *output, int32_t n, double least)
{
    double *distance = hs_output_next(output, HS_WANT_DISTANCE);
    for (int32_t h = 0; distance != NULL && h < n; h++) {
        distance[h] = hs_larger(distance[h], least);
    }
}

hs_status
hs_record_places(hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    const hs_choice *choice = scanner->search->call->choice;
    const hs_status  status = put_places(recorder, scanner, first, hits);
    if (status == HS_OK && choice != NULL && scanner->options.precision == HS_EXACT) {
        keep_apart(recorder->output, hits->end[hits->n - 1], choice->min_distance);
    }
    return status;
}

hs_status
hs_record_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_recorder  *recorder = context;
    hs_output    *output = recorder->output;
    const int32_t n = hits->end[hits->n - 1];
    hs_status     status = hs_output_reserve(output, n, hs_scanner_fraction(scanner));
    if (status == HS_OK && scanner->use == HS_BLOCK_LISTS_PLACES) {
        status = hs_record_places(recorder, scanner, first, hits);
    } else if (status == HS_OK) {
        put_indices(recorder, scanner->search, hits);
    }
    output->n_pairs += status == HS_OK ? n : 0;
    return status;
}
