/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_bound.c: a radius that surely holds as many points as are wanted: the tree is walked
 * down, nearest nodes first, with a heap of the least squares so far. */
#include "nearest.h"

#include "../base/poll.h"

#include <math.h>

/* Relative room, far more than roundings take. */
#define ROOM 0x1p-36
/* Nodes and points between two polls: some milliseconds. */
#define POLL_WORK (INT64_C(1) << 20)
/* Squares outside this are near underflow or overflow: another unit is needed. */
#define LEAST_SQUARE 0x1p-600
#define MOST_SQUARE  0x1p600
#define UNIT_STEP    400

/* An asking point, in one image and unit. */
typedef struct near_probe {
    const hs_nearest   *near;
    hs_nearest_bounder *bounder;
    int32_t             self;           /* the point itself is left out; -1 in other images */
    double              at[HS_MAX_DIM]; /* its X less the image's displacement */
    double              unit;
} near_probe;

/* Largest of the k least squares, infinity as long as there are fewer. */
static double
worst(const near_probe *probe)
{
    const hs_nearest_bounder *bounder = probe->bounder;
    return bounder->n < probe->near->k ? INFINITY : bounder->least[0];
}

static void
sink(double *heap, int64_t n, double value)
{
    int64_t at = 0;
    for (int64_t child = 1; child < n; child = 2 * at + 1) {
        child += child + 1 < n && heap[child + 1] > heap[child];
        if (heap[child] <= value) {
            break;
        }
        heap[at] = heap[child];
        at = child;
    }
    heap[at] = value;
}

static bool
note_square(near_probe *probe, double square)
{
    hs_nearest_bounder *bounder = probe->bounder;
    const int64_t       k = probe->near->k;
    if (bounder->n == k) {
        if (square < bounder->least[0]) {
            sink(bounder->least, k, square);
        }
        return true;
    }
    if (bounder->n == bounder->capacity) {
        const int64_t twice = 2 * bounder->capacity + 64, capacity = twice < k ? twice : k;
        if (!hs_shared_resize(probe->near->shared, (void **)&bounder->least, bounder->capacity,
                              capacity, sizeof(double))) {
            return false;
        }
        bounder->capacity = capacity;
    }
    int64_t at = bounder->n++;
    while (at > 0 && bounder->least[(at - 1) / 2] < square) {
        bounder->least[at] = bounder->least[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    bounder->least[at] = square;
    return true;
}

static bool
note_leaf(near_probe *probe, const hs_tree_node *node)
{
    const hs_bins *bins = &probe->near->search->bins;
    const int32_t  n = hs_nearest_of_leaf(probe->near, node);
    for (int32_t si = node->first; si < node->first + n; si++) {
        double square = 0.0;
        for (int k = 0; k < bins->ndim; k++) {
            const double along = (bins->x[k][si] - probe->at[k]) * probe->unit;
            square += along * along;
        }
        if (si != probe->self && !note_square(probe, square)) {
            return false;
        }
    }
    probe->bounder->work += n;
    return true;
}

static hs_status
walk_image(near_probe *probe)
{
    const hs_tree      *tree = &probe->near->tree;
    hs_nearest_bounder *bounder = probe->bounder;
    int64_t             n_waiting = 1;
    bounder->stack[0] = 0;
    bounder->gaps[0] = hs_tree_gap(tree, probe->at, probe->at, probe->unit);
    while (n_waiting > 0) {
        const int32_t       number = bounder->stack[--n_waiting];
        const hs_tree_node *node = &tree->nodes[number];
        bounder->work++;
        if (bounder->gaps[n_waiting] > worst(probe)) {
            continue;
        }
        if (node->left == 0) {
            if (!note_leaf(probe, node)) {
                return HS_ERR_MEMORY;
            }
            continue;
        }
        double gap[2];
        hs_tree_gaps(hs_tree_bounds(tree, node->left, tree->ndim), probe->at, probe->at,
                     probe->unit, tree->ndim, gap);
        const int nearer = gap[1] < gap[0];
        bounder->stack[n_waiting] = node->left + 1 - nearer;
        bounder->gaps[n_waiting++] = gap[1 - nearer];
        bounder->stack[n_waiting] = node->left + nearer;
        bounder->gaps[n_waiting++] = gap[nearer];
    }
    return HS_OK;
}

/* The k least squares among all images within group->radius, or as many as there are. */
static hs_status
walk_images(const hs_nearest *near, const hs_options *options, const hs_nearest_group *group,
            near_probe *probe, double *error)
{
    const hs_bins    *bins = hs_search_asking(near->search);
    hs_nearest_images images;
    hs_status         status = hs_nearest_images_start(near, group, &images);
    *error = images.error;
    probe->bounder->n = 0;
    while (status == HS_OK && hs_nearest_images_next(&images)) {
        int32_t any = 0;
        for (int r = 0; r < bins->n_periodic; r++) {
            any |= images.shift[r];
        }
        probe->self = near->omits_self && any == 0 ? group->first : -1;
        for (int k = 0; k < bins->ndim; k++) {
            probe->at[k] = bins->x[k][group->first] - images.moved[k];
        }
        status = walk_image(probe);
        if (status == HS_OK && probe->bounder->work > POLL_WORK) {
            probe->bounder->work = 0;
            status = hs_poll(options, 0.0);
        }
    }
    return status;
}

/* The k least squares, in a unit in which the largest of them is an ordinary number. A unit changes
 * by powers that bring no square from one end to the other: a few times at most. */
static hs_status
walk_scaled(const hs_nearest *near, const hs_options *options, const hs_nearest_group *group,
            near_probe *probe, double *error)
{
    int exponent = -hs_nearest_exponent(group->radius);
    for (;;) {
        probe->unit = hs_power_of_two(exponent);
        const hs_status status = walk_images(near, options, group, probe, error);
        const double    square = worst(probe);
        int             better = exponent;
        if (status == HS_OK && probe->bounder->n == near->k && square < LEAST_SQUARE) {
            better = exponent + UNIT_STEP < 1000 ? exponent + UNIT_STEP : 1000;
        } else if (status == HS_OK && probe->bounder->n == near->k && square > MOST_SQUARE) {
            better = exponent - UNIT_STEP > -1000 ? exponent - UNIT_STEP : -1000;
        }
        if (better == exponent) {
            return status;
        }
        exponent = better;
    }
}

/* Sets the radius to all that could be of use. */
static void
take_all(hs_nearest_group *group, double farthest)
{
    group->is_complete = true;
    group->radius = hs_larger(farthest, HS_NEAREST_LEAST_RADIUS);
}

hs_status
hs_nearest_bound(const hs_nearest *near, const hs_options *options, hs_nearest_bounder *bounder,
                 hs_nearest_group *group)
{
    const bool   is_open = near->search->scene.lattice.n_periodic == 0;
    const double farthest = hs_nearest_farthest(near, group);
    near_probe   probe = {.near = near, .bounder = bounder};
    double       error, along = hs_smaller(group->radius, near->smallest_period);
    /* Each time twice as far: some times, until hs_nearest_images_start refuses so many images. */
    for (;;) {
        /* The radius only says which images are looked at, as yet: `along` the axes that repeat. */
        group->radius = group->away > 0.0 ? hypot(group->away, along) : along;
        group->radius = hs_smaller(group->radius, hs_larger(farthest, HS_NEAREST_LEAST_RADIUS));
        const hs_status status = walk_scaled(near, options, group, &probe, &error);
        if (status != HS_OK) {
            return status;
        }
        const bool   is_all = is_open || group->radius >= farthest;
        const double far = bounder->n < near->k ? INFINITY : sqrt(bounder->least[0]) / probe.unit;
        const double enough = (far + 8.0 * sqrt(near->tree.ndim) * error) * (1.0 + ROOM);
        if (enough >= farthest && is_all) { /* there may be fewer */
            take_all(group, farthest);
            return HS_OK;
        }
        if (is_all || enough <= group->radius) {
            group->is_complete = false;
            group->radius = hs_larger(enough, HS_NEAREST_LEAST_RADIUS);
            return HS_OK;
        }
        along = 2.0 * along;
    }
}
