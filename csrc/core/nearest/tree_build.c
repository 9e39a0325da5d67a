/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * tree_build.c: builds the tree by all threads. At the top there are too few subtrees for them, so
 * the first nodes are split level by level, those of a level at once. Each subtree of few points is
 * then split to its leaves by one thread, the smaller half first, in memory of its own: its points
 * fit a cache, and its nodes need no lock. The subtrees are appended at the end. The tree is the
 * same for any number of threads.
 */
#include "tree_build.h"

#include "tree_bounds.h"
#include "tree_split.h"
#include "../base/poll.h"
#include "../memory/account_shared.h"

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
    hs_splitter       splitter;
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
        node->left = hs_tree_split(&builder->splitter, node);
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

static hs_status
open_subtrees(tree_builder *builder)
{
    const hs_tree *tree = builder->tree;
    int32_t        n = 0;
    for (int32_t number = 0; number < tree->n_nodes; number++) {
        n += is_root(builder, &tree->nodes[number]);
    }
    builder->subtrees = hs_alloc(builder->account, HS_FOR_CELLS, n, sizeof *builder->subtrees);
    builder->begins = hs_alloc(builder->account, HS_FOR_CELLS, n + 1, sizeof *builder->begins);
    if (builder->subtrees == NULL || builder->begins == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int32_t number = 0; number < tree->n_nodes; number++) {
        if (is_root(builder, &tree->nodes[number])) {
            builder->subtrees[builder->n_subtrees++] = (subtree){.root = number};
        }
    }
    return HS_OK;
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

static hs_status
split_nodes(const tree_builder *builder, subtree *sub)
{
    int32_t waiting[MOST_WAITING];
    int     n_waiting = 1;
    if (!grow(builder, sub)) {
        return HS_ERR_MEMORY;
    }
    sub->nodes[sub->n_nodes++] = builder->tree->nodes[sub->root];
    waiting[0] = 0;
    while (n_waiting > 0) {
        const int32_t number = waiting[--n_waiting], left = sub->n_nodes;
        if (hs_tree_points(&sub->nodes[number]) > builder->splitter.leaf_points &&
            left + 2 > sub->capacity && !grow(builder, sub)) {
            return HS_ERR_MEMORY;
        }
        const int32_t middle = hs_tree_split(&builder->splitter, &sub->nodes[number]);
        if (middle != 0) {
            append_children(sub->nodes, &sub->n_nodes, number, middle);
            const bool left_is_larger = hs_tree_points(&sub->nodes[left]) >
                                        hs_tree_points(&sub->nodes[left + 1]);
            waiting[n_waiting++] = left_is_larger ? left : left + 1;
            waiting[n_waiting++] = left_is_larger ? left + 1 : left;
        }
    }
    return HS_OK;
}

static void
split_subtree(void *context, int64_t task)
{
    const tree_builder *builder = context;
    subtree            *sub = &builder->subtrees[builder->first_subtree + task];
    sub->status = split_nodes(builder, sub);
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

/* Node `number` of a subtree as a node of the tree, where node 1 of the subtree is `begin`. */
static hs_tree_node
renumbered(const subtree *sub, int32_t begin, int32_t number)
{
    hs_tree_node node = sub->nodes[number];
    node.left += node.left != 0 ? begin - 1 : 0;
    return node;
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
        tree->nodes[sub->root] = renumbered(sub, begin, 0);
        for (int32_t number = 1; number < sub->n_nodes; number++) {
            tree->nodes[tree->n_nodes++] = renumbered(sub, begin, number);
        }
    }
    builder->begins[builder->n_subtrees] = tree->n_nodes;
    return HS_OK;
}

/* Subtrees have memory while they are split, and until they are appended. */
static hs_status
build_subtrees(tree_builder *builder)
{
    hs_status status = open_subtrees(builder);
    if (status != HS_OK) {
        return status;
    }
    builder->shared = hs_shared_new(builder->account, HS_FOR_CELLS);
    if (builder->shared == NULL) {
        return HS_ERR_MEMORY;
    }
    status = split_subtrees(builder);
    if (status == HS_OK) {
        status = append_subtrees(builder);
    }
    for (int32_t s = 0; s < builder->n_subtrees; s++) {
        hs_shared_release(builder->shared, (void **)&builder->subtrees[s].nodes);
    }
    hs_shared_free(builder->shared);
    return status;
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

static hs_status
build_tree(tree_builder *builder, hs_scene *scene, hs_bins *bins)
{
    hs_tree  *tree = builder->tree;
    hs_status status = build_nodes(builder);
    if (status == HS_OK) {
        status = hs_bins_arrange(builder->account, builder->team, builder->options, scene, bins);
    }
    if (status == HS_OK) {
        tree->bounds = hs_alloc(builder->account, HS_FOR_CELLS,
                                (int64_t)tree->n_nodes * 2 * tree->ndim, sizeof(double));
        status = tree->bounds == NULL ? HS_ERR_MEMORY : HS_OK;
    }
    if (status == HS_OK && tree->n_nodes > 0) {
        hs_tree_bound(builder->team, bins, builder->begins, builder->n_subtrees, tree);
    }
    return status;
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
    const hs_status status = build_tree(&builder, scene, bins);
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
