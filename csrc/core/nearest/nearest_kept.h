/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * nearest_kept.h: a tree that is kept with cells. The first search for the nearest points there
 * builds it; others borrow it, any number of them at once. No call waits: one that comes while it
 * is being built makes a tree for itself alone.
 */
#ifndef HS_NEAREST_KEPT_H
#define HS_NEAREST_KEPT_H

#include "nearest.h"

typedef struct hs_near_kept hs_near_kept;

/* One without a tree as yet. NULL when memory is short. */
hs_near_kept *hs_near_kept_new(void);
void          hs_near_kept_free(hs_near_kept *kept); /* NULL-safe */

/*
 * What has been built, or NULL. *room is then NULL too, or where the caller is to build it: a
 * hs_near of zeros but for its search, which is not begun. hs_near_kept_end says how that went.
 */
const hs_near *hs_near_kept_get(hs_near_kept *kept, hs_near **room);

/* After a failure the room must hold nothing again. */
void hs_near_kept_end(hs_near_kept *kept, bool done);

#endif
