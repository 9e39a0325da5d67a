/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * tree.c: builds the tree by all threads. The first nodes are split level by level, all of a level
 * at once. What has few points then is a part of the tree that one thread splits to the leaves, the
 * smaller half first, in memory of the part's own; the parts are joined at the end. The tree is the
 * same for any number of threads.
 */
#include "tree.h"

#include "tree_bounds.h"
#include "tree_split.h"
#include "../base/poll.h"
#include "../memory/account_shared.h"

/* Points of a part at most: small enough for even work, and large enough to be worth a task. */
#define PART_POINTS 8192
/* Parts between two polls: some milliseconds. */
#define PARTS_AT_ONCE 64
/* Nodes that wait: the smaller half is always split first, so they are fewer than bits of n. */
#define MOST_WAITING 64

/* Node `root` of the tree and all below it. */
typedef struct tree_part {
    hs_tree_node *nodes; /* of the builder's shared account; the first stands for the root */
    int32_t       root;
    int32_t       n_nodes, capacity;
    hs_status     status;
} tree_part;

typedef struct tree_builder {
    hs_account       *account;
    hs_shared        *shared; /* while parts are split and joined */
    hs_team          *team;
    const hs_options *options;
    hs_splitter       splitter;
    hs_tree          *tree;
    tree_part        *parts; /* owned */
    int32_t           n_parts;
    int32_t          *begins; /* owned: where the nodes of each part begin in the tree, and end */
    int32_t           first;  /* node, or part, of the first task */
} tree_builder;

static int32_t
points_of(const hs_tree_node *node)
{
    return node->end - node->first;
}

/* ---- nodes that many threads split ---- */

/* Of one node of a level: `left` becomes where the right one begins, until all are split. */
static void
split_large(void *context, int64_t task)
{
    const tree_builder *builder = context;
    hs_tree_node       *node = &builder->tree->nodes[builder->first + task];
    if (points_of(node) > PART_POINTS) {
        node->left = hs_tree_split(&builder->splitter, node);
    }
}

static void
add_children(hs_tree *tree, int32_t number)
{
    hs_tree_node *node = &tree->nodes[number];
    const int32_t middle = node->left;
    if (middle != 0) {
        node->left = tree->n_nodes;
        tree->nodes[tree->n_nodes++] = (hs_tree_node){.first = node->first, .end = middle};
        tree->nodes[tree->n_nodes++] = (hs_tree_node){.first = middle, .end = node->end};
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

static hs_status
split_levels(tree_builder *builder)
{
    hs_tree  *tree = builder->tree;
    int64_t   work = 0;
    hs_status status = HS_OK;
    for (int32_t end = 1; status == HS_OK && builder->first < end; end = tree->n_nodes) {
        const int32_t n_level = end - builder->first;
        hs_team_run(builder->team, n_level, split_large, builder);
        status = reserve(builder, end + 2 * (int64_t)n_level);
        for (int32_t number = builder->first; status == HS_OK && number < end; number++) {
            work += tree->nodes[number].left != 0 ? points_of(&tree->nodes[number]) : 0;
            add_children(tree, number);
        }
        builder->first = end;
        if (status == HS_OK && work > HS_POLL_POINTS) {
            work = 0;
            status = hs_poll(builder->options, 0.0);
        }
    }
    return status;
}

/* ---- parts, each split by one thread ---- */

/* A node that is the root of a part: one that may have children, and was not split yet. */
static bool
begins_part(const tree_builder *builder, const hs_tree_node *node)
{
    return node->left == 0 && points_of(node) <= PART_POINTS &&
           points_of(node) > builder->splitter.leaf_points;
}

static hs_status
open_parts(tree_builder *builder)
{
    const hs_tree *tree = builder->tree;
    int32_t        n = 0;
    for (int32_t number = 0; number < tree->n_nodes; number++) {
        n += begins_part(builder, &tree->nodes[number]);
    }
    builder->parts = hs_alloc(builder->account, HS_FOR_CELLS, n, sizeof *builder->parts);
    builder->begins = hs_alloc(builder->account, HS_FOR_CELLS, n + 1, sizeof *builder->begins);
    if (builder->parts == NULL || builder->begins == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int32_t number = 0; number < tree->n_nodes; number++) {
        if (begins_part(builder, &tree->nodes[number])) {
            builder->parts[builder->n_parts++] = (tree_part){.root = number};
        }
    }
    return HS_OK;
}

/* Room for half full leaves and as many other nodes at first, then for twice as many as before. */
static bool
grow(const tree_builder *builder, tree_part *part)
{
    const hs_tree_node *root = &builder->tree->nodes[part->root];
    const int32_t       capacity = part->capacity > 0
                                       ? 2 * part->capacity
                                       : 4 * points_of(root) / builder->splitter.leaf_points + 4;
    if (!hs_shared_resize(builder->shared, (void **)&part->nodes, part->n_nodes, capacity,
                          sizeof *part->nodes)) {
        return false;
    }
    part->capacity = capacity;
    return true;
}

/* Gives a node of the part two children, for which there is room; false when it stays a leaf. */
static bool
split_node(const tree_builder *builder, tree_part *part, int32_t number)
{
    hs_tree_node *node = &part->nodes[number];
    const int32_t middle = hs_tree_split(&builder->splitter, node);
    if (middle == 0) {
        return false;
    }
    node->left = part->n_nodes;
    part->nodes[part->n_nodes++] = (hs_tree_node){.first = node->first, .end = middle};
    part->nodes[part->n_nodes++] = (hs_tree_node){.first = middle, .end = node->end};
    return true;
}

static void
split_part(void *context, int64_t task)
{
    const tree_builder *builder = context;
    tree_part          *part = &builder->parts[builder->first + task];
    int32_t             waiting[MOST_WAITING];
    int                 n_waiting = 1;
    if (!grow(builder, part)) {
        part->status = HS_ERR_MEMORY;
        return;
    }
    part->nodes[part->n_nodes++] = builder->tree->nodes[part->root];
    waiting[0] = 0;
    while (n_waiting > 0) {
        const int32_t number = waiting[--n_waiting];
        if (part->n_nodes + 2 > part->capacity && !grow(builder, part)) {
            part->status = HS_ERR_MEMORY;
            return;
        }
        if (split_node(builder, part, number)) {
            const int32_t left = part->nodes[number].left;
            const bool    left_is_larger = points_of(&part->nodes[left]) >
                                        points_of(&part->nodes[left + 1]);
            waiting[n_waiting++] = left_is_larger ? left : left + 1;
            waiting[n_waiting++] = left_is_larger ? left + 1 : left;
        }
    }
}

static hs_status
split_parts(tree_builder *builder)
{
    hs_status status = HS_OK;
    for (builder->first = 0; status == HS_OK && builder->first < builder->n_parts;) {
        const int32_t first = builder->first, rest = builder->n_parts - first;
        const int32_t n = rest < PARTS_AT_ONCE ? rest : PARTS_AT_ONCE;
        hs_team_run(builder->team, n, split_part, builder);
        for (int32_t p = first; p < first + n && status == HS_OK; p++) {
            status = builder->parts[p].status;
        }
        builder->first += n;
        if (status == HS_OK && builder->first < builder->n_parts) {
            status = hs_poll(builder->options, 0.0);
        }
    }
    return status;
}

/* Node `number` of the part as a node of the tree, in which node 1 of the part is number `begin`. */
static hs_tree_node
in_tree(const tree_part *part, int32_t begin, int32_t number)
{
    hs_tree_node node = part->nodes[number];
    node.left += node.left != 0 ? begin - 1 : 0;
    return node;
}

/* Appends the nodes of all parts to those of the tree. */
static hs_status
join_parts(tree_builder *builder)
{
    hs_tree *tree = builder->tree;
    int64_t  n = tree->n_nodes;
    for (int32_t p = 0; p < builder->n_parts; p++) {
        n += builder->parts[p].n_nodes - 1;
    }
    if (reserve(builder, n) != HS_OK) {
        return HS_ERR_MEMORY;
    }
    for (int32_t p = 0; p < builder->n_parts; p++) {
        const tree_part *part = &builder->parts[p];
        const int32_t    begin = builder->begins[p] = tree->n_nodes;
        tree->nodes[part->root] = in_tree(part, begin, 0);
        for (int32_t number = 1; number < part->n_nodes; number++) {
            tree->nodes[tree->n_nodes++] = in_tree(part, begin, number);
        }
    }
    builder->begins[builder->n_parts] = tree->n_nodes;
    return HS_OK;
}

/* The parts have memory while they are split, and until they are joined. */
static hs_status
build_parts(tree_builder *builder)
{
    hs_status status = open_parts(builder);
    builder->shared = status == HS_OK ? hs_shared_new(builder->account) : NULL;
    if (builder->shared == NULL) {
        return HS_ERR_MEMORY;
    }
    status = split_parts(builder);
    if (status == HS_OK) {
        status = join_parts(builder);
    }
    for (int32_t p = 0; p < builder->n_parts; p++) {
        hs_shared_release(builder->shared, (void **)&builder->parts[p].nodes);
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
    return status == HS_OK ? build_parts(builder) : status;
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
        hs_tree_bound(builder->team, bins, builder->begins, builder->n_parts, tree);
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
    hs_free(account, builder.parts);
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
