/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * halfshell.h: the public C interface. Every pair of points within a cutoff, decided exactly for
 * the floating-point numbers that were given.
 *
 * Words: a point is a row of the input; the box is up to d row vectors, some of which repeat
 * (periodic); a cell is one bin of the search grid; a shift S is a row of integers, one per box
 * vector, zero where the box does not repeat; a pair is (i, j, S) with the vector D = point[j] -
 * point[i] + S * box.
 *
 * Rules: nothing here prints, reads the environment or, but for hs_pool_*, keeps state between
 * calls. Every function may be called from several threads at once. On failure outputs are
 * untouched or NULL, and `hs_failure` says what was wrong.
 */
#ifndef HALFSHELL_H
#define HALFSHELL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define HS_MAX_DIM 8

/* What a call came to. */
typedef enum hs_status {
    HS_OK = 0,
    HS_ERR_MEMORY,        /* an allocation was refused, or the result passes memory_limit */
    HS_ERR_CUTOFF,        /* the cutoff is negative, NaN or infinite */
    HS_ERR_NOT_FINITE,    /* a coordinate is NaN or infinite: failure.row, failure.column */
    HS_ERR_BOX_FINITE,    /* a box entry is NaN or infinite: failure.row, failure.column */
    HS_ERR_BOX_DEPENDENT, /* the periodic box vectors are exactly linearly dependent */
    HS_ERR_TOO_MANY,      /* 2^31 points or more, or more pairs than int64 counts */
    HS_ERR_SHIFT_RANGE,   /* a shift does not fit: failure.row is the point */
    HS_ERR_KERNEL,        /* no kernel of that name on this CPU */
    HS_ERR_INTERRUPTED,   /* poll() asked to stop */
    HS_ERR_CAPACITY,      /* the caller's arrays are too small: failure.expected_pairs are needed */
    HS_STATUS_END         /* number of codes, not a code */
} hs_status;

/* One plain sentence for a status; never NULL, static storage. */
const char *hs_status_text(hs_status status);

/* Details of a failure, as far as its status uses them. */
typedef struct hs_failure {
    int64_t row;            /* point or box vector, -1 when it does not apply */
    int64_t column;         /* coordinate, -1 when it does not apply */
    bool    in_queries;     /* the row is one of the queries, not of the points */
    int64_t system;         /* of several that were searched at once, -1 when it does not apply */
    double  value;          /* the offending number */
    double  expected_pairs; /* HS_ERR_MEMORY: pairs that were expected, or 0; HS_ERR_CAPACITY */
    double  expected_bytes; /* HS_ERR_MEMORY: bytes that they would need, or 0 */
    double  limit_bytes;    /* HS_ERR_MEMORY: bytes that were allowed, or 0 */
} hs_failure;

typedef enum hs_real { HS_FLOAT32, HS_FLOAT64 } hs_real;

/* The caller's coordinates, borrowed for the call. Strides are in bytes and may be zero or
 * negative; entries need not be aligned. Native byte order. */
typedef struct hs_points {
    const void *data;
    int64_t     n;      /* 0 <= n < 2^31 */
    int         ndim;   /* 1 <= ndim <= HS_MAX_DIM */
    hs_real     real;
    ptrdiff_t   row_stride;
    ptrdiff_t   column_stride;
} hs_points;

/* The box. Rows of axes that do not repeat are ignored. */
typedef struct hs_box {
    int    ndim;
    bool   periodic[HS_MAX_DIM];
    double rows[HS_MAX_DIM][HS_MAX_DIM]; /* rows[l][k]: component k of box vector l */
} hs_box;

/* How a pair near the cutoff is decided. */
typedef enum hs_precision {
    HS_EXACT,  /* by the real numbers that the inputs are */
    HS_DOUBLE, /* by one float64 comparison of a fixed, unfused formula */
    HS_SINGLE  /* by one float32 comparison of a fixed, unfused formula */
} hs_precision;

/* What to return for each pair: a union of these bits. */
enum {
    HS_WANT_I        = 1, /* lower point number */
    HS_WANT_J        = 2, /* higher (or, for an image of the point itself, equal) number */
    HS_WANT_DISTANCE = 4, /* |D|, float64, within 1 ulp, never on the wrong side of the cutoff */
    HS_WANT_VECTOR   = 8, /* D, float64, each component within 1 ulp of |D| */
    HS_WANT_SHIFT    = 16, /* S, int32 */
    HS_WANT_BOTH     = 32  /* i and j side by side */
};

/* Bytes are accounted by what they are for. */
typedef enum hs_purpose {
    HS_FOR_POINTS,     /* the search's copy of the coordinates, in cell order */
    HS_FOR_ORIGINALS,  /* coordinates as given, kept only where the copy had to be rounded */
    HS_FOR_WRAPS,      /* per point: how many box vectors it was wrapped by */
    HS_FOR_ORDER,      /* point numbers in cell order, and the cell of each while sorting */
    HS_FOR_CELLS,      /* where each cell starts */
    HS_FOR_STENCIL,    /* neighbouring cell rows */
    HS_FOR_CANDIDATES, /* the gathered neighbourhood of one group */
    HS_FOR_INDICES,    /* i and j */
    HS_FOR_DISTANCES,  /* d */
    HS_FOR_VECTORS,    /* D */
    HS_FOR_SHIFTS,     /* S */
    HS_FOR_SORTING,    /* scratch of sort=true */
    HS_PURPOSE_END
} hs_purpose;

/* What a search did. Filled on request; every number is a count made by the search itself. */
typedef struct hs_counters {
    int64_t bytes[HS_PURPOSE_END]; /* allocated over the whole call, by purpose */
    int64_t bytes_peak;            /* most bytes held at one time */
    int64_t groups;                /* gathered neighbourhoods */
    int64_t candidates;            /* pairs that the kernel tested */
    int64_t pairs;                 /* pairs found */
    int64_t ambiguous;             /* pairs that the float32 filter passed on */
    int64_t by_float64;            /* of these: decided in float64 ... */
    int64_t by_double_word;        /* ... in double-word arithmetic ... */
    int64_t by_integers;           /* ... by integers */
    int64_t polls;                 /* times that poll() was called */
} hs_counters;

/*
 * Called now and then from the searching thread; fraction in [0, 1] is the work done.
 * Return false to stop the search with HS_ERR_INTERRUPTED.
 */
typedef bool (*hs_poll_fn)(void *context, double fraction);

/* One array for each quantity; NULL for those that are not there. */
typedef struct hs_pair_arrays {
    int64_t  capacity;     /* pairs that fit */
    int      index_bytes;  /* 4 or 8: int32 or int64 elements of the next three */
    void    *i;            /* m */
    void    *j;            /* m */
    void    *both;         /* m * 2: i and j side by side */
    double  *distance;     /* m */
    double  *vector;       /* m * ndim */
    int32_t *shift;        /* m * ndim */
} hs_pair_arrays;

/* Called at most once per call, when the result may be large: bytes that may still be used. */
typedef double (*hs_limit_fn)(void *context);

/* Points from which on the work takes a millisecond, while a thread costs some ten microseconds to
 * start and to end. */
#define HS_POINTS_FOR_THREADS 20000

typedef struct hs_options {
    double       cutoff;       /* finite, not negative; same unit as the points */
    bool         inclusive;    /* whether |D| == cutoff counts */
    bool         sorted;       /* ascending (i, j, S) */
    hs_precision precision;
    unsigned     want;         /* HS_WANT_ bits */
    int          index_bytes;  /* 4 or 8: int32 or int64 i and j */
    const hs_pair_arrays *out; /* borrowed: where to write all that is wanted; NULL: new arrays */
    const char  *kernel;       /* borrowed; NULL: the best of this CPU */
    int          threads;      /* exactly so many; -n: n from HS_POINTS_FOR_THREADS on, else 1 */
    double       memory_limit; /* bytes that result and search may take; infinity: no limit */
    hs_limit_fn  find_limit;   /* NULL, or asked for a further limit beyond 64 MB */
    void        *find_context;
    hs_poll_fn   poll;         /* NULL: never */
    void        *poll_context;
    hs_counters *counters;     /* borrowed, filled also on failure; NULL: not wanted */
} hs_options;

/* Defaults: cutoff 0, inclusive, unsorted, exact, i and j of 8 bytes, no limit, no poll. */
hs_options hs_options_default(void);

/* A finished search: opaque, owned by the caller. */
typedef struct hs_pairs hs_pairs;

/*
 * Find every pair within the cutoff, each once (half list): i < j, or i == j and the first
 * nonzero component of S positive. (i, i, S = 0) is no pair; coincident points are.
 *
 * points, options  borrowed; points must not move during the call (a concurrent write may
 *                  change the answer, it cannot corrupt memory: each number is read once)
 * box              borrowed; NULL: open space
 * pairs            receives an object to be freed with hs_pairs_free; NULL on failure
 * failure          filled on failure; may be NULL
 *
 * Order: fixed by the scene; it does not depend on the kernel. Returns any status.
 */
hs_status hs_pairs_find(const hs_points *points, const hs_box *box, const hs_options *options,
                        hs_pairs **pairs, hs_failure *failure);

/* The same search, counting only; options->want and ->sorted are ignored. */
hs_status hs_pairs_count(const hs_points *points, const hs_box *box, const hs_options *options,
                         int64_t *count, hs_failure *failure);

/*
 * Find all neighbours of each query among the points, row after row: pairs (i in queries, j in
 * points, S) with the vector D = points[j] - queries[i] + S * box. queries NULL: of each point among
 * the points, itself left out where S = 0, so that each pair is there twice, as (i, j, S) and
 * (j, i, -S). With queries nothing is left out: an identical point is a neighbour at distance 0.
 *
 * Rows are in the order of the queries, each ascending by (j, S); options->sorted is ignored.
 * hs_pairs_offsets says where each begins. Memory and failures as for hs_pairs_find; a failure's
 * row is that of a query when failure->in_queries.
 */
hs_status hs_neighbors_find(const hs_points *points, const hs_points *queries, const hs_box *box,
                            const hs_options *options, hs_pairs **rows, hs_failure *failure);

/* The length of each row only. counts: one for each query, or point; unspecified on failure. */
hs_status hs_neighbors_count(const hs_points *points, const hs_points *queries, const hs_box *box,
                             const hs_options *options, int64_t *counts, hs_failure *failure);

/* The sum of these lengths only, for queries that are not NULL. */
hs_status hs_between_count(const hs_points *points, const hs_points *queries, const hs_box *box,
                           const hs_options *options, int64_t *count, hs_failure *failure);

/*
 * Find the k nearest points of each query, k >= 1, row after row and k entries in each: pairs (i in
 * queries, j in points, S) with the vector D = points[j] - queries[i] + S * box, ascending by the
 * exact distance and, where that is the same, by (j, S). In a periodic box each image of a point
 * counts for itself. queries NULL: of each point among the points, itself left out where S = 0.
 *
 * options->cutoff is the largest distance that counts, itself included, and may be infinite. What a
 * row lacks is j = -1, distance infinity, vector NaN, S = 0. Of options->want, j, distance, vector
 * and shift are heard; inclusive, sorted, precision and out are ignored. hs_pairs_length is k times
 * the number of queries. Memory and failures as for hs_neighbors_find; HS_ERR_MEMORY also when a
 * query is so far from points that repeat that more of their images than memory holds are about as
 * near.
 */
hs_status hs_nearest_find(const hs_points *points, const hs_points *queries, const hs_box *box,
                          int64_t k, const hs_options *options, hs_pairs **rows,
                          hs_failure *failure);

/* Rows of a result of hs_neighbors_find, and where each begins: rows + 1 numbers, the last one the
 * length of all; borrowed. NULL when taken, or of another search. */
int64_t        hs_pairs_rows(const hs_pairs *pairs);
const int64_t *hs_pairs_offsets(const hs_pairs *pairs);

/* The same, but ownership goes to the caller: hs_array_free. */
int64_t *hs_pairs_take_offsets(hs_pairs *pairs);

/* Number of pairs: each array has one entry or row for each. */
int64_t hs_pairs_length(const hs_pairs *pairs);

/* The array of one HS_WANT_ bit: borrowed from the result, in the types of hs_pair_arrays; NULL
 * when it was not wanted, has been taken, or the caller's arrays were used. */
const void *hs_pairs_array(const hs_pairs *pairs, unsigned which);

/* The same, but ownership goes to the caller: hs_array_free. Never NULL for a quantity that was
 * wanted, unless it was taken before or the caller's arrays were used. */
void *hs_pairs_take(hs_pairs *pairs, unsigned which);

/* NULL-safe. */
void hs_array_free(void *array);

/* NULL-safe. */
void hs_pairs_free(hs_pairs *pairs);

/*
 * Several systems, searched in one call: system s has points first[s] to first[s + 1] and no pair
 * with another. All arrays are borrowed.
 */
typedef struct hs_systems {
    int64_t        n;
    const int64_t *first;   /* n + 1; from 0, not descending, to the number of points */
    const hs_box  *box;     /* of all; NULL: open space */
    const double  *rows;    /* n * ndim * ndim, in place of box->rows: of each; or NULL */
    const double  *cutoffs; /* n, in place of options->cutoff; or NULL */
} hs_systems;

/*
 * As hs_pairs_find for one system after the other: the result is that of so many calls, one behind
 * the other, with numbers of all points as i and j. Threads share the systems out. A failure names
 * the point among all, and the system where that says more. options->counters: bytes_peak is the
 * sum of what each thread held at most.
 */
hs_status hs_systems_find(const hs_points *points, const hs_systems *systems,
                          const hs_options *options, hs_pairs **pairs, hs_failure *failure);

/* The same search, counting only; counts: n, unspecified on failure. */
hs_status hs_systems_count(const hs_points *points, const hs_systems *systems,
                           const hs_options *options, int64_t *counts, hs_failure *failure);

/* What a search of this scene would do, without doing it. */
typedef struct hs_plan {
    int         ndim;
    int         n_periodic;
    bool        aligned;              /* every periodic box vector lies along one coordinate axis */
    bool        reduced;              /* the box was replaced by an equivalent, less skewed one */
    bool        keeps_originals;      /* coordinates as given are kept beside the wrapped */
    bool        all_pairs;            /* one cell: every point meets every point */
    int64_t     shape[HS_MAX_DIM];    /* cells along each grid axis */
    double      cell_size[HS_MAX_DIM];/* extent of a cell along each grid axis */
    int64_t     reach[HS_MAX_DIM];    /* cells to look at on either side */
    int64_t     images[HS_MAX_DIM];   /* periods that a pair can be apart; 0 on open axes */
    int64_t     stencil_rows;         /* neighbouring rows of cells, own row included */
    double      expected_pairs;       /* from the density; NaN where there is none */
    int         threads;              /* that the walk would be shared by */
    const char *kernel;               /* static storage */
} hs_plan;

hs_status hs_plan_make(const hs_points *points, const hs_box *box, const hs_options *options,
                       hs_plan *plan, hs_failure *failure);

/* Check a box: every periodic entry finite, periodic rows linearly independent (decided
 * exactly). heights[l]: distance between the faces that box vector l connects, for periodic
 * axes; volume: of the periodic vectors (length in 1-D, area in 2-D). Either may be NULL. */
hs_status hs_box_measure(const hs_box *box, double *heights, double *volume, hs_failure *failure);

/*
 * Wrap points into the box: wrapped = point + shift * box, each fraction along a periodic axis in
 * [0, 1). wrapped: n * ndim, within 1 ulp of the largest term; along an axis-aligned box vector
 * never equal to its length. shift: n * ndim; either may be NULL. Returns HS_ERR_SHIFT_RANGE for a
 * shift beyond 2^51.
 */
hs_status hs_box_wrap(const hs_box *box, const hs_points *points, double *wrapped,
                      int64_t *shift, hs_failure *failure);

/*
 * Memory of results that are gone is kept for the next ones, up to a limit: the one thing that
 * outlives a call. No answer depends on it. Bytes kept at most (256 MB at first; 0 keeps nothing),
 * bytes kept now, and giving all of it back to the system.
 */
size_t hs_pool_limit(void);
void   hs_pool_set_limit(size_t bytes);
size_t hs_pool_held(void);
void   hs_pool_clear(void);

/* Names of the kernels that this CPU can run, best first; static storage. Writes at most
 * `capacity` of them and returns how many there are. */
int hs_kernel_names(const char **names, int capacity);

#ifdef __cplusplus
}
#endif
#endif
