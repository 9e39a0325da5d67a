/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * record.h: turns hits into pairs of the half list: i < j, or for a point and its own image the
 * first nonzero component of S positive, with D, d and S of that orientation.
 */
#ifndef HS_RECORD_H
#define HS_RECORD_H

#include "recorder.h"

/* A hs_visit_fn. */
hs_status hs_record_hits(void *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits);

#endif
