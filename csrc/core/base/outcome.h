/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * outcome.h: a failure that is still to be told, and how a step inside the core can end besides
 * with a status of halfshell.h. Each function that returns one of these says so; none reaches the
 * caller of the library.
 */
#ifndef HS_OUTCOME_H
#define HS_OUTCOME_H

#include "../../halfshell.h"

/* A failure without details. */
#define HS_NO_FAILURE ((hs_failure){.row = -1, .column = -1, .system = -1})

/* What was kept (cells, a tree, a list) does not serve: it is to be made anew. */
#define HS_UNSERVED ((hs_status)(HS_STATUS_END + 1))

/* There is more than this method is made for: the caller takes another one. */
#define HS_TOO_MUCH ((hs_status)(HS_STATUS_END + 2))

/* The work ended here because something else did: a visitor left, or another thread has failed. */
#define HS_STOPPED ((hs_status)(HS_STATUS_END + 3))

/* The caller's function has seen enough pairs: all threads stop, and that is no failure. */
#define HS_ENOUGH ((hs_status)(HS_STATUS_END + 4))

#endif
