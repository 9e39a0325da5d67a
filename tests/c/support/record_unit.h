/* SPDX-License-Identifier: BSD-3-Clause */
/* record_unit.h: all pairs of an open search, recorded by one walk, and whether each is what it
 * says. */
#ifndef HS_RECORD_UNIT_H
#define HS_RECORD_UNIT_H

#include "../../../csrc/core/collect/record.h"
#include "search_unit.h"

#include <math.h>

typedef struct record_unit {
    hs_recorder recorder;
    hs_output   output;
} record_unit;

/* Records; record_unit_free in any case. *failed_point: where a status is about one. */
static inline hs_status
record_all(search_unit *unit, unsigned columns, int index_bytes, int32_t *failed_point,
           record_unit *recorded)
{
    hs_search  *search = &unit->search;
    hs_account *account = &unit->call.account;
    hs_walker   walker;
    hs_output_init(account, unit->points.ndim, columns, index_bytes, &recorded->output);
    hs_status status = hs_walker_init(search, hs_record_use(columns), hs_record_hits,
                                      &recorded->recorder, &walker);
    CHECK(status == HS_OK);
    CHECK(hs_recorder_init(account, &recorded->output, walker.scanner.block.most_hits,
                           &recorded->recorder) == HS_OK);
    status = hs_walk(&walker, 0, (int32_t)search->bins.n);
    *failed_point = status == HS_ERR_SHIFT_RANGE ? (int32_t)walker.scanner.failed_point : -1;
    hs_walker_close(search, &walker);
    return status;
}

static inline void
record_unit_free(search_unit *unit, record_unit *recorded)
{
    hs_recorder_free(&unit->call.account, &recorded->recorder);
    hs_output_free(&recorded->output);
}

/* i or j of pair e. */
static inline int64_t
recorded_index(const record_unit *recorded, unsigned bit, int64_t e)
{
    const void *column = hs_output_column(&recorded->output, bit);
    return recorded->output.index_bytes == 8 ? ((const int64_t *)column)[e]
                                             : ((const int32_t *)column)[e];
}

#endif
