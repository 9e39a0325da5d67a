/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * nearest_kept.h: a tree that is kept with cells. The first search for the nearest points there
 * builds it; others borrow it, any number of them at once. No call waits: one that comes while it
 * is being built makes a tree for itself alone.
 */
#ifndef HS_NEAREST_KEPT_H
#define HS_NEAREST_KEPT_H

#include "nearest.h"

typedef struct hs_nearest_kept hs_nearest_kept;

/* One without a tree as yet. NULL when memory is short. */
hs_nearest_kept *hs_nearest_kept_new(void);
void             hs_nearest_kept_free(hs_nearest_kept *kept); /* NULL-safe */

/*
 * What has been built, or NULL. *room is then NULL too, or where the caller is to build it: a
 * hs_nearest of zeros but for its search, which is not begun. hs_nearest_kept_end says how that
 * went.
 */
const hs_nearest *hs_nearest_kept_get(hs_nearest_kept *kept, hs_nearest **room);

/* After a failure the room must hold nothing again. */
void hs_nearest_kept_end(hs_nearest_kept *kept, bool done);

#endif
