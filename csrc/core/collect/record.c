/* SPDX-License-Identifier: BSD-3-Clause */
#include "record.h"
#include "../search/search.h"
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
    bool           complete = true;
    *recorder = (hs_recorder){.output = output, .columns = columns, .most_hits = most_hits};
    if (hs_record_use(columns) == HS_BLOCK_LISTS_PLACES) {
        recorder->ids = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(int32_t));
        complete = recorder->ids != NULL;
    }
    if (columns & HS_WANT_BOTH) {
        recorder->ends[0] = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(int32_t));
        recorder->ends[1] = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(int32_t));
        complete = complete && recorder->ends[0] != NULL && recorder->ends[1] != NULL;
    }
    if (columns & HS_MEASURED) {
        recorder->distance = hs_alloc(account, HS_FOR_CANDIDATES, in_batch, sizeof(double));
        complete = complete && recorder->distance != NULL;
    }
    for (int k = 0; (columns & HS_WANT_VECTOR) && k < output->ndim; k++) {
        recorder->vector[k] = hs_alloc(account, HS_FOR_CANDIDATES, in_batch, sizeof(double));
        complete = complete && recorder->vector[k] != NULL;
    }
    if ((columns & HS_WANT_SHELL) && !(columns & HS_WANT_DISTANCE)) {
        recorder->all_distances = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(double));
        complete = complete && recorder->all_distances != NULL;
    }
    if (!complete) {
        hs_recorder_free(account, recorder);
        return HS_ERR_MEMORY;
    }
    return HS_OK;
}

void
hs_recorder_free(hs_account *account, hs_recorder *recorder)
{
    hs_free(account, recorder->ids);
    hs_free(account, recorder->ends[0]);
    hs_free(account, recorder->ends[1]);
    hs_free(account, recorder->distance);
    hs_free(account, recorder->all_distances);
    for (int k = 0; k < HS_MAX_DIM; k++) {
        hs_free(account, recorder->vector[k]);
    }
    *recorder = (hs_recorder){0};
}

/* By the rounded distance where that is far enough from all edges, which are
 * nearly all pairs; the others are decided exactly, those at one edge together. */

/* A pair that is beyond `low` edges, at most `high`. */
typedef struct open_pair {
    int32_t hit, si;
    int32_t low, high;
} open_pair;

/* Pairs that are to be decided, and where their shells go. */
typedef struct open_pairs {
    hs_scanner    *scanner;
    const int32_t *places;
    double        *distance;
    int32_t       *shell;
    int32_t        n;
    open_pair      pair[HS_BATCH];
} open_pairs;

/* Traces the open pairs whose next edge is this one; of[e]: which of them is pair e. */
static hs_status
batch_at(const open_pairs *open, int32_t edge, int32_t *of)
{
    hs_pair_batch *pair_batch = &open->scanner->pair_batch;
    hs_pair_batch_clear(pair_batch);
    for (int32_t u = 0; u < open->n; u++) {
        const open_pair *pair = &open->pair[u];
        if (pair->low == edge) {
            of[pair_batch->n] = u;
            hs_pair_batch_put(pair_batch, pair->si, open->places[pair->hit]);
        }
    }
    return hs_pair_batch_look_up(pair_batch, true, &open->scanner->failed_point);
}

/* Decides the pairs that are in the batch at this edge. */
static void
decide_at(open_pairs *open, int32_t edge, const int32_t *of)
{
    const hs_metric *given = &open->scanner->search->scene.metric;
    const hs_shells *shells = &open->scanner->search->shells;
    hs_metric        metric;
    uint8_t          within[HS_BATCH];
    hs_metric_init(&metric, given->ndim, given->n_rows, (const double(*)[HS_MAX_DIM])given->rows,
                   shells->at[edge], shells->inclusive);
    hs_decide_pair_batch(open->scanner, &metric, within);
    for (int32_t e = 0; e < open->scanner->pair_batch.n; e++) {
        open_pair *pair = &open->pair[of[e]];
        if (within[e]) {
            pair->high = edge;
        } else {
            pair->low = edge + 1;
        }
    }
}

/* Writes those that are decided, and keeps the others. */
static void
put_decided(open_pairs *open)
{
    const hs_shells *shells = &open->scanner->search->shells;
    int32_t          n = 0;
    for (int32_t u = 0; u < open->n; u++) {
        const open_pair pair = open->pair[u];
        if (pair.low < pair.high) {
            open->pair[n++] = pair;
        } else {
            double *distance = &open->distance[pair.hit];
            *distance = hs_shells_keep(shells, pair.low, *distance);
            open->shell[pair.hit] = pair.low;
        }
    }
    open->n = n;
}

static hs_status
decide_open(open_pairs *open)
{
    int32_t of[HS_BATCH];
    open->scanner->n_ambiguous += open->n;
    while (open->n > 0) {
        const int32_t   edge = open->pair[0].low;
        const hs_status status = batch_at(open, edge, of);
        if (status != HS_OK) {
            return status;
        }
        decide_at(open, edge, of);
        put_decided(open);
    }
    return HS_OK;
}

/* Looks again at the distances that are too near to an edge. */
static hs_status
look_again(open_pairs *open, int32_t first, const hs_hits *hits)
{
    const hs_shells *shells = &open->scanner->search->shells;
    for (int32_t t = 0, h = 0; t < hits->n; t++) {
        for (; h < hits->end[t]; h++) {
            int32_t low = open->shell[h], high;
            hs_shells_range(shells, open->distance[h], &low, &high);
            open->shell[h] = low;
            if (low < high) {
                open->pair[open->n++] = (open_pair){h, first + t, low, high};
            }
            if (open->n == HS_BATCH) {
                const hs_status status = decide_open(open);
                if (status != HS_OK) {
                    return status;
                }
            }
        }
    }
    return decide_open(open);
}

/* The shells of the hits of points from `first` on, places in the walker's block whose distances
 * have been written, as the next of the column; nothing where they are not wanted. Distances that
 * rounding has moved across an edge are put right. HS_OK, HS_ERR_SHIFT_RANGE, which sets
 * scanner->failed_point, or HS_ERR_INTERRUPTED. */
static hs_status
put_shells(const hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    const hs_shells *shells = &scanner->search->shells;
    const int32_t    n = hits->end[hits->n - 1];
    open_pairs       open; /* large, and seldom used: not cleared */
    if (!(recorder->columns & HS_WANT_SHELL)) {
        return HS_OK;
    }
    open.scanner = scanner;
    open.places = hits->label;
    open.distance = hs_recorder_distances(recorder);
    open.shell = hs_output_next(recorder->output, HS_WANT_SHELL);
    open.n = 0;
    const bool is_open = hs_shells_find(shells, open.distance, n, open.shell);
    return is_open ? look_again(&open, first, hits) : HS_OK;
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

/* Pair e of the batch, by itself. */
static void
measure_one(const hs_metric *metric, const hs_batch *batch, int64_t *const *shift, int32_t e,
            double *distance, double *const *vector)
{
    double         p[HS_MAX_DIM], q[HS_MAX_DIM], along[HS_MAX_DIM];
    int64_t        of_pair[HS_MAX_DIM];
    const int64_t *own = pair_of(metric, batch, shift, e, p, q, of_pair);
    distance[e] = hs_metric_measure(metric, p, q, own, along);
    for (int k = 0; vector != NULL && k < metric->ndim; k++) {
        vector[k][e] = along[k];
    }
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
            measure_one(metric, batch, shift, e, distance, vector);
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

/* The largest distance that is within the cutoff. */
static double
largest_within(double cutoff, bool inclusive)
{
    return inclusive ? cutoff : nextafter(cutoff, 0.0);
}

void
hs_measures_tell(const hs_scene *scene, const hs_options *options, hs_write *write)
{
    const hs_scale unscale = hs_measures_unscale(scene);
    const bool     is_exact = options->precision == HS_EXACT;
    write->first = unscale.first;
    write->second = unscale.second;
    write->cutoff = is_exact ? options->cutoff : INFINITY;
    write->largest = is_exact ? largest_within(options->cutoff, options->inclusive) : INFINITY;
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
    const double largest = largest_within(cutoff, inclusive);
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

/* Whether hits of this search can be written so, to these columns. */
static bool
can_write(const hs_recorder *recorder, const hs_scanner *scanner)
{
    const hs_search *search = scanner->search;
    return scanner->block.candidates != NULL && !(recorder->columns & HS_WANT_BOTH) &&
           (!(recorder->columns & HS_MEASURED) ||
            (!search->scene.extreme && search->scene.metric.floats_usable));
}

/* What candidates and points are, of the hits of n points from `first` on. turns: room for those of
 * these points, over the box vectors as given. */
static void
describe(const hs_scanner *scanner, int32_t first, int32_t n,
         int32_t turns[HS_WRITE_MOST_DIM][HS_GROUP_POINTS], hs_write *write)
{
    const hs_search  *search = scanner->search;
    const hs_bins    *asking = hs_search_asking(search), *bins = &search->bins;
    const hs_lattice *lattice = &search->scene.lattice;
    write->candidates = scanner->block.candidates;
    write->place = scanner->block.number;
    write->x_width = 1;
    for (int k = 0; k < search->scene.ndim; k++) {
        write->p[k] = (write->by_S ? asking->originals[k] : asking->x[k]) + first;
        write->x[k] = write->by_S ? bins->originals[k] : bins->x[k];
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        write->column[r] = lattice->vector_of_row[r];
        write->turns[r] = asking->turns.known ? asking->turns.narrow[r] + first : NULL;
        write->turned[r] = bins->turns.known ? bins->turns.narrow[r] : NULL;
        write->base[r] = asking->turns.known ? asking->turns.narrow[r][scanner->group.first] : 0;
    }
    if (!scanner->pair_batch.is_plain && asking->turns.known) {
        hs_lattice_few(lattice, write->base, write->base);
        for (int32_t t = 0; t < n; t++) {
            int32_t of_point[HS_WRITE_MOST_DIM];
            for (int r = 0; r < lattice->n_periodic; r++) {
                of_point[r] = write->turns[r][t];
            }
            hs_lattice_few(lattice, of_point, of_point);
            for (int r = 0; r < lattice->n_periodic; r++) {
                turns[r][t] = of_point[r];
            }
        }
        for (int r = 0; r < lattice->n_periodic; r++) {
            write->turns[r] = turns[r];
        }
    }
}

/* Where the pairs go. */
static void
direct(const hs_recorder *recorder, hs_write *write)
{
    const hs_output *output = recorder->output;
    write->index_bytes = output->index_bytes;
    write->i = hs_output_next(output, HS_WANT_I);
    write->j = hs_output_next(output, HS_WANT_J);
    write->distance = hs_recorder_distances(recorder);
    write->vector = hs_output_next(output, HS_WANT_VECTOR);
    write->shift = hs_output_next(output, HS_WANT_SHIFT);
}

/* The hits of points from `first` on, which are places in the walker's block, as the next pairs of
 * the output, but for HS_WANT_BOTH. *written: whether that was possible; if not, nothing is there
 * yet. HS_OK or HS_ERR_INTERRUPTED. */
static hs_status
write_hits(hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits,
           bool *written)
{
    const hs_search *search = scanner->search;
    *written = false;
    if (!can_write(recorder, scanner)) {
        return HS_OK;
    }
    int32_t  turns[HS_WRITE_MOST_DIM][HS_GROUP_POINTS];
    hs_write write = {.ndim = search->scene.ndim,
                      .is_half = search->is_half,
                      .is_measured = recorder->columns & HS_MEASURED,
                      .by_S = search->bins.keeps_originals,
                      .metric = &search->scene.metric};
    write.is_shifted = write.by_S || scanner->block.has_images;
    hs_measures_tell(&search->scene, &search->call->options, &write);
    if (has_lengths(search)) { /* keep_within_lengths, once all is written */
        write.cutoff = write.largest = INFINITY;
    }
    describe(scanner, first, hits->n, turns, &write);
    if (hs_scanner_load_candidates(scanner, write.base) != HS_OK) {
        return HS_ERR_INTERRUPTED;
    }
    write.is_fine = scanner->block.are_fine;
    memset(scanner->block.hits + hits->end[hits->n - 1], 0, HS_PADDING * sizeof(int32_t));
    direct(recorder, &write);
    *written = search->call->kernel->write(&write, hits);
    return HS_OK;
}

/* A batch of hits at a time, looked up, measured by the batch kernel, brought to
 * the caller's unit. */

/* Hits of the batch that is being written. */
typedef struct batch_part {
    int32_t first;           /* its first hit */
    int32_t point[HS_BATCH]; /* number of the point whose hit each one is */
} batch_part;

/* The first nonzero component of S is negative. */
static bool
is_backward(const hs_pair_batch *pair_batch, int32_t e)
{
    const int m = pair_batch->search->scene.lattice.n_periodic;
    for (int l = 0; l < m; l++) {
        const int64_t shift = pair_batch->given[l][e];
        if (shift != 0) {
            return shift < 0;
        }
    }
    return false;
}

/* 1, or -1 for pairs of a half list that are listed the other way round. */
static void
find_signs(const hs_pair_batch *pair_batch, const int32_t *point, const int32_t *id, double *sign)
{
    int32_t any_own = 0;
    for (int32_t e = 0; e < pair_batch->n; e++) {
        sign[e] = id[e] < point[e] ? -1.0 : 1.0;
        any_own |= id[e] == point[e];
    }
    for (int32_t e = 0; any_own && e < pair_batch->n; e++) {
        if (id[e] == point[e] && is_backward(pair_batch, e)) {
            sign[e] = -1.0;
        }
    }
}

/* d and D of the batch to the recorder's arrays, in the unit of the metric. */
static void
measure(hs_recorder *recorder, hs_pair_batch *pair_batch)
{
    const hs_search *search = pair_batch->search;
    const hs_batch   batch = hs_pair_batch_view(pair_batch);
    int64_t *const  *shift = search->bins.keeps_originals ? pair_batch->given : pair_batch->image;
    double *const   *vector = recorder->columns & HS_WANT_VECTOR ? recorder->vector : NULL;
    measure_pairs(search->call->kernel, &search->scene.metric, &batch,
                  pair_batch->is_shifted ? shift : NULL, pair_batch->is_wide, recorder->distance,
                  vector);
}

static void
put_distances(hs_recorder *recorder, const hs_scanner *scanner, int32_t first)
{
    const hs_search  *search = scanner->search;
    const hs_options *options = &search->call->options;
    const int32_t     n = scanner->pair_batch.n;
    const hs_scale    unscale = hs_measures_unscale(&search->scene);
    double           *to = hs_recorder_distances(recorder);
    hs_restore_distances(recorder->distance, n, unscale);
    if (options->precision == HS_EXACT && !has_lengths(search)) {
        hs_keep_all_within(recorder->distance, n, options->cutoff, options->inclusive);
    }
    memcpy(to + first, recorder->distance, (size_t)n * sizeof *to);
}

static void
put_vectors(const hs_recorder *recorder, const hs_search *search, const double *sign, int32_t first,
            int32_t n)
{
    const int d = recorder->output->ndim;
    double   *to = hs_output_next(recorder->output, HS_WANT_VECTOR);
    hs_restore_vectors(to + (int64_t)first * d, recorder->vector, sign, n, d,
                       hs_measures_unscale(&search->scene));
}

/* Shifts that only sort the images of one pair may leave out what these images share: the turns by
 * which i and j were wrapped, which can be too many for int32. Returns the first pair whose shift
 * does not fit, or their number. */
static int32_t
find_keys(const hs_pair_batch *pair_batch, int64_t keys[][HS_BATCH])
{
    const int m = pair_batch->search->scene.lattice.n_periodic;
    for (int32_t e = 0; e < pair_batch->n; e++) {
        int64_t image[HS_MAX_DIM], key[HS_MAX_DIM];
        for (int r = 0; r < m; r++) {
            image[r] = pair_batch->image[r][e];
        }
        if (!hs_lattice_shift(&pair_batch->search->scene.lattice, image, key)) {
            return e;
        }
        for (int l = 0; l < m; l++) {
            keys[l][e] = key[l];
        }
    }
    return pair_batch->n;
}

/* S over all box vectors, zero on open ones. Returns the first pair whose S does not fit int32, or
 * their number. */
static int32_t
put_shifts(const hs_recorder *recorder, const hs_pair_batch *pair_batch, const double *sign,
           int32_t first)
{
    const hs_lattice *lattice = &pair_batch->search->scene.lattice;
    const int         d = lattice->ndim, m = lattice->n_periodic;
    const bool        keys_only = !(pair_batch->search->call->options.want & HS_WANT_SHIFT);
    int64_t           keys[HS_MAX_DIM][HS_BATCH];
    int32_t *to = (int32_t *)hs_output_next(recorder->output, HS_WANT_SHIFT) + (int64_t)first * d;
    int32_t  fitting = pair_batch->n;
    if (m < d) {
        memset(to, 0, (size_t)pair_batch->n * (size_t)d * sizeof *to);
    }
    if (keys_only) {
        fitting = find_keys(pair_batch, keys);
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

/* Writes the batch. */
static hs_status
put_batch(hs_recorder *recorder, hs_scanner *scanner, const batch_part *part)
{
    hs_pair_batch   *pair_batch = &scanner->pair_batch;
    const hs_search *search = scanner->search;
    const bool       measured = recorder->columns & HS_MEASURED;
    double           sign[HS_BATCH];
    const hs_status  status =
        hs_pair_batch_look_up(&scanner->pair_batch, measured, &scanner->failed_point);
    if (status != HS_OK) {
        return status;
    }
    if (!search->is_half) {
        for (int32_t e = 0; e < pair_batch->n; e++) {
            sign[e] = 1.0;
        }
    } else if (recorder->columns & (HS_WANT_VECTOR | HS_WANT_SHIFT)) {
        find_signs(pair_batch, part->point, recorder->ids + part->first, sign);
    }
    if (measured) {
        measure(recorder, pair_batch);
    }
    if (recorder->columns & (HS_WANT_DISTANCE | HS_WANT_SHELL)) {
        put_distances(recorder, scanner, part->first);
    }
    if (recorder->columns & HS_WANT_VECTOR) {
        put_vectors(recorder, search, sign, part->first, pair_batch->n);
    }
    if (recorder->columns & HS_WANT_SHIFT) {
        const int32_t fitting = put_shifts(recorder, pair_batch, sign, part->first);
        if (fitting < pair_batch->n) {
            scanner->failed_point = part->point[fitting];
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
    batch_part     part = {.first = 0};
    hs_pair_batch_clear(pair_batch);
    for (int32_t t = 0, h = 0; t < hits->n; t++) {
        while (h < hits->end[t]) {
            const int32_t taken =
                hs_pair_batch_add(pair_batch, first + t, hits->label + h, hits->end[t] - h);
            for (int32_t e = pair_batch->n - taken; e < pair_batch->n; e++) {
                part.point[e] = hits->point[t];
            }
            h += taken;
            if (pair_batch->n == HS_BATCH) {
                const hs_status status = put_batch(recorder, scanner, &part);
                if (status != HS_OK) {
                    return status;
                }
                part.first = h;
                hs_pair_batch_clear(pair_batch);
            }
        }
    }
    return pair_batch->n > 0 ? put_batch(recorder, scanner, &part) : HS_OK;
}

#define INDICES (HS_WANT_I | HS_WANT_J | HS_WANT_BOTH)

/* The lower of the two numbers to i, the other to j. */
static void
put_ordered(const hs_recorder *recorder, const hs_kernel *kernel, const hs_hits *hits)
{
    const hs_output *output = recorder->output;
    const int        bytes = output->index_bytes;
    const int32_t    n = hits->end[hits->n - 1];
    char            *both = hs_output_next(output, HS_WANT_BOTH);
    if (recorder->columns & (HS_WANT_I | HS_WANT_J)) {
        kernel->emit(hits, bytes, hs_output_next(output, HS_WANT_I),
                     hs_output_next(output, HS_WANT_J));
    }
    if (both != NULL) {
        kernel->emit(hits, 4, recorder->ends[0], recorder->ends[1]);
        hs_put_indices(both, bytes, 2, recorder->ends[0], 1, n);
        hs_put_indices(both + bytes, bytes, 2, recorder->ends[1], 1, n);
    }
}

/* The asking point to i and what it met to j, whatever their numbers are. */
static void
put_directed(const hs_recorder *recorder, const hs_hits *hits)
{
    const hs_output *output = recorder->output;
    const int        bytes = output->index_bytes;
    const int32_t    n = hits->end[hits->n - 1];
    char            *i = hs_output_next(output, HS_WANT_I), *j = hs_output_next(output, HS_WANT_J);
    char            *both = hs_output_next(output, HS_WANT_BOTH);
    hs_put_indices(j, bytes, 1, hits->label, 1, n);
    hs_put_indices(both != NULL ? both + bytes : NULL, bytes, 2, hits->label, 1, n);
    for (int32_t t = 0, h = 0; t < hits->n && (i != NULL || both != NULL); h = hits->end[t++]) {
        const int64_t at = (int64_t)h * bytes, of_point = hits->end[t] - h;
        hs_put_indices(i != NULL ? i + at : NULL, bytes, 1, &hits->point[t], 0, of_point);
        hs_put_indices(both != NULL ? both + 2 * at : NULL, bytes, 2, &hits->point[t], 0, of_point);
    }
}

static void
put_indices(const hs_recorder *recorder, const hs_search *search, const hs_hits *hits)
{
    if (search->is_half) {
        put_ordered(recorder, search->call->kernel, hits);
    } else {
        put_directed(recorder, hits);
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
    hs_status      status = write_hits(recorder, scanner, first, hits, &written);
    if (status != HS_OK) {
        return status;
    }
    if (written) {
        return put_shells(recorder, scanner, first, hits);
    }
    if (scanner->search->is_half || (recorder->columns & INDICES)) {
        for (int32_t h = 0; h < n; h++) {
            recorder->ids[h] = id[hits->label[h]];
        }
        by_id.label = recorder->ids;
        put_indices(recorder, scanner->search, &by_id);
    }
    status = put_measures(recorder, scanner, first, hits);
    return status == HS_OK ? put_shells(recorder, scanner, first, hits) : status;
}

/* Distances that have been written, in an exact search: none is left beyond the length of its pair,
 * or beyond the float64 nearest to that. */
static void
keep_within_lengths(const hs_recorder *recorder, const hs_scanner *scanner, int32_t first,
                    const hs_hits *hits)
{
    const hs_limits *limits = scanner->search->limits;
    const hs_scale   unscale = hs_measures_unscale(&scanner->search->scene);
    double          *distance = hs_recorder_distances(recorder);
    for (int32_t t = 0, h = 0; distance != NULL && t < hits->n; t++) {
        for (; h < hits->end[t]; h++) {
            const int32_t sj = scanner->block.number[hits->label[h]];
            const hs_dw   limit = hs_limit_of(limits, first + t, sj);
            distance[h] = hs_keep_within(distance[h], hs_scale_apply(unscale, limit.hi),
                                         scanner->options.inclusive || limit.lo > 0.0);
        }
    }
}

/* Distances of pairs that are this far apart or further are not below that; only a point that asks
 * for its own neighbours is at 0 from itself. */
static void
keep_apart(const hs_output *output, int32_t n, double least)
{
    double *distance = hs_output_next(output, HS_WANT_DISTANCE);
    for (int32_t h = 0; distance != NULL && h < n; h++) {
        distance[h] = distance[h] > 0.0 ? hs_larger(distance[h], least) : 0.0;
    }
}

hs_status
hs_record_places(hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    const hs_choice *choice = scanner->search->call->choice;
    const hs_status  status = put_places(recorder, scanner, first, hits);
    const bool       is_exact = scanner->options.precision == HS_EXACT;
    if (status == HS_OK && is_exact && has_lengths(scanner->search)) {
        keep_within_lengths(recorder, scanner, first, hits);
    }
    if (status == HS_OK && choice != NULL && is_exact) {
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
