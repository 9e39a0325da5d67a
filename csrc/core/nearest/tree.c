/* SPDX-License-Identifier: BSD-3-Clause */
#include "tree.h"
#include "../base/os.h"
#include "../memory/memory.h"

#include <string.h>

/* tree.c: a node is split at a sampled middle of its widest axis, or between the outermost points
 * where the sample is all in one place. */

/* Points that say where a node is split: enough for halves of 35 to 65 of 100. */
#define SAMPLE       15
#define LARGE_SAMPLE 63
#define FEW_SAMPLE   7
/* Nodes with more points than this are worth a larger sample, with fewer a smaller one. */
#define LARGE_NODE 4096
#define SMALL_NODE 32

/*
 * The tree is built by all threads, a round of nodes at a time. A node of many points is split
 * once, and its children are for the next round. One of few is split to its leaves by one thread,
 * the smaller half first, as its points fit a cache. Each has memory of its own while it is split,
 * so that nodes need no lock, and what it becomes is appended in order: the tree is the same for
 * any number of threads.
 */

/* Points of a node that is split to its leaves at most: few enough for even work, and enough to be
 * worth a task. */
#define SUBTREE_POINTS 8192
/* The work of that, in points that are split once. */
#define SUBTREE_SPLITS 10
/* Nodes that wait: the smaller half is always split first, so they are fewer than bits of n. */
#define MOST_WAITING  64
#define NODES_AT_ONCE 1024 /* whose ranges a task sets */

/* A node of the tree and all below it, as far as it has been split. */
typedef struct subtree {
    hs_tree_node *nodes; /* of the builder's shared account; the first stands for the root */
    int32_t       root;
    int32_t       n_nodes, capacity;
    bool          is_large; /* split once */
    hs_status     status;
} subtree;

typedef struct tree_builder {
    hs_call       *call;
    hs_shared     *shared;
    const hs_bins *bins;
    int32_t       *order; /* numbers of points, of each node those from `first` to `end` */
    int32_t       *aside; /* room for as many */
    int32_t        leaf_points;
    hs_tree       *tree;
    subtree       *round;          /* owned; those of the present round */
    int32_t        n_round, first; /* the first of those that are split now */
    int64_t        work;           /* since the last poll, in points that are split once */
} tree_builder;

/* Where a node is split: what is below the pivot goes left. */
typedef struct tree_cut {
    int    axis;
    double pivot;
} tree_cut;

/* The axis along which these points lie widest; sets their range there. */
static int
widest_axis(const hs_bins *bins, const int32_t *points, int32_t n, double *lowest, double *highest)
{
    int axis = 0;
    *lowest = *highest = 0.0;
    for (int k = 0; k < bins->ndim; k++) {
        const double *x = bins->x[k];
        double        low = x[points[0]], high = low;
        for (int32_t e = 1; e < n; e++) {
            low = hs_smaller(x[points[e]], low);
            high = hs_larger(x[points[e]], high);
        }
        if (high - low > *highest - *lowest) {
            *lowest = low;
            *highest = high;
            axis = k;
        }
    }
    return axis;
}

/* Finds where to split, by a sample picked evenly from the node, or where that is all in one place
 * by all points; false when these are too. */
static bool
find_cut(const tree_builder *builder, const hs_tree_node *node, tree_cut *cut)
{
    const hs_bins *bins = builder->bins;
    const int32_t  n = hs_tree_points(node);
    const int      m = n > LARGE_NODE ? LARGE_SAMPLE : n > SMALL_NODE ? SAMPLE : FEW_SAMPLE;
    const int32_t *order = builder->order + node->first;
    int32_t        picked[LARGE_SAMPLE];
    double         numbers[LARGE_SAMPLE], low, high;
    HS_ASSERT(n >= m); /* leaves hold as many as the smallest sample */
    for (int s = 0; s < m; s++) {
        picked[s] = order[(int64_t)n * (2 * s + 1) / (2 * m)];
    }
    cut->axis = widest_axis(bins, picked, m, &low, &high);
    if (low == high) {
        cut->axis = widest_axis(bins, order, n, &low, &high);
        const double halfway = low + 0.5 * (high - low);
        cut->pivot = halfway > low ? halfway : high;
        return low < high;
    }
    for (int s = 0; s < m; s++) { /* sorted by insertion */
        const double number = bins->x[cut->axis][picked[s]];
        int          at = s;
        for (; at > 0 && numbers[at - 1] > number; at--) {
            numbers[at] = numbers[at - 1];
        }
        numbers[at] = number;
    }
    int middle = m / 2;
    while (numbers[middle] == numbers[0]) { /* something must be below */
        middle++;
    }
    cut->pivot = numbers[middle];
    return true;
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
partition(const tree_builder *builder, const hs_tree_node *node, const tree_cut *cut)
{
    const double        *x = builder->bins->x[cut->axis];
    int32_t             *order = builder->order;
    int32_t *HS_RESTRICT aside = builder->aside + node->first;
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

/* Room for two nodes more; for half full leaves and as many other nodes at first, then for twice as
 * many as before. */
static bool
make_room(const tree_builder *builder, subtree *sub, int32_t n_points)
{
    const int32_t first = sub->is_large ? 3 : 4 * n_points / builder->leaf_points + 4;
    const int32_t capacity = sub->capacity > 0 ? 2 * sub->capacity : first;
    if (sub->n_nodes + 2 <= sub->capacity) {
        return true;
    }
    if (!hs_shared_resize(builder->shared, (void **)&sub->nodes, sub->n_nodes, capacity,
                          sizeof *sub->nodes)) {
        return false;
    }
    sub->capacity = capacity;
    return true;
}

/* A task for hs_team_run: splits one node of the round. */
static void
split_subtree(void *context, int64_t task)
{
    const tree_builder *builder = context;
    subtree            *sub = &builder->round[builder->first + task];
    const hs_tree_node  root = builder->tree->nodes[sub->root];
    int32_t             waiting[MOST_WAITING];
    int                 n_waiting = 1;
    sub->status = HS_ERR_MEMORY;
    if (!make_room(builder, sub, hs_tree_points(&root))) {
        return;
    }
    sub->nodes[sub->n_nodes++] = root;
    waiting[0] = 0;
    while (n_waiting > 0) {
        const int32_t number = waiting[--n_waiting], left = sub->n_nodes;
        hs_tree_node *node = &sub->nodes[number];
        tree_cut      cut;
        if (hs_tree_points(node) <= builder->leaf_points) {
            continue;
        }
        if (!find_cut(builder, node, &cut)) { /* all at one place, as wrapped */
            node->is_spot = is_spot(builder, node);
            continue;
        }
        const int32_t middle = partition(builder, node, &cut);
        if (!make_room(builder, sub, 0)) {
            return;
        }
        node = &sub->nodes[number];
        node->left = left;
        sub->nodes[left] = (hs_tree_node){.first = node->first, .end = middle};
        sub->nodes[left + 1] = (hs_tree_node){.first = middle, .end = node->end};
        sub->n_nodes += 2;
        if (!sub->is_large) {
            const bool left_is_larger = middle - node->first > node->end - middle;
            waiting[n_waiting++] = left_is_larger ? left : left + 1;
            waiting[n_waiting++] = left_is_larger ? left + 1 : left;
        }
    }
    sub->status = HS_OK;
}

/* Splits the nodes of a round, some at a time; the caller is polled once in HS_POLL_POINTS points
 * of each thread. */
static hs_status
split_round(tree_builder *builder)
{
    const int64_t most = HS_POLL_POINTS * (int64_t)hs_team_size(builder->call->team);
    hs_status     status = HS_OK;
    for (int32_t next = 0; next < builder->n_round && status == HS_OK;) {
        builder->first = next;
        while (next < builder->n_round && builder->work < most) {
            const subtree *sub = &builder->round[next++];
            const int64_t  n = hs_tree_points(&builder->tree->nodes[sub->root]);
            builder->work += sub->is_large ? n : SUBTREE_SPLITS * n;
        }
        hs_team_run(builder->call->team, next - builder->first, split_subtree, builder);
        for (int32_t s = builder->first; s < next && status == HS_OK; s++) {
            status = builder->round[s].status;
        }
        if (status == HS_OK && builder->work >= most) {
            builder->work = 0;
            status = hs_poll(&builder->call->options, 0.0);
        }
    }
    return status;
}

/* Room for n nodes in the tree; those that it has are kept. */
static hs_status
reserve(tree_builder *builder, int64_t n)
{
    hs_tree      *tree = builder->tree;
    hs_tree_node *nodes = n > INT32_MAX ? NULL
                                        : hs_grow(&builder->call->account, HS_FOR_CELLS,
                                                  tree->nodes, tree->n_nodes, n, sizeof *nodes);
    tree->nodes = nodes != NULL ? nodes : tree->nodes;
    return nodes != NULL ? HS_OK : HS_ERR_MEMORY;
}

/* Appends what the nodes of the round became to the tree; *next: those of the next round, for all
 * of which there is room. */
static hs_status
append_round(tree_builder *builder, subtree *next, int32_t *n_next)
{
    hs_tree *tree = builder->tree;
    int64_t  n = tree->n_nodes;
    for (int32_t s = 0; s < builder->n_round; s++) {
        n += builder->round[s].n_nodes - 1;
    }
    if (reserve(builder, n) != HS_OK) {
        return HS_ERR_MEMORY;
    }
    for (int32_t s = 0; s < builder->n_round; s++) {
        const subtree *sub = &builder->round[s];
        const int32_t  begin = tree->n_nodes;
        for (int32_t number = 0; number < sub->n_nodes; number++) {
            hs_tree_node *to = &tree->nodes[number == 0 ? sub->root : tree->n_nodes++];
            *to = sub->nodes[number];
            to->left += to->left != 0 ? begin - 1 : 0; /* node 1 of the subtree is `begin` */
        }
        for (int32_t child = begin; sub->is_large && child < tree->n_nodes; child++) {
            const int32_t n_points = hs_tree_points(&tree->nodes[child]);
            next[(*n_next)++] = (subtree){.root = child, .is_large = n_points > SUBTREE_POINTS};
        }
    }
    return HS_OK;
}

static hs_status
build_nodes(tree_builder *builder)
{
    hs_tree      *tree = builder->tree;
    hs_account   *account = &builder->call->account;
    const int32_t n = (int32_t)builder->bins->n;
    hs_status     status = reserve(builder, 1);
    builder->round = hs_alloc(account, HS_FOR_CELLS, 1, sizeof *builder->round);
    builder->shared = hs_shared_new(account, HS_FOR_CELLS);
    if (builder->round == NULL || builder->shared == NULL) {
        status = HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        tree->nodes[tree->n_nodes++] = (hs_tree_node){.first = 0, .end = n};
        builder->round[builder->n_round++] = (subtree){.is_large = n > SUBTREE_POINTS};
    }
    while (status == HS_OK && builder->n_round > 0) {
        const int32_t n_round = builder->n_round;
        subtree      *next = hs_alloc(account, HS_FOR_CELLS, INT64_C(2) * n_round, sizeof *next);
        int32_t       n_next = 0;
        status = next != NULL ? split_round(builder) : HS_ERR_MEMORY;
        if (status == HS_OK) {
            status = append_round(builder, next, &n_next);
        }
        for (int32_t s = 0; s < n_round; s++) {
            hs_shared_release(builder->shared, (void **)&builder->round[s].nodes);
        }
        hs_free(account, builder->round);
        builder->round = next;
        builder->n_round = n_next;
    }
    hs_free(account, builder->round);
    hs_shared_free(builder->shared);
    return status;
}

/* Sets the range of a leaf from its points, which are in tree order by now; of another node, from
 * its children. */
static void
set_range(const tree_builder *builder, int32_t number)
{
    hs_tree            *tree = builder->tree;
    const hs_tree_node *node = &tree->nodes[number];
    const int           d = tree->ndim, side = (number + 1) % 2;
    for (int k = 0; k < d; k++) {
        const double *x = builder->bins->x[k];
        double        low = x[node->first], high = low;
        if (node->left != 0) {
            const double *of = hs_tree_bounds(tree, node->left, d) + 4 * k;
            low = hs_smaller(of[0], of[1]);
            high = hs_larger(of[2], of[3]);
        } else {
            for (int32_t si = node->first + 1; si < node->end; si++) {
                low = hs_smaller(x[si], low);
                high = hs_larger(x[si], high);
            }
        }
        if (number == 0) {
            tree->lower[k] = low;
            tree->upper[k] = high;
        } else {
            double *to = tree->bounds + (int64_t)(number - 1 - side) * 2 * d + 4 * k + side;
            to[0] = low;
            to[2] = high;
        }
    }
}

/* A task for hs_team_run: ranges of the leaves among some nodes. */
static void
set_leaves(void *context, int64_t task)
{
    const tree_builder *builder = context;
    const hs_tree      *tree = builder->tree;
    const int64_t       first = task * NODES_AT_ONCE, rest = tree->n_nodes - first;
    for (int64_t e = first; e < first + (rest < NODES_AT_ONCE ? rest : NODES_AT_ONCE); e++) {
        if (tree->nodes[e].left == 0) {
            set_range(builder, (int32_t)e);
        }
    }
}

hs_status
hs_tree_build(hs_call *call, hs_scene *scene, int32_t leaf_points, hs_bins *bins, hs_tree *tree)
{
    tree_builder builder = {.call = call,
                            .bins = bins,
                            .order = scene->cloud.order,
                            .aside = (int32_t *)(void *)scene->cloud.spare,
                            .leaf_points = leaf_points,
                            .tree = tree};
    *tree = (hs_tree){.ndim = scene->ndim};
    hs_bins_take(scene, bins);
    for (int64_t i = 0; i < bins->n; i++) {
        bins->order[i] = (int32_t)i;
    }
    hs_status status = bins->n > 0 ? build_nodes(&builder) : HS_OK;
    if (status == HS_OK) {
        status = hs_bins_arrange(&call->account, call->team, &call->options, scene, bins);
    }
    if (status == HS_OK) {
        tree->bounds = hs_alloc(&call->account, HS_FOR_CELLS,
                                (int64_t)tree->n_nodes * 2 * tree->ndim, sizeof(double));
        status = tree->bounds == NULL ? HS_ERR_MEMORY : HS_OK;
    }
    if (status == HS_OK && tree->n_nodes > 0) {
        double *steps = tree->bounds; /* down to each node, for a moment */
        steps[0] = 0.0;
        for (int32_t number = 0; number < tree->n_nodes; number++) {
            const int32_t left = tree->nodes[number].left;
            tree->depth = (int)hs_larger(steps[number], (double)tree->depth);
            if (left != 0) {
                steps[left] = steps[left + 1] = steps[number] + 1.0;
            }
        }
        hs_team_run(call->team, (tree->n_nodes - 1) / NODES_AT_ONCE + 1, set_leaves, &builder);
        for (int32_t number = tree->n_nodes - 1; number >= 0; number--) {
            if (tree->nodes[number].left != 0) { /* children come after their parents */
                set_range(&builder, number);
            }
        }
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
