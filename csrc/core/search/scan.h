/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_SEARCH_SCAN_H
#define HS_SEARCH_SCAN_H

#include "search.h"

/*
 * scan.h: a scanner's block against its group: candidates appended, copied, put in order where that
 * is wanted, tested by the kernel, decided, and the hits handed to the visitor. The block is the
 * neighbourhood of one group of points, copied once into contiguous float32 arrays relative to a
 * common centre, with the shift of its periodic image already added. All points of the group are
 * then tested against it in long, predictable loops: no ghosts, no minimum image per pair.
 */

#define HS_BLOCK_RUNS 1024 /* runs held at a time, at most */

/*
 * Hits after which a scan stops, so that they can be written out. Measured: the stores of a short
 * burst drain to memory while the next one is scanned; with bursts of thousands the two take turns,
 * which costs up to 0.9 ns a pair. Shorter ones cost more beside.
 */
#define HS_BURST 256

/* Room to put a block in the order of the caller's numbers: a neighbourhood is sorted once for all
 * points of its group, which is some twenty times less work than sorting each point's hits. */
typedef struct hs_order {
    void     *memory;  /* owned: of these arrays, and of the block's origin; NULL: none is sorted */
    uint64_t *entries; /* key << 32 | candidate or run; one for each candidate, as of ... */
    uint64_t *spare;   /* ... all but the last */
    int32_t  *run;     /* in order */
    float    *column;
    int64_t  *shifts; /* of images, by runs: one for each run and given box vector */
} hs_order;

/* One block of candidates at a time, and what scans say about it. The arrays have capacity +
 * HS_PADDING entries where nothing else is said. */
typedef struct hs_block {
    void      *memory; /* owned: of all arrays but those of `order` */
    float     *y[HS_MAX_DIM];
    int32_t   *id;      /* point numbers of the candidates */
    int32_t   *number;  /* their numbers in cell order, as they were gathered */
    int32_t   *place;   /* 0, 1, 2, ..., set as far as needed; NULL unless hits are places */
    int32_t   *origin;  /* where candidates were before they were put in order; NULL when they were
                        * not */
    int32_t   *hits;    /* most_hits + HS_PADDING; NULL when only counting */
    float     *squares; /* of the hits, as many; NULL without HS_BLOCK_LISTS_SQUARES */
    float     *radius;  /* rows of the candidates' radii; NULL without limits */
    int64_t    pitch;   /* from one row to the next */
    hs_unsure *unsure;  /* as many as candidates, or hits, where pairs are chosen (choice.h) */
    hs_run    *runs;    /* most_runs + 1; runs[n_runs].at is the number of candidates */
    hs_order   order;
    int32_t    capacity, most_hits, most_runs;
    int32_t    n_runs;
    int32_t    n;          /* candidates, of all runs */
    int32_t    n_places;   /* entries of `place` that are set */
    bool       has_images; /* some run is in another image */
    /* As writers take them: */
    hs_candidate *candidates;     /* in the memory of the pair batch; NULL where there are none */
    bool          has_candidates; /* they are those of the present block */
    bool          are_fine;       /* hs_write.is_fine, if so */
} hs_block;

/* What a block has room for. */
typedef enum hs_block_use {
    HS_BLOCK_SIZES, /* nothing: candidates are appended, and not looked at */
    HS_BLOCK_COUNTS,
    HS_BLOCK_LISTS_IDS,
    HS_BLOCK_LISTS_PLACES,
    HS_BLOCK_LISTS_SQUARES /* places, all that may be hits, and their float32 squares */
} hs_block_use;

/* The points whose neighbourhood it is: [first, last) in cell order. */
typedef struct hs_group {
    int32_t        first, last;
    double         centre[HS_MAX_DIM];
    float          q[HS_MAX_DIM][HS_GROUP_POINTS]; /* relative to the centre */
    hs_nearest_box near; /* its own box, and how near candidates must be; infinity: not set yet */
    uint32_t       largest; /* bits of the largest |q| or |y| gathered for it so far */
} hs_group;

/* Candidates that can be sorted, and places told apart: more fit no memory that results fit. */
#define HS_ORDER_CANDIDATES (INT64_C(1) << 28)

/* A batch of pairs: from places in the gathered block back to the numbers that were given, as the
 * exact decision and the measuring want them. Arrays have one entry for each pair, HS_BATCH and
 * some more of doubles; those of shifts are one for each row of B. */
typedef struct hs_pair_batch {
    const hs_search *search;      /* borrowed */
    const hs_block  *block;       /* borrowed */
    void            *memory;      /* owned: of the arrays, and of the candidates' */
    bool             is_narrow;   /* all S of the scene are few */
    int              n_rows;      /* of B */
    bool             needs_given; /* S is wanted, or the metric measures between points as given */
    bool             is_plain;    /* shifts over B are those over the box vectors as given */
    int32_t          n;
    int32_t         *place, *si;                    /* of the candidate, and of the asking point */
    double          *p[HS_MAX_DIM], *q[HS_MAX_DIM]; /* what the metric measures between */
    double          *times[HS_MAX_DIM];             /* its shift */
    int64_t         *image[HS_MAX_DIM];             /* shift over B, of X */
    int64_t *given[HS_MAX_DIM]; /* S over the periodic box vectors as given; when needs_given */
    bool     is_shifted;        /* some entry of times is not zero: if not, they may not be set */
    bool     is_wide;           /* some entry is too large for the batch kernels */
} hs_pair_batch;

/* Empties the batch. */
HS_ALWAYS_INLINE void
hs_pair_batch_clear(hs_pair_batch *pair_batch)
{
    pair_batch->n = 0;
    pair_batch->is_shifted = pair_batch->is_wide = false;
}

/* Adds the pair of point si with the candidate at a place; there must be room. */
HS_ALWAYS_INLINE void
hs_pair_batch_put(hs_pair_batch *pair_batch, int32_t si, int32_t place)
{
    pair_batch->si[pair_batch->n] = si;
    pair_batch->place[pair_batch->n] = place;
    pair_batch->n++;
}

/* Adds the pairs of point si with the candidates at n places, as far as there is room; returns how
 * many. They are looked up together, because one point has few hits. */
int32_t hs_pair_batch_add(hs_pair_batch *pair_batch, int32_t si, const int32_t *places, int32_t n);

/* Fills the arrays of the batch: shifts, S when needs_given, and with `metric` what the metric
 * measures between. HS_OK, or HS_ERR_SHIFT_RANGE when S passes its range, with the number of the
 * point. */
hs_status hs_pair_batch_look_up(hs_pair_batch *pair_batch, bool metric, int64_t *failed_point);

/* The batch as the batch kernels take it. */
hs_batch hs_pair_batch_view(hs_pair_batch *pair_batch);

/* Pair e as the functions of metric.h take it; returns shift, filled, or NULL for none. */
const int64_t *hs_pair_batch_pair(const hs_pair_batch *pair_batch, int32_t e, double *p, double *q,
                                  int64_t *shift);

/*
 * What tests one group of points after the other against its neighbourhood: the block of
 * gathered candidates, the group, the batch of pairs to decide, thresholds, and counts of what was
 * done. The walk (walk.h) feeds it, scan.c scans and decides, a visitor gets its hits.
 */

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

/* How a block is scanned. */
typedef struct hs_form {
    double        extent; /* a bound on |y_k| of the block plus |q_k| of the group */
    hs_scan_form  kind;
    hs_thresholds direct;
    hs_limit_form limits; /* for pairs with limits of their own */
} hs_form;

/* Belongs to one thread. */
struct hs_scanner {
    /* Large, and filled before they are read: not cleared at first. */
    hs_form       form; /* of the present group and block */
    hs_group      group;
    hs_block      block;
    hs_pair_batch pair_batch;
    /* From here on all begins as zero. */
    const hs_search *search;     /* borrowed, read only */
    hs_options       options;    /* the call's, with a poll only for the caller's own thread */
    hs_block_use     use;        /* what the visitor gets */
    hs_block_use     scans;      /* what scans list: places, where these are looked at before */
    bool             chooses;    /* pairs that do not count are taken out (choice.h) */
    bool             is_ordered; /* candidates are put in order before they are tested */
    hs_visit_fn      visit;      /* NULL when counting */
    void            *visit_context;
    int64_t          n_subnormal; /* blocks in which subnormal numbers were met */
    bool             flushes;     /* too many: only gathering and scanning flush them from now on */
    bool             block_is_first; /* of its group: candidate t is group point t; half lists */
    hs_neighbourhood of_group, most; /* of the present group, of any so far */
    int64_t          n_found;
    bool             leaves;         /* set by a visitor: HS_STOPPED once the block is done */
    int32_t          blocks;         /* of the present group, scanned or skipped so far */
    int32_t          blocks_to_skip; /* of the next group; they were scanned before */
    int64_t          n_gathered;     /* candidates in blocks, tested or left out */
    int64_t          gather_limit;   /* the walk ends with HS_STOPPED when they are more */
    int64_t          failed_point;   /* whose shift passed its range, for HS_ERR_SHIFT_RANGE */
    hs_stages        stages;
    int64_t          n_groups, n_blocks, n_candidates, n_ambiguous;
    int64_t          work_since_poll;
};

/*
 * A scanner for blocks of so many candidates and runs; no visitor yet. is_ordered: each point's
 * hits come in one visit, ascending by the candidate's number and then by S, for which the whole
 * neighbourhood must fit the block. Memory is freed with the walker's, on failure as well.
 */
hs_status hs_scanner_init(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                          bool is_ordered, hs_scanner *scanner);

/* Makes it ready for what its search has become, without limits, as hs_scanner_init without an
 * order would for the same use, if its memory will do: false where it will not, or where it has
 * none. */
bool hs_scanner_renew(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                      hs_scanner *scanner);

/* Adds what was done to that of the call. */
void hs_scanner_flush_counters(hs_search *search, hs_scanner *scanner);

/* Points [first, last) in cell order are the group from here on, with an empty block. */
void hs_scanner_start(hs_scanner *scanner, int32_t first, int32_t last);

/*
 * Appends points [si, end) of one image to the neighbourhood; a full block is tested first. shift:
 * the image's displacement, ndim doubles; image: that displacement over the rows of B. HS_STOPPED
 * past the gather limit, or when a visitor leaves; what the visitor or the poll say.
 */
hs_status hs_scanner_append(hs_scanner *scanner, int32_t si, int32_t end, const double *shift,
                            const int32_t *image);

/* Tests every point of the group against what has been appended to the block, unless it is one to
 * skip, then empties it; likewise. For the last block of a group, which may be empty. */
hs_status hs_scanner_scan(hs_scanner *scanner);

/* Fills the block's candidates, moved as hs_write says, unless that is done. HS_OK or
 * HS_ERR_INTERRUPTED. */
hs_status hs_scanner_load_candidates(hs_scanner *scanner, const int32_t *base);

/* Whether each pair of the scanner's pair batch, which has been looked up, stays among the hits:
 * HS_BATCH of them. Any status ends the walk. */
typedef hs_status (*hs_decide_fn)(hs_scanner *scanner, uint8_t *stays);

/* Decides scan->unsure, which are hits of points [first, next) of the group, and takes those that
 * do not stay from the hits; the order of the others stays. Any status of hs_pair_batch_look_up and
 * of `by`, with the asking point in scanner->failed_point. */
hs_status hs_scanner_decide(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next,
                            hs_decide_fn by);

/* Whether each pair of the pair batch is within the metric's cutoff, which need not be the scene's.
 * within: HS_BATCH of them. */
void hs_decide_pair_batch(hs_scanner *scanner, const hs_metric *metric, uint8_t *within);

#endif
