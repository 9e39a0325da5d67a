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

/* What nodes of one tree are split with; all borrowed. */
typedef struct tree_splitter {
    const hs_bins *bins;
    int32_t       *order; /* numbers of points, of each node those from `first` to `end` */
    int32_t       *aside; /* room for as many */
    int32_t        leaf_points;
} tree_splitter;

/* Where a node is split: what is below the pivot goes left. */
typedef struct tree_cut {
    int    axis;
    double pivot;
} tree_cut;

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

/* Finds where to split, by a sample picked evenly from the node; false when it is all in one
 * place. */
static bool
cut_by_sample(const tree_splitter *splitter, const hs_tree_node *node, tree_cut *cut)
{
    const int32_t  n = hs_tree_points(node);
    const int      m = n > LARGE_NODE ? LARGE_SAMPLE : n > SMALL_NODE ? SAMPLE : FEW_SAMPLE;
    const int32_t *order = splitter->order + node->first;
    int32_t        picked[LARGE_SAMPLE];
    double         numbers[LARGE_SAMPLE], widest = 0.0;
    HS_ASSERT(n >= m); /* leaves hold as many as the smallest sample */
    for (int s = 0; s < m; s++) {
        picked[s] = order[(int64_t)n * (2 * s + 1) / (2 * m)];
    }
    for (int k = 0; k < splitter->bins->ndim; k++) {
        const double *x = splitter->bins->x[k];
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
        numbers[s] = splitter->bins->x[cut->axis][picked[s]];
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
cut_by_range(const tree_splitter *splitter, const hs_tree_node *node, tree_cut *cut)
{
    double widest = 0.0;
    for (int k = 0; k < splitter->bins->ndim; k++) {
        const double *x = splitter->bins->x[k];
        double        low = x[splitter->order[node->first]], high = low;
        for (int32_t at = node->first + 1; at < node->end; at++) {
            low = hs_smaller(x[splitter->order[at]], low);
            high = hs_larger(x[splitter->order[at]], high);
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
is_spot(const tree_splitter *splitter, const hs_tree_node *node)
{
    const hs_bins *bins = splitter->bins;
    for (int k = 0; bins->keeps_originals && k < bins->ndim; k++) {
        const double *given = bins->originals[k];
        const double  first = given[splitter->order[node->first]];
        for (int32_t at = node->first + 1; at < node->end; at++) {
            if (given[splitter->order[at]] != first) {
                return false;
            }
        }
    }
    return true;
}

/* Partitions the points of a node, keeping the order on both sides; returns where the right one
 * begins. */
static int32_t
partition(const tree_splitter *splitter, const hs_tree_node *node, const tree_cut *cut)
{
    const double        *x = splitter->bins->x[cut->axis];
    int32_t             *order = splitter->order;
    int32_t *HS_RESTRICT aside = splitter->aside + node->first;
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

/*
 * Divides the points of a node, which keep their order on both sides; returns where those of the
 * right child begin. 0: the node stays a leaf, and is_spot says whether that is because its points
 * are equal. Nodes that share no points can be split at the same time.
 */
static int32_t
tree_split(const tree_splitter *splitter, hs_tree_node *node)
{
    tree_cut cut;
    if (hs_tree_points(node) <= splitter->leaf_points) {
        return 0;
    }
    if (!cut_by_sample(splitter, node, &cut) && !cut_by_range(splitter, node, &cut)) {
        node->is_spot = is_spot(splitter, node);
        return 0;
    }
    return partition(splitter, node, &cut);
}

/* The range of each node, from the leaves up, and the depth of a tree. */

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

/* Of nodes [first, last), from the last to the first: children come after their parents. The first
 * node of the tree is not among them. */
static void
bound_nodes(const hs_bins *bins, hs_tree *tree, int32_t first, int32_t last)
{
    const int d = tree->ndim;
    double    range[2];
    for (int32_t number = last - 1; number >= first; number--) {
        const int side = (number - 1) % 2;
        double   *of = tree->bounds + (int64_t)(number - 1 - side) * 2 * d;
        for (int k = 0; k < d; k++) {
            bound_axis(bins, tree, number, k, range);
            of[4 * k + side] = range[0];
            of[4 * k + 2 + side] = range[1];
        }
    }
}

/*
 * Builds the tree by all threads. At the top there are too few subtrees for them, so the first
 * nodes are split level by level, those of a level at once. Each subtree of few points is then
 * split to its leaves by one thread, the smaller half first, in memory of its own: its points fit a
 * cache, and its nodes need no lock. The subtrees are appended at the end. The tree is the same for
 * any number of threads.
 */

/* Points of a subtree at most: few enough for even work, and enough to be worth a task. */
#define SUBTREE_POINTS 8192
/* Subtrees for each thread between two polls. */
#define SUBTREES_AT_ONCE 4
/* Nodes that wait: the smaller half is always split first, so they are fewer than bits of n. */
#define MOST_WAITING 64

/* Node `root` of the tree and all below it. */
typedef struct subtree {
    hs_tree_node *nodes; /* of the builder's shared account; the first stands for the root */
    int32_t       root;
    int32_t       n_nodes, capacity;
    hs_status     status;
} subtree;

typedef struct tree_builder {
    hs_account       *account;
    hs_shared        *shared; /* while subtrees are split and appended */
    hs_team          *team;
    const hs_options *options;
    tree_splitter     splitter;
    hs_tree          *tree;
    subtree          *subtrees; /* owned */
    int32_t           n_subtrees;
    int32_t *begins; /* owned: where the nodes of each subtree begin in the tree, and end */
    int32_t  first_node, first_subtree; /* of the tasks that run */
} tree_builder;

/* Gives a node two children, for which there is room after the n_nodes nodes. */
static void
append_children(hs_tree_node *nodes, int32_t *n_nodes, int32_t number, int32_t middle)
{
    hs_tree_node *node = &nodes[number], *left = &nodes[*n_nodes];
    node->left = *n_nodes;
    left[0] = (hs_tree_node){.first = node->first, .end = middle};
    left[1] = (hs_tree_node){.first = middle, .end = node->end};
    *n_nodes += 2;
}

/* ---- the first nodes ---- */

/* Splits one node. Until its children are appended, its `left` is the first point of the right
 * one. */
static void
split_large(void *context, int64_t task)
{
    const tree_builder *builder = context;
    hs_tree_node       *node = &builder->tree->nodes[builder->first_node + task];
    if (hs_tree_points(node) > SUBTREE_POINTS) {
        node->left = tree_split(&builder->splitter, node);
    }
}

/* Room for n nodes in the tree; those that it has are kept. */
static hs_status
reserve(tree_builder *builder, int64_t n)
{
    hs_tree      *tree = builder->tree;
    hs_tree_node *nodes = n > INT32_MAX ? NULL
                                        : hs_grow(builder->account, HS_FOR_CELLS, tree->nodes,
                                                  tree->n_nodes, n, sizeof *nodes);
    if (nodes == NULL) {
        return HS_ERR_MEMORY;
    }
    tree->nodes = nodes;
    return HS_OK;
}

/* Splits nodes [first, end) of a level, some at a time; the caller is polled once in HS_POLL_POINTS
 * points of each thread, *work those since the last time. */
static hs_status
split_level(tree_builder *builder, int32_t first, int32_t end, int64_t *work)
{
    const int64_t most = HS_POLL_POINTS * (int64_t)hs_team_size(builder->team);
    hs_status     status = HS_OK;
    for (int32_t next = first; status == HS_OK && next < end;) {
        int64_t n_points = 0;
        builder->first_node = next;
        while (next < end && *work + n_points < most) {
            const int32_t n = hs_tree_points(&builder->tree->nodes[next++]);
            n_points += n > SUBTREE_POINTS ? n : 0;
        }
        if (n_points > 0) {
            hs_team_run(builder->team, next - builder->first_node, split_large, builder);
        }
        *work += n_points;
        if (*work >= most) {
            *work = 0;
            status = hs_poll(builder->options, 0.0);
        }
    }
    return status;
}

static hs_status
split_levels(tree_builder *builder)
{
    hs_tree  *tree = builder->tree;
    int64_t   work = 0;
    int32_t   first = 0;
    hs_status status = HS_OK;
    while (status == HS_OK && first < tree->n_nodes) {
        const int32_t end = tree->n_nodes;
        status = split_level(builder, first, end, &work);
        if (status == HS_OK) {
            status = reserve(builder, end + 2 * (int64_t)(end - first));
        }
        for (int32_t number = first; status == HS_OK && number < end; number++) {
            const int32_t middle = tree->nodes[number].left;
            if (middle != 0) {
                append_children(tree->nodes, &tree->n_nodes, number, middle);
            }
        }
        first = end;
    }
    return status;
}

/* ---- subtrees, each split by one thread ---- */

/* A node that may have children, and was not split yet. */
static bool
is_root(const tree_builder *builder, const hs_tree_node *node)
{
    return node->left == 0 && hs_tree_points(node) <= SUBTREE_POINTS &&
           hs_tree_points(node) > builder->splitter.leaf_points;
}

/* Room for half full leaves and as many other nodes at first, then for twice as many as before. */
static bool
grow(const tree_builder *builder, subtree *sub)
{
    const int32_t n = hs_tree_points(&builder->tree->nodes[sub->root]);
    const int32_t capacity = sub->capacity > 0 ? 2 * sub->capacity
                                               : 4 * n / builder->splitter.leaf_points + 4;
    if (!hs_shared_resize(builder->shared, (void **)&sub->nodes, sub->n_nodes, capacity,
                          sizeof *sub->nodes)) {
        return false;
    }
    sub->capacity = capacity;
    return true;
}

static void
split_subtree(void *context, int64_t task)
{
    const tree_builder *builder = context;
    subtree            *sub = &builder->subtrees[builder->first_subtree + task];
    int32_t             waiting[MOST_WAITING];
    int                 n_waiting = 1;
    sub->status = HS_ERR_MEMORY;
    if (!grow(builder, sub)) {
        return;
    }
    sub->nodes[sub->n_nodes++] = builder->tree->nodes[sub->root];
    waiting[0] = 0;
    while (n_waiting > 0) {
        const int32_t number = waiting[--n_waiting], left = sub->n_nodes;
        if (hs_tree_points(&sub->nodes[number]) > builder->splitter.leaf_points &&
            left + 2 > sub->capacity && !grow(builder, sub)) {
            return;
        }
        const int32_t middle = tree_split(&builder->splitter, &sub->nodes[number]);
        if (middle != 0) {
            append_children(sub->nodes, &sub->n_nodes, number, middle);
            const bool left_is_larger = hs_tree_points(&sub->nodes[left]) >
                                        hs_tree_points(&sub->nodes[left + 1]);
            waiting[n_waiting++] = left_is_larger ? left : left + 1;
            waiting[n_waiting++] = left_is_larger ? left + 1 : left;
        }
    }
    sub->status = HS_OK;
}

static hs_status
split_subtrees(tree_builder *builder)
{
    const int32_t at_once = SUBTREES_AT_ONCE * hs_team_size(builder->team);
    hs_status     status = HS_OK;
    for (int32_t first = 0; status == HS_OK && first < builder->n_subtrees; first += at_once) {
        const int32_t rest = builder->n_subtrees - first, n = rest < at_once ? rest : at_once;
        builder->first_subtree = first;
        hs_team_run(builder->team, n, split_subtree, builder);
        for (int32_t s = first; s < first + n && status == HS_OK; s++) {
            status = builder->subtrees[s].status;
        }
        if (status == HS_OK && n < rest) {
            status = hs_poll(builder->options, 0.0);
        }
    }
    return status;
}

/* Appends the nodes of all subtrees to those of the tree. */
static hs_status
append_subtrees(tree_builder *builder)
{
    hs_tree *tree = builder->tree;
    int64_t  n = tree->n_nodes;
    for (int32_t s = 0; s < builder->n_subtrees; s++) {
        n += builder->subtrees[s].n_nodes - 1;
    }
    if (reserve(builder, n) != HS_OK) {
        return HS_ERR_MEMORY;
    }
    for (int32_t s = 0; s < builder->n_subtrees; s++) {
        const subtree *sub = &builder->subtrees[s];
        const int32_t  begin = builder->begins[s] = tree->n_nodes;
        for (int32_t number = 0; number < sub->n_nodes; number++) {
            hs_tree_node *to = &tree->nodes[number == 0 ? sub->root : tree->n_nodes++];
            *to = sub->nodes[number];
            to->left += to->left != 0 ? begin - 1 : 0; /* node 1 of the subtree is `begin` */
        }
    }
    builder->begins[builder->n_subtrees] = tree->n_nodes;
    return HS_OK;
}

/* Subtrees have memory while they are split, and until they are appended. */
static hs_status
build_subtrees(tree_builder *builder)
{
    const hs_tree *tree = builder->tree;
    int32_t        n = 0;
    for (int32_t number = 0; number < tree->n_nodes; number++) {
        n += is_root(builder, &tree->nodes[number]);
    }
    builder->subtrees = hs_alloc(builder->account, HS_FOR_CELLS, n, sizeof *builder->subtrees);
    builder->begins = hs_alloc(builder->account, HS_FOR_CELLS, n + 1, sizeof *builder->begins);
    builder->shared = hs_shared_new(builder->account, HS_FOR_CELLS);
    if (builder->subtrees == NULL || builder->begins == NULL || builder->shared == NULL) {
        hs_shared_free(builder->shared);
        return HS_ERR_MEMORY;
    }
    for (int32_t number = 0; number < tree->n_nodes; number++) {
        if (is_root(builder, &tree->nodes[number])) {
            builder->subtrees[builder->n_subtrees++] = (subtree){.root = number};
        }
    }
    hs_status status = split_subtrees(builder);
    if (status == HS_OK) {
        status = append_subtrees(builder);
    }
    for (int32_t s = 0; s < n; s++) {
        hs_shared_release(builder->shared, (void **)&builder->subtrees[s].nodes);
    }
    hs_shared_free(builder->shared);
    return status;
}

/* A task for hs_team_run: bounds of the nodes below the root of one subtree; roots and what is
 * above them come before. */
static void
bound_subtree(void *context, int64_t task)
{
    const tree_builder *builder = context;
    bound_nodes(builder->splitter.bins, builder->tree, builder->begins[task],
                builder->begins[task + 1]);
}

static hs_status
build_nodes(tree_builder *builder)
{
    hs_tree       *tree = builder->tree;
    const hs_bins *bins = builder->splitter.bins;
    for (int64_t i = 0; i < bins->n; i++) {
        bins->order[i] = (int32_t)i;
    }
    if (bins->n == 0) {
        return HS_OK;
    }
    hs_status status = reserve(builder, 1);
    if (status == HS_OK) {
        tree->nodes[tree->n_nodes++] = (hs_tree_node){.first = 0, .end = (int32_t)bins->n};
        status = split_levels(builder);
    }
    return status == HS_OK ? build_subtrees(builder) : status;
}

hs_status
hs_tree_build(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
              int32_t leaf_points, hs_bins *bins, hs_tree *tree)
{
    tree_builder builder = {.account = account,
                            .team = team,
                            .options = options,
                            .splitter = {.bins = bins,
                                         .order = scene->cloud.order,
                                         .aside = (int32_t *)(void *)scene->cloud.spare,
                                         .leaf_points = leaf_points},
                            .tree = tree};
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
        hs_team_run(team, builder.n_subtrees, bound_subtree, &builder);
        bound_nodes(bins, tree, 1, builder.begins[0]);
        for (int k = 0; k < tree->ndim; k++) {
            double range[2];
            bound_axis(bins, tree, 0, k, range);
            tree->lower[k] = range[0];
            tree->upper[k] = range[1];
        }
    }
    hs_free(account, builder.subtrees);
    hs_free(account, builder.begins);
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
