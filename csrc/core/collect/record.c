/* SPDX-License-Identifier: BSD-3-Clause */
#include "record.h"
#include "../search/limits.h"
#include "../search/choice.h"

#include <math.h>
#include <string.h>

/* record.c: all columns at once if the writer can; else i and j by the kernel, then what is
 * measured in batches. */

/* Takes only the arrays that the columns of the output need. */

hs_block_use
hs_record_use(unsigned columns)
{
    return columns & (HS_MEASURED | HS_WANT_SHIFT) ? HS_BLOCK_LISTS_PLACES : HS_BLOCK_LISTS_IDS;
}

hs_status
hs_recorder_init(hs_account *account, hs_output *output, int32_t most_hits, hs_recorder *recorder)
{
    const int64_t  n = most_hits + HS_PADDING, in_batch = HS_BATCH + HS_PADDING;
    const unsigned columns = output->columns;
    hs_parts       parts;
    *recorder = (hs_recorder){.output = output, .columns = columns, .most_hits = most_hits};
    hs_parts_begin(&parts);
    if (hs_record_use(columns) == HS_BLOCK_LISTS_PLACES) {
        hs_parts_add(&parts, (void **)&recorder->ids, n, sizeof(int32_t));
    }
    for (int end = 0; (columns & HS_WANT_BOTH) && end < 2; end++) {
        hs_parts_add(&parts, (void **)&recorder->ends[end], n, sizeof(int32_t));
    }
    if (columns & HS_MEASURED) {
        hs_parts_add(&parts, (void **)&recorder->distance, in_batch, sizeof(double));
    }
    for (int k = 0; (columns & HS_WANT_VECTOR) && k < output->ndim; k++) {
        hs_parts_add(&parts, (void **)&recorder->vector[k], in_batch, sizeof(double));
    }
    if ((columns & HS_WANT_SHELL) && !(columns & HS_WANT_DISTANCE)) {
        hs_parts_add(&parts, (void **)&recorder->all_distances, n, sizeof(double));
    }
    recorder->memory = hs_parts_alloc(account, HS_FOR_CANDIDATES, &parts);
    return recorder->memory != NULL ? HS_OK : HS_ERR_MEMORY;
}

void
hs_recorder_free(hs_account *account, hs_recorder *recorder)
{
    hs_free(account, recorder->memory);
    *recorder = (hs_recorder){0};
}

/* By the rounded distance where that is far enough from all edges, which are
 * nearly all pairs; the others are decided exactly, those at one edge together. */

/* The edge in the middle of those that a pair may or may not be beyond; -1: it is decided. */
static int32_t
middle_of(const hs_edge_pair *pair)
{
    return pair->low < pair->high ? pair->low + (pair->high - pair->low) / 2 : -1;
}

hs_status
hs_decide_edges(hs_scanner *scanner, hs_edge_pairs *open)
{
    hs_pair_batch   *pair_batch = &scanner->pair_batch;
    const hs_shells *shells = &scanner->search->shells;
    const hs_metric *given = &scanner->search->scene.metric;
    hs_metric        metric;
    int32_t          next[HS_EDGE_PAIRS]; /* the edge of each that is to be decided next */
    int32_t          of[HS_BATCH];        /* of[e]: which of them is pair e of the batch */
    uint8_t          within[HS_BATCH];
    scanner->n_ambiguous += open->n;
    for (int32_t u = 0; u < open->n; u++) {
        next[u] = middle_of(&open->pair[u]);
    }
    for (int32_t u = 0; u < open->n;) {
        const int32_t edge = next[u];
        if (edge < 0) {
            u++;
            continue;
        }
        hs_pair_batch_clear(pair_batch);
        for (int32_t v = u; v < open->n && pair_batch->n < HS_BATCH; v++) {
            if (next[v] == edge) {
                of[pair_batch->n] = v;
                hs_pair_batch_put(pair_batch, open->pair[v].si, open->pair[v].place);
            }
        }
        const hs_status status = hs_pair_batch_look_up(pair_batch, true, &scanner->failed_point);
        if (status != HS_OK) {
            return status;
        }
        if (edge < shells->n) {
            hs_metric_init(&metric, given->ndim, given->n_rows,
                           (const double(*)[HS_MAX_DIM])given->rows, shells->at[edge],
                           shells->inclusive);
        }
        hs_decide_pair_batch(scanner, edge < shells->n ? &metric : given, within);
        for (int32_t e = 0; e < pair_batch->n; e++) {
            hs_edge_pair *pair = &open->pair[of[e]];
            pair->high = within[e] ? edge : pair->high;
            pair->low = within[e] ? pair->low : edge + 1;
            next[of[e]] = middle_of(pair);
        }
    }
    return HS_OK;
}

/* The shells of the hits of points from `first` on, places in the walker's block whose distances
 * have been written, as the next of the column. Distances that rounding has moved across an edge
 * are put right. HS_OK, HS_ERR_SHIFT_RANGE, which sets scanner->failed_point, or
 * HS_ERR_INTERRUPTED. */
static hs_status
put_shells(const hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    const hs_shells *shells = &scanner->search->shells;
    const int32_t    n = hits->end[hits->n - 1];
    double          *distance = hs_recorder_distances(recorder);
    int32_t         *shell = hs_output_next(recorder->output, HS_WANT_SHELL);
    hs_edge_pairs    open; /* large, and seldom used: not cleared */
    hs_status        status = HS_OK;
    open.n = 0;
    if (!hs_shells_find(shells, distance, n, shell)) {
        return HS_OK;
    }
    for (int32_t h = 0, t = 0; h < n && status == HS_OK; h++) { /* some are too near to an edge */
        while (hits->end[t] <= h) {
            t++;
        }
        int32_t low = shell[h], high;
        hs_shells_range(shells, distance[h], &low, &high);
        shell[h] = low;
        if (low < high) {
            open.pair[open.n++] = (hs_edge_pair){h, first + t, hits->label[h], low, high};
        }
        if (open.n == HS_EDGE_PAIRS || h == n - 1) {
            status = hs_decide_edges(scanner, &open);
            for (int32_t u = 0; u < open.n && status == HS_OK; u++) {
                const hs_edge_pair *pair = &open.pair[u];
                shell[pair->hit] = pair->low;
                distance[pair->hit] = hs_shells_keep(shells, pair->low, distance[pair->hit]);
            }
            open.n = 0;
        }
    }
    return status;
}

/* Kernels first, one pair at a time where they decline; then to the caller's unit, in
 * loops without branches, which compilers turn into vectors. */

/* Takes pair e out of the batch; returns its shift, which is NULL if `shift` is. */
static const int64_t *
pair_of(const hs_metric *metric, const hs_batch *batch, int64_t *const *shift, int32_t e, double *p,
        double *q, int64_t *of_pair)
{
    for (int k = 0; k < metric->ndim; k++) {
        p[k] = batch->p[k][e];
        q[k] = batch->q[k][e];
    }
    for (int r = 0; shift != NULL && r < metric->n_rows; r++) {
        of_pair[r] = shift[r][e];
    }
    return shift != NULL ? of_pair : NULL;
}

/* Measures pairs in the arrays of `batch`. shift: one array for each row of the metric, or NULL if
 * no pair is shifted. is_wide: batch->shift does not hold these numbers. vector: NULL, or one array
 * for each axis. */
static void
measure_pairs(const hs_kernel *kernel, const hs_metric *metric, const hs_batch *batch,
              int64_t *const *shift, bool is_wide, double *distance, double *const *vector)
{
    uint8_t done[HS_IN_BATCH] = {0};
    if (!is_wide) {
        kernel->measure(metric, batch, distance, vector, done);
    }
    for (int32_t e = 0; e < batch->n; e++) {
        if (HS_UNLIKELY(!done[e])) {
            double         p[HS_MAX_DIM], q[HS_MAX_DIM], along[HS_MAX_DIM];
            int64_t        of_pair[HS_MAX_DIM];
            const int64_t *own = pair_of(metric, batch, shift, e, p, q, of_pair);
            distance[e] = hs_metric_measure(metric, p, q, own, along);
            for (int k = 0; vector != NULL && k < metric->ndim; k++) {
                vector[k][e] = along[k];
            }
        }
    }
}

/* Pairs as kernels see them. shift: room for HS_MAX_DIM arrays. Returns it, or NULL if no pair is
 * shifted. */
static int64_t *const *
view(const hs_metric *metric, hs_measured *pairs, hs_batch *batch, int64_t **shift)
{
    *batch = (hs_batch){.n = pairs->n};
    for (int k = 0; k < metric->ndim; k++) {
        batch->p[k] = pairs->p[k];
        batch->q[k] = pairs->q[k];
    }
    for (int r = 0; pairs->is_shifted && r < metric->n_rows; r++) {
        batch->shift[r] = pairs->times[r];
        shift[r] = pairs->shift[r];
    }
    return pairs->is_shifted ? shift : NULL;
}

void
hs_measured_find(const hs_kernel *kernel, const hs_metric *metric, bool vectors, hs_measured *pairs)
{
    hs_batch              batch;
    int64_t              *of[HS_MAX_DIM];
    int64_t *const *const shift = view(metric, pairs, &batch, of);
    double               *vector[HS_MAX_DIM];
    for (int k = 0; k < metric->ndim; k++) {
        vector[k] = pairs->vector[k];
    }
    measure_pairs(kernel, metric, &batch, shift, pairs->is_wide, pairs->distance,
                  vectors ? vector : NULL);
}

void
hs_measured_decide(const hs_kernel *kernel, const hs_metric *metric, hs_measured *pairs,
                   uint8_t *within, hs_stages *stages)
{
    hs_batch              batch;
    int64_t              *of[HS_MAX_DIM], of_pair[HS_MAX_DIM];
    int64_t *const *const shift = view(metric, pairs, &batch, of);
    double                p[HS_MAX_DIM], q[HS_MAX_DIM];
    if (!pairs->is_wide) {
        kernel->decide_batch(metric, &batch, within, stages);
    }
    for (int32_t e = 0; e < pairs->n; e++) {
        if (!pairs->is_wide && within[e] != HS_UNDECIDED) {
            within[e] = within[e] == HS_WITHIN;
        } else {
            const int64_t *own = pair_of(metric, &batch, shift, e, p, q, of_pair);
            within[e] = hs_metric_within(metric, p, q, own, stages);
        }
    }
}

hs_scale
hs_measures_unscale(const hs_scene *scene)
{
    const hs_scale same = {.exponent = 0, .first = 1.0, .second = 1.0};
    return scene->extreme ? same : scene->unscale; /* then the metric has the caller's unit */
}

void
hs_measures_tell(const hs_scene *scene, const hs_options *options, hs_write *write)
{
    const hs_scale unscale = hs_measures_unscale(scene);
    const bool     is_exact = options->precision == HS_EXACT;
    write->first = unscale.first;
    write->second = unscale.second;
    write->cutoff = is_exact ? options->cutoff : INFINITY;
    write->largest = !is_exact            ? INFINITY
                     : options->inclusive ? options->cutoff
                                          : nextafter(options->cutoff, 0.0);
}

void
hs_restore_distances(double *distance, int32_t n, hs_scale unscale)
{
    for (int32_t e = 0; unscale.exponent != 0 && e < n; e++) {
        distance[e] = hs_scale_apply(unscale, distance[e]);
    }
}

void
hs_keep_all_within(double *distance, int32_t n, double cutoff, bool inclusive)
{
    const double largest = inclusive ? cutoff : nextafter(cutoff, 0.0);
    for (int32_t e = 0; e < n; e++) {
        distance[e] = distance[e] < cutoff ? distance[e] : largest;
    }
}

HS_ALWAYS_INLINE void
restore_vectors(double *HS_RESTRICT to, double *const *vector, const double *sign, int32_t n,
                const int ndim, hs_scale unscale)
{
    for (int32_t e = 0; e < n; e++) {
        for (int k = 0; k < ndim; k++) {
            /* Plus zero: a zero has no sign, which would tell where the search met the pair. */
            to[(int64_t)e * ndim + k] = hs_scale_apply(unscale, vector[k][e]) * sign[e] + 0.0;
        }
    }
}

void
hs_restore_vectors(double *HS_RESTRICT to, double *const *vector, const double *sign, int32_t n,
                   int ndim, hs_scale unscale)
{
    switch (ndim) {
    case 1: restore_vectors(to, vector, sign, n, 1, unscale); break;
    case 2: restore_vectors(to, vector, sign, n, 2, unscale); break;
    case 3: restore_vectors(to, vector, sign, n, 3, unscale); break;
    default: restore_vectors(to, vector, sign, n, ndim, unscale);
    }
}

/* Most scenes have few turns and ordinary numbers, in 2-D or 3-D. Their pairs are
 * shifted and measured while they are written, without the arrays of a batch in between: the time
 * goes into passes over these, not into arithmetic. */

/* Whether each pair has a length of its own that it is within. */
static bool
has_lengths(const hs_search *search)
{
    return search->limits != NULL && search->limits->supports == NULL;
}

/* The hits of points from `first` on, which are places in the walker's block, as the next pairs of
 * the output, but for HS_WANT_BOTH. *written: whether that was possible; if not, nothing is there
 * yet. HS_OK or HS_ERR_INTERRUPTED. */
static hs_status
write_hits(hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits,
           bool *written)
{
    const hs_search  *search = scanner->search;
    const hs_bins    *asking = hs_search_asking(search), *bins = &search->bins;
    const hs_lattice *lattice = &search->scene.lattice;
    const hs_output  *output = recorder->output;
    const bool        is_measured = recorder->columns & HS_MEASURED;
    *written = false;
    if (scanner->block.candidates == NULL || (recorder->columns & HS_WANT_BOTH) ||
        (is_measured && (search->scene.extreme || !search->scene.metric.floats_usable))) {
        return HS_OK;
    }
    int32_t  turns[HS_WRITE_MOST_DIM][HS_GROUP_POINTS]; /* over the box vectors as given */
    hs_write write = {.ndim = search->scene.ndim,
                      .is_half = search->is_half,
                      .is_measured = is_measured,
                      .by_S = bins->keeps_originals,
                      .candidates = scanner->block.candidates,
                      .place = scanner->block.number,
                      .x_width = 1,
                      .metric = &search->scene.metric,
                      .index_bytes = output->index_bytes,
                      .i = hs_output_next(output, HS_WANT_I),
                      .j = hs_output_next(output, HS_WANT_J),
                      .distance = hs_recorder_distances(recorder),
                      .vector = hs_output_next(output, HS_WANT_VECTOR),
                      .shift = hs_output_next(output, HS_WANT_SHIFT)};
    write.is_shifted = write.by_S || scanner->block.has_images;
    hs_measures_tell(&search->scene, &search->call->options, &write);
    if (has_lengths(search)) { /* once all is written */
        write.cutoff = write.largest = INFINITY;
    }
    for (int k = 0; k < search->scene.ndim; k++) {
        write.p[k] = (write.by_S ? asking->originals[k] : asking->x[k]) + first;
        write.x[k] = write.by_S ? bins->originals[k] : bins->x[k];
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        write.column[r] = lattice->vector_of_row[r];
        write.turns[r] = asking->turns.known ? asking->turns.narrow[r] + first : NULL;
        write.turned[r] = bins->turns.known ? bins->turns.narrow[r] : NULL;
        write.base[r] = asking->turns.known ? asking->turns.narrow[r][scanner->group.first] : 0;
    }
    if (!scanner->pair_batch.is_plain && asking->turns.known) {
        hs_lattice_few(lattice, write.base, write.base);
        for (int32_t t = 0; t < hits->n; t++) {
            int32_t of_point[HS_WRITE_MOST_DIM];
            for (int r = 0; r < lattice->n_periodic; r++) {
                of_point[r] = write.turns[r][t];
            }
            hs_lattice_few(lattice, of_point, of_point);
            for (int r = 0; r < lattice->n_periodic; r++) {
                turns[r][t] = of_point[r];
            }
        }
        for (int r = 0; r < lattice->n_periodic; r++) {
            write.turns[r] = turns[r];
        }
    }
    if (hs_scanner_load_candidates(scanner, write.base) != HS_OK) {
        return HS_ERR_INTERRUPTED;
    }
    write.is_fine = scanner->block.are_fine;
    memset(scanner->block.hits + hits->end[hits->n - 1], 0, HS_PADDING * sizeof(int32_t));
    *written = search->call->kernel->write(&write, hits);
    return HS_OK;
}

/* A batch of hits at a time, looked up, measured by the batch kernel, brought to
 * the caller's unit. */

/* S over all box vectors, zero on open ones. Shifts that only sort the images of one pair may leave
 * out what these images share: the turns by which i and j were wrapped, which can be too many for
 * int32. Returns the first pair whose S does not fit int32, or their number. */
static int32_t
put_shifts(const hs_recorder *recorder, const hs_pair_batch *pair_batch, const double *sign,
           int32_t first)
{
    const hs_lattice *lattice = &pair_batch->search->scene.lattice;
    const int         d = lattice->ndim, m = lattice->n_periodic;
    const bool        is_wanted = pair_batch->search->call->options.want & HS_WANT_SHIFT;
    /* Where all S are small, a writer puts them whole beside those of batches. */
    const bool keys_only = !is_wanted && !pair_batch->is_narrow;
    int64_t    keys[HS_MAX_DIM][HS_BATCH];
    int32_t   *to = (int32_t *)hs_output_next(recorder->output, HS_WANT_SHIFT) + (int64_t)first * d;
    int32_t    fitting = pair_batch->n;
    if (m < d) {
        memset(to, 0, (size_t)pair_batch->n * (size_t)d * sizeof *to);
    }
    for (int32_t e = 0; keys_only && e < fitting; e++) {
        int64_t image[HS_MAX_DIM], key[HS_MAX_DIM];
        for (int r = 0; r < m; r++) {
            image[r] = pair_batch->image[r][e];
        }
        fitting = hs_lattice_shift(lattice, image, key) ? fitting : e;
        for (int l = 0; e < fitting && l < m; l++) {
            keys[l][e] = key[l];
        }
    }
    for (int l = 0; l < m; l++) {
        const int64_t *shifts = keys_only ? keys[l] : pair_batch->given[l];
        int32_t       *column = to + lattice->vector_of_row[l];
        for (int32_t e = 0; e < fitting; e++) {
            const int64_t value = sign[e] < 0.0 ? -shifts[e] : shifts[e];
            column[(int64_t)e * d] = (int32_t)value;
            if (value < INT32_MIN || value > INT32_MAX) {
                fitting = e;
            }
        }
    }
    return fitting;
}

/* Writes the batch, whose first pair is this hit. */
static hs_status
put_batch(hs_recorder *recorder, hs_scanner *scanner, int32_t first)
{
    hs_pair_batch    *pair_batch = &scanner->pair_batch;
    const hs_search  *search = scanner->search;
    const hs_options *options = &search->call->options;
    const hs_scale    unscale = hs_measures_unscale(&search->scene);
    const bool        measured = recorder->columns & HS_MEASURED;
    const int32_t    *order = hs_search_asking(search)->order, *si = pair_batch->si;
    /* Whether pairs may be listed the other way round. */
    const bool is_turned = search->is_half &&
                           (recorder->columns & (HS_WANT_VECTOR | HS_WANT_SHIFT));
    double          sign[HS_BATCH]; /* -1 for those */
    const hs_status status = hs_pair_batch_look_up(pair_batch, measured, &scanner->failed_point);
    if (status != HS_OK) {
        return status;
    }
    for (int32_t e = 0; e < pair_batch->n; e++) {
        sign[e] = 1.0;
    }
    for (int32_t e = 0; is_turned && e < pair_batch->n; e++) {
        const int32_t id = recorder->ids[first + e], point = order[si[e]];
        int64_t       way = (int64_t)id - point; /* or the first component of S that is not zero */
        for (int l = 0; way == 0 && l < pair_batch->n_rows; l++) {
            way = pair_batch->given[l][e];
        }
        sign[e] = way < 0 ? -1.0 : 1.0;
    }
    if (measured) { /* to the recorder's arrays, in the unit of the metric */
        const hs_batch  batch = hs_pair_batch_view(pair_batch);
        int64_t *const *shift = search->bins.keeps_originals ? pair_batch->given
                                                             : pair_batch->image;
        measure_pairs(search->call->kernel, &search->scene.metric, &batch,
                      pair_batch->is_shifted ? shift : NULL, pair_batch->is_wide,
                      recorder->distance,
                      recorder->columns & HS_WANT_VECTOR ? recorder->vector : NULL);
    }
    if (recorder->columns & (HS_WANT_DISTANCE | HS_WANT_SHELL)) {
        hs_restore_distances(recorder->distance, pair_batch->n, unscale);
        if (options->precision == HS_EXACT && !has_lengths(search)) {
            hs_keep_all_within(recorder->distance, pair_batch->n, options->cutoff,
                               options->inclusive);
        }
        memcpy(hs_recorder_distances(recorder) + first, recorder->distance,
               (size_t)pair_batch->n * sizeof(double));
    }
    if (recorder->columns & HS_WANT_VECTOR) {
        const int d = recorder->output->ndim;
        double   *to = hs_output_next(recorder->output, HS_WANT_VECTOR);
        hs_restore_vectors(to + (int64_t)first * d, recorder->vector, sign, pair_batch->n, d,
                           unscale);
    }
    if (recorder->columns & HS_WANT_SHIFT) {
        const int32_t fitting = put_shifts(recorder, pair_batch, sign, first);
        if (fitting < pair_batch->n) {
            scanner->failed_point = order[si[fitting]];
            return HS_ERR_SHIFT_RANGE;
        }
    }
    return HS_OK;
}

/* The hits of points from `first` on, which are places in the walker's block, as the next pairs of
 * the output; recorder->ids holds their numbers. HS_ERR_SHIFT_RANGE sets scanner->failed_point. */
static hs_status
put_measures(hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_pair_batch *pair_batch = &scanner->pair_batch;
    int32_t        first_hit = 0; /* of the batch */
    hs_pair_batch_clear(pair_batch);
    for (int32_t t = 0, h = 0; t < hits->n; t++) {
        while (h < hits->end[t]) {
            const int32_t taken =
                hs_pair_batch_add(pair_batch, first + t, hits->label + h, hits->end[t] - h);
            h += taken;
            if (pair_batch->n == HS_BATCH) {
                const hs_status status = put_batch(recorder, scanner, first_hit);
                if (status != HS_OK) {
                    return status;
                }
                first_hit = h;
                hs_pair_batch_clear(pair_batch);
            }
        }
    }
    return pair_batch->n > 0 ? put_batch(recorder, scanner, first_hit) : HS_OK;
}

#define INDICES (HS_WANT_I | HS_WANT_J | HS_WANT_BOTH)

/* Of half lists the lower of the two numbers to i, the other to j; else the asking point to i and
 * what it met to j, whatever their numbers are. */
static void
put_indices(const hs_recorder *recorder, const hs_search *search, const hs_hits *hits)
{
    const hs_output *output = recorder->output;
    const int        bytes = output->index_bytes;
    const int32_t    n = hits->end[hits->n - 1];
    char            *i = hs_output_next(output, HS_WANT_I), *j = hs_output_next(output, HS_WANT_J);
    char            *both = hs_output_next(output, HS_WANT_BOTH);
    if (search->is_half && (i != NULL || j != NULL)) {
        search->call->kernel->emit(hits, bytes, i, j);
    }
    if (search->is_half && both != NULL) {
        search->call->kernel->emit(hits, 4, recorder->ends[0], recorder->ends[1]);
        hs_put_indices(both, bytes, 2, recorder->ends[0], 1, n);
        hs_put_indices(both + bytes, bytes, 2, recorder->ends[1], 1, n);
    }
    if (search->is_half) {
        return;
    }
    hs_put_indices(j, bytes, 1, hits->label, 1, n);
    hs_put_indices(both != NULL ? both + bytes : NULL, bytes, 2, hits->label, 1, n);
    for (int32_t t = 0, h = 0; t < hits->n && (i != NULL || both != NULL); h = hits->end[t++]) {
        const int64_t at = (int64_t)h * bytes, of_point = hits->end[t] - h;
        hs_put_indices(i != NULL ? i + at : NULL, bytes, 1, &hits->point[t], 0, of_point);
        hs_put_indices(both != NULL ? both + 2 * at : NULL, bytes, 2, &hits->point[t], 0, of_point);
    }
}

/* All columns of hits that are places: at once where that is possible, else in batches. */
static hs_status
put_places(hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    const hs_search *search = scanner->search;
    const hs_choice *choice = search->call->choice;
    const bool       is_exact = scanner->options.precision == HS_EXACT;
    const int32_t    n = hits->end[hits->n - 1];
    hs_hits          by_id = *hits;
    bool             written;
    hs_status        status = write_hits(recorder, scanner, first, hits, &written);
    if (status == HS_OK && !written) {
        if (search->is_half || (recorder->columns & INDICES)) {
            for (int32_t h = 0; h < n; h++) {
                recorder->ids[h] = scanner->block.id[hits->label[h]];
            }
            by_id.label = recorder->ids;
            put_indices(recorder, search, &by_id);
        }
        status = put_measures(recorder, scanner, first, hits);
    }
    if (status == HS_OK && (recorder->columns & HS_WANT_SHELL)) {
        status = put_shells(recorder, scanner, first, hits);
    }
    double *distance = hs_recorder_distances(recorder);
    if (status != HS_OK || !is_exact || distance == NULL) {
        return status;
    }
    if (has_lengths(search)) {
        /* None is left beyond the length of its pair, or beyond the float64 nearest to that. */
        const hs_scale unscale = hs_measures_unscale(&search->scene);
        for (int32_t h = 0, t = 0; h < n; h++) {
            while (hits->end[t] <= h) {
                t++;
            }
            const int32_t sj = scanner->block.number[hits->label[h]];
            const hs_dw   limit = hs_limit_of(search->limits, first + t, sj);
            distance[h] = hs_keep_within(distance[h], hs_scale_apply(unscale, limit.hi),
                                         scanner->options.inclusive || limit.lo > 0.0);
        }
    }
    if (choice != NULL) {
        /* No pair is nearer than that; only the distance of a point from itself, in rows, is 0. */
        for (int32_t h = 0; h < n; h++) {
            distance[h] = distance[h] > 0.0 ? hs_larger(distance[h], choice->min_distance) : 0.0;
        }
    }
    return status;
}

hs_status
hs_record_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_recorder  *recorder = context;
    hs_output    *output = recorder->output;
    const int32_t n = hits->end[hits->n - 1];
    hs_status     status =
        hs_output_reserve(output, n, hs_search_fraction(scanner->search, scanner->group.first));
    if (status == HS_OK && scanner->use == HS_BLOCK_LISTS_PLACES) {
        status = put_places(recorder, scanner, first, hits);
    } else if (status == HS_OK) {
        put_indices(recorder, scanner->search, hits);
    }
    output->n_pairs += status == HS_OK ? n : 0;
    return status;
}
