/* SPDX-License-Identifier: BSD-3-Clause */
#include "candidates.h"
#include "../base/status.h"
#include "../base/os.h"
#include "../exact/bounds.h"

#include <math.h>

/* candidates.c: how far a group looks, images of the points within that, leaves of the tree in
 * these, and the block of floats that they fill. */

/* How far to look, by the density of points. */

/* Relative room, far more than roundings take. */
#define RADIUS_ROOM 0x1p-40
/* The density is that of at least so many times the points that are wanted. */
#define POINTS_PER_WANTED 4.0
/* Standard deviations of their number that a first radius makes room for. Measured: with 3 the time
 * differs by less than the noise. */
#define SPREAD 3.5
/* Products of unit vectors at right angles, and the room that this takes beside squares. */
#define UPRIGHT    0x1p-40
#define LAYER_ROOM 0x1p-36
/* What a group looks at may be as large as what one of its points does, so many times for each. */
#define BALLS_A_POINT 2.0

/* Range of t_k of points [first, last), which are in order; none: from infinity to -infinity. */
static void
range_of(const hs_lattice *lattice, const hs_bins *bins, int k, int64_t first, int64_t last,
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
        range_of(lattice, bins, k, first, last, &group->t_lower[k], &group->t_upper[k]);
    }
    for (int k = 0; near->has_layer && k < bins->ndim; k++) {
        if (lattice->row_of_axis[k] < 0) {
            const double apart = hs_larger(near->layer_lower[k] - group->t_upper[k],
                                           group->t_lower[k] - near->layer_upper[k]);
            const double surely = apart - 4.0 * near->search->scene.t_error[k];
            group->away = hypot(hs_larger(surely, 0.0), group->away);
        }
    }
    group->away *= 1.0 - LAYER_ROOM;
}

double
hs_nearest_farthest(const hs_nearest *near, const hs_nearest_group *group)
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

/* The node around the group with at least so many points, and its sides; *away: how far from it
 * the group is. */
static const hs_tree_node *
find_node(const hs_tree *tree, const double *middle, double least, double *sides, double *away)
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
            for (int side = 0; side < 2; side++) {
                const double below = bounds[4 * k + side] - middle[k];
                gap[side] += hs_larger(hs_larger(below, middle[k] - bounds[4 * k + 2 + side]), 0.0);
            }
        }
        const int     side = gap[1] < gap[0];
        const int32_t next = left + side;
        if (left == 0 || hs_tree_points(&tree->nodes[next]) < least) {
            return &tree->nodes[number];
        }
        *away = gap[side];
        number = next;
        for (int k = 0; k < d; k++) {
            sides[k] = bounds[4 * k + 2 + side] - bounds[4 * k + side];
        }
    }
}

void
hs_nearest_guess(const hs_nearest *near, double scale, hs_nearest_group *group)
{
    const hs_tree    *tree = &near->tree;
    const hs_lattice *lattice = &near->search->scene.lattice;
    const int         d = tree->ndim;
    const double      k = (double)near->k + near->omits_self, wanted = k + SPREAD * sqrt(k) + 1.0;
    double            middle[HS_MAX_DIM], sides[HS_MAX_DIM], away, outside = 0.0;
    bool              whole[HS_MAX_DIM]; /* the node goes on along this side */
    for (int c = 0; c < d; c++) {
        middle[c] = group->lower[c] + 0.5 * (group->upper[c] - group->lower[c]);
    }
    const hs_tree_node *node =
        find_node(tree, middle, POINTS_PER_WANTED * hs_larger(wanted, 16.0), sides, &away);
    for (int c = 0; c < d; c++) {
        whole[c] = node == tree->nodes && lattice->row_of_axis[c] >= 0;
        sides[c] = whole[c] ? lattice->period[c] : sides[c];
    }
    /* Sides that are shorter than the ball is wide do not count: points on a line or in a plane
     * have the density of their line or plane. Base 2 logarithms, as products might overflow. */
    const double width = exp2(log2(hs_ball_volume(d, 1.0)) / d);
    double       radius = 0.0, before;
    do {
        double sum = log2(wanted / hs_tree_points(node));
        int    n = 0;
        before = radius;
        for (int c = 0; c < d; c++) {
            if (sides[c] > 0.0 && (whole[c] || sides[c] >= before * width)) {
                sum += log2(sides[c]);
                n++;
            }
        }
        radius = n > 0 ? hs_larger(exp2(sum / n) / width, before) : before;
    } while (radius > before);
    if (near->least > 0.0) { /* a shell around a ball holds as many as are wanted */
        const double ratio = pow(near->least / radius, d);
        const double wider = radius * pow(1.0 + ratio, 1.0 / d);
        group->more = wanted * ratio;
        radius = wider < INFINITY ? wider : near->least;
    }
    /* A ball that sticks out of all points along open axes holds fewer; where they are less wide
     * than the ball, the density says so already. */
    for (int c = 0; c < d; c++) {
        const double below = hs_smaller(middle[c] - tree->lower[c], radius);
        const double above = hs_smaller(tree->upper[c] - middle[c], radius);
        const bool   is_wide = tree->upper[c] - tree->lower[c] >= 2.0 * radius;
        if (is_wide && lattice->n_periodic < d &&
            (!lattice->aligned || lattice->row_of_axis[c] < 0)) {
            outside -= log2(fmin(fmax((below + above) / (2.0 * radius), 0.5), 1.0));
        }
    }
    radius = scale * (radius * exp2(outside / d) + away);
    const double farthest = hs_nearest_farthest(near, group);
    group->is_complete = radius >= farthest ||
                         (lattice->n_periodic == 0 && (double)tree->nodes[0].end <= k);
    group->radius = hs_larger(group->is_complete ? farthest : radius, HS_NEAREST_LEAST_RADIUS);
}

bool
hs_nearest_is_scattered(const hs_nearest *near, const hs_nearest_group *group)
{
    double balls = 1.0;
    for (int k = 0; k < near->tree.ndim; k++) {
        balls *= 1.0 + (group->upper[k] - group->lower[k]) / (2.0 * group->radius);
    }
    const int n = group->last - group->first;
    return balls > BALLS_A_POINT * n || group->more > (double)near->k + n;
}

/* Which images of the points can be near a group, by the range of its t_k along each periodic
 * axis. */

#define UNIT 0x1p-53
/* In periods: far more than the rounding of a quotient of ordinary size, ... */
#define SLACK 0x1p-20
/* ... and of the quotient itself where it is large. */
#define RELATIVE_SLACK 0x1p-40
#define MOST_SHIFTS    0x1p30 /* they are int32, with room for sums of two */
/* More images than these take minutes: they are refused, unless k is so large that all neighbours
 * may be images of one point. A box around a ball in 8 dimensions is 63 times as large. */
#define MOST_IMAGES        0x1p24
#define IMAGES_A_NEIGHBOUR 1024.0

/* Whether unit normals of open axes are at right angles to all others, as nearly as rounding lets
 * them. */
static bool
is_upright(const hs_lattice *lattice)
{
    for (int k = 0; k < lattice->ndim; k++) {
        for (int open = 0; !lattice->aligned && open < lattice->ndim; open++) {
            double product = 0.0;
            for (int c = 0; c < lattice->ndim; c++) {
                product += lattice->normal[k][c] * lattice->normal[open][c];
            }
            if (open != k && lattice->row_of_axis[open] < 0 && fabs(product) > UPRIGHT) {
                return false;
            }
        }
    }
    return lattice->n_periodic > 0 && lattice->n_periodic < lattice->ndim;
}

void
hs_nearest_measure(hs_nearest *near)
{
    const hs_lattice *lattice = &near->search->scene.lattice;
    const hs_bins    *bins = &near->search->bins;
    const int         d = lattice->ndim;
    near->smallest_period = INFINITY;
    for (int k = 0; k < d; k++) {
        if (lattice->row_of_axis[k] >= 0) {
            near->smallest_period = hs_smaller(lattice->period[k], near->smallest_period);
        }
        for (int r = 0; r < lattice->n_periodic; r++) {
            double along = 0.0, largest = 0.0;
            for (int c = 0; !lattice->aligned && c < d; c++) {
                along += lattice->normal[k][c] * lattice->rows[r][c];
                largest = hs_larger(fabs(lattice->rows[r][c]), largest);
            }
            if (!lattice->aligned && lattice->row_of_axis[k] == r) {
                along -= lattice->period[k];
            }
            near->drift[k][r] = lattice->aligned ? 0.0
                                                 : fabs(along) + (d + 2) * d * UNIT * largest +
                                                       d * lattice->row_error[r];
        }
    }
    near->has_layer = bins->n > 0 && is_upright(lattice);
    for (int k = 0; near->has_layer && k < d; k++) {
        const int64_t n = lattice->row_of_axis[k] < 0 ? bins->n : 0;
        range_of(lattice, bins, k, 0, n, &near->layer_lower[k], &near->layer_upper[k]);
    }
}

/* Shifts along the row of B of axis k, at most most[r] of them; false when too many. */
static bool
set_range(const hs_nearest *near, const hs_nearest_group *group, int k, const double *most,
          hs_nearest_images *images)
{
    const hs_scene   *scene = &near->search->scene;
    const hs_lattice *lattice = &scene->lattice;
    const double      period = lattice->period[k];
    /* What the distance to the layer leaves of the radius. */
    const double ratio = hs_smaller(group->away / group->radius, 1.0); /* squares overflow */
    const double along =
        group->radius * (sqrt((1.0 - ratio) * (1.0 + ratio) + LAYER_ROOM) + UPRIGHT);
    double reach = along * (1.0 + RELATIVE_SLACK) + 2.0 * scene->t_error[k];
    for (int r = 0; r < lattice->n_periodic; r++) {
        reach += (most[r] + 1.0) * near->drift[k][r];
    }
    const double low = (group->t_lower[k] - scene->upper[k] - reach) / period;
    const double high = (group->t_upper[k] - scene->lower[k] + reach) / period;
    const double first = ceil(low - SLACK - RELATIVE_SLACK * fabs(low));
    const double last = floor(high + SLACK + RELATIVE_SLACK * fabs(high));
    if (!(fabs(first) < MOST_SHIFTS && fabs(last) < MOST_SHIFTS)) {
        return false;
    }
    const int row = lattice->row_of_axis[k];
    images->low[row] = (int64_t)first;
    images->high[row] = (int64_t)last;
    return true;
}

hs_status
hs_nearest_images_start(const hs_nearest *near, const hs_nearest_group *group,
                        hs_nearest_images *images)
{
    const hs_scene   *scene = &near->search->scene;
    const hs_lattice *lattice = &scene->lattice;
    const double      roundings = 2 * lattice->n_periodic + 4;
    double            most[HS_MAX_DIM] = {0.0}, error = 0.0;
    *images = (hs_nearest_images){.lattice = lattice, .count = 1.0};
    /* The drift depends on the largest shifts, and these a little on the drift. */
    for (int pass = 0; group != NULL && pass < (lattice->aligned ? 1 : 3); pass++) {
        for (int k = 0; k < lattice->ndim; k++) {
            if (lattice->row_of_axis[k] >= 0 && !set_range(near, group, k, most, images)) {
                return HS_TRY_OTHER;
            }
        }
        for (int r = 0; r < lattice->n_periodic; r++) {
            most[r] = hs_larger(fabs((double)images->low[r]), fabs((double)images->high[r]));
        }
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        images->count *= hs_larger((double)(images->high[r] - images->low[r] + 1), 0.0);
    }
    /* Of X_j + moved, by the rule of docs/exactness.md for gathered candidates. */
    for (int c = 0; c < scene->ndim; c++) {
        double moved = 0.0, row_errors = 0.0;
        for (int r = 0; r < lattice->n_periodic; r++) {
            moved += most[r] * fabs(lattice->rows[r][c]);
            row_errors += most[r] * lattice->row_error[r];
        }
        if (moved > 0.0) {
            error = hs_larger(roundings * UNIT * (moved + 2.0 * scene->x_largest[c]) + row_errors,
                              error);
        }
    }
    images->error = error + 2.0 * scene->x_error;
    return images->count < fmax(MOST_IMAGES, IMAGES_A_NEIGHBOUR * (double)near->k) ? HS_OK
                                                                                   : HS_TRY_OTHER;
}

bool
hs_nearest_images_next(hs_nearest_images *images)
{
    const hs_lattice *lattice = images->lattice;
    hs_nearest_image *next = &images->next;
    int64_t           rest = images->n_met++;
    if ((double)rest >= images->count) {
        return false;
    }
    *next = (hs_nearest_image){.is_home = true};
    for (int r = 0; r < lattice->n_periodic; r++) { /* the first row fastest */
        const int64_t n = images->high[r] - images->low[r] + 1;
        next->shift[r] = (int32_t)(images->low[r] + rest % n);
        next->is_home = next->is_home && next->shift[r] == 0;
        rest /= n;
        for (int c = 0; c < lattice->ndim; c++) {
            next->moved[c] += next->shift[r] * lattice->rows[r][c];
        }
    }
    return true;
}

void
hs_nearest_frame_set(int ndim, double unit, double error, double reach, hs_nearest_frame *frame)
{
    const double along = sqrt(ndim) * error;
    *frame = (hs_nearest_frame){unit, error, reach,
                                .flat_error = 2.1 * along * (reach + along) + 0x1p-1000};
    /* 2 e |D| + e^2, and what underflow may lose. */
}

/* One walk for the box of all groups, in float32 units around its centre; then the kernel lists
 * each group's leaves. */

#define MOST_LEAVES      4096 /* with more, each point walks down the tree by itself */
#define MOST_LEAF_IMAGES 512
/* In units, where the radius is between 1 and 2: floats tell leaves apart, and relative to the
 * centre of a group, distances. */
#define WIDEST_LEAF 128.0
/* Least radius, in errors of shifted coordinates: floats tell nothing of smaller ones. */
#define LEAST_IN_ERRORS 1024.0
/* Relative room, far more than roundings of floats take. */
#define LEAF_ROOM 0x1p-18
/* Error on each axis as a fraction of the extent: two roundings to floats and one of their
 * difference, twice. */
#define AXIS_ERROR 0x1p-21

/* Sets the addresses of parts that become one array of the threads' memory. */
static bool
allocate(const hs_nearest *near, const hs_parts *parts, void **memory)
{
    if (!hs_shared_resize(near->shared, memory, 0, (int64_t)parts->bytes, 1)) {
        return false;
    }
    for (int p = 0; p < parts->n; p++) {
        *parts->part[p].to = (char *)*memory + parts->part[p].at;
    }
    return true;
}

/* Room for the leaves of the tree in all images, if they are few. */
static hs_status
open_leaves(const hs_nearest *near, hs_nearest_leaves *leaves)
{
    const int     images = near->search->bins.n_periodic > 0 ? MOST_LEAF_IMAGES : 1;
    const int64_t all = (near->tree.n_nodes + INT64_C(1)) / 2 * images;
    const int64_t room = (all < MOST_LEAVES ? all : MOST_LEAVES) + HS_PADDING;
    hs_parts      parts;
    if (leaves->memory != NULL) {
        return HS_OK;
    }
    hs_parts_begin(&parts);
    for (int k = 0; k < near->tree.ndim; k++) {
        hs_parts_add(&parts, (void **)&leaves->low[k], room, sizeof(float));
        hs_parts_add(&parts, (void **)&leaves->high[k], room, sizeof(float));
    }
    hs_parts_add(&parts, (void **)&leaves->runs, room, sizeof *leaves->runs);
    hs_parts_add(&parts, (void **)&leaves->joined, room, sizeof *leaves->joined);
    hs_parts_add(&parts, (void **)&leaves->label, room, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&leaves->hits, room, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&leaves->images, MOST_LEAF_IMAGES, sizeof *leaves->images);
    hs_parts_add(&parts, (void **)&leaves->stack, near->tree.depth + 2, sizeof(int32_t));
    if (!allocate(near, &parts, &leaves->memory)) {
        return HS_ERR_MEMORY;
    }
    for (int32_t c = 0; c < room; c++) {
        leaves->label[c] = c;
    }
    return HS_OK;
}

/* Number x in units, from the centre, and no further than the extent, which nothing in reach is. */
HS_ALWAYS_INLINE float
clamped(double x, double centre, double unit, double extent)
{
    const double y = (x - centre) * unit;
    return (float)hs_larger(hs_smaller(y, extent), -extent);
}

/* The same relative to the centre of all groups. */
HS_ALWAYS_INLINE float
relative(const hs_nearest_leaves *leaves, int k, double x)
{
    return clamped(x, leaves->centre[k], leaves->unit, leaves->extent);
}

/* Adds a leaf, of a spot no more points than can be of use: k of them, and the asking one. */
static void
add_leaf(const hs_nearest *near, int32_t number, hs_nearest_leaves *leaves)
{
    const hs_tree_node *node = &near->tree.nodes[number];
    const int           d = near->tree.ndim, side = (number + 1) % 2;
    const int64_t       n = hs_tree_points(node), most = node->is_spot ? near->k + 1 : n;
    const double       *moved = leaves->images[leaves->n_images - 1].moved;
    for (int k = 0; k < d; k++) {
        const double *bounds = hs_tree_bounds(&near->tree, number - side, d) + 4 * k + side;
        const double  low = number > 0 ? bounds[0] : near->tree.lower[k];
        const double  high = number > 0 ? bounds[2] : near->tree.upper[k];
        leaves->low[k][leaves->n] = relative(leaves, k, low + moved[k]);
        leaves->high[k][leaves->n] = relative(leaves, k, high + moved[k]);
    }
    leaves->runs[leaves->n] =
        (hs_nearest_run){0, (int32_t)(n < most ? n : most), node->first, leaves->n_images - 1};
    leaves->n_points += leaves->runs[leaves->n++].n;
}

/* Adds the leaves of the last image whose squared distance is within `limit`; false when there are
 * too many. */
static bool
find_leaves_in_image(const hs_nearest *near, const hs_nearest_group *group, double limit,
                     double most, hs_nearest_leaves *leaves)
{
    const hs_tree *tree = &near->tree;
    const int      ndim = tree->ndim;
    const double  *moved = leaves->images[leaves->n_images - 1].moved;
    double         low[HS_MAX_DIM] = {0.0}, high[HS_MAX_DIM] = {0.0};
    int64_t        n_waiting = 0;
    int32_t        number = 0;
    for (int k = 0; k < ndim; k++) {
        low[k] = group->lower[k] - moved[k];
        high[k] = group->upper[k] - moved[k];
    }
    if (hs_tree_gap(tree, low, high, leaves->unit) > limit) {
        return true;
    }
    for (;;) {
        const hs_tree_node *node = &tree->nodes[number];
        const int32_t       left = node->left;
        double              gap[2] = {INFINITY, INFINITY};
        HS_PREFETCH(&tree->nodes[left]);
        if (left != 0) {
            hs_tree_gaps(hs_tree_bounds(tree, left, ndim), low, high, leaves->unit, ndim, gap);
        } else if (leaves->n == MOST_LEAVES || (double)leaves->n_points > most ||
                   (node->is_spot && near->search->call->choice != NULL &&
                    hs_tree_points(node) > near->k)) {
            return false; /* too many, or a spot of which it is not known which k points count */
        } else {
            add_leaf(near, number, leaves);
        }
        if (gap[0] <= limit) { /* the first child first */
            leaves->stack[n_waiting] = left + 1;
            n_waiting += gap[1] <= limit;
            number = left;
        } else if (gap[1] <= limit) {
            number = left + 1;
        } else if (n_waiting > 0) {
            number = leaves->stack[--n_waiting];
        } else {
            return true;
        }
    }
}

hs_status
hs_nearest_leaves_find(const hs_nearest *near, const hs_nearest_group *group, double most,
                       hs_nearest_leaves *leaves)
{
    hs_nearest_images images;
    const int         d = near->tree.ndim;
    double            widest = 0.0;
    bool              fit = true;
    leaves->radius = 0.0;
    if (open_leaves(near, leaves) != HS_OK) {
        return HS_ERR_MEMORY;
    }
    leaves->unit = hs_power_of_two(-ilogb(group->radius));
    for (int k = 0; k < d; k++) {
        const double width = group->upper[k] - group->lower[k];
        leaves->centre[k] = group->lower[k] + 0.5 * width;
        widest = hs_larger(width * leaves->unit, widest);
    }
    leaves->extent = 0.5 * widest + 4.0;
    if (!(widest < WIDEST_LEAF) || hs_nearest_images_start(near, group, &images) != HS_OK ||
        images.count > MOST_LEAF_IMAGES || images.error * leaves->unit > LEAF_ROOM) {
        return HS_OK;
    }
    leaves->error = images.error;
    const double reach = group->radius * leaves->unit * (1.0 + LEAF_ROOM) +
                         4.0 * sqrt(d) * images.error * leaves->unit;
    const double limit = reach * reach;
    leaves->n = leaves->n_images = 0;
    leaves->n_points = 0;
    while (fit && hs_nearest_images_next(&images)) {
        const int32_t n = leaves->n;
        leaves->images[leaves->n_images++] = images.next;
        fit = find_leaves_in_image(near, group, limit, most, leaves);
        leaves->n_images -= leaves->n == n; /* nothing there */
    }
    leaves->radius = fit ? group->radius : 0.0;
    return HS_OK;
}

/* The block: runs first, then a unit for which the radius is between 1 and 2, then the kernel
 * copies. */

/* Relative room, far more than roundings take. */
#define BLOCK_ROOM 0x1p-30
/* Candidates for which there is room at first. */
#define FIRST_CAPACITY 1024
/* With more to be found there are more hits than a kernel puts in order. */
#define MOST_BY_SQUARES (HS_ORDER_MOST / 2)
#define LARGEST_SQUARE  0x1p60 /* far from where float32 ends */

/* Makes room for n candidates, and for what kernels read and write beyond. */
static bool
reserve(const hs_nearest *near, hs_nearest_block *block, int64_t n)
{
    const int64_t capacity = n + n / 2 + FIRST_CAPACITY, room = capacity + HS_PADDING;
    hs_parts      parts;
    if (n <= block->capacity && block->capacity > 0) {
        return true;
    }
    block->capacity = 0;
    hs_parts_begin(&parts);
    for (int k = 0; k < near->tree.ndim; k++) {
        hs_parts_add(&parts, (void **)&block->y[k], room, sizeof(float));
    }
    hs_parts_add(&parts, (void **)&block->number, room, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&block->image_of, room, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&block->place, room, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&block->unsure, room, sizeof(hs_unsure));
    hs_parts_add(&parts, (void **)&block->hits, 2 * capacity + HS_PADDING, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&block->squares, 2 * capacity + HS_PADDING, sizeof(float));
    if (!allocate(near, &parts, &block->memory)) {
        return false;
    }
    for (int64_t c = 0; c < room; c++) {
        block->place[c] = (int32_t)c;
    }
    block->capacity = (int32_t)capacity;
    return true;
}

/* Sets runs: points of the leaves in reach, those that follow one another together. */
static void
find_runs(const hs_nearest *near, const hs_nearest_group *group, const hs_nearest_leaves *leaves,
          hs_nearest_block *block)
{
    const int    d = near->tree.ndim;
    const double reach =
        group->radius * leaves->unit * (1.0 + LEAF_ROOM) +
        sqrt(d) * (4.0 * leaves->error * leaves->unit + AXIS_ERROR * leaves->extent);
    hs_boxes boxes = {.ndim = d,
                      .n = leaves->n,
                      .label = leaves->label,
                      .hits = leaves->hits,
                      .out = (float)(reach * reach * (1.0 + LEAF_ROOM))};
    for (int k = 0; k < d; k++) {
        boxes.low[k] = leaves->low[k];
        boxes.high[k] = leaves->high[k];
        boxes.from[k] = relative(leaves, k, group->lower[k]);
        boxes.to[k] = relative(leaves, k, group->upper[k]);
    }
    const int32_t n = near->search->call->kernel->near_boxes(&boxes); /* hits ascend */
    block->n = block->n_runs = 0;
    for (int32_t l = 0; l < n; l++) {
        const hs_nearest_run *leaf = &leaves->runs[leaves->hits[l]];
        hs_nearest_run       *last = block->n_runs > 0 ? &block->runs[block->n_runs - 1] : NULL;
        if (last != NULL && last->image == leaf->image && last->si + last->n == leaf->si) {
            last->n += leaf->n;
        } else {
            block->runs[block->n_runs] = *leaf;
            block->runs[block->n_runs++].at = block->n;
        }
        block->n += leaf->n;
    }
}

/* Largest |y| and |q| together, as floats, which round up. */
static double
scan_extent(const hs_nearest_block *block)
{
    return 2.0 * block->extent * (1.0 + 0x1p-20);
}

/* Whether squares in float32 may do: where there are hits enough for all that are wanted, but not
 * more than a kernel puts in order. */
static void
choose_squares(const hs_nearest *near, const hs_nearest_group *group, hs_nearest_block *block)
{
    const hs_nearest_frame *frame = &block->frame;
    double                  in, out;
    block->has_squares = false;
    if (group->is_complete || near->k > MOST_BY_SQUARES ||
        near->limit * frame->unit < frame->reach || near->search->call->choice != NULL) {
        return;
    }
    hs_threshold_bounds(near->tree.ndim, frame->reach, scan_extent(block), frame->error,
                        HS_FILTER_UNIT, HS_FILTER_TINY, &in, &out);
    const double square = frame->reach * frame->reach;
    /* The radius is 1024 errors at least, and the extent some hundred radii at most. */
    HS_ASSERT(in > 0.0 && out < LARGEST_SQUARE);
    block->has_squares = true;
    block->square_error = hs_larger(square - in, out - square) * (1.0 + BLOCK_ROOM);
}

/* Copies coordinates of the group and of all candidates, relative to its centre. */
static void
gather(const hs_nearest *near, const hs_nearest_group *group, hs_nearest_block *block)
{
    const hs_bins   *asking = hs_search_asking(near->search);
    hs_relative_keys keys = {.ndim = near->tree.ndim,
                             .images = block->images,
                             .unit = block->frame.unit,
                             .extent = block->extent,
                             .number = block->number};
    for (int k = 0; k < near->tree.ndim; k++) {
        keys.x[k] = near->search->bins.x[k];
        keys.y[k] = block->y[k];
        keys.centre[k] = group->lower[k] + 0.5 * (group->upper[k] - group->lower[k]);
        for (int32_t t = 0; t < group->last - group->first; t++) {
            block->q[k][t] =
                clamped(asking->x[k][group->first + t], keys.centre[k], keys.unit, keys.extent);
        }
    }
    near->search->call->kernel->gather_relative(&keys, block->runs, block->n_runs);
    for (int k = 0; k < near->tree.ndim; k++) {
        hs_pad_lanes(block->y[k], block->n);
    }
    for (int32_t r = 0; r < block->n_runs; r++) {
        int32_t *image_of = block->image_of + block->runs[r].at;
        for (int32_t c = 0; c < block->runs[r].n; c++) {
            image_of[c] = block->runs[r].image;
        }
    }
}

hs_status
hs_nearest_block_fill(const hs_nearest *near, const hs_options *options,
                      const hs_nearest_group *group, double most, const hs_nearest_leaves *leaves,
                      hs_nearest_block *block)
{
    const double unit = hs_power_of_two(-ilogb(group->radius));
    double       widest = 0.0;
    if (group->radius > leaves->radius || group->radius < LEAST_IN_ERRORS * leaves->error) {
        return HS_TRY_OTHER;
    }
    hs_nearest_frame_set(near->tree.ndim, unit, leaves->error * unit, group->radius * unit,
                         &block->frame);
    for (int k = 0; k < near->tree.ndim; k++) {
        widest = hs_larger((group->upper[k] - group->lower[k]) * unit, widest);
    }
    block->extent = 0.5 * widest + 4.0; /* beyond the radius, by more than roundings take */
    block->images = leaves->images;
    block->runs = leaves->joined;
    find_runs(near, group, leaves, block);
    if (block->n > most) {
        return HS_TRY_OTHER;
    }
    if (!reserve(near, block, block->n)) {
        return HS_ERR_MEMORY;
    }
    choose_squares(near, group, block);
    gather(near, group, block);
    return block->n > HS_POLL_POINTS ? hs_poll(options, 0.0) : HS_OK;
}

int32_t
hs_nearest_block_scan(const hs_nearest *near, const hs_nearest_group *group,
                      hs_nearest_block *block, int32_t first, int32_t *end)
{
    const int    d = near->tree.ndim;
    const double extent = scan_extent(block), reach = block->frame.reach;
    hs_scan      scan = {.ndim = d,
                         .form = block->has_squares ? HS_SCAN_SQUARES : HS_SCAN_DIRECT,
                         .squares = block->squares,
                         .label = block->place,
                         .n = block->n,
                         .n_points = group->last - group->first,
                         .hits = block->hits,
                         .end = end,
                         .unsure = block->unsure,
                         .most_hits = 2 * block->capacity,
                         .most_unsure = block->capacity};
    for (int k = 0; k < d; k++) {
        scan.y[k] = block->y[k];
        scan.q[k] = block->q[k];
    }
    /* rank.c decides: no hit is unsure here. */
    scan.direct = hs_thresholds_of(d, reach, extent, block->frame.error);
    scan.direct.in = INFINITY;
    return near->search->call->kernel->scan(&scan, first);
}
