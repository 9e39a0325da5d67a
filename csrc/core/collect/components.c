/* SPDX-License-Identifier: BSD-3-Clause */
#include "components.h"
#include "record.h"

#include <math.h>
#include <string.h>

/*
 * components.c: the forest. Ways to the root are halved as they are gone, and a root hangs itself
 * under a lower one. Shifts are added modulo 2^32: a ring that is missed would have to wind 2^32
 * times around the box.
 */

hs_status
hs_components_open(hs_account *account, int64_t n, int n_axes, hs_components *components)
{
    *components = (hs_components){.n = n, .n_axes = n_axes};
    components->parent = hs_alloc(account, HS_FOR_INDICES, n, sizeof(int32_t));
    bool complete = components->parent != NULL;
    if (n_axes > 0) {
        components->image = hs_alloc(account, HS_FOR_SHIFTS, n, (size_t)n_axes * sizeof(uint32_t));
        components->winds = hs_alloc(account, HS_FOR_SHIFTS, n, 1);
        complete = complete && components->image != NULL && components->winds != NULL;
    }
    if (!complete) {
        hs_components_close(account, components);
        return HS_ERR_MEMORY;
    }
    for (int64_t p = 0; p < n; p++) {
        components->parent[p] = (int32_t)p;
    }
    if (n_axes > 0) {
        memset(components->image, 0, (size_t)n * (size_t)n_axes * sizeof(uint32_t));
        memset(components->winds, 0, (size_t)n);
    }
    return HS_OK;
}

void
hs_components_close(hs_account *account, hs_components *components)
{
    hs_free(account, components->parent);
    hs_free(account, components->image);
    hs_free(account, components->winds);
    *components = (hs_components){0};
}

/* The root of a point; *image is where the way from it ends, if shifts are kept. */
static int32_t
root_of(hs_components *components, int32_t p, uint32_t *image)
{
    int32_t  *parent = components->parent;
    const int n_axes = components->n_axes;
    for (int l = 0; l < n_axes; l++) {
        image[l] = 0;
    }
    while (parent[p] != p) {
        const int32_t above = parent[p];
        for (int l = 0; l < n_axes; l++) { /* zero where the parent is the root */
            uint32_t *from_parent = &components->image[(int64_t)p * n_axes + l];
            *from_parent += components->image[(int64_t)above * n_axes + l];
            image[l] += *from_parent;
        }
        parent[p] = parent[above];
        p = parent[p];
    }
    return p;
}

void
hs_components_join(hs_components *components, int32_t i, int32_t j, const int32_t *S)
{
    uint32_t      image_i[HS_MAX_DIM], image_j[HS_MAX_DIM], between[HS_MAX_DIM];
    const int     n_axes = components->n_axes;
    const int32_t a = root_of(components, i, image_i), b = root_of(components, j, image_j);
    const int32_t root = a < b ? a : b, lower = a < b ? b : a;
    uint8_t       winds = 0;
    /* From root a to the tree of b: to i, over the pair, and from j back to b. */
    for (int l = 0; l < n_axes; l++) {
        between[l] = image_i[l] + (uint32_t)S[l] - image_j[l];
        winds |= (uint8_t)((between[l] != 0) << l);
    }
    if (a == b) {
        if (n_axes > 0) {
            components->winds[a] |= winds;
        }
        return;
    }
    components->parent[lower] = root;
    for (int l = 0; l < n_axes; l++) {
        components->image[(int64_t)lower * n_axes + l] = a < b ? between[l] : 0u - between[l];
    }
    if (n_axes > 0) {
        components->winds[root] |= components->winds[lower];
    }
}

int64_t
hs_components_label(hs_components *components, const uint8_t *counts, int64_t *labels,
                    uint8_t *winding)
{
    int64_t  n_found = 0;
    uint32_t image[HS_MAX_DIM];
    for (int64_t p = 0; p < components->n; p++) {
        const int32_t root = root_of(components, (int32_t)p, image);
        if (counts != NULL && counts[p] == 0) {
            labels[p] = -1;
        } else if (root < p) {
            labels[p] = labels[root];
        } else {
            if (winding != NULL) {
                winding[n_found] = components->n_axes > 0 ? components->winds[p] : 0;
            }
            labels[p] = n_found++;
        }
    }
    return n_found;
}

/* A batch at a time, between the points as given, by the kernels that measure pairs of searches.
 * Far from the box, where their error could reach the last place, by integers. */

#define MOST_SHIFT (INT64_C(1) << 62)
/* Distances below this part of the terms that they are made of: double-words leave an error of
 * 2^-26 units in the last place otherwise, which rounding nearly never shows. */
#define CANCELLED 0x1p-24

/* What is done, and what went wrong in each slab of a round. */
typedef struct measuring {
    const hs_given_pairs *given;
    const hs_kernel      *kernel;
    hs_metric             slow; /* by integers alone */
    double                longest;
    int64_t               failed[HS_SLABS];
} measuring;

/* Takes pair `at` into the batch as number e. */
static hs_status
take_pair(const hs_given_pairs *given, int64_t at, int32_t e, int32_t *S, hs_measured *batch)
{
    const hs_cloud   *cloud = given->cloud;
    const hs_lattice *lattice = &given->box->lattice;
    const int         d = cloud->ndim;
    const int64_t     i = given->pairs->i[at], j = given->pairs->j[at];
    const int64_t    *known = given->pairs->shift; /* S over all box vectors; NULL: to be found */
    double            p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t           shift[HS_MAX_DIM]; /* over those that repeat */
    if (i < 0 || i >= cloud->n || j < 0 || j >= cloud->n) {
        return HS_ERR_ARGUMENT;
    }
    for (int k = 0; k < d; k++) {
        batch->p[k][e] = p[k] = cloud->x[k][i];
        batch->q[k][e] = q[k] = cloud->x[k][j];
    }
    if (known == NULL && lattice->n_periodic > 0) {
        const hs_status status = hs_near_image(given->box, p, q, shift);
        if (status != HS_OK) {
            return status;
        }
    }
    for (int r = 0; known != NULL && r < lattice->n_periodic; r++) {
        shift[r] = known[at * d + lattice->vector_of_row[r]];
        if (shift[r] >= MOST_SHIFT || shift[r] <= -MOST_SHIFT) {
            return HS_ERR_ARGUMENT;
        }
    }
    for (int l = 0, r = 0; known != NULL && l < d; l++) {
        const bool repeats = r < lattice->n_periodic && lattice->vector_of_row[r] == l;
        if (!repeats && known[at * d + l] != 0) {
            return HS_ERR_ARGUMENT;
        }
        r += repeats;
    }
    if (S != NULL) { /* over all box vectors */
        memset(S + at * d, 0, (size_t)d * sizeof *S);
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        hs_measured_shift(batch, e, r, shift[r]);
        if (S != NULL && (shift[r] < INT32_MIN || shift[r] > INT32_MAX)) {
            return HS_ERR_SHIFT_RANGE;
        }
        if (S != NULL) {
            S[at * d + lattice->vector_of_row[r]] = (int32_t)shift[r];
        }
    }
    return HS_OK;
}

/* Measures the batch, and writes it to the place of its first pair. *failed: the first whose vector
 * is not finite, else -1. */
static void
put_batch(const measuring *doing, int64_t first, hs_measured *batch, int32_t *failed)
{
    const hs_output *output = doing->given->output;
    const hs_scale   same = {.exponent = 0, .first = 1.0, .second = 1.0};
    const double     largest = 2.0 * doing->given->cloud->largest;
    const int        d = output->ndim, m = doing->slow.n_rows;
    double          *distance = hs_output_column(output, HS_WANT_DISTANCE);
    double          *vectors = hs_output_column(output, HS_WANT_VECTOR);
    double          *vector[HS_MAX_DIM], sign[HS_BATCH];
    hs_measured_find(doing->kernel, &doing->given->box->metric, vectors != NULL, batch);
    *failed = -1;
    for (int32_t e = 0; e < batch->n; e++) {
        double  p[HS_MAX_DIM], q[HS_MAX_DIM], along[HS_MAX_DIM], terms = largest;
        int64_t shift[HS_MAX_DIM];
        sign[e] = 1.0;
        for (int r = 0; batch->is_shifted && r < m; r++) {
            shift[r] = batch->shift[r][e];
            terms += fabs((double)shift[r]) * doing->longest;
        }
        if (batch->is_shifted && !(batch->distance[e] >= CANCELLED * terms)) { /* measured anew */
            for (int k = 0; k < d; k++) {
                p[k] = batch->p[k][e];
                q[k] = batch->q[k][e];
            }
            batch->distance[e] = hs_metric_measure(&doing->slow, p, q, shift, along);
            for (int k = 0; k < d; k++) {
                batch->vector[k][e] = along[k];
            }
        }
        if (*failed < 0 && !(batch->distance[e] < INFINITY)) {
            *failed = e;
        }
    }
    if (distance != NULL) {
        memcpy(distance + first, batch->distance, (size_t)batch->n * sizeof *distance);
    }
    if (vectors != NULL) {
        for (int k = 0; k < d; k++) {
            vector[k] = batch->vector[k];
        }
        hs_restore_vectors(vectors + first * d, vector, sign, batch->n, d, same);
    }
}

/* A hs_slab_fn. */
static hs_status
measure_slab(void *context, int slab, int64_t first, int64_t last)
{
    measuring            *doing = context;
    const hs_given_pairs *given = doing->given;
    int32_t              *S = hs_output_column(given->output, HS_WANT_SHIFT);
    const bool            measures = given->output->columns & (HS_WANT_DISTANCE | HS_WANT_VECTOR);
    hs_measured           batch;
    memset(&batch, 0, sizeof batch); /* kernels read a little beyond the last pair */
    while (first < last) {
        int32_t failed = -1;
        batch.n = (int32_t)(last - first < HS_BATCH ? last - first : HS_BATCH);
        batch.is_shifted = batch.is_wide = false;
        for (int32_t e = 0; e < batch.n; e++) {
            const hs_status status = take_pair(given, first + e, e, S, &batch);
            if (status != HS_OK) {
                doing->failed[slab] = first + e;
                return status;
            }
        }
        if (measures) {
            put_batch(doing, first, &batch, &failed);
        }
        if (failed >= 0) {
            doing->failed[slab] = first + failed;
            return HS_ERR_FAR;
        }
        first += batch.n;
    }
    return HS_OK;
}

hs_status
hs_given_pairs_measure(const hs_given_pairs *given, hs_call *call, hs_failure *failure)
{
    measuring doing = {.given = given, .kernel = call->kernel, .slow = given->box->metric};
    doing.slow.floats_usable = false;
    for (int r = 0; r < doing.slow.n_rows; r++) {
        for (int k = 0; k < doing.slow.ndim; k++) {
            doing.longest = hs_larger(fabs(doing.slow.rows[r][k]), doing.longest);
        }
    }
    for (int slab = 0; slab < HS_SLABS; slab++) {
        doing.failed[slab] = -1;
    }
    const hs_status status =
        hs_walk_points(call->team, &call->options, given->pairs->n, 0, measure_slab, &doing);
    for (int slab = 0; status != HS_OK && slab < HS_SLABS && failure->row < 0; slab++) {
        failure->row = doing.failed[slab];
    }
    return status;
}
