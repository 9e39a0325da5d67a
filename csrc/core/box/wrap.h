/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * wrap.h: X = r - w B, with integers w that bring the point r into the box. Nothing is lost: any w
 * will do, because a pair's shift S is corrected by w_i - w_j, in integers.
 */
#ifndef HS_WRAP_H
#define HS_WRAP_H

#include "lattice.h"

#define HS_WRAP_LIMIT 0x1p51     /* turns beyond this are not known exactly */
#define HS_WRAP_UNKNOWN INT64_MIN /* stands for such a number of turns */

/*
 * Along one coordinate axis of an aligned box: returns x - turns * length, exactly, in
 * [-length/2, length/2]. Exact for any finite x; *turns is HS_WRAP_UNKNOWN beyond the limit.
 */
double hs_wrap_axis(double x, double length, int64_t *turns);

/*
 * In any box. r: ndim scaled coordinates. inside: receives X rounded, in the middle period
 * (|t_k| <= period/2) but for rounding. turns: receives n_periodic integers, over B. Returns false
 * beyond the limit. *magnitude: raised to the largest sum of absolute terms; the error of each
 * component of X is at most 2^-53 |X| + (2 n_periodic + 2)^2 2^-104 magnitude.
 */
bool hs_wrap_point(const hs_lattice *lattice, const double *r, double *inside, int64_t *turns,
                   double *magnitude);

/*
 * X = r - turns * B, rounded, for turns over B; without turns r itself. Returns false when a turn
 * over the given rows passes 2^62. *magnitude as above.
 */
bool hs_wrap_by(const hs_lattice *lattice, const double *r, const int64_t *turns, double *inside,
                double *magnitude);

#endif
