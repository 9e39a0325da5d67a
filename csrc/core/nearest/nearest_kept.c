/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_kept.c: a mutex guards two flags, is_building and is_built; the tree is built without
 * holding it. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "nearest_kept.h"

#include "tree_build.h"
#include "../base/os_thread.h"

struct hs_nearest_kept {
    hs_mutex   mutex; /* guards the next two; what is built does not change any more */
    bool       is_building;
    bool       is_built;
    hs_nearest near;
    hs_search  search; /* its own, as is its call */
    hs_call    call;
};

hs_nearest_kept *
hs_nearest_kept_new(void)
{
    hs_nearest_kept *kept = hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *kept);
    if (kept != NULL) {
        kept->is_building = kept->is_built = false;
        hs_mutex_init(&kept->mutex);
    }
    return kept;
}

void
hs_nearest_kept_free(hs_nearest_kept *kept)
{
    if (kept == NULL) {
        return;
    }
    if (kept->is_built) {
        hs_tree_free(&kept->call.account, &kept->near.tree);
        hs_search_close(&kept->search);
        hs_account_close(&kept->call.account);
    }
    hs_mutex_destroy(&kept->mutex);
    hs_free(NULL, kept);
}

const hs_nearest *
hs_nearest_kept_get(hs_nearest_kept *kept, hs_nearest **room)
{
    hs_mutex_lock(&kept->mutex);
    const bool is_built = kept->is_built, builds = !is_built && !kept->is_building;
    kept->is_building = kept->is_building || builds;
    hs_mutex_unlock(&kept->mutex);
    *room = NULL;
    if (builds) {
        *room = &kept->near;
        kept->near = (hs_nearest){.search = &kept->search};
        kept->search.call = &kept->call;
    }
    return is_built ? &kept->near : NULL;
}

void
hs_nearest_kept_end(hs_nearest_kept *kept, bool done)
{
    hs_mutex_lock(&kept->mutex);
    kept->is_building = false;
    kept->is_built = done;
    hs_mutex_unlock(&kept->mutex);
}
