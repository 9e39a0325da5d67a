/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_write.c: a batch of entries at a time, measured by the batch kernel; each goes to its
 * place in the output. */
#include "nearest_write.h"

#include <math.h>
#include <string.h>

#define LINE          64  /* bytes that are fetched at once, */
#define MOST_EXPECTED 512 /* and of a row */
#define MOST_SQUARE   0x1p1000

void
hs_nearest_writer_init(const hs_nearest *near, hs_nearest_writer *writer)
{
    memset(writer, 0, sizeof *writer); /* kernels read a little beyond the last entry */
    writer->near = near;
    writer->j = hs_output_column(near->rows, HS_WANT_J);
    writer->d = hs_output_column(near->rows, HS_WANT_DISTANCE);
    writer->D = hs_output_column(near->rows, HS_WANT_VECTOR);
    writer->S = hs_output_column(near->rows, HS_WANT_SHIFT);
}

void
hs_nearest_expect(const hs_nearest_writer *writer, int32_t si)
{
    const hs_nearest *near = writer->near;
    const int64_t     row = hs_search_asking(near->search)->order[si];
    const int64_t bytes[2] = {near->k * near->rows->index_bytes, near->k * (int64_t)sizeof(double)};
    char *const   column[2] = {writer->j, (char *)writer->d};
    for (int c = 0; c < 2; c++) {
        char *line = column[c] != NULL ? column[c] + row * bytes[c] : NULL;
        for (int64_t at = 0; line != NULL && at < bytes[c] && at < MOST_EXPECTED; at += LINE) {
            HS_PREFETCH_WRITE(line + at);
        }
    }
}

HS_ALWAYS_INLINE void
put_number(void *j, int index_bytes, int64_t at, int32_t number)
{
    if (j != NULL && index_bytes == 8) {
        ((int64_t *)j)[at] = number;
    } else if (j != NULL) {
        ((int32_t *)j)[at] = number;
    }
}

void
hs_nearest_write_nothing(const hs_nearest *near, int64_t row, int64_t from)
{
    const hs_output *rows = near->rows;
    const int        d = rows->ndim;
    void            *j = hs_output_column(rows, HS_WANT_J);
    double          *distance = hs_output_column(rows, HS_WANT_DISTANCE);
    double          *vector = hs_output_column(rows, HS_WANT_VECTOR);
    int32_t         *shift = hs_output_column(rows, HS_WANT_SHIFT);
    HS_ASSERT((row + 1) * near->k <= rows->n_pairs);
    for (int64_t at = row * near->k + from; at < (row + 1) * near->k; at++) {
        put_number(j, rows->index_bytes, at, -1);
        if (distance != NULL) {
            distance[at] = INFINITY;
        }
        for (int k = 0; vector != NULL && k < d; k++) {
            vector[at * d + k] = NAN;
        }
        for (int k = 0; shift != NULL && k < d; k++) {
            shift[at * d + k] = 0;
        }
    }
}

/* Rows ascend in exact order; a distance, known to a unit in the last place, may be lifted to the
 * one before it, which is then no further from the true one than that. */
static void
put_distances(hs_nearest_writer *writer, double *to)
{
    const hs_search *search = writer->near->search;
    hs_measured     *pairs = &writer->pairs;
    hs_restore_distances(pairs->distance, pairs->n, hs_measures_unscale(&search->scene));
    if (search->call->options.cutoff < INFINITY) {
        hs_keep_all_within(pairs->distance, pairs->n, search->call->options.cutoff, true);
    }
    double before = pairs->n > 0 && !writer->is_first[0] ? to[writer->at[0] - 1] : 0.0;
    for (int32_t e = 0; e < pairs->n; e++) {
        before = hs_larger(pairs->distance[e], writer->is_first[e] ? 0.0 : before);
        to[writer->at[e]] = before;
    }
}

static void
put_vectors(hs_nearest_writer *writer, double *to)
{
    const hs_search *search = writer->near->search;
    hs_measured     *pairs = &writer->pairs;
    const int        d = search->scene.ndim;
    double          *vector[HS_MAX_DIM], sign[HS_BATCH], packed[HS_BATCH * HS_MAX_DIM];
    for (int k = 0; k < d; k++) {
        vector[k] = pairs->vector[k];
    }
    for (int32_t e = 0; e < pairs->n; e++) {
        sign[e] = 1.0;
    }
    hs_restore_vectors(packed, vector, sign, pairs->n, d, hs_measures_unscale(&search->scene));
    for (int32_t e = 0; e < pairs->n; e++) {
        memcpy(to + writer->at[e] * d, packed + (int64_t)e * d, (size_t)d * sizeof *to);
    }
}

void
hs_nearest_flush(hs_nearest_writer *writer)
{
    hs_measured *pairs = &writer->pairs;
    if (pairs->n > 0 && (writer->d != NULL || writer->D != NULL)) {
        hs_measured_find(writer->near->search->call->kernel, &writer->near->order,
                         writer->D != NULL, pairs);
    }
    if (writer->d != NULL) {
        put_distances(writer, writer->d);
    }
    if (writer->D != NULL) {
        put_vectors(writer, writer->D);
    }
    if (pairs->is_shifted) {
        memset(pairs->times, 0, sizeof pairs->times);
        memset(pairs->shift, 0, sizeof pairs->shift);
    }
    pairs->n = 0;
    pairs->is_shifted = pairs->is_wide = false;
}

/* S over all box vectors; false when it does not fit int32. */
static bool
put_shift(const hs_nearest *near, const int64_t *given, int32_t *to)
{
    const hs_lattice *lattice = &near->search->scene.lattice;
    const int         d = lattice->ndim;
    bool              fits = true;
    memset(to, 0, (size_t)d * sizeof *to);
    for (int l = 0; l < lattice->n_periodic; l++) {
        fits = fits && given[l] >= INT32_MIN && given[l] <= INT32_MAX;
        to[lattice->vector_of_row[l]] = fits ? (int32_t)given[l] : 0;
    }
    return fits;
}

/* The metric's shifts, and S where that is wanted, of n entries from place `at` of the output and
 * from the batch's next entry on: where they follow from the points' turns. */
static hs_status
put_given(hs_nearest_writer *writer, const hs_nearest_ranker *ranker, const hs_nearest_key *keys,
          int32_t n, int64_t at)
{
    const hs_nearest *near = writer->near;
    const hs_bins    *asking = hs_search_asking(near->search);
    for (int32_t e = 0; e < n; e++) {
        double  q[HS_MAX_DIM];
        int64_t shift[HS_MAX_DIM], given[HS_MAX_DIM];
        if (!hs_nearest_pair(near, ranker->block, ranker->si, keys[e].place, q, shift, given) ||
            (writer->S != NULL && !put_shift(near, given, writer->S + (at + e) * asking->ndim))) {
            writer->failed = asking->order[ranker->si];
            return HS_ERR_SHIFT_RANGE;
        }
        for (int r = 0; r < asking->n_periodic; r++) {
            hs_measured_shift(&writer->pairs, writer->pairs.n + e, r, shift[r]);
        }
    }
    return HS_OK;
}

/* The metric's shifts where they are those of the images: all are zero before, and few are not
 * after. */
static void
put_images(hs_nearest_writer *writer, const hs_nearest_ranker *ranker, const hs_nearest_key *keys,
           int32_t n)
{
    const hs_nearest_block *block = ranker->block;
    if (block->n_images == 1 && block->images[0].is_home) {
        return;
    }
    for (int32_t e = 0; e < n; e++) {
        const hs_nearest_image *image = hs_nearest_image_of(block, keys[e].place);
        for (int r = 0; !image->is_home && r < writer->near->order.n_rows; r++) {
            hs_measured_shift(&writer->pairs, writer->pairs.n + e, r, image->shift[r]);
        }
    }
}

/* n entries of the ranker's row, from `at` on; the batch has room for them. */
static hs_status
put_entries(hs_nearest_writer *writer, const hs_nearest_ranker *ranker, const hs_nearest_key *keys,
            int32_t n, int64_t at, bool is_first)
{
    const hs_nearest *near = writer->near;
    const hs_bins    *bins = &near->search->bins, *asking = hs_search_asking(near->search);
    const int32_t     begin = writer->pairs.n;
    const int         index_bytes = near->rows->index_bytes;
    int32_t           number[HS_BATCH];
    for (int32_t e = 0; e < n; e++) {
        number[e] = ranker->block->number[keys[e].place];
        put_number(writer->j, index_bytes, at + e, bins->order[number[e]]);
    }
    for (int k = 0; k < bins->ndim; k++) {
        const double *from = bins->keeps_originals ? bins->originals[k] : bins->x[k];
        const double  own = asking->keeps_originals ? asking->originals[k][ranker->si]
                                                    : asking->x[k][ranker->si];
        for (int32_t e = 0; e < n; e++) {
            writer->pairs.p[k][begin + e] = own;
            writer->pairs.q[k][begin + e] = from[number[e]];
        }
    }
    for (int32_t e = 0; e < n; e++) {
        writer->at[begin + e] = at + e;
        writer->is_first[begin + e] = is_first && e == 0;
    }
    hs_status status = HS_OK;
    if (bins->keeps_originals || writer->S != NULL) {
        status = put_given(writer, ranker, keys, n, at);
    } else if (bins->n_periodic > 0) {
        put_images(writer, ranker, keys, n);
    }
    writer->pairs.n += n;
    return status;
}

/* How many of the ranked are within the largest distance: all before the first that is not. */
static int64_t
count_within(hs_nearest_ranker *ranker, int64_t count)
{
    const hs_nearest *near = ranker->near;
    const hs_bins    *asking = hs_search_asking(near->search);
    const double      limit = near->limit * ranker->block->unit;
    const double      square = limit * limit;
    if (!(square < MOST_SQUARE)) { /* beyond all that a block holds */
        return count;
    }
    while (count > 0) {
        const hs_nearest_key *key = &ranker->keys[count - 1];
        const double          error =
            2.0 * hs_nearest_error(ranker->block, near->tree.ndim, hs_larger(square, key->square));
        double  p[HS_MAX_DIM], q[HS_MAX_DIM];
        int64_t shift[HS_MAX_DIM];
        if (key->square + error < square) {
            break;
        }
        for (int k = 0; k < asking->ndim; k++) {
            p[k] = asking->keeps_originals ? asking->originals[k][ranker->si]
                                           : asking->x[k][ranker->si];
        }
        if (key->square <= square + error &&
            (!hs_nearest_pair(near, ranker->block, ranker->si, key->place, q, shift, NULL) ||
             hs_metric_within(&near->within, p, q, shift, &ranker->stages))) {
            break; /* shifts that pass their range are found when they are written */
        }
        count--;
    }
    return count;
}

hs_status
hs_nearest_write(hs_nearest_writer *writer, hs_nearest_ranker *ranker, int64_t count)
{
    const hs_nearest *near = writer->near;
    const int64_t     row = hs_search_asking(near->search)->order[ranker->si];
    count = count_within(ranker, count);
    for (int64_t e = 0; e < count;) {
        const int64_t   room = HS_BATCH - writer->pairs.n;
        const int32_t   n = (int32_t)(count - e < room ? count - e : room);
        const hs_status status =
            put_entries(writer, ranker, ranker->keys + e, n, row * near->k + e, e == 0);
        if (status != HS_OK) {
            return status;
        }
        e += n;
        if (writer->pairs.n == HS_BATCH) {
            hs_nearest_flush(writer);
        }
    }
    if (count < near->k) {
        hs_nearest_write_nothing(near, row, count);
    }
    return HS_OK;
}
