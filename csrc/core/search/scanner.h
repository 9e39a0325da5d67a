/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scanner.h: what tests one group of points after the other against its neighbourhood: the block of
 * gathered candidates, the group, the batch of pairs to decide, thresholds, and counts of what was
 * done. The walk (walk.h) feeds it, scan.h and decide.h work on it, a visitor gets its hits.
 */
#ifndef HS_SCANNER_H
#define HS_SCANNER_H

#include "neighbourhood.h"
#include "neighbourhood_sort.h"
#include "pair_batch.h"

typedef struct hs_scanner hs_scanner;

/*
 * The decided hits of points [first, first + hits->n) in cell order against the present block, as
 * entries of scanner->block: point numbers, or places when scanner->use says so; with
 * HS_BLOCK_COUNTS only where they would end. With HS_BLOCK_LISTS_SQUARES they are not decided, and
 * scanner->block.squares are theirs. Anything but HS_OK ends the walk with that status.
 */
typedef hs_status (*hs_visit_fn)(void *context, hs_scanner *scanner, int32_t first,
                                 const hs_hits *hits);

/* How large the neighbourhood of a group is. */
typedef struct hs_neighbourhood {
    int64_t candidates, runs;
} hs_neighbourhood;

/* How blocks of one extent are scanned, in a search of such a cutoff and error. */
typedef struct hs_form {
    double        extent; /* a bound on |y_k| of the block plus |q_k| of the group; -1: not set */
    double        cutoff, cutoff_low, error;
    bool          is_extreme;
    hs_scan_fn    scan;
    hs_thresholds direct;
    hs_expanded   expanded;
    hs_limit_form limits; /* for pairs with limits of their own */
} hs_form;

/* Forms that a scanner keeps: those of half a binary order (hs_extent_bits). */
#define HS_FORMS 16

/* Belongs to one thread. */
struct hs_scanner {
    /* Large, and filled before they are read: not cleared at first. */
    hs_form  forms[HS_FORMS]; /* by the last bits of the extent */
    hs_group group;
    hs_block block;
    hs_trace trace;
    /* From here on all begins as zero. */
    const hs_search *search;     /* borrowed, read only */
    hs_options       options;    /* the call's, with a poll only for the caller's own thread */
    hs_block_use     use;        /* what the visitor gets */
    hs_block_use     scans;      /* what scans list: places, where these are looked at before */
    bool             chooses;    /* pairs that do not count are taken out (choose.h) */
    bool             is_ordered; /* candidates are put in order before they are tested */
    hs_order         order;
    hs_visit_fn      visit; /* NULL when counting */
    void            *visit_context;
    const hs_form   *form;        /* of the present group and block */
    int64_t          n_subnormal; /* blocks in which subnormal numbers were met */
    bool             flushes;     /* too many: only gathering and scanning flush them from now on */
    bool             block_is_first; /* of its group: candidate t is group point t; half lists */
    hs_neighbourhood of_group, most; /* of the present group, of any so far */
    int64_t          n_found;
    bool             leaves;          /* set by a visitor: HS_STOPPED once the block is done */
    int32_t          blocks;          /* of the present group, scanned or skipped so far */
    int32_t          blocks_to_skip;  /* of the next group; they were scanned before */
    int64_t          candidate_limit; /* the walk ends with HS_STOPPED when it has tested more */
    int64_t          failed_point;    /* whose shift passed its range, for HS_ERR_SHIFT_RANGE */
    hs_stages        stages;
    int64_t          n_groups, n_blocks, n_candidates, n_ambiguous;
    int64_t          work_since_poll;
};

/* hs_search_fraction where the scanner is. */
HS_ALWAYS_INLINE double
hs_scanner_fraction(const hs_scanner *scanner)
{
    return hs_search_fraction(scanner->search, scanner->group.first);
}

#endif
