/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_SCENE_SCENE_H
#define HS_SCENE_SCENE_H

#include "../box/wrap.h"
#include "points.h"

/*
 * scene.h: points, box and cutoff in the form that the search works on: scaled by a power of two so
 * that the cutoff has an ordinary size, wrapped into the box, with a bound on every rounding.
 */

/* More than any digit that scaling can lose times any number of turns: 2^-1074 * 2^51 < 2^-1000. */
#define HS_SCALING_LOSS 0x1p-1000

typedef struct hs_scene {
    int        ndim;
    int64_t    n;
    hs_scale   scale;
    hs_scale   unscale; /* the way back */
    hs_lattice lattice;
    double     sought;         /* the caller's cutoff, not scaled; less if no two points are so far
                               * apart */
    double     cutoff;         /* scaled; the true one, or an upper bound when `extreme` */
    double     cutoff_low;     /* at most the true one */
    double     radius;         /* candidates are sought up to here; cutoff, or a little more */
    double less[HS_MAX_DIM];   /* so much less than the radius can t_k of a pair differ; mostly 0 */
    bool   is_ordinary;        /* searched as the points were given: no number is far */
    bool   extreme;            /* scaling lost digits: pairs are decided on the originals */
    hs_metric metric;          /* decides on X, or on the originals if there are any */
    hs_cloud  cloud;           /* its columns are X, in the caller's order, once that is known */
    bool      keeps_originals; /* X does not hold every digit */
    double   *originals[HS_MAX_DIM]; /* n each, in cloud.block: the points as given. X is beside */
    hs_turns  turns;                 /* known if shifts or originals need them */
    void     *beside; /* owned; the columns of such an X and of turns, one behind another */
    double    lower[HS_MAX_DIM]; /* range of t_k that the grid covers: the points, the period */
    double    upper[HS_MAX_DIM];
    double    x_largest[HS_MAX_DIM]; /* at least the largest |X_k| */
    double    x_error;               /* each component of X is within this of r - w B */
    double    t_error[HS_MAX_DIM];   /* and each computed t_k of the true one, clamping included */
    double    formula_error;         /* precision="double": its |D| against the true one */
    bool      is_kept;               /* the bounds above hold for queries that come later, too */
    bool      in_one_cell;           /* kept, but no scale holds it (scene_put_in_one_cell) */
    bool      is_untested;           /* only cells are wanted: bounds for these alone will do */
} hs_scene;

/* The points to search among, and the points whose neighbours are sought; borrowed. */
typedef struct hs_sets {
    const hs_points *points;
    const hs_points *queries; /* NULL: the points themselves; else of the same dimension */
    const hs_set    *of_points, *of_queries; /* what is known of them; NULL: nothing */
    bool             is_kept;                /* queries come later: bounds with room for them */
    bool             is_plain; /* the cutoff is taken as it is, however far beyond all distances,
                                * and gaps are closed only if need be */
    bool             is_wide;  /* X is not made float32: it may be larger than that holds */
    bool             follows;  /* the scene was filled before, with as many dimensions and the same
                                * options but for the cutoff: lattice, scale and metric are
                                * kept if they are the same */
    const struct hs_search *built; /* NULL, or a search that has the points in cells already */
    struct hs_nearest_kept *trees; /* NULL, or what keeps a tree of the points (nearest.h) */
    bool                    is_untested; /* cells are all that is wanted, no distance is computed */
    bool                    keeps_none;  /* pairs are handed on and not kept: any number will fit */
    bool   is_full; /* each asking point meets all its neighbours, not the half list that
                               * has each pair once; always so with queries */
    bool   is_once; /* where it is full: each pair is listed once even so, by its lower number */
    double least_cutoff; /* the smallest positive length that pairs are compared with,
                                    * where there are several; 0: the cutoff alone */
    double within;       /* where is_wide: no pair further apart than this matters; 0: any */
    const struct hs_narrowing *narrowing; /* NULL: pairs lie within a ball, and fill it */
    const double *domain; /* NULL, or what the range of the points reaches from and to at least, as
                           * in hs_options */
} hs_sets;

/* These points, with what is known of them; either may be NULL. */
HS_ALWAYS_INLINE hs_set
hs_set_with(const hs_points *points, const hs_set *known)
{
    hs_set set = {.n_systems = 0};
    set = known != NULL ? *known : set;
    set.at = points != NULL ? *points : set.at;
    return set;
}

/* For pairs that lie within less than a ball: how far normal . D of a pair can be from 0, in the
 * caller's unit, for a normal of a grid axis; any larger number where it is `enough` or more. HS_OK
 * or HS_ERR_INTERRUPTED. */
typedef struct hs_narrowing {
    hs_status (*find)(const void *context, const double *normal, double enough, double *width);
    const void *context; /* borrowed */
} hs_narrowing;

/* How far apart t_k of a pair can be. */
HS_ALWAYS_INLINE double
hs_scene_radius_along(const hs_scene *scene, int k)
{
    return scene->radius - scene->less[k];
}

/* Sets scene->less, for a scene whose radius is known; the status is that of narrowing. */
hs_status hs_scene_narrow(hs_scene *scene, const hs_narrowing *narrowing);

/*
 * Reads the points and the queries, if there are any, checks everything that has a value, wraps:
 * each set becomes a scene of its own, with one scale, one lattice and bounds that hold for both.
 * asking: the queries' scene, NULL without queries; only its arrays and what describes them are its
 * own. On failure the scenes hold nothing and any status but HS_ERR_KERNEL is possible.
 */
hs_status hs_scene_make(hs_account *account, hs_team *team, const hs_sets *sets, const hs_box *box,
                        const hs_options *options, hs_scene *scene, hs_scene *asking,
                        hs_failure *failure);

/* Names, of queries whose cells are wanted, row, column and value of the first coordinate that a
 * kept scene does not take; if each alone would do, the largest. Names none where no query would
 * do. */
void hs_scene_name_refused(const hs_scene *kept, const hs_points *queries, hs_failure *failure);

/* For a box whose short vectors float64 does not tell points along (HS_ERR_BOX_SKEWED): names the
 * farthest point or query, where it is to blame, since it lies far outside along an open axis.
 * asking: NULL without queries. */
void hs_scene_name_outlier(const hs_scene *scene, const hs_scene *asking, hs_failure *failure);

/*
 * Queries that meet the points of a scene that was made to be kept, as a scene of their own.
 * HS_REBUILD when its bounds do not hold for them: they need another one. for_cells: points wrapped
 * into its box for their cells alone, however far away they are. On failure it holds nothing.
 */
hs_status hs_scene_from_kept(hs_account *account, hs_team *team, const hs_scene *kept,
                             const hs_points *queries, const hs_options *options, bool for_cells,
                             hs_scene *asking, hs_failure *failure);

/* Sets cutoff and radius for another cutoff of a scene that is not extreme; hs_scene_init_metric is
 * to follow. */
void hs_scene_set_cutoff(hs_scene *scene, const hs_options *options);

/* Sets what decides: X and B where they hold every digit, else points and box vectors as given. */
void hs_scene_init_metric(hs_scene *scene, const hs_options *options);

/* t_k of point i, with the bits of hs_lattice_coordinate. */
HS_ALWAYS_INLINE double
hs_scene_coordinate(const hs_scene *scene, int64_t i, int k)
{
    const hs_lattice *lattice = &scene->lattice;
    if (lattice->aligned) {
        return scene->cloud.x[k][i];
    }
    double t = 0.0;
    for (int c = 0; c < lattice->ndim; c++) {
        t += lattice->normal[k][c] * scene->cloud.x[c][i];
    }
    return t;
}

void hs_scene_free(hs_account *account, hs_scene *scene);

/* The power of two that a scene is scaled by, so that the search has ordinary numbers. */

/*
 * Beyond so many largest distances gaps are closed in a bounded search for the nearest. Wrapped
 * into a coupled box, coordinates err by 2^-52 of the largest one. The radius that is looked at is
 * 2^10 times the error of two at least (candidates.c), so it passes the largest distance from here
 * on, and soon spans many images.
 */
#define HS_FAR_BOUNDED_EXPONENT 40

/* x = m 2^e with 1 <= m < 2: e. Of zero a very small number, of infinity a very large one. */
int hs_exponent_of(double x);

/* Whether a size is more than 2^powers times a length of the exponent `unit`, 2^unit. */
bool hs_is_far(double size, int unit, int powers);

/* Sizes of the periodic box entries. */
typedef struct hs_box_size {
    double   largest;    /* 0 without box vectors */
    double   smallest;   /* not counting zeros; infinity without box vectors */
    double   short_row;  /* the least of the vectors' largest entries; infinity without */
    unsigned moved;      /* bit k: some vector has an entry in column k */
    bool     is_coupled; /* a vector has several entries, or a column has */
} hs_box_size;

/* box: NULL for none. */
hs_box_size hs_box_size_of(const hs_box *box);

/* A copy of the caller's points and box at one step, as given: what a list that
 * outlives the call (pair_list.h) compares and decides with. */

typedef struct hs_frame {
    void     *rows;    /* owned: one point behind another, of the caller's type */
    hs_points points;  /* these */
    double    largest; /* largest |x| of all coordinates, 0 without points */
    bool      has_box;
    hs_box    box; /* without one nothing repeats */
} hs_frame;

/*
 * Copies both, each number read once. HS_ERR_NOT_FINITE names the first bad row and column. Storage
 * is used again where it is large enough. On failure the frame holds nothing of use.
 */
hs_status hs_frame_take(const hs_points *points, const hs_box *box, const hs_options *options,
                        hs_frame *frame, hs_failure *failure);

/* Whether points of one are those of the other as far as a list goes: as many, of the same type, in
 * boxes that repeat along the same axes. */
bool hs_frames_match(const hs_frame *one, const hs_frame *other);

/* Whether all box vectors that repeat are the same numbers. */
bool hs_frames_share_box(const hs_frame *one, const hs_frame *other);

void hs_frame_free(hs_frame *frame);

/* The box, or NULL for open space. */
HS_ALWAYS_INLINE const hs_box *
hs_frame_box(const hs_frame *frame)
{
    return frame->has_box ? &frame->box : NULL;
}

/* Coordinate e, counted point after point. */
HS_ALWAYS_INLINE double
hs_frame_entry(const void *rows, hs_real real, int64_t e)
{
    return real == HS_FLOAT32 ? (double)((const float *)rows)[e] : ((const double *)rows)[e];
}

/* How many box vectors repeat. */
HS_ALWAYS_INLINE int
hs_frame_periodic(const hs_frame *frame, int *vector_of_row)
{
    int m = 0;
    for (int l = 0; l < frame->box.ndim; l++) {
        if (frame->box.periodic[l]) {
            vector_of_row[m++] = l;
        }
    }
    return m;
}

#endif
