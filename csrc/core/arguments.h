/* SPDX-License-Identifier: BSD-3-Clause */
/* arguments.h: what a program of C may get wrong about the arguments of halfshell.h and what would
 * then be read or written out of bounds; Python's are checked before. Values are not looked at
 * here: scene.h does that. */
#ifndef HS_ARGUMENTS_H
#define HS_ARGUMENTS_H

#include "base.h"

#include "../halfshell.h"

/* HS_OK or HS_ERR_ARGUMENT. Points, from 2^31 on: HS_OK, for that is another failure. */
hs_status hs_check_points(const hs_points *points);

/* The same of a box, which may be NULL, for points of this dimension. */
hs_status hs_check_box(const hs_box *box, int ndim);

hs_status hs_check_options(const hs_options *options);

/* All of these; queries and box may be NULL. */
hs_status hs_check_arguments(const hs_points *points, const hs_points *queries, const hs_box *box,
                             const hs_options *options);

#endif
