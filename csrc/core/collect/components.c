/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * components.c: the forest. Ways to the root are halved as they are gone, and a root hangs itself
 * under a lower one. Shifts are added modulo 2^32: a ring that is missed would have to wind 2^32
 * times around the box.
 */
#include "components.h"

hs_status
hs_components_open(hs_account *account, int64_t n, int n_axes, hs_components *components)
{
    *components = (hs_components){.n = n, .n_axes = n_axes};
    components->parent = hs_alloc(account, HS_FOR_INDICES, n, sizeof(int32_t));
    bool complete = components->parent != NULL;
    if (n_axes > 0) {
        components->image = hs_alloc(account, HS_FOR_SHIFTS, n, (size_t)n_axes * sizeof(uint32_t));
        components->winds = hs_alloc(account, HS_FOR_SHIFTS, n, 1);
        complete = complete && components->image != NULL && components->winds != NULL;
    }
    if (!complete) {
        hs_components_close(account, components);
        return HS_ERR_MEMORY;
    }
    for (int64_t p = 0; p < n; p++) {
        components->parent[p] = (int32_t)p;
    }
    if (n_axes > 0) {
        memset(components->image, 0, (size_t)n * (size_t)n_axes * sizeof(uint32_t));
        memset(components->winds, 0, (size_t)n);
    }
    return HS_OK;
}

void
hs_components_close(hs_account *account, hs_components *components)
{
    hs_free(account, components->parent);
    hs_free(account, components->image);
    hs_free(account, components->winds);
    *components = (hs_components){0};
}

/* The root of a point; *image is where the way from it ends, if shifts are kept. */
static int32_t
root_of(hs_components *components, int32_t p, uint32_t *image)
{
    int32_t  *parent = components->parent;
    const int n_axes = components->n_axes;
    for (int l = 0; l < n_axes; l++) {
        image[l] = 0;
    }
    while (parent[p] != p) {
        const int32_t   above = parent[p];
        uint32_t       *from_parent = components->image + (int64_t)p * n_axes;
        const uint32_t *of_point = components->image + (int64_t)above * n_axes;
        for (int l = 0; l < n_axes; l++) { /* zero where the parent is the root */
            from_parent[l] += of_point[l];
            image[l] += from_parent[l];
        }
        parent[p] = parent[above];
        p = parent[p];
    }
    return p;
}

void
hs_components_join(hs_components *components, int32_t i, int32_t j, const int32_t *S)
{
    uint32_t      image_i[HS_MAX_DIM], image_j[HS_MAX_DIM], between[HS_MAX_DIM];
    const int     n_axes = components->n_axes;
    const int32_t a = root_of(components, i, image_i), b = root_of(components, j, image_j);
    const int32_t root = a < b ? a : b, lower = a < b ? b : a;
    uint8_t       winds = 0;
    /* From root a to the tree of b: to i, over the pair, and from j back to b. */
    for (int l = 0; l < n_axes; l++) {
        between[l] = image_i[l] + (uint32_t)S[l] - image_j[l];
        winds |= (uint8_t)((between[l] != 0) << l);
    }
    if (a == b) {
        if (n_axes > 0) {
            components->winds[a] |= winds;
        }
        return;
    }
    components->parent[lower] = root;
    for (int l = 0; l < n_axes; l++) {
        components->image[(int64_t)lower * n_axes + l] = a < b ? between[l] : 0u - between[l];
    }
    if (n_axes > 0) {
        components->winds[root] |= components->winds[lower];
    }
}

int64_t
hs_components_label(hs_components *components, const uint8_t *counts, int64_t *labels,
                    uint8_t *winding)
{
    int64_t  n_found = 0;
    uint32_t image[HS_MAX_DIM];
    for (int64_t p = 0; p < components->n; p++) {
        const int32_t root = root_of(components, (int32_t)p, image);
        if (counts != NULL && counts[p] == 0) {
            labels[p] = -1;
        } else if (root < p) {
            labels[p] = labels[root];
        } else {
            if (winding != NULL) {
                winding[n_found] = components->n_axes > 0 ? components->winds[p] : 0;
            }
            labels[p] = n_found++;
        }
    }
    return n_found;
}
