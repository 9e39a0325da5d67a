/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_SEARCH_SCAN_H
#define HS_SEARCH_SCAN_H

#include "../cells/bins.h"
#include "../../kernels/kernel.h"
#include "search.h"

/*
 * scan.h: a scanner's block against its group: candidates appended, copied, put in order where that
 * is wanted, tested by the kernel, decided, and the hits handed to the visitor.
 */

/*
 * The neighbourhood of one group of points, copied once into contiguous float32
 * arrays relative to a common centre, with the shift of its periodic image already added. All
 * points of the group are then tested against it in long, predictable loops: no ghosts, no minimum
 * image per pair.
 */

#define HS_BLOCK_RUNS 1024 /* runs held at a time, at most */

/* Hits held at a time, as a multiple of the candidates: those of a few points at least. Blocks of
 * fewer candidates than a burst have room for one hit each and a burst. */
#define HS_HITS_PER_CANDIDATE 2
/*
 * Hits after which a scan stops, so that they can be written out. Measured: the stores of a short
 * burst drain to memory while the next one is scanned; with bursts of thousands the two take turns,
 * which costs up to 0.9 ns a pair. Shorter ones cost more beside.
 */
#define HS_BURST 256

/* One block of candidates at a time, and what scans say about it. The arrays have capacity +
 * HS_PADDING entries where nothing else is said. */
typedef struct hs_block {
    void      *memory; /* owned: of all arrays but radius and origin, which have their own */
    float     *y[HS_MAX_DIM];
    float     *norm;    /* sum of y_k^2 */
    int32_t   *id;      /* point numbers of the candidates */
    int32_t   *number;  /* their numbers in cell order, as they were gathered */
    int32_t   *place;   /* 0, 1, 2, ..., set as far as needed; NULL unless hits are places */
    int32_t   *origin;  /* where candidates were before they were put in order; NULL when they were
                        * not */
    int32_t   *hits;    /* most_hits + HS_PADDING; NULL when only counting */
    float     *squares; /* of the hits, as many; NULL without HS_BLOCK_LISTS_SQUARES */
    float     *radius;  /* rows of the candidates' radii, owned; NULL until hs_block_add_radii */
    int64_t    pitch;   /* from one row to the next */
    hs_unsure *unsure;  /* capacity */
    hs_run    *runs;    /* most_runs + 1; runs[n_runs].at is the number of candidates */
    int32_t    capacity, most_hits, most_runs;
    int32_t    n_runs;
    int32_t    n;        /* candidates, of all runs */
    int32_t    n_places; /* entries of `place` that are set */
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

/* Room for so many rows of radii of the candidates besides. On failure the block may be freed. */
hs_status hs_block_add_radii(hs_account *account, int32_t n_rows, hs_block *block);

/* most_hits of a block of this capacity. */
int32_t hs_block_most_hits(int32_t capacity);

#define HS_EXTENT_SHIFT 18 /* bits of the mantissa that extents do without */

/* Runs appended or gathered between two polls. Where there are so many each has few candidates. */
#define HS_RUNS_PER_POLL (1 << 16)

/* Chooses the centre. */
void hs_group_start(const hs_bins *bins, int32_t first, int32_t last, hs_group *group);

/* Its box, from its points, which it loads; returns the largest |q_k|. */
float hs_group_bound(const hs_bins *bins, hs_group *group);

/* The bits of a float >= 0, rounded up to the top five bits of the mantissa, which adds 1/32 at
 * most: so that few different thresholds are needed. NaN and infinity remain. */
HS_ALWAYS_INLINE uint32_t
hs_extent_bits(uint32_t bits)
{
    const uint32_t low = (UINT32_C(1) << HS_EXTENT_SHIFT) - 1;
    return bits < UINT32_C(0x7f800000) ? (bits + low) & ~low : bits;
}

HS_ALWAYS_INLINE bool
hs_block_is_full(const hs_block *block)
{
    return block->n == block->capacity || block->n_runs == block->most_runs;
}

/*
 * Gathered candidates in the order of the caller's numbers, so that hits come
 * out sorted: a neighbourhood is sorted once for all points of its group, which is some twenty
 * times less work than sorting each point's hits.
 */

/* Candidates that can be sorted, and places told apart: more fit no memory that results fit. */
#define HS_ORDER_CANDIDATES (INT64_C(1) << 28)

/* Room to sort a block in; owned, one entry for each candidate. */
typedef struct hs_order {
    uint64_t *entries; /* key << 32 | place */
    uint64_t *spare;
    float    *column;
    int64_t  *shifts; /* of images, by runs: one for each run and given box vector */
} hs_order;

/* Frees it, and the `origin` of the block. Idempotent. */
void hs_order_free(hs_account *account, hs_block *block, hs_order *order);

/*
 * What was given of the candidates of a block: float64 coordinates, images and turns, as
 * the exact decision and the measuring want them. One record a candidate, because hits are few and
 * far between: a cache line has all of one.
 */

/* Arrays have `width` entries for each place of the block. */
typedef struct hs_records {
    const hs_search  *search; /* borrowed */
    void             *memory; /* owned: of the arrays */
    const hs_block   *block;  /* borrowed */
    const hs_options *polls;  /* borrowed; polled while a large block is loaded */
    int               width;  /* HS_RECORD, or twice that where a record does not hold all axes */
    double           *q;      /* what the metric measures to */
    int32_t          *image;  /* shift over B, of X; not set without images */
    int64_t          *turned; /* `image` less the turns by which the candidate was wrapped; ... */
    int32_t          *few;    /* ... as int32, when is_narrow; not set where turns are not known */
    bool              needs_given; /* turned or few are set */
    bool              is_narrow;   /* all S of the scene are few */
    bool has_metric, has_given;    /* arrays are the block's: q and image; turned or few */
    bool has_images, knows_images; /* some candidate is in another image; valid if knows_images */
    hs_candidate *candidates;      /* as writers take them; NULL where there are none */
    bool          has_candidates, are_fine; /* hs_write.is_fine; valid if has_candidates */
} hs_records;

/* Call when the block has new candidates: they will be looked up again. */
HS_ALWAYS_INLINE void
hs_records_reset(hs_records *records)
{
    records->has_metric = records->has_given = records->knows_images = false;
    records->has_candidates = false;
}

/* Fills what is needed for all candidates of the block, as far as that is not done yet; `metric`:
 * also q. HS_OK or HS_ERR_INTERRUPTED. */
hs_status hs_records_load(hs_records *records, bool metric);

/* Fills candidates, moved as hs_write says, unless that is done. HS_OK or HS_ERR_INTERRUPTED. */
hs_status hs_records_load_candidates(hs_records *records, const int32_t *base);

/* Whether some candidate is in another image. */
bool hs_records_has_images(hs_records *records);

/*
 * From places in the gathered block back to the numbers that were given, a batch of
 * pairs at a time, as the exact decision and the measuring want them.
 */

/* A batch of pairs. Arrays have one entry for each pair, HS_BATCH and some more of doubles; those
 * of shifts are one for each row of B. */
typedef struct hs_pair_batch {
    const hs_search *search;   /* borrowed */
    void            *memory;   /* owned: of the arrays */
    hs_records       of;       /* the candidates */
    int              n_rows;   /* of B, and ... */
    bool             as_given; /* ... whether the metric measures between points as given */
    bool             is_plain; /* shifts over B are those over the box vectors as given */
    int32_t          n;
    int32_t         *place, *si;                    /* of the candidate, and of the asking point */
    double          *p[HS_MAX_DIM], *q[HS_MAX_DIM]; /* what the metric measures between */
    double          *times[HS_MAX_DIM];             /* its shift */
    int64_t         *image[HS_MAX_DIM];             /* shift over B, of X */
    int64_t *given[HS_MAX_DIM]; /* S over the periodic box vectors as given; when needs_given */
    int32_t *shift[HS_MAX_DIM]; /* S as int32, when is_narrow */
    bool     has_zeros;         /* image holds nothing but zeros */
    bool     is_shifted;        /* some entry of times is not zero */
    bool     is_wide;           /* some entry is too large for the batch kernels */
} hs_pair_batch;

/* needs_given: whether S is wanted, or else only what the metric needs. */
hs_status hs_pair_batch_init(const hs_search *search, const hs_block *block,
                             const hs_options *polls, bool needs_given, hs_pair_batch *pair_batch);
void      hs_pair_batch_free(hs_account *account, hs_pair_batch *pair_batch);

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

/*
 * Fills the arrays of the batch: S, when needs_given, and unless `metric` is false and S needs
 * nothing else, what the metric measures between. HS_OK; HS_ERR_SHIFT_RANGE when a shift passes its
 * range, with the number of the point; HS_ERR_INTERRUPTED.
 */
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
    hs_form       forms[HS_FORMS]; /* by the last bits of the extent */
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

/* Opens scanners, makes them ready for another search, closes them. */

/*
 * A scanner for blocks of so many candidates and runs; no visitor yet. is_ordered: each point's
 * hits come in one visit, ascending by the candidate's number and then by S, for which the whole
 * neighbourhood must fit the block. On failure it may be closed.
 */
hs_status hs_scanner_init(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                          bool is_ordered, hs_scanner *scanner);

/* Makes it ready for what its search has become, as hs_scanner_init without an order would, if its
 * memory will do: false where it will not, or where it has none. */
bool hs_scanner_renew(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
                      hs_scanner *scanner);

/* Adds what was done to that of the call. */
void hs_scanner_flush_counters(hs_search *search, hs_scanner *scanner);

/* hs_scanner_flush_counters, and frees; idempotent. */
void hs_scanner_close(hs_search *search, hs_scanner *scanner);

/* Points [first, last) in cell order are the group from here on, with an empty block. */
void hs_scanner_start(hs_scanner *scanner, int32_t first, int32_t last);

/*
 * Appends points [si, end) of one image to the neighbourhood; a full block is tested first. shift:
 * the image's displacement, ndim doubles; image: that displacement over the rows of B. Any status
 * of hs_scan_block.
 */
hs_status hs_scanner_append(hs_scanner *scanner, int32_t si, int32_t end, const double *shift,
                            const int32_t *image);

/*
 * Tests every point of the group against what has been appended to the block, unless it is one to
 * skip, then empties it. HS_STOPPED past the candidate limit, or when a visitor leaves; what the
 * visitor or the poll say.
 */
hs_status hs_scan_block(hs_scanner *scanner);

/* The last block of the group, and what is known of the group then. */
hs_status hs_scanner_finish(hs_scanner *scanner);

/*
 * How a block is scanned. Its extent decides form and thresholds of the scan; groups
 * of a search have few extents, and what follows from each is kept.
 */

/* Sets scanner->form by the size of the present group and block. */
void hs_form_set(hs_scanner *scanner);

/* The exact decision of the hits that float32 could not tell. */

/* Whether each pair of the pair batch is within the metric's cutoff, which need not be the scene's.
 * within: HS_BATCH of them. */
void hs_decide_pair_batch(hs_scanner *scanner, const hs_metric *metric, uint8_t *within);

#endif
