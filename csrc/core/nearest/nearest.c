/* SPDX-License-Identifier: BSD-3-Clause */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "nearest.h"
#include "../base/os_thread.h"
#include "../base/status.h"
#include "../scene/scene.h"
#include "../base/os.h"
#include "../collect/parallel.h"
#include "rank.h"

#include <math.h>
#include <string.h>

/* nearest.c: trees that are built once for many calls, first radii, radii that surely suffice, and
 * the search of groups by threads. */

/* Who may build is decided by one compare-and-swap. */

#define NOTHING 0
#define BUILT   1 /* and does not change any more */
#define BUILDS  2 /* a thread, after state - BUILDS forks */

struct hs_nearest_kept {
    volatile int64_t state;
    hs_nearest       near;
    hs_search        search; /* its own, as is its call */
    hs_call          call;
};

hs_nearest_kept *
hs_nearest_kept_new(void)
{
    hs_nearest_kept *kept = hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *kept);
    if (kept != NULL) {
        kept->state = NOTHING;
    }
    return kept;
}

void
hs_nearest_kept_free(hs_nearest_kept *kept)
{
    if (kept == NULL) {
        return;
    }
    if (hs_atomic_load(&kept->state) == BUILT) {
        hs_tree_free(&kept->call.account, &kept->near.tree);
        hs_search_close(&kept->search);
        hs_account_close(&kept->call.account);
    }
    hs_free(NULL, kept);
}

const hs_nearest *
hs_nearest_kept_get(hs_nearest_kept *kept, hs_nearest **room)
{
    const int64_t state = hs_atomic_load(&kept->state), now = BUILDS + hs_atomic_load(&hs_n_forks);
    const bool    is_built = state == BUILT;
    /* What a thread that does not exist in this process has begun is lost, and built anew. */
    const bool builds = !is_built && state != now && hs_atomic_swap_if(&kept->state, state, now);
    *room = NULL;
    if (builds) {
        *room = &kept->near;
        kept->near = (hs_nearest){.search = &kept->search};
        kept->search.call = &kept->call;
    }
    return is_built ? &kept->near : NULL;
}

void
hs_nearest_kept_end(hs_nearest_kept *kept, bool done)
{
    hs_atomic_store(&kept->state, done ? BUILT : NOTHING);
}

/* Chooses a cutoff that scales the scene without loss, then builds the trees or
 * borrows the kept one. */

/* Points of a leaf. Measured: from 8 to 12 the time changes by some 5 %. */
#define LEAF_POINTS 8
/* The nearest of a point take as long as so many pairs of a search with a cutoff, for which it is
 * known how many threads they are worth. */
#define PAIRS_PER_POINT 200.0
/* Lengths that distances are compared with scale the scene by themselves below this. */
#define SMALL_LIMIT 0x1p-800
/* Periods below this do. */
#define SMALL_BOX 0x1p-500

static bool
limit_is_small(double limit)
{
    return limit > 0.0 && limit < SMALL_LIMIT;
}

/* The smallest length above 0 that distances are compared with. */
static double
smallest_length(const hs_nearest *near, double limit)
{
    return hs_choice_least_length(near->search->call->choice, limit);
}

/* Which cutoff lets the scene keep every digit: one that leaves ordinary numbers as they are; the
 * box's own size, or what distances are compared with, where these are too small for that. */
static double
scene_cutoff(const hs_box *box, double limit)
{
    double largest = 0.0, short_row = INFINITY;
    for (int l = 0; box != NULL && l < box->ndim; l++) {
        for (int k = 0; box->periodic[l] && k < box->ndim; k++) {
            largest = hs_larger(fabs(box->rows[l][k]), largest);
        }
        short_row = box->periodic[l] ? hs_smaller(largest, short_row) : short_row;
        largest = 0.0;
    }
    return limit_is_small(limit) ? limit : short_row < SMALL_BOX ? 0.0 : 1.0;
}

/* Sets the largest and the least distance, in the scene's unit and for the metrics. */
static void
set_limit(hs_nearest *near, double limit)
{
    const hs_scene  *scene = &near->search->scene;
    const hs_metric *metric = &scene->metric;
    const hs_choice *choice = near->search->call->choice;
    near->limit = hs_scale_apply(scene->scale, limit);
    const double of_metric = scene->extreme ? limit : near->limit;
    hs_metric_init(&near->within, scene->ndim, metric->n_rows, metric->rows,
                   of_metric < INFINITY ? of_metric : 1.0, near->search->call->options.inclusive);
    if (choice != NULL && choice->min_distance > 0.0) {
        near->least = hs_scale_apply(scene->scale, choice->min_distance);
        hs_metric_init(&near->nearer, scene->ndim, metric->n_rows, metric->rows,
                       hs_choice_least(choice, scene), false);
    }
}

/* The call's options for its scene. Where images are compared, S is needed of all pairs. */
static hs_options
options_of_scene(const hs_nearest *near, double limit)
{
    const hs_call *call = near->search->call;
    hs_options     options = call->options;
    if (call->choice != NULL && hs_choice_needs_places(call->choice, limit)) {
        options.want |= HS_WANT_SHIFT;
    }
    return options;
}

/* Builds the tree of the points and measures them: all that searches with other k and other queries
 * can share. */
static hs_status
build_tree(hs_nearest *near, int32_t leaf_points)
{
    hs_search       *search = near->search;
    hs_scene        *scene = &search->scene;
    const hs_metric *metric = &scene->metric;
    hs_metric_init(&near->order, scene->ndim, metric->n_rows, metric->rows, 1.0, true);
    hs_nearest_measure_drift(near);
    const hs_status status = hs_tree_build(&search->call->account, search->call->team,
                                           &search->call->options, scene, leaf_points,
                                           &search->bins, &near->tree);
    if (status == HS_OK) {
        hs_nearest_measure_layer(near);
    }
    return status;
}

/* Builds the tree of the queries, and frees their scene. */
static hs_status
build_asking_tree(hs_nearest *near, hs_scene *asking)
{
    hs_search *search = near->search;
    search->has_queries = true;
    near->asking = &near->asking_tree;
    const hs_status status = hs_tree_build(&search->call->account, search->call->team,
                                           &search->call->options, asking, LEAF_POINTS,
                                           &search->query_bins, &near->asking_tree);
    hs_scene_free(&search->call->account, asking);
    return status;
}

static hs_status
prepare_anew(hs_nearest *near, const hs_sets *sets, const hs_box *box, double limit,
             hs_failure *failure)
{
    hs_search    *search = near->search;
    hs_scene      queries, *asking = sets->queries != NULL ? &queries : NULL;
    hs_options    options = options_of_scene(near, limit);
    const int32_t leaf_points = near->k < 4 * LEAF_POINTS ? LEAF_POINTS : 2 * LEAF_POINTS;
    hs_sets       bounded = *sets;
    bounded.within = limit < INFINITY ? limit : 0.0;
    options.cutoff = scene_cutoff(box, smallest_length(near, limit));
    hs_call_gather(search->call, sets->points->n + (asking != NULL ? sets->queries->n : 0));
    near->asking = &near->tree;
    hs_status status = hs_scene_init_sets(&search->call->account, search->call->team, &bounded, box,
                                          &options, &search->scene, asking, failure);
    if (status != HS_OK) {
        return status;
    }
    set_limit(near, limit);
    status = build_tree(near, leaf_points);
    if (asking != NULL && status == HS_OK) {
        status = build_asking_tree(near, asking);
    } else if (asking != NULL) {
        hs_scene_free(&search->call->account, asking);
    }
    return status;
}

/* Builds a tree that any later call can use: for any k, largest distance and quantities. */
static hs_status
build_kept(const hs_nearest *near, const hs_sets *sets, const hs_box *box, hs_nearest *room,
           hs_failure *failure)
{
    hs_search    *search = room->search;
    hs_options    options = near->search->call->options;
    const hs_sets kept = {.points = sets->points,
                          .is_kept = true,
                          .is_full = true,
                          .is_plain = sets->is_plain,
                          .is_wide = sets->is_wide};
    options.cutoff = scene_cutoff(box, INFINITY);
    options.want = HS_WANT_SHIFT;
    options.counters = NULL;
    hs_call *call = search->call;
    hs_call_begin(&options, call);
    call->account.is_kept = true;
    hs_search_begin(call, search);
    call->team = near->search->call->team;
    hs_status status = hs_scene_init_sets(&search->call->account, search->call->team, &kept, box,
                                          &options, &search->scene, NULL, failure);
    if (status == HS_OK) {
        status = build_tree(room, LEAF_POINTS);
    }
    call->team = NULL;
    hs_call_detach(call);
    if (status != HS_OK) {
        hs_tree_free(&search->call->account, &room->tree);
        hs_search_close(search);
        hs_account_close(&call->account);
    }
    return status;
}

/* Takes what is shared as the new search's own, and marks as borrowed what it must not free. */
static void
borrow(const hs_nearest *kept, hs_nearest *near)
{
    hs_search *search = near->search;
    search->scene = kept->search->scene;
    search->bins = kept->search->bins;
    search->is_borrowed = true;
    near->tree = kept->tree;
    near->asking = &near->tree;
    near->order = kept->order;
    memcpy(near->drift, kept->drift, sizeof near->drift);
    near->smallest_period = kept->smallest_period;
    near->has_layer = kept->has_layer;
    memcpy(near->layer_lower, kept->layer_lower, sizeof near->layer_lower);
    memcpy(near->layer_upper, kept->layer_upper, sizeof near->layer_upper);
}

/* HS_REBUILD when what is kept does not serve: bounds that do not hold for the queries, a scale
 * that would lose digits of the largest distance; or another thread is building it. */
static hs_status
prepare_from_kept(hs_nearest *near, const hs_sets *sets, const hs_box *box, double limit,
                  hs_failure *failure)
{
    hs_search  *search = near->search;
    hs_nearest *room;
    hs_scene    asking;
    hs_status   status = HS_OK;
    if (limit_is_small(smallest_length(near, limit))) {
        return HS_REBUILD;
    }
    const hs_nearest *kept = hs_nearest_kept_get(sets->trees, &room);
    if (room != NULL) {
        hs_call_gather(search->call, sets->points->n);
        status = build_kept(near, sets, box, room, failure);
        hs_nearest_kept_end(sets->trees, status == HS_OK);
        kept = room;
    }
    if (kept == NULL || status != HS_OK) {
        return kept == NULL ? HS_REBUILD : status;
    }
    const hs_scene *scene = &kept->search->scene;
    const int       unit = hs_exponent_of(hs_scale_apply(scene->scale, limit));
    /* Far points need closed gaps, which a tree that is kept does not have. */
    if (scene->in_one_cell || hs_is_far(scene->cloud.largest, unit, HS_FAR_BOUNDED_EXPONENT)) {
        return HS_REBUILD;
    }
    if (sets->queries != NULL) {
        const hs_options options = options_of_scene(near, limit);
        status = hs_scene_from_kept(&search->call->account, search->call->team,
                                    &kept->search->scene, sets->queries, &options, &asking,
                                    failure);
        if (status != HS_OK) {
            return status;
        }
    }
    borrow(kept, near);
    set_limit(near, limit);
    return sets->queries != NULL ? build_asking_tree(near, &asking) : HS_OK;
}

hs_status
hs_nearest_prepare(hs_nearest *near, const hs_sets *sets, const hs_box *box, double limit,
                   hs_failure *failure)
{
    hs_search    *search = near->search;
    const int64_t n_asking = sets->queries != NULL ? sets->queries->n : sets->points->n;
    if (search->call->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    hs_call_gather_for(search->call, n_asking, PAIRS_PER_POINT * (double)n_asking,
                       sets->trees != NULL);
    search->is_full = true;
    hs_status status = HS_REBUILD;
    if (sets->trees != NULL) {
        status = prepare_from_kept(near, sets, box, limit, failure);
    }
    return status == HS_REBUILD ? prepare_anew(near, sets, box, limit, failure) : status;
}

void
hs_nearest_release(hs_nearest *near)
{
    hs_account *account = &near->search->call->account;
    if (!near->search->is_borrowed) {
        hs_tree_free(account, &near->tree);
    }
    hs_tree_free(account, &near->asking_tree);
}

/* How far to look: at first by the density of points, and where that was too
 * short or would be too far, by walking down the tree. */

/* Relative room, far more than roundings take. */
#define RADIUS_ROOM 0x1p-40
/* The density is that of at least so many times the points that are wanted. */
#define POINTS_PER_WANTED 4.0
/* Standard deviations of their number that a first radius makes room for. Measured: with 3 the time
 * differs by less than the noise. */
#define SPREAD 3.5
/* Points whose labels say how many more are to be looked at. */
#define MOST_LABELS 512

int
hs_nearest_exponent(double radius)
{
    return ilogb(hs_larger(radius, HS_NEAREST_LEAST_RADIUS));
}

void
hs_nearest_range(const hs_lattice *lattice, const hs_bins *bins, int k, int64_t first, int64_t last,
                 double *lower, double *upper)
{
    double low = INFINITY, high = -INFINITY;
    for (int64_t si = first; si < last; si++) {
        double x[HS_MAX_DIM];
        for (int c = 0; c < bins->ndim; c++) {
            x[c] = bins->x[c][si];
        }
        const double t = hs_lattice_coordinate(lattice, x, k);
        low = hs_smaller(t, low);
        high = hs_larger(t, high);
    }
    *lower = low;
    *upper = high;
}

void
hs_nearest_group_set(const hs_nearest *near, int32_t first, int32_t last, hs_nearest_group *group)
{
    const hs_bins    *bins = hs_search_asking(near->search);
    const hs_lattice *lattice = &near->search->scene.lattice;
    *group = (hs_nearest_group){.first = first, .last = last};
    for (int k = 0; k < bins->ndim; k++) {
        const double *x = bins->x[k];
        double        low = x[first], high = low;
        for (int32_t si = first + 1; si < last; si++) {
            low = hs_smaller(x[si], low);
            high = hs_larger(x[si], high);
        }
        group->lower[k] = group->t_lower[k] = low;
        group->upper[k] = group->t_upper[k] = high;
    }
    for (int k = 0; !lattice->aligned && k < bins->ndim; k++) {
        hs_nearest_range(lattice, bins, k, first, last, &group->t_lower[k], &group->t_upper[k]);
    }
    for (int k = 0; near->has_layer && k < bins->ndim; k++) {
        if (lattice->row_of_axis[k] < 0) {
            const double apart = hs_larger(near->layer_lower[k] - group->t_upper[k],
                                           group->t_lower[k] - near->layer_upper[k]);
            group->away = hs_larger(
                apart * (1.0 - RADIUS_ROOM) - 4.0 * near->search->scene.t_error[k], group->away);
        }
    }
}

/* A distance beyond which nothing is of use: that of all points, or the largest distance. In
 * periodic boxes infinity, unless there is a largest distance. */
static double
nearest_farthest(const hs_nearest *near, const hs_nearest_group *group)
{
    const hs_scene *scene = &near->search->scene;
    const double    limit = near->limit * (1.0 + RADIUS_ROOM);
    const hs_tree  *tree = &near->tree;
    double          all = 32.0 * scene->x_error; /* two in each of up to eight components */
    if (scene->lattice.n_periodic > 0) {
        return limit;
    }
    for (int k = 0; k < scene->ndim; k++) { /* no component is longer than this */
        all += hs_larger(fabs(tree->upper[k] - group->lower[k]),
                         fabs(group->upper[k] - tree->lower[k]));
    }
    return hs_smaller(limit, all * (1.0 + RADIUS_ROOM));
}

/* Sides of a region, base 2 logarithms, and what it holds. */
typedef struct near_region {
    int    ndim;
    double side[HS_MAX_DIM];
    bool   repeats[HS_MAX_DIM]; /* the region goes on along this side */
    double n_points;
} near_region;

/* log2 of the volume of a ball of radius 1. */
static double
ball_volume(int ndim)
{
    static const double volume[HS_MAX_DIM + 1] = {1.0,    2.0,    3.1416, 4.1888, 4.9348,
                                                  5.2638, 5.1677, 4.7248, 4.0587};
    return log2(volume[ndim]);
}

/*
 * log2 of the radius of a ball with `wanted` points in it, if the region is filled evenly. Sides
 * that are shorter than the ball is wide do not count: points on a line or in a plane have the
 * density of their line or plane.
 */
static double
radius_of(const near_region *region, double wanted)
{
    const double width = ball_volume(region->ndim) / region->ndim; /* of the ball, as a cube */
    bool         counts[HS_MAX_DIM];
    double       longest = -INFINITY;
    for (int k = 0; k < region->ndim; k++) {
        counts[k] = region->side[k] > -INFINITY;
        longest = hs_larger(region->side[k], longest);
    }
    for (;;) {
        double sum = log2(wanted / region->n_points);
        int    n = 0;
        for (int k = 0; k < region->ndim; k++) {
            sum += counts[k] ? region->side[k] : 0.0;
            n += counts[k];
        }
        const double radius = n > 0 ? sum / n - width : longest - width;
        bool         changed = false;
        for (int k = 0; n > 0 && k < region->ndim; k++) {
            if (counts[k] && !region->repeats[k] && region->side[k] < radius + width) {
                counts[k] = false;
                changed = true;
            }
        }
        if (!changed) {
            return radius;
        }
    }
}

/* The node around the group with at least so many points, and its sides; *away: how far from it
 * the group is. */
static int32_t
find_node(const hs_tree *tree, const hs_nearest_group *group, double least, double *sides,
          double *away)
{
    const int d = tree->ndim;
    int32_t   number = 0;
    *away = 0.0;
    for (int k = 0; k < d; k++) {
        sides[k] = tree->upper[k] - tree->lower[k];
    }
    for (;;) {
        const int32_t left = tree->nodes[number].left;
        double        gap[2] = {0.0, 0.0};
        const double *bounds = left != 0 ? hs_tree_bounds(tree, left, d) : NULL;
        HS_PREFETCH(&tree->nodes[left]); /* comes with the bounds, not after them */
        for (int k = 0; left != 0 && k < d; k++) {
            const double middle = group->lower[k] + 0.5 * (group->upper[k] - group->lower[k]);
            for (int side = 0; side < 2; side++) {
                const double below = bounds[4 * k + side] - middle;
                gap[side] += hs_larger(hs_larger(below, middle - bounds[4 * k + 2 + side]), 0.0);
            }
        }
        const int     side = gap[1] < gap[0];
        const int32_t next = left + side;
        if (left == 0 || tree->nodes[next].end - tree->nodes[next].first < least) {
            return number;
        }
        *away = gap[side];
        number = next;
        for (int k = 0; k < d; k++) {
            sides[k] = bounds[4 * k + 2 + side] - bounds[4 * k + side];
        }
    }
}

/* The whole box counts as the region when points are too few for a part of it. */
static void
take_box(const hs_lattice *lattice, near_region *region)
{
    const double side =
        (log2(lattice->volume_mantissa) + lattice->volume_exponent) / lattice->n_periodic;
    for (int k = 0; k < region->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0) {
            region->side[k] = side;
            region->repeats[k] = true;
        }
    }
}

/* A ball that sticks out of all points along open axes holds fewer. */
static double
widen_at_edges(const hs_nearest *near, const hs_nearest_group *group, double radius)
{
    const hs_tree *tree = &near->tree;
    double         part = 1.0;
    for (int k = 0; k < tree->ndim; k++) {
        const double middle = group->lower[k] + 0.5 * (group->upper[k] - group->lower[k]);
        const double below = hs_smaller(middle - tree->lower[k], radius);
        const double above = hs_smaller(tree->upper[k] - middle, radius);
        const bool   repeats = near->search->scene.lattice.aligned &&
                             near->search->scene.lattice.row_of_axis[k] >= 0;
        part *= repeats ? 1.0 : fmin(fmax((below + above) / (2.0 * radius), 0.5), 1.0);
    }
    return part < 1.0 ? radius * pow(part, -1.0 / tree->ndim) : radius;
}

/* How many points of the node, or of as many as are looked at, do not count by their labels: for a
 * point of the group. */
static int32_t
count_left_out(const hs_nearest *near, const hs_nearest_group *group, const hs_tree_node *node)
{
    const int32_t *order = near->search->bins.order;
    const int32_t  end = node->end - node->first < MOST_LABELS ? node->end
                                                               : node->first + MOST_LABELS;
    hs_chooser     chooser;
    int32_t        n = 0;
    hs_chooser_set(near->search->call->choice,
                   hs_search_asking(near->search)->order[(group->first + group->last) / 2],
                   &chooser);
    for (int32_t sj = node->first; sj < end; sj++) {
        n += !hs_chooser_is_of_group(&chooser, order[sj]) ||
             hs_chooser_excludes(&chooser, order[sj]);
    }
    return n;
}

void
hs_nearest_guess(const hs_nearest *near, hs_nearest_group *group)
{
    const hs_tree    *tree = &near->tree;
    const hs_lattice *lattice = &near->search->scene.lattice;
    const double      k = (double)near->k + near->omits_self;
    double            wanted = k + SPREAD * sqrt(k) + 1.0;
    double            away, sides[HS_MAX_DIM];
    const int32_t     number =
        find_node(tree, group, POINTS_PER_WANTED * hs_larger(wanted, 16.0), sides, &away);
    const hs_tree_node *node = &tree->nodes[number];
    group->more = near->search->call->choice != NULL ? count_left_out(near, group, node) : 0.0;
    wanted += group->more;
    near_region region = {.ndim = tree->ndim, .n_points = (double)(node->end - node->first)};
    for (int axis = 0; axis < tree->ndim; axis++) {
        region.side[axis] = log2(sides[axis]);
    }
    if (lattice->n_periodic > 0 && number == 0) {
        take_box(lattice, &region);
    }
    const double farthest = nearest_farthest(near, group);
    double       inside = exp2(radius_of(&region, wanted));
    if (near->least > 0.0) { /* a shell around a ball holds as many as are wanted */
        const double ratio = pow(near->least / inside, tree->ndim);
        const double wider = inside * pow(1.0 + ratio, 1.0 / tree->ndim);
        group->more += wanted * ratio;
        inside = wider < INFINITY ? wider : near->least;
    }
    group->radius = hs_larger(widen_at_edges(near, group, inside) + away, HS_NEAREST_LEAST_RADIUS);
    group->is_complete = group->radius >= farthest ||
                         (lattice->n_periodic == 0 && (double)tree->nodes[0].end <= k);
    if (group->is_complete) {
        group->radius = hs_larger(farthest, HS_NEAREST_LEAST_RADIUS);
    }
}

hs_status
hs_nearest_bounder_init(const hs_nearest *near, hs_nearest_bounder *bounder)
{
    *bounder = (hs_nearest_bounder){.depth = near->tree.depth + 2};
    return hs_shared_resize(near->shared, (void **)&bounder->stack, 0, bounder->depth,
                            sizeof *bounder->stack) &&
                   hs_shared_resize(near->shared, (void **)&bounder->gaps, 0, bounder->depth,
                                    sizeof *bounder->gaps)
               ? HS_OK
               : HS_ERR_MEMORY;
}

void
hs_nearest_bounder_free(const hs_nearest *near, hs_nearest_bounder *bounder)
{
    hs_shared_release(near->shared, (void **)&bounder->least);
    hs_shared_release(near->shared, (void **)&bounder->stack);
    hs_shared_release(near->shared, (void **)&bounder->gaps);
}

/* A radius that surely holds as many points as are wanted: the tree is walked
 * down, nearest nodes first, with a heap of the least squares so far. */

/* Relative room, far more than roundings take. */
#define BOUND_ROOM 0x1p-36
/* Nodes and points between two polls: some milliseconds. */
#define POLL_WORK (INT64_C(1) << 20)
/* What deciding whether a point counts may take, in points: images of it are compared. */
#define WORK_OF_CHOICE 512
/* Squares outside this are near underflow or overflow: another unit is needed. */
#define LEAST_SQUARE 0x1p-600
#define MOST_SQUARE  0x1p600
#define UNIT_STEP    400

/* An asking point, in one image and unit. */
typedef struct near_probe {
    const hs_nearest    *near;
    const hs_options    *options; /* polled */
    hs_nearest_bounder  *bounder;
    int32_t              self;           /* the point itself is left out; -1 in other images */
    double               at[HS_MAX_DIM]; /* its X less the image's displacement */
    double               unit;
    double               most;      /* what has a larger square is beyond the largest distance */
    hs_chooser           chooser;   /* if the call has a choice */
    hs_nearest_candidate candidate; /* for that */
    hs_stages            stages;
} near_probe;

/* Largest of the k least squares; as long as there are fewer, any that may be within the largest
 * distance. */
static double
worst(const near_probe *probe)
{
    const hs_nearest_bounder *bounder = probe->bounder;
    return bounder->n < probe->near->k ? probe->most : bounder->least[0];
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

/* Whether a point that is nearer than all that was found counts, by the call's choice. */
static hs_status
probe_counts(near_probe *probe, int32_t sj, double square, bool *counts)
{
    probe->candidate.sj = sj;
    probe->candidate.square = square;
    probe->bounder->work += WORK_OF_CHOICE;
    if (probe->bounder->work > POLL_WORK) {
        probe->bounder->work = 0;
        const hs_status status = hs_poll(probe->options, 0.0);
        if (status != HS_OK) {
            return status;
        }
    }
    return hs_nearest_counts(probe->near, &probe->chooser, &probe->candidate, &probe->stages,
                             counts);
}

static hs_status
note_leaf(near_probe *probe, const hs_tree_node *node)
{
    const hs_search *search = probe->near->search;
    const hs_bins   *bins = &search->bins;
    const int32_t    n = hs_nearest_of_leaf(probe->near, node);
    for (int32_t si = node->first; si < node->first + n; si++) {
        double square = 0.0;
        for (int k = 0; k < bins->ndim; k++) {
            const double along = (bins->x[k][si] - probe->at[k]) * probe->unit;
            square += along * along;
        }
        bool counts = si != probe->self && square <= worst(probe);
        if (counts && search->call->choice != NULL) {
            const hs_status status = probe_counts(probe, si, square, &counts);
            if (status != HS_OK) {
                return status;
            }
        }
        if (counts && !note_square(probe, square)) {
            return HS_ERR_MEMORY;
        }
    }
    probe->bounder->work += n;
    return HS_OK;
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
            const hs_status status = note_leaf(probe, node);
            if (status != HS_OK) {
                return status;
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
walk_images(const hs_nearest_group *group, near_probe *probe, double *error)
{
    const hs_nearest *near = probe->near;
    const hs_bins    *bins = hs_search_asking(near->search);
    hs_nearest_images images;
    hs_status         status = hs_nearest_images_start(near, group, &images);
    *error = images.error;
    const double reach =
        (near->limit + 8.0 * sqrt(near->tree.ndim) * images.error) * (1.0 + BOUND_ROOM);
    probe->most = reach * probe->unit * (reach * probe->unit);
    probe->bounder->n = 0;
    probe->candidate = (hs_nearest_candidate){.si = group->first,
                                              .image = images.shift,
                                              .unit = probe->unit,
                                              .error = images.error * probe->unit};
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
            status = hs_poll(probe->options, 0.0);
        }
    }
    return status;
}

/* The k least squares, in a unit in which the largest of them is an ordinary number. A unit changes
 * by powers that bring no square from one end to the other: a few times at most. */
static hs_status
walk_scaled(const hs_nearest_group *group, near_probe *probe, double *error)
{
    const hs_nearest *near = probe->near;
    int               exponent = -hs_nearest_exponent(group->radius);
    for (;;) {
        probe->unit = hs_power_of_two(exponent);
        const hs_status status = walk_images(group, probe, error);
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
    const double farthest = nearest_farthest(near, group);
    near_probe   probe = {.near = near, .options = options, .bounder = bounder};
    double       error, along = hs_smaller(group->radius, near->smallest_period);
    if (near->search->call->choice != NULL) {
        hs_chooser_set(near->search->call->choice,
                       hs_search_asking(near->search)->order[group->first], &probe.chooser);
    }
    /* Each time twice as far: some times, until hs_nearest_images_start refuses so many images. */
    for (;;) {
        /* The radius only says which images are looked at, as yet: `along` the axes that repeat. */
        group->radius = group->away > 0.0 ? hypot(group->away, along) : along;
        group->radius = hs_smaller(group->radius, hs_larger(farthest, HS_NEAREST_LEAST_RADIUS));
        const hs_status status = walk_scaled(group, &probe, &error);
        if (status != HS_OK) {
            return status;
        }
        const bool   is_all = is_open || group->radius >= farthest;
        const double far = bounder->n < near->k ? INFINITY : sqrt(bounder->least[0]) / probe.unit;
        const double enough = (far + 8.0 * sqrt(near->tree.ndim) * error) * (1.0 + BOUND_ROOM);
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

/*
 * Threads take ranges of groups.
 *
 * Asking points are taken in groups, subtrees of a few points. What lies within a radius guessed
 * from the local density is gathered once for the group, and each of its points ranks its hits.
 * Points that found too few, and groups for which the guess is of no use, are searched one by one,
 * with a radius that surely suffices: so the cost follows n and k, however unevenly points lie.
 */

/* Points of a group. Measured: from 32 to 64 the time falls by some 10 %,
 * where vectors are wide. */
#define GROUP_POINTS 48
#define AHEAD        8 /* points from prefetching a row to writing it */
/* A thread takes subtrees at a time whose groups share a walk down the tree: at most a so many-th
 * part of all points, so that there is enough for all threads, within these bounds. Measured: with
 * more points the walk is a smaller part of the work. */
#define RANGES       32
#define LEAST_RANGE  640
#define MOST_RANGE   2560
#define RANGE_GROUPS 160 /* groups of one, at most; three times as many as there usually are */
/* Candidates of a group, in points of the group and wanted ones, beyond which the guess was bad:
 * some three times as many as there are where points are evenly spread, ... */
#define MOST_CANDIDATES 24.0
/* ... and so many times more for each axis beyond the third. */
#define MOST_PER_AXIS 3.0
/* What is in reach of a group, by what it would be if reach were a cube. */
#define CUBE_OF_BALL 4.0

/* Groups, as nodes of the tree of asking points; spots are cut into several. */
typedef struct near_part {
    int32_t first, last;
} near_part;

/* What the threads share. */
typedef struct nearest_job {
    hs_nearest *near;
    near_part  *parts;
    int64_t     n_parts;
    int64_t    *ranges; /* the first part of each, and behind the last one n_parts */
    int64_t     n_ranges;
    int64_t     most_groups; /* of a range */
} nearest_job;

/* What one thread works with; rows are written where they belong, not committed. */
typedef struct nearest_worker {
    hs_committer       committer;
    const nearest_job *job;
    hs_options         options;
    hs_nearest_group  *groups; /* owned; of one range */
    hs_nearest_leaves  leaves;
    hs_nearest_block   block;
    hs_nearest_bounder bounder;
    hs_nearest_ranker  ranker;
    hs_nearest_writer  writer;
    int64_t            n_groups, n_candidates;
} nearest_worker;

/* The status of what was done for an asking point, which is named where its shift is too long. */
static hs_status
of_point(nearest_worker *worker, int32_t si, hs_status status)
{
    const hs_search *search = worker->job->near->search;
    if (status == HS_ERR_SHIFT_RANGE) {
        worker->committer.failure.row = hs_search_asking(search)->order[si];
        worker->committer.failure.in_queries = search->has_queries;
    }
    return status;
}

/* Ranks and writes those of one point's hits that count; *done: whether the group's radius
 * sufficed. */
static hs_status
finish_point(nearest_worker *worker, const hs_nearest_group *group, int32_t si, int32_t begin,
             int32_t end, bool *done)
{
    const hs_nearest_block *block = &worker->block;
    int32_t                *hits = block->hits + begin, n = end - begin;
    float                  *squares = block->has_squares ? block->squares + begin : NULL;
    int64_t                 count;
    hs_status               status = HS_OK;
    if (worker->job->near->search->call->choice != NULL) {
        status = hs_nearest_choose(&worker->ranker, si, hits, squares, &n);
        if (status != HS_OK) {
            return of_point(worker, si, status);
        }
    }
    if (squares == NULL || !hs_nearest_rank_fast(&worker->ranker, si, hits, squares, n, &count)) {
        status = hs_nearest_rank(&worker->ranker, group, si, hits, n, &count);
    }
    *done = count >= 0;
    if (status == HS_OK && *done) {
        status = of_point(worker, si, hs_nearest_write(&worker->writer, &worker->ranker, count));
    }
    return status;
}

/* Does the points of a filled block; bit t of *left: point t of the group is not done. */
static hs_status
finish_block(nearest_worker *worker, const hs_nearest_group *group, uint64_t *left)
{
    const hs_nearest *near = worker->job->near;
    const int32_t     n_points = group->last - group->first;
    int32_t           end[HS_GROUP_POINTS];
    hs_status         status = HS_OK;
    worker->n_groups++;
    worker->n_candidates += (int64_t)n_points * worker->block.n;
    *left = 0;
    for (int32_t first = 0, next; first < n_points && status == HS_OK; first = next) {
        next = hs_nearest_block_scan(near, group, &worker->block, first, end);
        for (int32_t t = first; t < next && status == HS_OK; t++) {
            const int32_t begin = t > first ? end[t - 1] : 0;
            if (t + AHEAD < n_points) {
                hs_nearest_prefetch(&worker->writer, group->first + t + AHEAD);
            }
            bool done = false;
            status = finish_point(worker, group, group->first + t, begin, end[t], &done);
            *left |= (uint64_t)!done << t;
        }
    }
    return status;
}

/* Whether points repeat without end and none of them is of the asking one's group. */
static bool
is_endless(const hs_nearest *near, int32_t si)
{
    const hs_search *search = near->search;
    hs_chooser       chooser;
    if (search->call->choice == NULL || search->call->choice->group == NULL ||
        search->scene.lattice.n_periodic == 0 || near->limit < INFINITY) {
        return false;
    }
    hs_chooser_set(search->call->choice, hs_search_asking(search)->order[si], &chooser);
    for (int64_t j = 0; j < search->bins.n; j++) {
        if (hs_chooser_is_of_group(&chooser, (int32_t)j)) {
            return false;
        }
    }
    return true;
}

/* Does one point within a radius that surely suffices; a larger one where rounding makes it fall
 * short. */
static hs_status
search_point(nearest_worker *worker, int32_t si, double guess)
{
    const hs_nearest *near = worker->job->near;
    hs_nearest_group  alone;
    uint64_t          left = 1;
    hs_nearest_group_set(near, si, si + 1, &alone);
    alone.radius = guess;
    if (is_endless(near, si)) {
        hs_nearest_write_nothing(near, hs_search_asking(near->search)->order[si], 0);
        return HS_OK;
    }
    hs_status status =
        of_point(worker, si, hs_nearest_bound(near, &worker->options, &worker->bounder, &alone));
    while (status == HS_OK && left != 0) {
        status =
            hs_nearest_block_fill(near, &worker->options, &alone, INFINITY, NULL, &worker->block);
        if (status == HS_OK) {
            status = finish_block(worker, &alone, &left);
        }
        alone.radius *= 1.5;
    }
    return status;
}

/* Candidates beyond which the guess of a group was bad. */
static double
most_candidates(const hs_nearest *near, const hs_nearest_group *group)
{
    const double more = pow(MOST_PER_AXIS, fmax(near->tree.ndim - 3.0, 0.0));
    const double wanted = (double)near->k + group->more + (group->last - group->first);
    return more * MOST_CANDIDATES * wanted + 64.0;
}

static hs_status
search_group(nearest_worker *worker, hs_nearest_group *group)
{
    const hs_nearest *near = worker->job->near;
    const int32_t     n_points = group->last - group->first;
    const double      most = most_candidates(near, group);
    uint64_t          left = UINT64_MAX;
    hs_status         status = hs_nearest_block_fill(near, &worker->options, group,
                                             n_points == 1 && group->is_complete ? INFINITY : most,
                                                     &worker->leaves, &worker->block);
    if (status == HS_OK) {
        status = finish_block(worker, group, &left);
    } else if (status == HS_TRY_OTHER) {
        status = HS_OK;
    }
    for (int32_t t = 0; t < n_points && status == HS_OK && left != 0; t++) {
        if (left >> t & 1) {
            status = search_point(worker, group->first + t, group->radius);
        }
    }
    return status;
}

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    nearest_worker    *worker = context;
    const nearest_job *job = worker->job;
    const int64_t      first = job->ranges[range];
    const int32_t      n = (int32_t)(job->ranges[range + 1] - first);
    hs_status          status = HS_OK;
    for (int32_t g = 0; g < n; g++) {
        const near_part *part = &job->parts[first + g];
        hs_nearest_group_set(job->near, part->first, part->last, &worker->groups[g]);
        hs_nearest_guess(job->near, &worker->groups[g]);
    }
    hs_nearest_leaves_find(job->near, worker->groups, n, &worker->leaves);
    for (int32_t g = 0; g < n && status == HS_OK; g++) {
        status = search_group(worker, &worker->groups[g]);
    }
    if (status == HS_OK) {
        status = hs_poll(&worker->options, (double)first / (double)job->n_parts);
    }
    return status;
}

static hs_status
open_worker(void *context, void *place)
{
    const nearest_job *job = context;
    const hs_nearest  *near = job->near;
    nearest_worker    *worker = place;
    worker->job = job;
    worker->options = near->search->call->options;
    worker->committer.options = &worker->options;
    worker->ranker = (hs_nearest_ranker){
        .near = near, .block = &worker->block, .pace = {.options = &worker->options}};
    hs_nearest_writer_init(near, &worker->writer);
    hs_status status = hs_nearest_bounder_init(near, &worker->bounder);
    if (status == HS_OK && !hs_shared_resize(near->shared, (void **)&worker->groups, 0,
                                             job->most_groups, sizeof *worker->groups)) {
        status = HS_ERR_MEMORY;
    }
    if (status == HS_OK && job->most_groups > 1) { /* one alone walks down the tree by itself */
        status = hs_nearest_leaves_init(near, &worker->leaves);
    }
    return status == HS_OK ? hs_nearest_block_init(near, &worker->block) : status;
}

static void
close_worker(void *context, void *place)
{
    const nearest_job *job = context;
    nearest_worker    *worker = place;
    const hs_stages   *stages = &worker->ranker.stages;
    const hs_counters  walked = {.groups = worker->n_groups,
                                 .candidates = worker->n_candidates,
                                 .ambiguous = worker->ranker.n_compared,
                                 .by_float64 = stages->by_float64,
                                 .by_double_word = stages->by_double_word,
                                 .by_integers = stages->by_integers};
    hs_nearest_flush(&worker->writer);
    hs_call_add_counters(job->near->search->call, &walked);
    hs_nearest_ranker_free(&worker->ranker);
    hs_nearest_bounder_free(job->near, &worker->bounder);
    hs_shared_release(job->near->shared, (void **)&worker->groups);
    hs_nearest_leaves_free(job->near, &worker->leaves);
    hs_nearest_block_free(job->near, &worker->block);
}

/* Adds the points of a node, in groups of at most `most`, to the present range and new ones. */
static void
add_parts(nearest_job *job, const hs_tree_node *node, int32_t most)
{
    for (int32_t first = node->first; first < node->end; first += most) {
        const int32_t last = node->end - first < most ? node->end : first + most;
        if (job->n_parts - job->ranges[job->n_ranges - 1] == RANGE_GROUPS) {
            job->ranges[job->n_ranges++] = job->n_parts;
        }
        job->parts[job->n_parts++] = (near_part){first, last};
    }
}

/* Whether queries lie so far apart, by how many points each one wants, that they are no group. */
static bool
is_scattered(const hs_nearest *near, const hs_tree_node *node)
{
    hs_nearest_group group;
    if (near->asking == &near->tree || hs_tree_points(node) == 1) {
        return false;
    }
    hs_nearest_group_set(near, node->first, node->end, &group);
    hs_nearest_guess(near, &group);
    const double k = (double)near->k, in_ball = k + SPREAD * sqrt(k) + group.more;
    return CUBE_OF_BALL * in_ball * hs_nearest_balls(&group, near->tree.ndim) >
           most_candidates(near, &group);
}

/* Cuts the tree into groups, the largest subtrees of at most GROUP_POINTS that are not scattered,
 * and these into ranges, which are larger subtrees. A larger leaf becomes several groups. */
static void
list_parts(nearest_job *job, const hs_tree *tree, int32_t *stack)
{
    const int32_t n = tree->nodes[0].end;
    const int32_t part = n / RANGES < MOST_RANGE ? n / RANGES : MOST_RANGE;
    const int32_t range_points = part > LEAST_RANGE ? part : LEAST_RANGE;
    int32_t       number = 0, range_end = 0;
    int64_t       n_waiting = 1; /* a node that is not looked at, for the end */
    stack[0] = 0;
    while (n_waiting > 0) {
        const hs_tree_node *node = &tree->nodes[number];
        const int32_t       points = node->end - node->first;
        const bool          is_leaf = node->left == 0;
        if (node->first >= range_end && (points <= range_points || is_leaf)) {
            job->ranges[job->n_ranges++] = job->n_parts;
            range_end = node->end;
        }
        const bool is_small = points <= GROUP_POINTS || is_leaf;
        const bool apart = is_small && is_scattered(job->near, node);
        if (is_small && (is_leaf || !apart)) {
            add_parts(job, node, apart ? 1 : GROUP_POINTS);
            number = stack[--n_waiting];
        } else {
            stack[n_waiting++] = node->left + 1;
            number = node->left;
        }
    }
    job->ranges[job->n_ranges] = job->n_parts;
    for (int64_t r = 0; r < job->n_ranges; r++) {
        const int64_t n_groups = job->ranges[r + 1] - job->ranges[r];
        job->most_groups = n_groups > job->most_groups ? n_groups : job->most_groups;
    }
}

static hs_status
search_ranges(nearest_job *job, hs_failure *failure)
{
    hs_crew crew = {.call = job->near->search->call,
                    .job = job,
                    .worker_size = sizeof(nearest_worker),
                    .open = open_worker,
                    .close = close_worker,
                    .n_ranges = job->n_ranges,
                    .search = search_range};
    return hs_crew_run(&crew, failure);
}

hs_status
hs_nearest_search(hs_nearest *near, hs_failure *failure)
{
    hs_search    *search = near->search;
    hs_account   *account = &search->call->account;
    nearest_job   job = {.near = near};
    const int64_t n = hs_search_asking(search)->n;
    for (int64_t row = 0; near->tree.n_nodes == 0 && row < n; row++) {
        hs_nearest_write_nothing(near, row, 0);
    }
    if (near->tree.n_nodes == 0 || near->asking->n_nodes == 0) {
        return HS_OK;
    }
    const int64_t most_parts = near->asking == &near->tree
                                   ? near->asking->n_nodes + n / GROUP_POINTS + 1
                                   : n; /* queries may be scattered */
    int32_t      *stack = hs_alloc(account, HS_FOR_STENCIL, near->asking->depth + 3, sizeof *stack);
    job.parts = hs_alloc(account, HS_FOR_STENCIL, most_parts, sizeof *job.parts);
    job.ranges = hs_alloc(account, HS_FOR_STENCIL, most_parts + 1, sizeof *job.ranges);
    near->shared = hs_shared_new(account, HS_FOR_CANDIDATES);
    hs_status status = HS_ERR_MEMORY;
    if (stack != NULL && job.parts != NULL && job.ranges != NULL && near->shared != NULL) {
        list_parts(&job, near->asking, stack);
        status = search_ranges(&job, failure);
    }
    hs_shared_free(near->shared);
    hs_free(account, job.ranges);
    hs_free(account, job.parts);
    hs_free(account, stack);
    return status;
}
