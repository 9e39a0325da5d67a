/* SPDX-License-Identifier: BSD-3-Clause */
/* choose.c: labels are compared for all hits, one point after the other (labels.h). Where that
 * leaves images or distances open, a batch of hits is looked up: of distances, those that float32
 * cannot tell. */
#include "choose.h"

#include "decide.h"
#include "form.h"
#include "labels.h"

#include <math.h>

/* Candidates that could be tested while the nearest image of a pair is found: in a microsecond, or
 * some in many dimensions. */
#define WORK_OF_IMAGE 1024

/* Hits of one point that are looked up together. */
typedef struct hit_batch {
    hs_scanner *scanner;
    int32_t     t, point; /* the asking point: of the group, and as the caller numbers it */
    int32_t     n;
    int32_t     hit[HS_BATCH];   /* where among the scan's hits */
    int32_t     place[HS_BATCH]; /* of the candidates */
    int32_t     id[HS_BATCH];    /* and their numbers */
    uint8_t     drop[HS_BATCH];  /* 0 or 1 */
} hit_batch;

static void
add_hit(const hs_scan *scan, int32_t h, hit_batch *batch)
{
    batch->hit[batch->n] = h;
    batch->place[batch->n] = hs_hit_place(batch->scanner, scan->hits[h]);
    batch->id[batch->n++] = hs_hit_number(batch->scanner, scan->hits[h]);
}

/* Looks up the pairs of the batch. */
static hs_status
trace_batch(hit_batch *batch, bool metric)
{
    hs_scanner *scanner = batch->scanner;
    hs_trace_clear(&scanner->trace);
    (void)hs_trace_add(&scanner->trace, scanner->group.first + batch->t, batch->place, batch->n);
    return hs_trace_look_up(&scanner->trace, metric, &scanner->failed_point);
}

/* Shift e of the trace over the periodic box vectors, from a point to a candidate. */
static void
given_shift(const hs_trace *trace, int32_t e, int64_t *shift)
{
    for (int r = 0; r < trace->search->scene.lattice.n_periodic; r++) {
        shift[r] = trace->of.is_narrow ? trace->shift[r][e] : trace->given[r][e];
    }
}

static void
point_of(const hs_cloud *cloud, int32_t point, double *x)
{
    for (int k = 0; k < cloud->ndim; k++) {
        x[k] = cloud->x[k][point];
    }
}

/* Whether this shift is that of the nearest image, as seen from the lower number of two points of
 * one set, or from a query. */
static hs_status
is_nearest(const hs_choice *choice, const hit_batch *batch, int32_t h, int64_t *shift,
           bool *nearest)
{
    const int       m = choice->images.lattice.n_periodic;
    const bool      turns = !choice->has_queries && batch->id[h] < batch->point;
    const hs_cloud *asking = choice->has_queries ? &choice->asking_cloud : &choice->cloud;
    double          p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t         near[HS_MAX_DIM];
    point_of(asking, batch->point, turns ? q : p);
    point_of(&choice->cloud, batch->id[h], turns ? p : q);
    for (int r = 0; turns && r < m; r++) {
        shift[r] = -shift[r];
    }
    const hs_status status = hs_near_image(&choice->images, p, q, near);
    *nearest = status == HS_OK && memcmp(shift, near, (size_t)m * sizeof *near) == 0;
    return status;
}

/* Drops the pairs of the batch, which are excluded, that are in their nearest image. */
static hs_status
drop_nearest(const hs_choice *choice, hit_batch *batch)
{
    hs_scanner *scanner = batch->scanner;
    int64_t     shift[HS_MAX_DIM];
    hs_status   status = trace_batch(batch, false);
    scanner->work_since_poll += WORK_OF_IMAGE * (int64_t)batch->n;
    for (int32_t e = 0; status == HS_OK && e < batch->n; e++) {
        bool nearest;
        given_shift(&scanner->trace, e, shift);
        status = is_nearest(choice, batch, e, shift, &nearest);
        if (status != HS_OK) {
            scanner->failed_point = batch->point;
        }
        batch->drop[e] = nearest;
    }
    return status;
}

/* Whether pair e of the trace, of a point with itself, is in the image S = 0. */
static bool
is_itself(const hs_trace *trace, int32_t e)
{
    int moved = 0;
    for (int r = 0; r < trace->search->scene.lattice.n_periodic && trace->is_shifted; r++) {
        moved += trace->times[r][e] != 0.0;
    }
    return moved == 0;
}

/* Drops the pairs of the batch that are nearer than the least distance. */
static hs_status
drop_near(const hs_choice *choice, hit_batch *batch)
{
    hs_scanner     *scanner = batch->scanner;
    const hs_scene *scene = &scanner->search->scene;
    const hs_status status = trace_batch(batch, true);
    hs_metric       nearer;
    if (status != HS_OK) {
        return status;
    }
    hs_metric_init(&nearer, scene->metric.ndim, scene->metric.n_rows,
                   (const double(*)[HS_MAX_DIM])scene->metric.rows, hs_choice_least(choice, scene),
                   false);
    hs_decide_traced(scanner, &nearer, batch->drop);
    for (int32_t e = 0; e < batch->n; e++) {
        const bool own = !choice->has_queries && batch->id[e] == batch->point;
        batch->drop[e] = batch->drop[e] && !(own && is_itself(&scanner->trace, e));
    }
    return HS_OK;
}

#define DROPPED (-1) /* in place of a hit */

/* Decides the batch, by images or by the least distance, marks what is dropped, and empties it. */
static hs_status
settle(const hs_choice *choice, bool by_image, hit_batch *batch, hs_scan *scan)
{
    const hs_status status = batch->n == 0 ? HS_OK
                             : by_image    ? drop_nearest(choice, batch)
                                           : drop_near(choice, batch);
    for (int32_t e = 0; status == HS_OK && e < batch->n; e++) {
        if (batch->drop[e]) {
            scan->hits[batch->hit[e]] = DROPPED;
        }
    }
    batch->n = 0;
    return status;
}

/* Takes hits that are dropped out of [from, end); returns where the others end. */
static int32_t
close_up(hs_scan *scan, int32_t from, int32_t end)
{
    int32_t to = from;
    for (int32_t h = from; h < end; h++) {
        const int32_t hit = scan->hits[h];
        scan->hits[to] = hit;
        if (scan->squares != NULL) {
            scan->squares[to] = scan->squares[h];
        }
        to += hit != DROPPED;
    }
    return to;
}

/* Marks those of hits [from, end) of a point that are excluded and in their nearest image. */
static hs_status
drop_images(const hs_asking *asking, hs_label_test test, int32_t from, int32_t end,
            hit_batch *batch, hs_scan *scan)
{
    const hs_choice *choice = batch->scanner->search->call->choice;
    hs_status        status = HS_OK;
    for (int32_t h = from; status == HS_OK && h < end; h++) {
        const int32_t id = hs_hit_number(batch->scanner, scan->hits[h]);
        if (hs_labels_leave_out(asking, id, test)) {
            add_hit(scan, h, batch);
        }
        if (batch->n == HS_BATCH) {
            status = settle(choice, true, batch, scan);
        }
    }
    return status == HS_OK ? settle(choice, true, batch, scan) : status;
}

/* Whether float32 cannot tell that a hit is as far as the least distance; out: beyond this square
 * it is. */
HS_ALWAYS_INLINE bool
may_be_near(const hs_scanner *scanner, int32_t t, int32_t hit, float out)
{
    float square = 0.0f;
    for (int k = 0; k < scanner->search->scene.ndim; k++) {
        const float along = scanner->block.y[k][hit] - scanner->group.q[k][t];
        square += along * along;
    }
    return !(square > out);
}

/* Marks those of hits [from, end) of a point that are nearer than the least distance. */
static hs_status
drop_nearer(float out, int32_t from, int32_t end, hit_batch *batch, hs_scan *scan)
{
    const hs_choice *choice = batch->scanner->search->call->choice;
    hs_status        status = HS_OK;
    for (int32_t h = from; status == HS_OK && h < end; h++) {
        if (may_be_near(batch->scanner, batch->t, scan->hits[h], out)) {
            add_hit(scan, h, batch);
        }
        if (batch->n == HS_BATCH) {
            status = settle(choice, false, batch, scan);
        }
    }
    return status == HS_OK ? settle(choice, false, batch, scan) : status;
}

/* Squares beyond this are those of pairs that are at least the least distance apart. */
static float
surely_far(const hs_scanner *scanner, const hs_choice *choice)
{
    const hs_scene *scene = &scanner->search->scene;
    return scene->extreme ? INFINITY
                          : hs_thresholds_of(scene->ndim, hs_choice_least(choice, scene),
                                             scanner->form->extent, scanner->search->filter_error)
                                .out;
}

/* Chooses among hits [from, scan->end[t]) of a point, and moves those that count to `to`; *end:
 * where they end. */
static hs_status
choose_of_point(hit_batch *batch, hs_scan *scan, float out, int32_t from, int32_t to, int32_t *end)
{
    const hs_scanner *scanner = batch->scanner;
    const hs_choice  *choice = scanner->search->call->choice;
    const int32_t     point = batch->point;
    hs_asking         asking;
    hs_label_test     test;
    hs_status         status = HS_OK;
    *end = hs_labels_sift_groups(scanner, scan, point, from, scan->end[batch->t], to);
    const bool excludes = hs_labels_find(choice, point, &asking, &test);
    const bool compares = hs_choice_compares(choice, scanner->options.cutoff);
    if (excludes && !compares) {
        *end = hs_labels_sift(scanner, scan, &asking, to, *end, to, test);
    } else if (excludes) {
        status = drop_images(&asking, test, to, *end, batch, scan);
        *end = close_up(scan, to, *end);
    }
    if (status == HS_OK && choice->min_distance > 0.0) {
        status = drop_nearer(out, to, *end, batch, scan);
        *end = close_up(scan, to, *end);
    }
    return status;
}

/* Hits as the visitor gets them. */
static void
restore_hits(const hs_scanner *scanner, hs_scan *scan)
{
    if (scanner->scans != HS_BLOCK_LISTS_PLACES) {
        return;
    }
    if (scanner->use == HS_BLOCK_LISTS_IDS) {
        for (int64_t h = 0; h < scan->n_hits; h++) {
            scan->hits[h] = hs_hit_number(scanner, scan->hits[h]);
        }
    } else if (scanner->is_ordered) {
        for (int64_t h = 0; h < scan->n_hits; h++) {
            scan->hits[h] = hs_hit_place(scanner, scan->hits[h]);
        }
    }
}

hs_status
hs_choose(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next)
{
    const hs_choice *choice = scanner->search->call->choice;
    const hs_bins   *asking = hs_search_asking(scanner->search);
    const float      out = choice->min_distance > 0.0 ? surely_far(scanner, choice) : 0.0f;
    hit_batch        batch = {.scanner = scanner};
    int32_t          kept = 0, from = 0;
    hs_status        status = HS_OK;
    for (int32_t t = first; status == HS_OK && t < next; t++) {
        const int32_t end = scan->end[t];
        batch.t = t;
        batch.point = asking->order[scanner->group.first + t];
        if (choice->number != NULL) {
            batch.point = (int32_t)choice->number[batch.point];
        }
        status = choose_of_point(&batch, scan, out, from, kept, &kept);
        from = end;
        scan->end[t] = kept;
    }
    scan->n_hits = kept;
    restore_hits(scanner, scan);
    return status;
}
