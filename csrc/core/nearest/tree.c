/* SPDX-License-Identifier: BSD-3-Clause */
/* tree.c: splits nodes at a sampled middle, the smaller half first; bounds are filled from the
 * leaves up. */
#include "tree.h"

#include "../base/poll.h"

#include <string.h>

/* Points that say where a node is split: enough for halves of 35 to 65 of 100. */
#define SAMPLE       15
#define LARGE_SAMPLE 63
#define FEW_SAMPLE   7
/* Nodes with more points than this are worth a larger sample, with fewer a smaller one. */
#define LARGE_NODE 4096
#define SMALL_NODE 32

/* Nodes that wait: the smaller half is always split first, so they are fewer than bits of n. */
#define MOST_WAITING 64

typedef struct tree_builder {
    hs_account       *account;
    const hs_options *options;
    const hs_bins    *bins;
    hs_tree          *tree;
    int32_t          *order;
    int32_t          *aside; /* room for n numbers */
    int32_t           leaf_points;
    int64_t           work; /* points that were moved since the last poll */
} tree_builder;

/* Where a node is split: what is below the pivot goes left. */
typedef struct tree_cut {
    int    axis;
    double pivot;
} tree_cut;

static bool
grow(tree_builder *builder)
{
    hs_tree      *tree = builder->tree;
    const int32_t capacity = tree->capacity < INT32_MAX / 2 ? 2 * tree->capacity : INT32_MAX;
    if (tree->capacity == INT32_MAX) {
        return false;
    }
    hs_tree_node *nodes = hs_grow(builder->account, HS_FOR_CELLS, tree->nodes, tree->n_nodes,
                                  capacity, sizeof *nodes);
    if (nodes == NULL) {
        return false;
    }
    tree->nodes = nodes;
    tree->capacity = capacity;
    return true;
}

static void
sort_numbers(double *numbers, int n)
{
    for (int i = 1; i < n; i++) {
        const double number = numbers[i];
        int          at = i;
        for (; at > 0 && numbers[at - 1] > number; at--) {
            numbers[at] = numbers[at - 1];
        }
        numbers[at] = number;
    }
}

/* Finds where to split, by a sample picked evenly from the node; false when it is all in
 * one place. */
static bool
cut_by_sample(const tree_builder *builder, const hs_tree_node *node, tree_cut *cut)
{
    const int32_t  n = node->end - node->first;
    const int      m = n > LARGE_NODE ? LARGE_SAMPLE : n > SMALL_NODE ? SAMPLE : FEW_SAMPLE;
    const int32_t *order = builder->order + node->first;
    int32_t        picked[LARGE_SAMPLE];
    double         numbers[LARGE_SAMPLE], widest = 0.0;
    HS_ASSERT(n >= m); /* leaves hold as many as the smallest sample */
    for (int s = 0; s < m; s++) {
        picked[s] = order[(int64_t)n * (2 * s + 1) / (2 * m)];
    }
    for (int k = 0; k < builder->bins->ndim; k++) {
        const double *x = builder->bins->x[k];
        double        low = x[picked[0]], high = low;
        for (int s = 1; s < m; s++) {
            low = hs_smaller(x[picked[s]], low);
            high = hs_larger(x[picked[s]], high);
        }
        if (high - low > widest) {
            widest = high - low;
            cut->axis = k;
        }
    }
    if (widest == 0.0) {
        return false;
    }
    for (int s = 0; s < m; s++) {
        numbers[s] = builder->bins->x[cut->axis][picked[s]];
    }
    sort_numbers(numbers, m);
    int middle = m / 2;
    while (numbers[middle] == numbers[0]) { /* something must be below */
        middle++;
    }
    cut->pivot = numbers[middle];
    return true;
}

/* Finds where to split, by all points; false when they are all in one place. */
static bool
cut_by_range(const tree_builder *builder, const hs_tree_node *node, tree_cut *cut)
{
    double widest = 0.0;
    for (int k = 0; k < builder->bins->ndim; k++) {
        const double *x = builder->bins->x[k];
        double        low = x[builder->order[node->first]], high = low;
        for (int32_t at = node->first + 1; at < node->end; at++) {
            low = hs_smaller(x[builder->order[at]], low);
            high = hs_larger(x[builder->order[at]], high);
        }
        if (high - low > widest) {
            const double middle = low + 0.5 * (high - low);
            widest = high - low;
            *cut = (tree_cut){k, middle > low ? middle : high};
        }
    }
    return widest > 0.0;
}

/* Points whose X are equal: are they equal as given? */
static bool
is_spot(const tree_builder *builder, const hs_tree_node *node)
{
    const hs_bins *bins = builder->bins;
    for (int k = 0; bins->keeps_originals && k < bins->ndim; k++) {
        const double *given = bins->originals[k];
        const double  first = given[builder->order[node->first]];
        for (int32_t at = node->first + 1; at < node->end; at++) {
            if (given[builder->order[at]] != first) {
                return false;
            }
        }
    }
    return true;
}

/* Partitions the points of a node, keeping the order on both sides; returns where the right one
 * begins. */
static int32_t
part_points(tree_builder *builder, const hs_tree_node *node, const tree_cut *cut)
{
    const double        *x = builder->bins->x[cut->axis];
    int32_t             *order = builder->order;
    int32_t *HS_RESTRICT aside = builder->aside;
    int32_t              left = node->first, right = 0;
    for (int32_t at = node->first; at < node->end; at++) {
        const int32_t i = order[at];
        const int32_t below = x[i] < cut->pivot;
        order[left] = i;
        aside[right] = i;
        left += below;
        right += 1 - below;
    }
    memcpy(order + left, aside, (size_t)right * sizeof *order);
    return left;
}

/* Gives the node two children; false when it stays a leaf. */
static bool
split(tree_builder *builder, int32_t number, hs_status *status)
{
    hs_tree      *tree = builder->tree;
    hs_tree_node *node = &tree->nodes[number];
    tree_cut      cut;
    if (node->end - node->first <= builder->leaf_points) {
        return false;
    }
    if (!cut_by_sample(builder, node, &cut) && !cut_by_range(builder, node, &cut)) {
        node->is_spot = is_spot(builder, node);
        return false;
    }
    if (tree->n_nodes + 2 > tree->capacity && !grow(builder)) {
        *status = HS_ERR_MEMORY;
        return false;
    }
    node = &tree->nodes[number];
    const int32_t middle = part_points(builder, node, &cut);
    builder->work += node->end - node->first;
    node->left = tree->n_nodes;
    tree->nodes[tree->n_nodes++] = (hs_tree_node){.first = node->first, .end = middle};
    tree->nodes[tree->n_nodes++] = (hs_tree_node){.first = middle, .end = node->end};
    return true;
}

static hs_status
split_all(tree_builder *builder)
{
    int32_t   waiting[MOST_WAITING];
    int       n_waiting = 1;
    hs_status status = HS_OK;
    waiting[0] = 0;
    while (n_waiting > 0 && status == HS_OK) {
        const int32_t number = waiting[--n_waiting];
        if (split(builder, number, &status)) {
            const hs_tree_node *nodes = builder->tree->nodes;
            const int32_t       left = nodes[number].left;
            const bool          left_is_larger = nodes[left].end - nodes[left].first >
                                        nodes[left + 1].end - nodes[left + 1].first;
            waiting[n_waiting++] = left_is_larger ? left : left + 1;
            waiting[n_waiting++] = left_is_larger ? left + 1 : left;
        }
        if (status == HS_OK && builder->work > HS_POLL_POINTS) {
            builder->work = 0;
            status = hs_poll(builder->options, 0.0);
        }
    }
    return status;
}

/* Sets the range of a leaf from its points, which are in tree order by now; of another node, from
 * its children. */
static void
bound_axis(const hs_bins *bins, const hs_tree *tree, int32_t number, int k, double *range)
{
    const hs_tree_node *node = &tree->nodes[number];
    if (node->left != 0) {
        const double *of = hs_tree_bounds(tree, node->left, tree->ndim) + 4 * k;
        range[0] = hs_smaller(of[0], of[1]);
        range[1] = hs_larger(of[2], of[3]);
        return;
    }
    const double *x = bins->x[k];
    double        low = x[node->first], high = low;
    for (int32_t si = node->first + 1; si < node->end; si++) {
        low = hs_smaller(x[si], low);
        high = hs_larger(x[si], high);
    }
    range[0] = low;
    range[1] = high;
}

/* Children come after their parents, so this is done from the last node to the first. */
static void
bound_nodes(const hs_bins *bins, hs_tree *tree)
{
    const int d = tree->ndim;
    double    range[2];
    for (int32_t number = tree->n_nodes - 1; number > 0; number--) {
        const int side = (number - 1) % 2;
        double   *of = tree->bounds + (int64_t)(number - 1 - side) * 2 * d;
        for (int k = 0; k < d; k++) {
            bound_axis(bins, tree, number, k, range);
            of[4 * k + side] = range[0];
            of[4 * k + 2 + side] = range[1];
        }
    }
    for (int k = 0; k < d; k++) {
        bound_axis(bins, tree, 0, k, range);
        tree->lower[k] = range[0];
        tree->upper[k] = range[1];
    }
}

/* Steps down to each node, kept for a moment where the bounds will be. */
static int
measure_depth(hs_tree *tree)
{
    double *steps = tree->bounds;
    int     deepest = 0;
    steps[0] = 0.0;
    for (int32_t number = 0; number < tree->n_nodes; number++) {
        const int32_t left = tree->nodes[number].left;
        deepest = (int)hs_larger(steps[number], (double)deepest);
        if (left != 0) {
            steps[left] = steps[left + 1] = steps[number] + 1.0;
        }
    }
    return deepest;
}

static hs_status
build_nodes(tree_builder *builder)
{
    hs_tree       *tree = builder->tree;
    const hs_bins *bins = builder->bins;
    for (int64_t i = 0; i < bins->n; i++) {
        bins->order[i] = (int32_t)i;
    }
    if (bins->n == 0) {
        return HS_OK;
    }
    /* Room for half full leaves and as many other nodes; it grows if there are more. */
    tree->capacity = (int32_t)(4 * bins->n / builder->leaf_points < INT32_MAX / 2
                                   ? 4 * bins->n / builder->leaf_points + 4
                                   : INT32_MAX / 2);
    tree->nodes = hs_alloc(builder->account, HS_FOR_CELLS, tree->capacity, sizeof *tree->nodes);
    if (tree->nodes == NULL) {
        return HS_ERR_MEMORY;
    }
    tree->n_nodes = 1;
    tree->nodes[0] = (hs_tree_node){.first = 0, .end = (int32_t)bins->n};
    return split_all(builder);
}

hs_status
hs_tree_build(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
              int32_t leaf_points, hs_bins *bins, hs_tree *tree)
{
    tree_builder builder = {.account = account,
                            .options = options,
                            .bins = bins,
                            .tree = tree,
                            .order = scene->cloud.order,
                            .aside = (int32_t *)(void *)scene->cloud.spare,
                            .leaf_points = leaf_points};
    *tree = (hs_tree){.ndim = scene->ndim};
    hs_bins_take(scene, bins);
    hs_status status = build_nodes(&builder);
    if (status == HS_OK) {
        status = hs_bins_arrange(account, team, options, scene, bins);
    }
    if (status == HS_OK) {
        tree->bounds = hs_alloc(account, HS_FOR_CELLS, (int64_t)tree->n_nodes * 2 * tree->ndim,
                                sizeof(double));
        status = tree->bounds == NULL ? HS_ERR_MEMORY : HS_OK;
    }
    if (status == HS_OK && tree->n_nodes > 0) {
        tree->depth = measure_depth(tree);
        bound_nodes(bins, tree);
    }
    return status;
}

void
hs_tree_free(hs_account *account, hs_tree *tree)
{
    hs_free(account, tree->nodes);
    hs_free(account, tree->bounds);
    tree->nodes = NULL;
    tree->bounds = NULL;
    tree->n_nodes = 0;
}
