/* SPDX-License-Identifier: BSD-3-Clause */
/* cpu.h: what this CPU can run and its operating system keeps across context switches. */
#ifndef HS_CPU_H
#define HS_CPU_H

#include <stdbool.h>

bool hs_cpu_has_avx2(void);   /* with FMA and POPCNT */
bool hs_cpu_has_avx512(void); /* F, BW, DQ and VL */

#endif
