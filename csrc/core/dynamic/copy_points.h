/* SPDX-License-Identifier: BSD-3-Clause */
/* copy_points.h: the points of a list in another one, which takes no more memory than they need. */
#ifndef HS_COPY_POINTS_H
#define HS_COPY_POINTS_H

#include "dynamic.h"

/* copy: a new list of the same kind. HS_ERR_MEMORY: it holds no points. */
hs_status hs_copy_points(const hs_dynamic *list, hs_dynamic *copy);

#endif
