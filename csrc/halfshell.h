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
 * calls. Every function may be called from several threads at once. On failure a result is NULL and
 * a number is untouched, but arrays that the caller provides (options->out, counts, wrapped, shift)
 * may hold anything; `hs_failure` says what was wrong, in all its fields. Functions that return
 * hs_status may return any that fits; those that return none cannot fail.
 *
 * Arguments: counts, sizes, strides and enums are checked before anything is read. A pointer may be
 * NULL where it is said, as `failure` may everywhere, and an array where it has no entries. For any
 * other that is NULL, a function that returns hs_status returns HS_ERR_ARGUMENT; the others return
 * 0, NULL or a struct of zeros, or write these. What nothing can check is left to the caller: that
 * objects are alive, and that arrays are as long as is said here.
 *
 * Link the core statically: compile csrc/core/ and csrc/kernels/ into the program, or call it from
 * an extension module through halfshell_capi.h. docs/c-interface.md shows both.
 */
#ifndef HALFSHELL_H
#define HALFSHELL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The version of this header: that of the package. Within one MAJOR.MINOR what is declared here is
 * only added to: new functions, new members of enums; structs stay as they are. */
#define HS_VERSION_MAJOR 0
#define HS_VERSION_MINOR 1
#define HS_VERSION_PATCH 0
#define HS_VERSION       (HS_VERSION_MAJOR * 10000 + HS_VERSION_MINOR * 100 + HS_VERSION_PATCH)

/* HS_VERSION of the core as it was compiled: not that of the caller's header, if they differ. */
int hs_version(void);

#define HS_MAX_DIM 8

/* What a call came to. */
typedef enum hs_status {
    HS_OK = 0,
    HS_ERR_MEMORY,        /* an allocation was refused, or the result passes memory_limit */
    HS_ERR_CUTOFF,        /* the cutoff, or with the skin, is negative, NaN or infinite */
    HS_ERR_NOT_FINITE,    /* a coordinate is NaN or infinite: failure.row, failure.column */
    HS_ERR_BOX_FINITE,    /* a box entry is NaN or infinite: failure.row, failure.column */
    HS_ERR_BOX_DEPENDENT, /* the periodic box vectors are exactly linearly dependent; failure.row:
                           * the first that is zero, or -1 */
    HS_ERR_BOX_SKEWED,    /* independent, but float64 does not tell points along the short ones;
                           * failure.row: the point that lies too far outside for it, or -1 */
    HS_ERR_TOO_MANY,      /* 2^31 points or systems or more, or more pairs than int64 counts */
    HS_ERR_SHIFT_RANGE,   /* a shift does not fit: failure.row is the point */
    HS_ERR_ROUNDING,      /* precision="double" cannot tell: failure.row is the farthest point */
    HS_ERR_KERNEL,        /* no kernel of that name on this CPU, or none compiled as it must be */
    HS_ERR_INTERRUPTED,   /* poll() asked to stop */
    HS_ERR_FAR,           /* queries, or points from each other, lie too far away for cells; or a
                             point lies outside of what keys are for: failure.row */
    HS_ERR_CAPACITY,      /* the caller's arrays are too small: failure.expected_pairs are needed */
    HS_ERR_EDGES,         /* edges are negative, not finite or not ascending: failure.row */
    HS_ERR_TYPES,         /* a type is negative or too large: failure.row */
    HS_ERR_WEIGHTS,       /* a weight is NaN or infinite: failure.row */
    HS_ERR_RADII,         /* a radius is negative, NaN, infinite or out of range: failure.row */
    HS_ERR_SUPPORTS,      /* a support is not symmetric and positive definite: failure.row */
    HS_ERR_SUPPORT_REACH, /* one reaches further than 2^1022, or is a needle beyond all floats:
                             failure.row */
    HS_ERR_EXTENT,        /* the extent of supports is negative, NaN or infinite */
    HS_ERR_ARGUMENT,      /* ndim, n, want, index_bytes, ... is none that there is, or a pointer is
                             NULL; failure.system: where first descends */
    HS_ERR_KEY,           /* a key is not there, comes twice, or has no position: failure.row */
    HS_STATUS_END         /* number of codes, not a code; it grows with them */
} hs_status;

/* One plain sentence for a status, also for a number that is none; never NULL, static storage. */
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
    double  search_bytes;   /* HS_ERR_MEMORY: bytes that the search takes besides; 0: it had them */
    double  limit_bytes;    /* HS_ERR_MEMORY: bytes that were allowed, or 0 */
} hs_failure;

typedef enum hs_real { HS_FLOAT32, HS_FLOAT64 } hs_real;

/* The caller's coordinates, borrowed for the call. Strides are in bytes and may be zero or
 * negative; entries need not be aligned. Native byte order. Strides that lead beyond what addresses
 * can reach are refused. */
typedef struct hs_points {
    const void *data;
    int64_t     n;    /* 0 <= n < 2^31 */
    int         ndim; /* 1 <= ndim <= HS_MAX_DIM */
    hs_real     real;
    ptrdiff_t   row_stride;
    ptrdiff_t   column_stride;
} hs_points;

/*
 * A set of points, and what is known of each; borrowed like them. NULL: it is not known. What a
 * search goes by is said by its hs_reach, hs_selection or hs_histogram: all else is not looked at.
 *
 * A set of several systems has one behind the other, and no pair of two of them: system s has
 * points first[s] to first[s + 1].
 */
typedef struct hs_set {
    hs_points      at;
    const double  *radii;     /* n, from 0 to 2^1022, with HS_RULE_MEAN 0 or 2^-1021 at least, as
                               * halves are exact */
    const double  *supports;  /* n * ndim * ndim: a matrix of each, see hs_reach */
    const double  *weights;   /* n, finite; NULL: all 1 */
    const int32_t *types;     /* n, from 0 on */
    const int64_t *groups;    /* n */
    const int64_t *labels;    /* n */
    int64_t        n_systems; /* 0 <= n_systems < 2^31; not looked at where there is one system */
    const int64_t *first;     /* n_systems + 1, from 0, not descending, to n; NULL: one system */
} hs_set;

/* The box. Rows of axes that do not repeat must be finite, and are otherwise ignored. */
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

/* Which cells the points are sorted into. The pairs are the same; their order, unless they are
 * sorted, is fixed by scene and algorithm. */
typedef enum hs_algorithm {
    HS_AUTO,      /* what is expected to be quickest; with a reach that is levels */
    HS_ALL_PAIRS, /* one cell: every point meets all others */
    HS_GRID,      /* all cells are stored. Their number is in proportion to the points: where these
                   * are far apart, cells are wider than they need be */
    HS_HASH,      /* only cells that hold points are stored */
    HS_HIERARCHY, /* levels of points of about the same reach, or of one type, which are searched
                   * apart; without a reach one level, in cells that are expected to be quickest */
    HS_ALGORITHM_END /* number of algorithms */
} hs_algorithm;

/* What to return for each pair: a union of these bits. */
enum {
    HS_WANT_I = 1,        /* lower point number */
    HS_WANT_J = 2,        /* higher (or, for an image of the point itself, equal) number */
    HS_WANT_DISTANCE = 4, /* |D|, float64, within 1 ulp, never on the wrong side of the cutoff */
    HS_WANT_VECTOR = 8,   /* D, float64, each component within 1 ulp of |D| */
    HS_WANT_SHIFT = 16,   /* S, int32 */
    HS_WANT_BOTH = 32,    /* i and j side by side */
    HS_WANT_SHELL = 64    /* the innermost of options->shells that holds the pair, int32 */
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
    HS_FOR_INDICES,    /* i and j, and the shell */
    HS_FOR_DISTANCES,  /* d */
    HS_FOR_VECTORS,    /* D */
    HS_FOR_SHIFTS,     /* S */
    HS_FOR_SORTING,    /* scratch of rows and of sort=true */
    HS_FOR_SUPPORTS,   /* supports of points, as they are read and as kernels read them */
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
    int64_t  capacity;    /* pairs that fit */
    int      index_bytes; /* 4 or 8: int32 or int64 elements of the next three */
    void    *i;           /* m */
    void    *j;           /* m */
    void    *both;        /* m * 2: i and j side by side */
    double  *distance;    /* m */
    double  *vector;      /* m * ndim */
    int32_t *shift;       /* m * ndim */
    int32_t *shell;       /* m */
} hs_pair_arrays;

/* Called where the result may be large, seldom more than once in a call: bytes that may still be
 * used. */
typedef double (*hs_limit_fn)(void *context);

/* With this many points the work takes a millisecond, while a thread costs some ten microseconds to
 * start and to end. */
#define HS_POINTS_FOR_THREADS 20000

/* Most threads of one call; more would only wait for each other. */
#define HS_MOST_THREADS 1024

typedef struct hs_options {
    double       cutoff;    /* finite, not negative; same unit as the points */
    bool         inclusive; /* whether |D| == cutoff counts */
    bool         sorted;    /* ascending (i, j, S) */
    hs_precision precision;
    unsigned     want;         /* HS_WANT_ bits */
    int          index_bytes;  /* 4 or 8: int32 or int64 i and j */
    double       cell_size;    /* least width of cells, as far as possible; 0: what is quick */
    hs_algorithm algorithm;    /* not looked at where there are cells already; cell_size is for
                                  those that store all of them */
    const hs_pair_arrays *out; /* borrowed: where to write all that is wanted; NULL: new arrays */
    const char           *kernel;  /* borrowed; NULL: the best of this CPU */
    int                   threads; /* at most so many, 0 as 1, where the work is worth them, and
                                  HS_MOST_THREADS; -n: n from HS_POINTS_FOR_THREADS on, else 1,
                                  where kept points are not counted, but the work of queries */
    double        memory_limit;    /* bytes that result and search may take; infinity: no limit */
    hs_limit_fn   find_limit;      /* NULL, or called for a further limit beyond 64 MB */
    void         *find_context;
    hs_poll_fn    poll; /* NULL: never */
    void         *poll_context;
    hs_counters  *counters; /* borrowed, filled also on failure; NULL: not wanted */
    int64_t       n_shells; /* with HS_WANT_SHELL, less than 2^30; ignored without it: */
    const double *shells;   /* borrowed: cutoffs that do not descend, the last one being `cutoff`.
                              Shell k holds the pairs within number k and not within number k - 1,
                              decided exactly; d is on the right side of both. For HS_EXACT in
                              hs_pairs_find and hs_stream_open, without a reach */
    const double *domain;   /* NULL, or borrowed, for hs_cells_build: a lowest and then a highest
                              coordinate for each axis, finite; cells reach from one to the other
                              or, where points lie beyond, further. Nothing is fixed along an axis
                              with lowest > highest, as axes that repeat need, nor in boxes whose
                              vectors do not lie along the coordinate axes */
} hs_options;

/* Defaults: cutoff 0, inclusive, unsorted, exact, i and j of 8 bytes, no limit, no poll. */
hs_options hs_options_default(void);

/* Points that are sorted into cells once and searched many times; see hs_cells_build. */
typedef struct hs_cells hs_cells;

/* How the radii of i and j make the largest distance of a pair; what is compared is the real
 * number, never a rounded one. */
typedef enum hs_rule {
    HS_RULE_SUM,  /* r_i + r_j */
    HS_RULE_MEAN, /* half of that */
    HS_RULE_MAX,
    HS_RULE_MIN,
    HS_RULE_GATHER,  /* that of i, which must be an asking point: not for half lists */
    HS_RULE_SCATTER, /* that of j, likewise */
    HS_RULE_END      /* number of rules */
} hs_rule;

/*
 * A reach for each pair, by what is known of its points: radii, types or supports. Cutoffs are
 * borrowed. With it options->cutoff is a further limit, which may be infinite but for types, and
 * failure->row may be that of a radius, type or support.
 *
 * The support of a point is a symmetric positive definite matrix H: D is within it if |H D| is at
 * most the extent, or less than that where options->inclusive is false. The rule says within whose
 * support D must be: HS_RULE_MAX, that of i or of j; HS_RULE_MIN, both; HS_RULE_GATHER, that of i;
 * HS_RULE_SCATTER, that of j. For 1, 2 and 3 dimensions.
 */
typedef struct hs_reach {
    hs_rule       rule;         /* a set whose radii or supports it does not need may lack them */
    int32_t       n_types;      /* in place of radii, if not 0: types are below it */
    const double *cutoffs;      /* n_types * n_types, finite and symmetric; negative: no pairs */
    bool          has_supports; /* in place of radii and types */
    double extent; /* of supports: finite, not negative. Radii count so many times, as real numbers:
                    * from 2^-64 to 2^64, with radii of 0 or from 2^-500 to 2^500, and rules that
                    * take one of two radii; 0 as 1, without these bounds */
} hs_reach;

/*
 * Which pairs count, of those within reach; arrays are borrowed, by a stream only until it is open.
 * Where all is 0, all do. Distances that are returned are not below min_distance.
 *
 * The nearest image of a pair is decided for the real numbers that were given. Of images that are
 * equally near it is the one with the lexicographically least S, as seen from the query, or else
 * from the point of the lower number. Other images of the pair count, and so do images of one
 * point; a point and a query are excluded like any pair.
 */
typedef struct hs_selection {
    bool           has_groups;    /* both points of a pair must be of one group */
    bool           has_labels;    /* pairs whose labels differ by at most `within` are excluded, in
                                   * their nearest image */
    int64_t        within;        /* not negative */
    int64_t        n_excluded;    /* not negative */
    const int64_t *excluded;      /* n_excluded * 2, in place of labels: numbers of points, or of a
                                   * query and a point, whose pair is excluded likewise */
    const int64_t *query_numbers; /* of queries that are points themselves, of the same system:
                                   * their numbers, by which groups, labels and `excluded` are
                                   * those of the points. They then pair as points do: a point is
                                   * not excluded from itself at S = 0, nor too near */
    double         min_distance;  /* finite, not negative: pairs that are nearer do not count; 0
                                   * with HS_SINGLE */
} hs_selection;

/* What each of several systems has of its own, in place of what all share; borrowed, each NULL
 * where all share it. */
typedef struct hs_each_system {
    const double  *rows;     /* n_systems * ndim * ndim, in place of box->rows */
    const uint8_t *periodic; /* n_systems, in place of box->periodic: bit l for row l */
    const double  *cutoffs;  /* n_systems, in place of options->cutoff */
} hs_each_system;

/*
 * What a search looks among: points in a box, or cells, which have both. All borrowed: points must
 * not move during the call (a concurrent write may change the answer, it cannot corrupt memory:
 * each number is read once). With cells, counters tell what the call took, not what the cells hold;
 * the first hs_nearest_find builds a tree of the points, which stays with the cells and is not
 * counted as memory of the call.
 *
 * Several systems are for all searches but hs_plan_make, and not for cells: the result is that of
 * so many calls, one behind the other, with numbers among all points and queries; so are clusters
 * and the blocks of a stream. Threads share the systems out. A
 * failure names the point among all, and the system where that says more; failure.system is also
 * where `first` descends. options->counters: bytes_peak is the sum of what each thread held at
 * most.
 */
typedef struct hs_among {
    const hs_set         *points;
    const hs_box         *box;     /* NULL: open space */
    const hs_set         *queries; /* where neighbours are looked for, of as many systems; NULL: at
                                    * each of the points */
    const hs_cells       *cells;   /* in place of box and points, which are NULL then, or have no
                                    * data and say what is known of the points of the cells */
    const hs_reach       *reach;   /* NULL: the cutoff holds for all pairs. Else for hs_pairs_find,
                                    * hs_pairs_count, hs_neighbors_*, hs_stream_open,
                                    * hs_pairs_visit, hs_clusters_find, hs_plan_make */
    const hs_selection   *selection; /* NULL: all of them count. Else for hs_pairs_histogram and the
                                      * same functions, but for hs_plan_make */
    const hs_each_system *each;      /* of several systems; NULL: they share all */
} hs_among;

/* A finished search: opaque, owned by the caller. */
typedef struct hs_pairs hs_pairs;

/*
 * Find every pair within the cutoff, each once (half list): i < j, or i == j and the first
 * nonzero component of S positive. (i, i, S = 0) is no pair; coincident points are.
 *
 * among, options   borrowed; no queries, which hs_neighbors_find is for
 * pairs            receives an object to be freed with hs_pairs_free; NULL on failure
 * failure          filled on failure; may be NULL
 *
 * Order: fixed by the scene; it does not depend on the kernel. Returns any status.
 */
hs_status hs_pairs_find(const hs_among *among, const hs_options *options, hs_pairs **pairs,
                        hs_failure *failure);

/* The number of pairs of hs_pairs_find; options->want and ->sorted are ignored. With queries: every
 * neighbour of each, the sum of what hs_neighbors_count counts. count: of several systems, one for
 * each, unspecified on failure. */
hs_status hs_pairs_count(const hs_among *among, const hs_options *options, int64_t *count,
                         hs_failure *failure);

/*
 * Find all neighbours of each query among the points, row after row: pairs (i in queries, j in
 * points, S) with the vector D = points[j] - queries[i] + S * box. Without queries: of each point
 * among the points, itself left out where S = 0, so that each pair is there twice, as (i, j, S) and
 * (j, i, -S). With queries nothing is left out: an identical point is a neighbour at distance 0.
 *
 * Rows are in the order of the queries, each ascending by (j, S); options->sorted is ignored.
 * hs_pairs_offsets says where each begins. Memory and failures as for hs_pairs_find; a failure's
 * row is that of a query when failure->in_queries.
 */
hs_status hs_neighbors_find(const hs_among *among, const hs_options *options, hs_pairs **rows,
                            hs_failure *failure);

/* The length of each row only. counts: one for each query, or point; unspecified on failure. */
hs_status hs_neighbors_count(const hs_among *among, const hs_options *options, int64_t *counts,
                             hs_failure *failure);

/* A search takes longer to begin than to look at all pairs of so few points. */
#define HS_FEW_PAIRS 1024

typedef struct hs_few {
    int           ndim;
    int64_t       n_points, n_queries;
    const double *points, *queries; /* in rows without gaps, borrowed; queries NULL: none */
    const double *period;           /* of each axis, 0 where it does not repeat; NULL: open space */
    double        cutoff;
} hs_few;

/*
 * Pairs of hs_pairs_find as i < j, or with queries those of hs_neighbors_find, both ascending by
 * (i, j), with the same d: inclusive, for cutoffs below half of each period. No memory is taken.
 *
 * i, j, d    room for HS_FEW_PAIRS; d may be NULL
 *
 * Returns how many there are, or -1 if a search is to find them, or to refuse: of more points, or
 * pairs of points, than HS_FEW_PAIRS; of a cutoff that is larger, or half of a period up to
 * rounding, or below 2^-400; of points more than 1.5 periods apart; of what is not finite.
 */
int hs_few_pairs(const hs_few *few, int32_t *i, int32_t *j, double *d);

/* Pairs by distance, and where the numbers go. Everything is borrowed. */
typedef struct hs_histogram {
    int64_t       n_edges;   /* at least 1, less than 2^30 */
    const double *edges;     /* finite, not negative, not descending */
    bool          inclusive; /* a pair at exactly an edge counts below it, not from it on ... */
    bool          last_inclusive; /* ... and at the last one, the cutoff; if inclusive, this too */
    int32_t       n_types;        /* at least 1; types of 1 are not needed */
    int64_t      *counts; /* n_types * n_types * n_edges, so many for each system; or NULL */
    double       *sums;   /* as many, or NULL */
} hs_histogram;

/*
 * Sort all pairs into a histogram by their distance, each decided exactly at each edge, and store
 * none. counts[(a * n_types + b) * n_edges + k]: how many lie below edge k and not below edge
 * k - 1, if there is one. sums: of the products of the weights of both points, exact until they are
 * rounded once.
 *
 * Without queries: each pair of points once (half list); a and b are its two types, and [a][b] is
 * [b][a]. Otherwise each query with each point: a is the type of the query, b that of the point.
 *
 * options->cutoff, inclusive and precision are ignored, as are want and sorted. Outputs are
 * unspecified on failure.
 */
hs_status hs_pairs_histogram(const hs_among *among, const hs_options *options,
                             const hs_histogram *histogram, hs_failure *failure);

/*
 * Find the k nearest points of each query, k >= 1, row after row and k entries in each: pairs (i in
 * queries, j in points, S) with the vector D = points[j] - queries[i] + S * box, ascending by the
 * exact distance and, where distances are equal, by (j, S). In a periodic box each image of a point
 * counts for itself. Without queries: of each point among the points, itself left out where S = 0.
 *
 * options->cutoff is the largest distance that counts, itself included if options->inclusive, and
 * may be infinite. A selection says which points count; a reach is refused. What a row lacks is
 * j = -1, distance infinity, vector NaN, S = 0. Of options->want only j, distance, vector and shift
 * count; sorted, precision and out are ignored. hs_pairs_length is k times the number of queries.
 * Memory and failures as for hs_neighbors_find; HS_ERR_MEMORY also when a query is so far from
 * points that repeat that more of their images than memory holds are about as near.
 */
hs_status hs_nearest_find(const hs_among *among, int64_t k, const hs_options *options,
                          hs_pairs **rows, hs_failure *failure);

/* Pairs that the caller has, borrowed, in any order: fixed edges, lists of other programs. */
typedef struct hs_pair_numbers {
    int64_t        n;
    const int64_t *i, *j; /* n numbers of points; they may be equal */
    const int64_t *shift; /* n * ndim, below 2^62, 0 along axes that do not repeat: S of each; NULL:
                             that of the nearest image of j to i, and of several that are equally
                             near the lexicographically least S */
} hs_pair_numbers;

/*
 * Measure pairs: the vector D = points[j] - points[i] + S * box, its length and S, in their order.
 * Which image is the nearest is decided for the real numbers that the inputs are; d and D are
 * those of hs_pairs_find. box: NULL for open space.
 *
 * Of options->want only distance, vector and shift count; of the others kernel, threads, limits,
 * poll and counters. Memory as for hs_pairs_find. failure.row is a pair: HS_ERR_ARGUMENT for a
 * number or a shift that cannot be; HS_ERR_SHIFT_RANGE where points are more than 2^51 periods
 * away, or S does not fit int32; HS_ERR_FAR for a vector that float64 does not hold;
 * HS_ERR_BOX_SKEWED for a box, or for a pair with too many images that are about as near.
 */
hs_status hs_measure(const hs_points *points, const hs_box *box, const hs_pair_numbers *pairs,
                     const hs_options *options, hs_pairs **result, hs_failure *failure);

/* Rows of a result of hs_neighbors_find or hs_cells_candidates, and where each
 * begins: rows + 1 numbers, the last one the length of all; borrowed. 0 and NULL when taken, or of
 * another search. */
int64_t        hs_pairs_rows(const hs_pairs *pairs);
const int64_t *hs_pairs_offsets(const hs_pairs *pairs);

/* The offsets, whose ownership goes to the caller: hs_array_free. */
int64_t *hs_pairs_take_offsets(hs_pairs *pairs);

/* Number of pairs: each array has one entry or row for each. */
int64_t hs_pairs_length(const hs_pairs *pairs);

/* The array of one HS_WANT_ bit: borrowed from the result, in the types of hs_pair_arrays; NULL
 * when it was not wanted, has been taken, or the caller's arrays were used, and for anything but
 * one bit. */
const void *hs_pairs_array(const hs_pairs *pairs, unsigned which);

/* The array of one HS_WANT_ bit, whose ownership goes to the caller: hs_array_free. Never NULL for
 * a quantity that was wanted, unless it was taken before or the caller's arrays were used. */
void *hs_pairs_take(hs_pairs *pairs, unsigned which);

/* NULL-safe. */
void hs_array_free(void *array);

/* NULL-safe. */
void hs_pairs_free(hs_pairs *pairs);

/* The pairs of hs_pairs_find in blocks, in the same order, for results that fit no memory. Opaque,
 * owned by the caller; used by one thread at a time. */
typedef struct hs_stream hs_stream;

/*
 * All is borrowed for this call only: points may change afterwards, but cells must outlive the
 * stream. No queries. max_pairs >= 1: of a block. options->sorted, ->out and ->counters are
 * ignored, ->poll is called by this call only; the limits, whose context must stay, hold for what
 * the stream has. *stream is NULL on failure.
 */
hs_status hs_stream_open(const hs_among *among, const hs_options *options, int64_t max_pairs,
                         hs_stream **stream, hs_failure *failure);

/*
 * The next max_pairs pairs, or those that are left, to be freed with hs_pairs_free; *block is NULL
 * after the last ones. poll may be NULL; from call to call its fraction never falls, and it is 1
 * once all pairs have been found. No thread is left behind. On failure *block is NULL, and the
 * stream is as it was before: it may be called again.
 */
hs_status hs_stream_next(hs_stream *stream, hs_poll_fn poll, void *context, hs_pairs **block,
                         hs_failure *failure);

/* NULL-safe. Blocks stay as they are. */
void hs_stream_free(hs_stream *stream);

/*
 * Called for each pair. S and D have ndim entries, borrowed for the call. d2 is d * d, rounded
 * once, of the d that hs_pairs_find returns: sqrt(d2) is d unless d * d overflows or is subnormal.
 * Not 0: the search ends. It must return, without a C++ exception, and may search itself.
 */
typedef int (*hs_pair_fn)(int64_t i, int64_t j, const int32_t *S, const double *D, double d2,
                          void *user);
/* Called for n pairs at once, with all arrays but `both`. *n_taken, n at first: how many it has
 * looked at. */
typedef int (*hs_pairs_fn)(const hs_pair_arrays *pairs, int64_t n, int64_t *n_taken, void *user);
typedef struct hs_visit {
    hs_pair_fn  pair;
    hs_pairs_fn pairs; /* in place of `pair`, or NULL */
    void       *user;
    bool        thread_safe; /* several threads may call it at once, in no order */
} hs_visit;

/*
 * Hands each pair of hs_pairs_find to a function, in the same order unless it is thread_safe, and
 * stores none; it rounds to nearest. options->want, ->sorted, ->index_bytes and ->out are
 * ignored. *n_visited, set also on failure: pairs looked at, the one that ended the search
 * included, which is no failure; other threads may go on for some hundred points then.
 */
hs_status hs_pairs_visit(const hs_among *among, const hs_options *options, const hs_visit *visit,
                         int64_t *n_visited, hs_failure *failure);

/*
 * Which points hang together over pairs of hs_pairs_find, none of which is stored: the connected
 * components of the graph, or with `core` the clusters of DBSCAN.
 *
 * core       NULL, or n: not 0 for points that clusters are made of; the others belong to the first
 *            cluster that has a core point within their cutoff, or to none
 * labels     n: cluster of each point, from 0, in the order of their lowest core points; -1: none.
 *            They depend on nothing but the pairs; unspecified on failure
 * winding    NULL, or n, of which the first n_clusters are filled: bit l is set if, along pairs of
 *            core points, the cluster meets images of itself that lie apart along box vector l
 *
 * No queries. options->want, ->sorted, ->index_bytes and ->out are ignored; with points that are
 * not core, pairs are looked for a second time, which the counters leave out. Takes 4 bytes a
 * point beyond the search, with windings in a periodic box 5 + 4 * ndim.
 */
hs_status hs_clusters_find(const hs_among *among, const hs_options *options, const uint8_t *core,
                           int64_t *labels, uint8_t *winding, int64_t *n_clusters,
                           hs_failure *failure);

/*
 * Points that are sorted into cells once and searched many times. Immutable: any number of calls
 * may use them at once. Opaque, owned by the caller.
 *
 * points, box, options are borrowed for this call only: the points are copied. options->cutoff is
 * the largest cutoff that the cells are made for; larger ones, and queries much further away than
 * the points or the box reach, are answered as well, by cells that are made for that call.
 * options->cell_size changes the layout and the time that calls take, but no answer except those of
 * HS_SINGLE, which goes by cells.
 */
hs_status hs_cells_build(const hs_points *points, const hs_box *box, const hs_options *options,
                         hs_cells **cells, hs_failure *failure);

/* NULL-safe. */
void hs_cells_free(hs_cells *cells);

/* The points of the cells, as float64, and their box, or NULL; borrowed from the cells. */
void          hs_cells_points(const hs_cells *cells, hs_points *points);
const hs_box *hs_cells_box(const hs_cells *cells);

/*
 * The layout of cells: points order[start[c]] to order[start[c + 1] - 1] are in cell c, ascending.
 * Cell ids run along the first axis fastest; in dense layouts that is all there is to them, in
 * those of occupied cells only hs_cells_indices tells where each one lies. Arrays are borrowed from
 * the cells.
 */
typedef struct hs_layout {
    int            ndim;
    int64_t        n_points;
    int64_t        n_cells;
    int64_t        shape[HS_MAX_DIM];     /* cells along each axis, occupied or not */
    double         cell_size[HS_MAX_DIM]; /* extent across the faces of that axis; infinity where
                                           * points are so far from each other, or the box is so
                                           * small beside that, that one cell holds everything */
    bool           occupied_only;         /* cells that hold no point have no id */
    const int32_t *start;                 /* n_cells + 1 */
    const int32_t *order;                 /* n_points */
} hs_layout;

void hs_cells_layout(const hs_cells *cells, hs_layout *layout);

/* Indices of each cell along the axes. indices: n_cells * ndim. */
void hs_cells_indices(const hs_cells *cells, int64_t *indices);

/* The cell that each point would be in, wrapped into the box; those beyond an open face count as on
 * it. -1 where only occupied cells have ids and this one is not. cell: n. */
hs_status hs_cells_find(const hs_cells *cells, const hs_points *points, int64_t *cell,
                        hs_failure *failure);

/*
 * The raw block of cells around each query (NULL: each point), without a distance test: ranges of
 * `order` that hold at least all points within the cutoff, images included, as HS_WANT_I (first)
 * and HS_WANT_J (end, not included) of rows as of hs_neighbors_find. A range may come more than
 * once, for several images. HS_ERR_CUTOFF for a cutoff that the cells cannot serve, HS_ERR_FAR for
 * queries that they cannot. Open space and boxes along the coordinate axes take queries up to some
 * 2^850 cutoffs away, skewed boxes those within four times the distance of the points or 1024 box
 * vectors. failure.row, column and value tell which one; row is -1 for cells that are one cell with
 * everything. Of the options out, precision, sorted, want and index_bytes are ignored: ranges are
 * of int64; counters.pairs is 0.
 */
hs_status hs_cells_candidates(const hs_cells *cells, const hs_points *queries,
                              const hs_options *options, hs_pairs **ranges, hs_failure *failure);

/*
 * A list of pairs that is used for many steps: built with a skin, kept as long as no pair within
 * the cutoff can be missing from it, and decided anew for the points of each step. Opaque, owned by
 * the caller. Not for two threads at once. docs/verlet.md
 */
typedef struct hs_verlet hs_verlet;

/* An empty list; NULL when out of memory. */
hs_verlet *hs_verlet_new(void);

/*
 * The next step. The points and the box are copied. The list is kept, or built again with
 * options->cutoff + skin where it must be (the first step, another number or type of points, other
 * axes that repeat, another cutoff, a margin that is used up) or `rebuild` says so. skin: finite,
 * not negative; not looked at unless the list is built. Of the options only cutoff, kernel,
 * threads, limits and poll count. On failure the list is as it was, with the points of the step
 * before.
 */
hs_status hs_verlet_update(hs_verlet *list, const hs_points *points, const hs_box *box,
                           const hs_options *options, double skin, bool rebuild, bool *rebuilt,
                           hs_failure *failure);

/*
 * The pairs of the last step: the same set, with the same bits of d, D and S, that hs_pairs_find
 * would find, in the order of the list: first those that were in one image when it was built, then
 * the others, each as found then. It does not depend on kernel or threads. options->cutoff and
 * ->precision are not looked at. Before the first step there are no points.
 */
hs_status hs_verlet_find(const hs_verlet *list, const hs_options *options, hs_pairs **pairs,
                         hs_failure *failure);

typedef struct hs_verlet_state {
    bool    has_list; /* some step was taken */
    int     ndim;     /* of the last step, as are the next */
    int64_t n_points;
    int64_t n_listed; /* pairs within `radius` when the list was built */
    double  cutoff;
    double  radius; /* cutoff + skin, rounded up */
    double  margin; /* by how much pairs may yet come closer before the list is built again */
    double  tried;  /* the margin of the last step with the list of the one before; -infinity:
                         unknown. Below 0: the list was built again */
} hs_verlet_state;

hs_verlet_state hs_verlet_look(const hs_verlet *list);

/* NULL-safe. */
void hs_verlet_free(hs_verlet *list);

/* What a search of this scene would do: cells are made, by threads if these pay, and not searched.
 * No queries. With a reach there may be several searches: then what is said of cells and images is
 * that of the one with the largest reach. */
typedef struct hs_plan {
    int          ndim;
    int          n_periodic;
    bool         aligned;           /* every periodic box vector lies along one coordinate axis */
    bool         reduced;           /* the box was replaced by an equivalent, less skewed one */
    bool         keeps_originals;   /* coordinates as given are kept beside the wrapped */
    hs_algorithm algorithm;         /* that of the options, or what was chosen for HS_AUTO */
    bool         all_pairs;         /* one cell: every point meets every point */
    bool         sparse;            /* only occupied cells are stored, out of those of shape */
    int64_t      n_searches;        /* 1, or those of a hierarchy; 0: no points can be pairs */
    int64_t      n_cells;           /* cells that are stored */
    int64_t      shape[HS_MAX_DIM]; /* cells along each grid axis */
    double       cell_size[HS_MAX_DIM]; /* extent of a cell along each grid axis */
    int64_t      reach[HS_MAX_DIM];     /* cells to look at on either side */
    int64_t      images[HS_MAX_DIM];    /* periods that a pair can be apart; 0 on open axes */
    int64_t      stencil_rows;          /* neighbouring rows of cells, own row included */
    double       expected_pairs;        /* from the pairs of some points; where these are too many
                                        * to count, from the density if that says more */
    int          threads;               /* that the walk would be shared by */
    const char  *kernel;                /* static storage */
} hs_plan;

hs_status hs_plan_make(const hs_among *among, const hs_options *options, hs_plan *plan,
                       hs_failure *failure);

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
hs_status hs_box_wrap(const hs_box *box, const hs_points *points, double *wrapped, int64_t *shift,
                      hs_failure *failure);

/* What the places of points along the axes of a short basis of a box, and open axes, mean. */
typedef struct hs_box_axes {
    bool   repeats[HS_MAX_DIM]; /* places are from 0 to 1, which is the same place as 0 */
    double reach[HS_MAX_DIM];   /* places of a pair differ by no more; infinity if not known */
    double width[HS_MAX_DIM];   /* about what 1 is in a common unit, to compare sides by */
} hs_box_axes;

/*
 * For dividing points into parts that see each other's edges: where points are along the axes of a
 * box (NULL: none), and how far places can be apart where some image of a pair is within the
 * cutoff; rounding is in the reach. places, or NULL: places[k * stride + i] of point i along axis
 * k, 0 where the reach is infinite. They do not depend on the other points: largest is at least the
 * largest |coordinate| of all points that are ever compared, so that several calls agree. No box,
 * size of numbers or distance from the box makes the reach too small.
 */
hs_status hs_box_places(const hs_box *box, const hs_points *points, double cutoff, double largest,
                        double *places, int64_t stride, hs_box_axes *axes, hs_failure *failure);

/*
 * Memory of results that are gone, and a megabyte that a call has worked in, is kept for the next
 * ones, up to a limit: the one thing that outlives a call. No answer depends on it. Bytes kept at
 * most (512 MB at first; 0 keeps nothing), bytes kept now, and giving all of it back to the system.
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
