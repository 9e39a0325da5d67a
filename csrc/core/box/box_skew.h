/* SPDX-License-Identifier: BSD-3-Clause */
/* box_skew.h: boxes that are refused, because float64 does not place points in them. */
#ifndef HS_BOX_SKEW_H
#define HS_BOX_SKEW_H

#include "lattice.h"

/* Whether reduction has failed: rows of B nearly depend on each other, or have coefficients over
 * the given box vectors that no shift may have. */
bool hs_skew_is_left(const hs_lattice *lattice);

/* Why a search would meet more images or rows of cells than any memory holds: HS_ERR_BOX_SKEWED or
 * HS_ERR_MEMORY, because the cutoff spans them. */
hs_status hs_skew_or_memory(const hs_lattice *lattice);

#endif
