/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_SEARCH_CHOICE_H
#define HS_SEARCH_CHOICE_H

#include "scan.h"

/*
 * choice.h: which pairs count, of those within reach: the caller's selection made ready for one
 * call. Labels stay in the caller's order and arrays; excluded pairs become rows of partners. Where
 * twice the cutoff may reach from one image of a point to another, points and box are kept as given
 * besides, so that it can be decided which image is the nearest. hs_choose applies it to hits.
 */

/* Excluded pairs of the caller as rows: the partners of each asking point. */

/* Those of row r are number[first[r]] to number[first[r + 1]], ascending. Arrays are owned. */
typedef struct hs_partners {
    int64_t *first; /* NULL: no pairs are excluded */
    int32_t *number;
} hs_partners;

typedef struct hs_choice {
    /* Borrowed. Labels of asking points and of points; NULL where they do not matter. */
    const int64_t *asking_group, *group;
    const int64_t *asking_label, *label;
    const int64_t *number;       /* of asking points among the points, where they are not these
                                  * in their order, and not queries of their own; or NULL */
    uint64_t       within;       /* most difference of labels whose pairs are excluded */
    double         min_distance; /* in the caller's unit; 0: there is none */
    bool           has_queries;  /* asking points are no points themselves */
    /* Owned. */
    int64_t     *copies;   /* of the labels, where the caller's do not last; or NULL */
    hs_partners  partners; /* points whose pairs are excluded */
    double       shortest; /* no vector of the lattice is shorter; infinity in open space */
    hs_cloud     asking_cloud, cloud; /* as given; empty where the shortest is far enough */
    hs_image_box images;
    int64_t      origin; /* of a part: partners and `number` count points from here */
} hs_choice;

/*
 * Sets call->choice for searches among these sets, to be freed with hs_choice_close.
 * HS_ERR_MEMORY, or HS_ERR_ARGUMENT for arrays that are missing, numbers that are no point's
 * (failure->row), or a min_distance that is negative or not finite, or not 0 with HS_SINGLE. On
 * failure there is none.
 */
hs_status hs_choice_open(const hs_selection *selection, const hs_sets *sets, hs_call *call,
                         hs_failure *failure);

/* Frees the choice of a call, if it has one; idempotent. */
void hs_choice_close(hs_call *call);

/* Whether pairs are excluded, in their nearest image. */
HS_ALWAYS_INLINE bool
hs_choice_excludes(const hs_choice *choice)
{
    return choice->label != NULL || choice->partners.first != NULL;
}

/* The box of a choice that excludes pairs, in place of one before: HS_ERR_BOX_SKEWED, or a status
 * of hs_box_check. */
hs_status hs_choice_set_box(const hs_box *box, int ndim, hs_choice *choice, hs_failure *failure);

/* The part of a choice for points from first_point on and queries from first_query on, which are
 * numbered from 0; it borrows all that it has. */
void hs_choice_cut(const hs_choice *all, int64_t first_point, int64_t first_query, hs_choice *part);

/* Keeps the points, for a choice that compares images; any status of hs_cloud_load. */
hs_status hs_choice_keep_points(const hs_sets *sets, hs_call *call, hs_failure *failure);

/* Copies the labels, for a choice that outlives the caller's; HS_OK or HS_ERR_MEMORY. */
hs_status hs_choice_keep_labels(const hs_sets *sets, hs_call *call);

/* Box and points, as far as the call's choice needs them, for a search of one scene; cutoff: no
 * pair is further apart. */
hs_status hs_choice_set_scene(const hs_sets *sets, const hs_box *box, double cutoff, hs_call *call,
                              hs_failure *failure);

/* Whether a pair as far apart as this may be excluded in one image and count in another. */
HS_ALWAYS_INLINE bool
hs_choice_compares(const hs_choice *choice, double cutoff)
{
    /* More than rounding changes both. */
    return hs_choice_excludes(choice) && choice->shortest < INFINITY &&
           !(2.02 * cutoff < choice->shortest);
}

/* Whether pairs are looked at one by one, besides their labels. */
HS_ALWAYS_INLINE bool
hs_choice_needs_places(const hs_choice *choice, double cutoff)
{
    return choice->min_distance > 0.0 || hs_choice_compares(choice, cutoff);
}

/* The smallest positive length that pairs are compared with besides the cutoff: `least`, if it is
 * not 0, or the least distance of a choice, if there is one; 0 where there is neither. */
HS_ALWAYS_INLINE double
hs_choice_least_length(const hs_choice *choice, double least)
{
    const double apart = choice != NULL ? choice->min_distance : 0.0;
    return apart > 0.0 && (least == 0.0 || apart < least) ? apart : least;
}

/* The least distance in the unit of the scene's metric. */
HS_ALWAYS_INLINE double
hs_choice_least(const hs_choice *choice, const hs_scene *scene)
{
    return scene->extreme ? choice->min_distance
                          : hs_scale_apply(scene->scale, choice->min_distance);
}

/*
 * Takes hits of points [first, next) of the group out that the call's choice leaves out; the order
 * of the others stays. Hits are places, and become point numbers where the scanner lists these. The
 * pair of a point with itself stays where lists are full: table rows count on it. HS_OK, or any
 * status of hs_pair_batch_look_up and hs_near_image, with the asking point in
 * scanner->failed_point.
 */
hs_status hs_choose(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next);

/*
 * Which hits of a point their labels leave out: those of another group; for excluded pairs those
 * whose label is in a range around the point's, or that are among its partners.
 */

/* What one asking point leaves out: labels from `least` on to `width` more, modulo 2^64. */
typedef struct hs_asking {
    int32_t        itself; /* its number, where it may be among its hits; else -1 */
    const int64_t *label;  /* of all points: groups, or what excludes; NULL: partners exclude */
    uint64_t       least, width;
    const int32_t *partner; /* ascending */
    int32_t        origin;  /* that partners count from */
    int64_t        n_partners;
    uint64_t       bits; /* one for the last six bits of each partner */
} hs_asking;

/* One asking point, and by what its pairs with others are left out. */
typedef struct hs_chooser {
    const hs_choice *choice;    /* borrowed */
    int32_t          point;     /* the asking one: its number among the points, or the queries */
    hs_asking        of_group;  /* label NULL: there are no groups */
    hs_asking        excluding; /* if `excludes` */
    bool             excludes;  /* some pairs of this point are excluded, in their nearest image */
} hs_chooser;

/* asking: in the order of the call. */
void hs_chooser_set(const hs_choice *choice, int32_t asking, hs_chooser *chooser);

/* Whether the point with this number is of the same group, or there are no groups; whether the pair
 * with it is excluded, in its nearest image. */
bool hs_chooser_is_of_group(const hs_chooser *chooser, int32_t number);
bool hs_chooser_excludes(const hs_chooser *chooser, int32_t number);

/* Whether this shift, over the periodic box vectors as given, which may be turned round, is that of
 * the nearest image, as seen from the lower number of two points of one set, or from a query. For a
 * choice that compares. Any status of hs_near_image. */
hs_status hs_choice_is_nearest(const hs_choice *choice, int32_t point, int32_t number,
                               int64_t *shift, bool *nearest);

#endif
