/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_COLLECT_COMPONENTS_H
#define HS_COLLECT_COMPONENTS_H

#include "../memory/memory.h"
#include "../box/wrap.h"
#include "../scene/points.h"
#include "columns.h"
#include "../threads/call.h"

/*
 * components.h: which points hang together, from pairs that are looked at one by one and forgotten:
 * a forest in which each tree is a component and its root the lowest number (disjoint sets). Where
 * windings are wanted, each point also knows in which image of it the way from its root ends: a
 * pair that closes a ring whose ends lie in different images winds around the box.
 */

typedef struct hs_components {
    int64_t   n;
    int       n_axes; /* of shifts; 0: windings are not wanted */
    int32_t  *parent; /* n, owned; of a root, itself */
    uint32_t *image; /* n * n_axes, owned: the image of a point that its parent's tree reaches, as a
                       * shift from its parent, modulo 2^32 */
    uint8_t  *winds; /* n, owned: of a root, a bit for each box vector */
} hs_components;

/* n points, each alone. HS_OK or HS_ERR_MEMORY: then it holds nothing. 0 <= n < 2^31. */
hs_status hs_components_open(hs_account *account, int64_t n, int n_axes, hs_components *components);

/* Idempotent. */
void hs_components_close(hs_account *account, hs_components *components);

/* Points i and j, in image S of j, belong together. S: n_axes entries. */
void hs_components_join(hs_components *components, int32_t i, int32_t j, const int32_t *S);

/*
 * Numbers the components by their lowest point, from 0, and returns how many there are. labels: n;
 * points for which `counts`, unless NULL, has 0 have not been joined to any: they get -1 and no
 * component. winding: NULL, or as many as components, at most n: bit l says whether the component
 * winds along box vector l; 0 where windings were not wanted.
 */
int64_t hs_components_label(hs_components *components, const uint8_t *counts, int64_t *labels,
                            uint8_t *winding);

/* d, D and S of pairs that the caller gives, in their order. */

/* What pairs are measured between; all borrowed. */
typedef struct hs_given_pairs {
    const hs_pair_numbers *pairs;
    const hs_cloud        *cloud;
    const hs_image_box    *box;
    hs_output             *output; /* with room for them */
} hs_given_pairs;

/*
 * Fills the output's columns of d, D and S. HS_ERR_ARGUMENT for a number that is no point's, or a
 * shift along an axis that does not repeat or beyond 2^62; HS_ERR_SHIFT_RANGE and HS_ERR_BOX_SKEWED
 * as hs_near_image, the former also for an S that does not fit its column; HS_ERR_FAR for a vector
 * that float64 does not hold. failure->row is the number of the first such pair in its part of
 * them. HS_ERR_INTERRUPTED.
 */
hs_status hs_given_pairs_measure(const hs_given_pairs *given, hs_call *call, hs_failure *failure);

#endif
