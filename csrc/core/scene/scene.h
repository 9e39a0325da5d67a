/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scene.h: points, box and cutoff in the form that the search works on: scaled by a power of two so
 * that the cutoff has an ordinary size, wrapped into the box, with a bound on every rounding.
 */
#ifndef HS_SCENE_H
#define HS_SCENE_H

#include "../exact/metric.h"
#include "../box/wrap.h"
#include "../memory/account.h"
#include "points.h"

struct hs_box_size;

/* More than any digit that scaling can lose times any number of turns: 2^-1074 * 2^51 < 2^-1000. */
#define HS_SCALING_LOSS 0x1p-1000

typedef struct hs_scene {
    int        ndim;
    int64_t    n;
    hs_scale   scale;
    hs_scale   unscale; /* the way back */
    hs_scale   pending; /* scale, less what closing gaps has already scaled */
    hs_lattice lattice;
    double     sought;         /* the caller's cutoff, not scaled; less if no two points are so far
                               * apart */
    double     cutoff;         /* scaled; the true one, or an upper bound when `extreme` */
    double     cutoff_low;     /* at most the true one */
    double     radius;         /* candidates are sought up to here; cutoff, or a little more */
    double less[HS_MAX_DIM];   /* so much less than the radius can t_k of a pair differ; mostly 0 */
    bool   is_ordinary;        /* of open space, and searched as the points were given */
    bool   extreme;            /* scaling lost digits: pairs are decided on the originals */
    hs_metric metric;          /* decides on X, or on the originals if there are any */
    hs_cloud  cloud;           /* its columns are X, in the caller's order, once that is known */
    bool      keeps_originals; /* X does not hold every digit */
    double   *originals[HS_MAX_DIM]; /* n each: the points as given */
    bool      x_is_beside;           /* the originals stayed in cloud.block, X is in `beside` */
    hs_turns  turns;                 /* known if shifts or originals need them */
    void     *beside;            /* owned; the columns of originals and turns, one behind another */
    double    lower[HS_MAX_DIM]; /* range of t_k that the grid covers: the points, the period */
    double    upper[HS_MAX_DIM];
    double    x_largest[HS_MAX_DIM]; /* at least the largest |X_k| */
    double    x_error;               /* each component of X is within this of r - w B */
    double    t_error[HS_MAX_DIM];   /* and each computed t_k of the true one, clamping included */
    double    formula_error;         /* precision="double": its |D| against the true one */
    bool      is_asked;              /* there are queries: the bounds above hold for these too */
    bool      is_kept;               /* and for queries that come later */
    bool      in_one_cell;           /* kept, but no scale holds it (hs_scene_put_in_one_cell) */
    bool      is_untested;           /* only cells are wanted: bounds for these alone will do */
    bool      is_plain;              /* the cutoff is taken as it is; gaps are closed only if
                                       * need be */
    bool      is_wide;               /* X is not made float32 */
    double    least_cutoff;          /* smallest positive length that pairs are compared with;
                                       * 0: the cutoff */
    double    within;                /* where is_wide: farther pairs do not matter; 0: all pairs
                                       * do */
} hs_scene;

/* The points to search among, and the points whose neighbours are sought; borrowed. */
typedef struct hs_sets {
    const hs_points *points;
    const hs_points *queries;  /* NULL: the points themselves; else of the same dimension */
    bool             is_kept;  /* queries come later: bounds with room for them */
    bool             is_plain; /* the cutoff is taken as it is, however far beyond all distances,
                                * and gaps (close_gaps.h) are closed only if need be */
    bool             is_wide;  /* X is not made float32: it may be larger than that holds */
    bool             follows;  /* the scene was filled before, with the same options but for the
                                * cutoff: lattice, scale and metric are kept if they are the same */
    const struct hs_search *built; /* NULL, or a search that has the points in cells already */
    struct hs_nearest_kept *trees; /* NULL, or what keeps a tree of the points (nearest_kept.h) */
    bool                    is_untested; /* cells are all that is wanted, no distance is computed */
    bool                    keeps_none;  /* pairs are handed on and not kept: any number will fit */
    bool   is_full;      /* each asking point meets all its neighbours, not the half list that
                               * has each pair once; always so with queries */
    double least_cutoff; /* the smallest positive length that pairs are compared with,
                                    * where there are several; 0: the cutoff alone */
    double within;       /* where is_wide: no pair further apart than this matters; 0: any */
    const struct hs_narrowing *narrowing; /* NULL: pairs lie within a ball, and fill it */
} hs_sets;

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

/* The volume that neighbours of a point lie in: of a ball, or less where they are narrower. */
double hs_scene_volume(const hs_scene *scene, double ball);

/* Sets scene->less, for a scene whose radius is known; the status is that of narrowing. In
 * scene_bounds.c. */
hs_status hs_scene_narrow(hs_scene *scene, const hs_narrowing *narrowing);

/*
 * Reads the points, checks everything that has a value, wraps. On failure the scene holds nothing
 * and any status but HS_ERR_KERNEL and HS_ERR_INTERRUPTED is possible.
 */
hs_status hs_scene_init(hs_account *account, hs_team *team, const hs_points *points,
                        const hs_box *box, const hs_options *options, hs_scene *scene,
                        hs_failure *failure);

/*
 * Two sets of points in one box: each becomes a scene of its own, with one scale, one lattice and
 * bounds that hold for both. asking: the queries' scene, NULL without queries; only its arrays and
 * what describes them are its own.
 */
hs_status hs_scene_init_sets(hs_account *account, hs_team *team, const hs_sets *sets,
                             const hs_box *box, const hs_options *options, hs_scene *scene,
                             hs_scene *asking, hs_failure *failure);

/* Steps of hs_scene_init_sets, in scene_scale.c. The cutoff that scale and gaps go by. */
double hs_scene_settle_cutoff(const hs_scene *scene, const struct hs_box_size *size, double cutoff);

/* Whether gaps between far points and queries are closed. Queries that come later may lie in such a
 * gap, and the k nearest may be at any distance. Where one scale holds everything, cells of queries
 * and of lists that last are those of the points as given. */
bool hs_scene_may_condense(const hs_scene *scene, const hs_scene *asking,
                           const struct hs_box_size *size, int unit);

/* The scale of points, lengths and the cutoff. asking: NULL, or the queries' scene. is_scaled:
 * closing gaps has brought the points and this box to units. */
void hs_scene_set_scale(const hs_box *box, bool is_scaled, int unit, hs_scene *scene,
                        const hs_scene *asking);

/* Whether a scene, once its points have been read, stays as it was given: there is no box, and
 * nothing is scaled. Then hs_scene_fill_ordinary fills it. follows: it has filled it before, with
 * this cutoff and as many axes. In scene_ordinary.c. */
bool      hs_scene_stays(const hs_sets *sets, const hs_box *box, const hs_options *options,
                         const hs_scene *scene);
hs_status hs_scene_fill_ordinary(const hs_options *options, bool follows, hs_scene *scene,
                                 hs_failure *failure);

/* Steps in scene_queries.c. Both clouds get the range of both. */
void hs_scene_join_clouds(hs_scene *scene, hs_scene *asking);

/* What has been settled for the points is settled for the queries. */
void hs_scene_share(const hs_scene *scene, hs_scene *asking);

/* The scene's x_largest, lower and upper cover what wrapping found in both. */
void hs_scene_join_wrapped(hs_scene *scene, const hs_scene *asking);

/*
 * A scene that is kept for numbers that no scale holds: all points on one spot of open space, which
 * gives one cell with everything. No search can use it: each reads the points again and makes a
 * scene of its own. It is there because what keeps cells owns the points, which those searches
 * read, and its layout is public: it must be a sound one that holds each point once.
 */
void hs_scene_put_in_one_cell(hs_scene *scene);

/* Whether a scene that was kept can take this cloud as it was loaded: no larger numbers, none that
 * its scale would round unless only cells are wanted. */
bool hs_scene_takes(const hs_scene *kept, const hs_cloud *cloud);

/* Whether the bounds of a scene that was kept hold for queries that have been wrapped. */
bool hs_scene_covers(const hs_scene *kept, const hs_scene *asking);

/* Names, of queries whose cells are wanted, row, column and value of the first coordinate that a
 * kept scene does not take; if each alone would do, the largest. Names none where no query would
 * do. */
void hs_scene_name_refused(const hs_scene *kept, const hs_points *queries, hs_failure *failure);

/* Widen the bounds on what was wrapped, for queries that come later: before and after they are
 * settled. */
void hs_scene_make_room(hs_scene *scene, double *magnitude);
void hs_scene_widen_errors(hs_scene *scene);

/*
 * Queries that meet the points of a scene that was made to be kept, as a scene of their own.
 * HS_UNSERVED when its bounds do not hold for them: they need another one. On failure it holds
 * nothing.
 */
hs_status hs_scene_like(hs_account *account, hs_team *team, const hs_scene *kept,
                        const hs_points *queries, const hs_options *options, hs_scene *asking,
                        hs_failure *failure);

/* Points wrapped into the box of a scene that was kept, however far away they are: for their cells
 * alone. On failure it holds nothing. */
hs_status hs_scene_wrapped_like(hs_account *account, const hs_scene *kept, const hs_points *points,
                                const hs_options *options, hs_scene *scene, hs_failure *failure);

/* Sets cutoff, radius and metric for another cutoff of a scene that is not extreme. */
void hs_scene_set_cutoff(hs_scene *scene, const hs_options *options);

/* Wraps columns that scaling would make infinite, or that lie more box vectors away than turns can
 * tell, in the caller's unit. For scenes whose S is not wanted, before they are scaled. In
 * scene_wrap.c. */
void hs_scene_fold_far(hs_scene *scene);

/* Wraps the points into the box, in scene_wrap.c. Sets x_largest, the range of t_k of the points in
 * lower and upper, and *magnitude, the largest sum of absolute terms. */
hs_status hs_scene_wrap(hs_scene *scene, hs_team *team, const hs_options *options,
                        double *magnitude, hs_failure *failure);

/* Steps in scene_bounds.c. Sets x_error and t_error, from x_largest and *magnitude of wrapping. */
void hs_scene_bound_errors(hs_scene *scene, double magnitude);

/* Sets the range of the grid coordinates: the points' own where open, one period where periodic. */
void hs_scene_settle_ranges(hs_scene *scene);

/* Sets formula_error and radius, from the cutoff, the lattice and the largest |x|, scaled. */
void hs_scene_set_radius(hs_scene *scene, const hs_options *options, double largest);

/* Whether the error of the formula of precision="double" passes both the cutoff and a small part of
 * the box: then it might call too many images near, and its answer is noise. hs_scene_name_farthest
 * says which point or query is to blame; asking: NULL without queries. */
bool hs_scene_is_drowned(const hs_scene *scene);
void hs_scene_name_farthest(const hs_scene *scene, const hs_scene *asking, hs_failure *failure);

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

/* Steps of scene_scale.c once the box is scaled. Whether one of its periods has become zero. */
struct hs_condensed;
bool hs_scene_box_vanishes(const hs_scene *scene);

/* Whether open axes leave nothing of the box, so that the points cannot be in cells. */
bool hs_scene_has_no_scale(const hs_scene *scene, const struct hs_condensed *condensed);

/* Why there is no search in a box that vanishes: HS_ERR_BOX_SKEWED or HS_ERR_MEMORY. */
hs_status hs_scene_refuse_vanishing(const hs_scene *scene, const struct hs_condensed *condensed,
                                    hs_failure *failure);

void hs_scene_free(hs_account *account, hs_scene *scene);

#endif
