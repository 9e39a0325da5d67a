/* SPDX-License-Identifier: BSD-3-Clause */
/* node_scenes.h: small scenes of node lists: a matrix of pairs, as a half list, and the lists that
 * the points are of, in their order or in another. */
#ifndef HS_NODE_SCENES_H
#define HS_NODE_SCENES_H

#include "../../../csrc/core/connectivity/connectivity.h"
#include "../../../csrc/core/threads/call.h"
#include "harness.h"

enum { NODE_POINTS = 80, NODE_LISTS = 6, NODE_PAIRS = NODE_POINTS * NODE_POINTS };

typedef struct node_scene {
    int32_t n, n_lists;
    int64_t n_nodes[NODE_LISTS], n_ghosts[NODE_LISTS];
    int32_t number[NODE_POINTS]; /* of each point */
    int32_t list[NODE_POINTS], node[NODE_POINTS];
    bool    is_ghost[NODE_POINTS];
    bool    near[NODE_POINTS][NODE_POINTS]; /* symmetric, without its diagonal */
    int64_t n_pairs;
    int32_t i[NODE_PAIRS], j[NODE_PAIRS];
    double  x[NODE_POINTS * HS_MAX_DIM];
} node_scene;

/* Lists of random lengths, some of them 0. */
static inline void
node_lists_fill(harness_random *random, node_scene *scene)
{
    scene->n = 0;
    scene->n_lists = (int32_t)(random_bits(random) % (NODE_LISTS + 1));
    for (int l = 0; l < scene->n_lists; l++) {
        const int64_t n = (int64_t)(random_bits(random) % (NODE_POINTS / NODE_LISTS));
        scene->n_nodes[l] = n;
        scene->n_ghosts[l] = n > 0 ? (int64_t)(random_bits(random) % (uint64_t)(n + 1)) : 0;
        scene->n += (int32_t)n;
    }
    for (int32_t p = 0; p < scene->n; p++)
        scene->number[p] = p;
}

/* Points in another order. */
static inline void
node_lists_shuffle(harness_random *random, node_scene *scene)
{
    for (int32_t p = scene->n - 1; p > 0; p--) {
        const int32_t q = (int32_t)(random_bits(random) % (uint64_t)(p + 1));
        const int32_t held = scene->number[p];
        scene->number[p] = scene->number[q];
        scene->number[q] = held;
    }
}

/* What each point is, from its number. */
static inline void
node_lists_label(node_scene *scene)
{
    for (int32_t p = 0; p < scene->n; p++) {
        int64_t left = scene->number[p];
        int32_t l = 0;
        while (left >= scene->n_nodes[l])
            left -= scene->n_nodes[l++];
        scene->list[p] = l;
        scene->node[p] = (int32_t)left;
        scene->is_ghost[p] = left >= scene->n_nodes[l] - scene->n_ghosts[l];
    }
}

/* Each pair with this probability. */
static inline void
node_pairs_fill(harness_random *random, double share, node_scene *scene)
{
    memset(scene->near, 0, sizeof scene->near);
    scene->n_pairs = 0;
    for (int32_t i = 0; i < scene->n; i++) {
        for (int32_t j = i + 1; j < scene->n; j++) {
            if (random_unit(random) < share) {
                scene->near[i][j] = scene->near[j][i] = true;
                scene->i[scene->n_pairs] = i;
                scene->j[scene->n_pairs++] = j;
            }
        }
    }
}

/* All of it; points on a lattice of small numbers, so that many feet are at the end of a segment. */
static inline void
node_scene_fill(harness_random *random, bool shuffled, node_scene *scene)
{
    node_lists_fill(random, scene);
    if (shuffled)
        node_lists_shuffle(random, scene);
    node_lists_label(scene);
    node_pairs_fill(random, random_unit(random), scene);
    for (int k = 0; k < scene->n * HS_MAX_DIM; k++)
        scene->x[k] = (double)(random_bits(random) % 5) * 0.1;
}

static inline hs_node_lists
node_lists_of(const node_scene *scene, bool shuffled, bool ghost_rows, bool ghost_pairs)
{
    return (hs_node_lists){.n_lists = scene->n_lists,
                           .n_nodes = scene->n_nodes,
                           .n_ghosts = scene->n_ghosts,
                           .number = shuffled ? scene->number : NULL,
                           .ghost_rows = ghost_rows,
                           .ghost_pairs = ghost_pairs};
}

static inline hs_half_list
node_half_of(const node_scene *scene)
{
    return (hs_half_list){.n = scene->n_pairs, .i = scene->i, .j = scene->j};
}

/* How many nodes of lists before `list` have rows. */
static inline int64_t
node_rows_before(const node_scene *scene, int32_t list, bool ghost_rows)
{
    int64_t n = 0;
    for (int32_t l = 0; l < list; l++)
        n += scene->n_nodes[l] - (ghost_rows ? 0 : scene->n_ghosts[l]);
    return n;
}

/* The rows of all nodes, list by list and in the order of points, of those that `has` says; each
 * entry, if shift is not NULL, with two numbers of its own. Returns how many entries there are. */
static inline int64_t
node_rows_fill(const node_scene *scene, bool has[NODE_POINTS][NODE_POINTS], int64_t *offsets,
               int32_t *indices, int32_t *shift)
{
    int32_t point_of[NODE_POINTS];
    int64_t at = 0;
    for (int32_t p = 0; p < scene->n; p++)
        point_of[scene->number[p]] = p;
    for (int32_t row = 0; row < scene->n; row++) {
        for (int32_t l = 0; l < scene->n_lists; l++) {
            *offsets++ = at;
            for (int32_t q = 0; q < scene->n; q++) {
                if (has[point_of[row]][q] && scene->list[q] == l) {
                    if (shift != NULL) {
                        shift[2 * at] = (int32_t)at;
                        shift[2 * at + 1] = -3;
                    }
                    indices[at++] = scene->node[q];
                }
            }
        }
    }
    *offsets = at;
    return at;
}

/* Whether the rows have, list by list and in the order of points, those that `has` says. */
static inline bool
node_rows_are(const node_scene *scene, bool ghost_rows, bool has[NODE_POINTS][NODE_POINTS],
              const int64_t *offsets, const int32_t *indices)
{
    bool right = true;
    for (int32_t p = 0; p < scene->n; p++) {
        const int64_t row = node_rows_before(scene, scene->list[p], ghost_rows) + scene->node[p];
        for (int32_t l = 0; (ghost_rows || !scene->is_ghost[p]) && l < scene->n_lists; l++) {
            int64_t at = offsets[row * scene->n_lists + l];
            for (int32_t q = 0; right && q < scene->n; q++) {
                if (has[p][q] && scene->list[q] == l)
                    right = indices[at++] == scene->node[q];
            }
            right = right && at == offsets[row * scene->n_lists + l + 1];
        }
    }
    return right;
}

#endif
