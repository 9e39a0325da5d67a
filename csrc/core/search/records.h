/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * records.h: what was given of the candidates of a block: float64 coordinates, images and turns, as
 * the exact decision and the measuring want them. One record a candidate, because hits are few and
 * far between: a cache line has all of one.
 */
#ifndef HS_RECORDS_H
#define HS_RECORDS_H

#include "neighbourhood.h"
#include "search.h"

/* Arrays have `width` entries for each place of the block. */
typedef struct hs_records {
    const hs_search  *search; /* borrowed */
    void             *memory; /* owned: of the arrays */
    const hs_block   *block;  /* borrowed */
    const hs_options *polls;  /* borrowed; polled while a large block is loaded */
    int               width;  /* HS_RECORD, or twice that where a record does not hold all axes */
    double           *q;     /* what the metric measures to; last in a record of three or fewer, the
                               * bits of the candidate's number */
    int32_t          *image; /* shift over B, of X; not set without images */
    int64_t          *turned; /* `image` less the turns by which the candidate was wrapped; ... */
    int32_t          *few;    /* ... as int32, when is_narrow; not set where turns are not known */
    bool              needs_given; /* turned or few are set */
    bool              is_narrow;   /* all S of the scene are few */
    bool has_metric, has_given;    /* arrays are the block's: q and image; turned or few */
    bool has_images, knows_images; /* some candidate is in another image; valid if knows_images */
} hs_records;

/* needs_given: whether S is wanted, or else only what the metric needs. */
hs_status hs_records_init(const hs_search *search, const hs_block *block, const hs_options *polls,
                          bool needs_given, hs_records *records);
void      hs_records_free(hs_account *account, hs_records *records);

/* Call when the block has new candidates: they will be looked up again. */
HS_ALWAYS_INLINE void
hs_records_reset(hs_records *records)
{
    records->has_metric = records->has_given = records->knows_images = false;
}

/* Fills what is needed for all candidates of the block, as far as that is not done yet; `metric`:
 * also q. HS_OK or HS_ERR_INTERRUPTED. */
hs_status hs_records_load(hs_records *records, bool metric);

/* Whether some candidate of the block is in another image; looks at its runs once. */
bool hs_records_has_images(hs_records *records);

/* Whether every S of the scene is the sum of an image and of turns that are known to be few. */
bool hs_has_narrow_shifts(const hs_search *search);

/* Whether shifts over B are those over the box vectors as given. */
bool hs_has_plain_shifts(const hs_lattice *lattice);

#endif
