/* SPDX-License-Identifier: BSD-3-Clause */
/* tree_split.c: a node is split at a sampled middle of its widest axis, or between the outermost
 * points where the sample is all in one place. */
#include "tree_split.h"

#include <string.h>

/* Points that say where a node is split: enough for halves of 35 to 65 of 100. */
#define SAMPLE       15
#define LARGE_SAMPLE 63
#define FEW_SAMPLE   7
/* Nodes with more points than this are worth a larger sample, with fewer a smaller one. */
#define LARGE_NODE 4096
#define SMALL_NODE 32

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

/* Finds where to split, by a sample picked evenly from the node; false when it is all in
 * one place. */
static bool
cut_by_sample(const hs_splitter *splitter, const hs_tree_node *node, tree_cut *cut)
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
cut_by_range(const hs_splitter *splitter, const hs_tree_node *node, tree_cut *cut)
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
is_spot(const hs_splitter *splitter, const hs_tree_node *node)
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
partition(const hs_splitter *splitter, const hs_tree_node *node, const tree_cut *cut)
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

int32_t
hs_tree_split(const hs_splitter *splitter, hs_tree_node *node)
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
