/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * fpenv.h: the floating-point environment that the exact stages need: round to nearest, no
 * flushing of subnormal numbers. Every entry into the core enters it and leaves it.
 */
#ifndef HS_FPENV_H
#define HS_FPENV_H

#include <stdint.h>

typedef struct hs_fpenv {
    uint64_t control; /* the control register as it was */
} hs_fpenv;

/* Save the control register, then set the defaults. */
hs_fpenv hs_fpenv_enter(void);

/* Put back what hs_fpenv_enter found. Exception flags are put back too. */
void hs_fpenv_leave(hs_fpenv saved);

#endif
