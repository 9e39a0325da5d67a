/* SPDX-License-Identifier: BSD-3-Clause */
/* records.c: runs of candidates are of one image, and consecutive points unless some were left out,
 * so records are written run by run. What is zero throughout the block is not written at all: most
 * blocks have no image and no turn. */
#include "records.h"

#include "../base/poll.h"
#include "../memory/parts.h"

#include <string.h>

/* Turns and images up to here are few: sums of four of them are int32. */
#define MOST_FEW 0x1p28

bool
hs_has_plain_shifts(const hs_lattice *lattice)
{
    for (int r = 0; r < lattice->n_periodic; r++) {
        for (int l = 0; l < lattice->n_periodic; l++) {
            if (lattice->U[r][l] != (r == l)) {
                return false;
            }
        }
    }
    return true;
}

bool
hs_has_narrow_shifts(const hs_search *search)
{
    const hs_scene *scene = &search->scene;
    for (int k = 0; k < scene->ndim; k++) {
        if (scene->lattice.row_of_axis[k] >= 0 &&
            search->grid.reach[k] / search->grid.shape[k] >= MOST_FEW) {
            return false;
        }
    }
    return hs_has_plain_shifts(&scene->lattice) &&
           (!search->bins.turns.known ||
            hs_fold_turns(&scene->lattice, scene->cloud.largest) < MOST_FEW);
}

hs_status
hs_records_init(const hs_search *search, const hs_block *block, const hs_options *polls,
                bool needs_given, hs_records *records)
{
    hs_account   *account = &search->call->account;
    const bool    has_rows = search->scene.lattice.n_periodic > 0;
    const int     width = search->scene.ndim <= HS_RECORD ? HS_RECORD : 2 * HS_RECORD;
    const int64_t n = (int64_t)block->capacity * width;
    hs_parts      parts;
    *records = (hs_records){.search = search, .block = block, .polls = polls, .width = width};
    records->needs_given = needs_given || search->bins.keeps_originals;
    records->is_narrow = hs_has_narrow_shifts(search);
    hs_parts_begin(&parts);
    hs_parts_add(&parts, (void **)&records->q, n, sizeof(double));
    if (has_rows) {
        hs_parts_add(&parts, (void **)&records->image, n, sizeof(int32_t));
    }
    if (has_rows && records->needs_given && records->is_narrow) {
        hs_parts_add(&parts, (void **)&records->few, n, sizeof(int32_t));
    } else if (has_rows && records->needs_given) {
        hs_parts_add(&parts, (void **)&records->turned, n, sizeof(int64_t));
    }
    records->memory = hs_parts_alloc(account, HS_FOR_CANDIDATES, &parts);
    return records->memory != NULL ? HS_OK : HS_ERR_MEMORY;
}

void
hs_records_free(hs_account *account, hs_records *records)
{
    hs_free(account, records->memory);
    records->memory = NULL;
}

/* Whether these are all of the points from the first to the last. */
static bool
are_consecutive(const int32_t *number, int32_t n)
{
    return number[n - 1] - number[0] == n - 1;
}

/* The image less the turns of each of n candidates. */
HS_ALWAYS_INLINE void
subtract_turns(const hs_bins *bins, const int32_t *image, const int32_t *number, int32_t n,
               const int m, const int width, int32_t *few)
{
    const int32_t *turns[HS_MAX_DIM];
    int32_t        moved[HS_MAX_DIM];
    for (int r = 0; r < m; r++) { /* `few` does not overlap these */
        turns[r] = bins->turns.narrow[r];
        moved[r] = image[r];
    }
    for (int32_t c = 0; c < n; c++) {
        for (int r = 0; r < m; r++) {
            few[(int64_t)c * width + r] = moved[r] - turns[r][number[c]];
        }
    }
}

/* Looks up the shifts of the candidates of one run, less their turns. */
static void
load_few(hs_records *records, const hs_run *run, int32_t n)
{
    const hs_bins   *bins = &records->search->bins;
    const hs_kernel *kernel = records->search->call->kernel;
    const int        m = bins->n_periodic, width = records->width;
    int32_t         *few = records->few + (int64_t)run->at * width;
    const int32_t   *number = records->block->number + run->at;
    if (m != 3 || width != HS_RECORD) {
        subtract_turns(bins, run->image, number, n, m, width, few);
    } else if (kernel->shift_records == NULL || !are_consecutive(number, n)) {
        subtract_turns(bins, run->image, number, n, 3, HS_RECORD, few);
    } else {
        const int32_t *turns[HS_MAX_DIM];
        for (int r = 0; r < m; r++) {
            turns[r] = bins->turns.narrow[r] + number[0];
        }
        kernel->shift_records(run->image, turns, n, few);
    }
}

static void
load_given(hs_records *records, const hs_run *run, int32_t n)
{
    const hs_bins *bins = &records->search->bins;
    const int32_t *number = records->block->number + run->at;
    const int      width = records->width;
    if (records->is_narrow) {
        load_few(records, run, n);
        return;
    }
    for (int r = 0; r < bins->n_periodic; r++) {
        int64_t *turned = records->turned + (int64_t)run->at * width + r;
        for (int32_t c = 0; c < n; c++) {
            const int64_t turns = bins->turns.known ? hs_turns_get(&bins->turns, r, number[c]) : 0;
            turned[c * width] = run->image[r] - turns;
        }
    }
}

/* Coordinates and number of each of n candidates. */
HS_ALWAYS_INLINE void
copy_points(double *const *x, const int32_t *order, const int32_t *number, int32_t n, const int d,
            const int width, double *to)
{
    const double *from[HS_MAX_DIM];
    for (int k = 0; k < d; k++) { /* `to` does not overlap this */
        from[k] = x[k];
    }
    for (int32_t c = 0; c < n; c++, to += width) {
        for (int k = 0; k < d; k++) {
            to[k] = from[k][number[c]];
        }
        if (d < HS_RECORD) {
            const int64_t id = order[number[c]];
            memcpy(to + HS_RECORD - 1, &id, sizeof id);
        }
    }
}

/* Looks up what the metric needs of the candidates of one run. */
static void
load_points(hs_records *records, const hs_run *run, int32_t n)
{
    const hs_bins   *bins = &records->search->bins;
    const hs_kernel *kernel = records->search->call->kernel;
    const int        d = bins->ndim;
    const int32_t   *number = records->block->number + run->at;
    double          *to = records->q + (int64_t)run->at * records->width;
    double *const   *x = bins->keeps_originals ? bins->originals : bins->x;
    if (d != 3) {
        copy_points(x, bins->order, number, n, d, records->width, to);
    } else if (kernel->point_records == NULL || !are_consecutive(number, n)) {
        copy_points(x, bins->order, number, n, 3, HS_RECORD, to);
    } else {
        const double *from[HS_MAX_DIM];
        for (int k = 0; k < d; k++) {
            from[k] = x[k] + number[0];
        }
        kernel->point_records(from, bins->order + number[0], n, to);
    }
}

static void
load_images(hs_records *records, const hs_run *run, int32_t n)
{
    const int m = records->search->bins.n_periodic, width = records->width;
    int32_t  *to = records->image + (int64_t)run->at * width;
    int32_t   image[HS_MAX_DIM] = {0};
    memcpy(image, run->image, (size_t)m * sizeof *image);
    if (width == HS_RECORD) { /* a copy of constant size is one instruction */
        for (int32_t c = 0; c < n; c++) {
            memcpy(to + c * HS_RECORD, image, HS_RECORD * sizeof *image);
        }
        return;
    }
    for (int32_t c = 0; c < n; c++) {
        memcpy(to + c * width, image, (size_t)width * sizeof *image);
    }
}

bool
hs_records_has_images(hs_records *records)
{
    if (records->knows_images) {
        return records->has_images;
    }
    int32_t any = 0;
    for (const hs_run *run = records->block->runs; run->at < records->block->n; run++) {
        for (int r = 0; r < records->search->bins.n_periodic; r++) {
            any |= run->image[r];
        }
    }
    records->knows_images = true;
    records->has_images = any != 0;
    return records->has_images;
}

/* Writes down all candidates of the block, as far as that is not done yet. */
hs_status
hs_records_load(hs_records *records, bool metric)
{
    int32_t unpolled = 0;
    bool    given = records->needs_given && !records->has_given;
    metric = metric && !records->has_metric;
    if (!given && !metric) {
        return HS_OK;
    }
    const bool images = hs_records_has_images(records);
    given = given && (records->search->bins.turns.known || !records->is_narrow);
    for (const hs_run *run = records->block->runs; run->at < records->block->n; run++) {
        const int32_t n = run[1].at - run->at;
        if (n == 0) { /* all of it was left out */
            continue;
        }
        if (metric) {
            load_points(records, run, n);
        }
        if (images) {
            load_images(records, run, n);
        }
        if (given) {
            load_given(records, run, n);
        }
        unpolled += n;
        if (unpolled > HS_POLL_CANDIDATES) {
            unpolled = 0;
            if (hs_poll(records->polls, 0.0) != HS_OK) {
                return HS_ERR_INTERRUPTED;
            }
        }
    }
    records->has_given = records->needs_given;
    records->has_metric = metric;
    return HS_OK;
}
