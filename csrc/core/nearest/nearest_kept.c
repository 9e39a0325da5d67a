/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_kept.c: who may build is decided by one compare-and-swap. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "nearest_kept.h"

#include "tree_build.h"
#include "../base/os_thread.h"

#define NOTHING 0
#define BUILT   1 /* and does not change any more */
#define BUILDS  2 /* a thread, after state - BUILDS forks */

struct hs_nearest_kept {
    volatile int64_t state;
    hs_nearest       near;
    hs_search        search; /* its own, as is its call */
    hs_call          call;
};

hs_nearest_kept *
hs_nearest_kept_new(void)
{
    hs_nearest_kept *kept = hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *kept);
    if (kept != NULL) {
        kept->state = NOTHING;
    }
    return kept;
}

void
hs_nearest_kept_free(hs_nearest_kept *kept)
{
    if (kept == NULL) {
        return;
    }
    if (hs_atomic_load(&kept->state) == BUILT) {
        hs_tree_free(&kept->call.account, &kept->near.tree);
        hs_search_close(&kept->search);
        hs_account_close(&kept->call.account);
    }
    hs_free(NULL, kept);
}

const hs_nearest *
hs_nearest_kept_get(hs_nearest_kept *kept, hs_nearest **room)
{
    const int64_t state = hs_atomic_load(&kept->state), now = BUILDS + hs_atomic_load(&hs_n_forks);
    const bool    is_built = state == BUILT;
    /* What a thread that does not exist in this process has begun is lost, and built anew. */
    const bool builds = !is_built && state != now && hs_atomic_swap_if(&kept->state, state, now);
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
    hs_atomic_store(&kept->state, done ? BUILT : NOTHING);
}
