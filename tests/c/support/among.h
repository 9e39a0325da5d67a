/* SPDX-License-Identifier: BSD-3-Clause */
/* among.h: short forms of hs_among, for arguments; they last until the end of the block. */
#ifndef HS_AMONG_H
#define HS_AMONG_H

#include "../../../csrc/halfshell.h"

#define AMONG(p, b)         (&(hs_among){.points = (p), .box = (b)})
#define QUERIED(p, q, b)    (&(hs_among){.points = (p), .queries = (q), .box = (b)})
#define IN_CELLS(c)         (&(hs_among){.cells = (c)})
#define QUERIED_CELLS(c, q) (&(hs_among){.cells = (c), .queries = (q)})

#endif
