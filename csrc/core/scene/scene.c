/* SPDX-License-Identifier: BSD-3-Clause */
/* scene.c: reads the points, closes gaps, scales, wraps, and settles bounds, in this order. */
#include "scene.h"

#include "close_gaps.h"
#include "unit.h"
#include "../base/outcome.h"
#include "../threads/passes.h"

#include <math.h>
#include <string.h>

/* Allocates columns for the originals and the turns, as far as these are kept, in this order. */
static bool
allocate_beside(hs_account *account, hs_scene *scene)
{
    const int m = scene->turns.known ? scene->lattice.n_periodic : 0;
    const int d = scene->keeps_originals ? scene->ndim : 0;
    if (d + m == 0) {
        return true;
    }
    const bool    narrow = hs_fold_turns(&scene->lattice, scene->cloud.largest) < INT32_MAX;
    const int64_t pitch = hs_column_pitch(scene->n, sizeof(double)) * (int64_t)sizeof(double);
    const int64_t turns_pitch =
        narrow ? hs_column_pitch(scene->n, sizeof(int32_t)) * (int64_t)sizeof(int32_t) : pitch;
    scene->beside =
        hs_alloc(account, HS_FOR_ORIGINALS, d * pitch + m * turns_pitch + HS_COLUMN_PADDING, 1);
    if (scene->beside == NULL) {
        return false;
    }
    hs_account_reassign(account, HS_FOR_ORIGINALS, HS_FOR_WRAPS,
                        m * turns_pitch + (d == 0 ? HS_COLUMN_PADDING : 0));
    char *column = scene->beside;
    for (int k = 0; k < d; k++, column += pitch) {
        scene->originals[k] = (double *)(void *)column;
    }
    for (int r = 0; r < m; r++, column += turns_pitch) {
        scene->turns.narrow[r] = narrow ? (int32_t *)(void *)column : NULL;
        scene->turns.wide[r] = narrow ? NULL : (int64_t *)(void *)column;
    }
    return true;
}

typedef struct scaling {
    hs_scene *scene;
    bool      copies;        /* to the originals ... */
    bool      copies_scaled; /* ... what has been scaled already */
} scaling;

/* Scales points [first, last), and copies them before or after that. */
static hs_status
scale_slab(void *context, int slab, int64_t first, int64_t last)
{
    const scaling *doing = context;
    hs_scene      *scene = doing->scene;
    const size_t   n_bytes = (size_t)(last - first) * sizeof(double);
    (void)slab;
    for (int k = 0; k < scene->ndim; k++) {
        double *x = scene->cloud.x[k];
        if (doing->copies && !doing->copies_scaled) {
            memcpy(scene->originals[k] + first, x + first, n_bytes);
        }
        for (int64_t i = first; scene->pending.exponent != 0 && i < last; i++) {
            x[i] = hs_scale_apply(scene->pending, x[i]);
        }
        if (doing->copies && doing->copies_scaled) {
            memcpy(scene->originals[k] + first, x + first, n_bytes);
        }
    }
    return HS_OK;
}

/* The originals are kept beside the search's copy only if needed. */
static hs_status
prepare_points(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene)
{
    const int m = scene->lattice.n_periodic;
    hs_cloud *cloud = &scene->cloud;
    scene->keeps_originals =
        scene->extreme || (m > 0 && (!scene->lattice.aligned || options->precision == HS_DOUBLE));
    scene->turns.known = m > 0 && (scene->keeps_originals || (options->want & HS_WANT_SHIFT));
    if (m > 0 && !(options->want & HS_WANT_SHIFT) && options->precision != HS_DOUBLE) {
        hs_scene_fold_far(scene);
    }
    for (int k = 0; k < scene->ndim; k++) {
        cloud->lower[k] = hs_scale_apply(scene->pending, cloud->lower[k]);
        cloud->upper[k] = hs_scale_apply(scene->pending, cloud->upper[k]);
    }
    cloud->largest = hs_scale_apply(scene->pending, cloud->largest);
    if (!allocate_beside(account, scene)) {
        return HS_ERR_MEMORY;
    }
    scene->x_is_beside = scene->keeps_originals && !scene->extreme && !scene->lattice.aligned;
    const bool copies = scene->keeps_originals && !scene->x_is_beside;
    if (copies || scene->pending.exponent != 0) {
        scaling          doing = {scene, copies, !scene->extreme};
        const hs_options silent = {.poll = NULL}; /* the caller was polled when this was copied */
        (void)hs_walk_slabs(team, &silent, scene->n, scale_slab, &doing);
    }
    for (int k = 0; scene->x_is_beside && k < scene->ndim; k++) {
        double *beside = scene->originals[k]; /* wrapping moves the points there */
        scene->originals[k] = cloud->x[k];
        cloud->x[k] = beside;
    }
    return HS_OK;
}

static hs_status
wrap_points(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
            double *magnitude, hs_failure *failure)
{
    const hs_status status = prepare_points(account, team, options, scene);
    return status == HS_OK ? hs_scene_wrap(scene, team, options, magnitude, failure) : status;
}

/* asking: NULL, or the queries' scene, which is wrapped too and gets the bounds of `scene`. */
static hs_status
fill_scene(hs_account *account, hs_team *team, const hs_options *options, hs_scene *scene,
           hs_scene *asking, hs_failure *failure)
{
    double    magnitude = 0.0, of_asking = 0.0;
    hs_status status = wrap_points(account, team, options, scene, &magnitude, failure);
    if (status == HS_OK && asking != NULL) {
        status = wrap_points(account, team, options, asking, &of_asking, failure);
        failure->in_queries = status == HS_ERR_SHIFT_RANGE;
    }
    if (status != HS_OK) {
        return status;
    }
    magnitude = hs_larger(magnitude, of_asking);
    if (asking != NULL) {
        hs_scene_join_wrapped(scene, asking);
    }
    if (scene->is_kept) {
        hs_scene_make_room(scene, &magnitude);
    }
    hs_scene_bound_errors(scene, magnitude);
    hs_scene_settle_ranges(scene);
    if (scene->is_kept) {
        hs_scene_widen_errors(scene);
    }
    hs_scene_init_metric(scene, options);
    return HS_OK;
}

/* Clears what is added to or freed. The rest is large, and set before it is read. */
static void
start_scene(const hs_points *points, hs_scene *scene)
{
    scene->ndim = points->ndim;
    scene->n = points->n;
    scene->keeps_originals = scene->x_is_beside = scene->is_asked = scene->is_kept = false;
    scene->in_one_cell = scene->is_untested = false;
    scene->cloud.block = scene->beside = NULL;
    scene->turns = (hs_turns){.known = false};
    memset(scene->x_largest, 0, sizeof scene->x_largest);
}

hs_status
hs_scene_like(hs_account *account, hs_team *team, const hs_scene *kept, const hs_points *queries,
              const hs_options *options, hs_scene *asking, hs_failure *failure)
{
    double     magnitude = 0.0;
    hs_options as_kept = *options;
    start_scene(queries, asking);
    if (kept->is_untested) { /* however many turns that are */
        as_kept.want &= ~(unsigned)HS_WANT_SHIFT;
    } else if (kept->turns.known) {
        as_kept.want |= HS_WANT_SHIFT;
    }
    hs_status status = hs_cloud_load(account, team, queries, options, &asking->cloud, failure);
    if (status == HS_OK && !hs_scene_takes(kept, &asking->cloud)) {
        status = HS_UNSERVED;
    }
    if (status == HS_OK) {
        hs_scene_share(kept, asking);
        status = wrap_points(account, team, &as_kept, asking, &magnitude, failure);
    }
    if (status == HS_ERR_SHIFT_RANGE && !(options->want & HS_WANT_SHIFT)) {
        status = HS_UNSERVED; /* a scene without turns will do */
    }
    failure->in_queries = status != HS_OK;
    if (status == HS_OK) {
        hs_scene_bound_errors(asking, magnitude);
        hs_scene_settle_ranges(asking);
        status = hs_scene_covers(kept, asking) ? HS_OK : HS_UNSERVED;
    }
    if (status != HS_OK) {
        hs_scene_free(account, asking);
    }
    return status;
}

hs_status
hs_scene_wrapped_like(hs_account *account, const hs_scene *kept, const hs_points *points,
                      const hs_options *options, hs_scene *scene, hs_failure *failure)
{
    double magnitude = 0.0;
    start_scene(points, scene);
    hs_status status = hs_cloud_load(account, NULL, points, options, &scene->cloud, failure);
    if (status == HS_OK) {
        hs_scene_share(kept, scene);
        status = wrap_points(account, NULL, options, scene, &magnitude, failure);
    }
    if (status != HS_OK) {
        hs_scene_free(account, scene);
    }
    return status;
}

/* Reads the points, and the queries if there are any. */
static hs_status
load_clouds(hs_account *account, hs_team *team, const hs_sets *sets, const hs_options *options,
            hs_scene *scene, hs_scene *asking, hs_failure *failure)
{
    hs_status status = hs_cloud_load(account, team, sets->points, options, &scene->cloud, failure);
    if (status == HS_OK && asking != NULL) {
        status = hs_cloud_load(account, team, sets->queries, options, &asking->cloud, failure);
        failure->in_queries = status != HS_OK;
    }
    if (status == HS_OK && asking != NULL) {
        hs_scene_join_clouds(scene, asking);
    }
    return status;
}

/* The turns that closing gaps made, added to those that wrapping made after it. With all of them
 * the originals are the columns as given. */
static void
add_turns(const hs_condensed *condensed, int set, hs_scene *scene)
{
    for (int k = 0; condensed->has_turns && k < scene->ndim; k++) {
        const int64_t *more = condensed->turns[set][k];
        const double  *given = condensed->given[set][k];
        const int      row = scene->lattice.row_of_axis[k];
        for (int64_t i = 0; more != NULL && i < scene->n; i++) {
            hs_turns_set(&scene->turns, row, i, hs_turns_get(&scene->turns, row, i) + more[i]);
        }
        if (scene->extreme && given != NULL) {
            memcpy(scene->originals[k], given, (size_t)scene->n * sizeof *given);
        }
    }
}

/* Sets the box vectors as given in columns that are decided on as they were given. */
static void
restore_rows(const hs_condensed *condensed, hs_lattice *lattice)
{
    for (int r = 0; condensed->has_turns && r < lattice->n_periodic; r++) {
        for (int k = 0; k < lattice->ndim; k++) {
            if (condensed->given[0][k] != NULL) {
                lattice->given[r][k] = condensed->given_box->rows[lattice->vector_of_row[r]][k];
            }
        }
    }
}

/* Sets lattice and radius, then wraps the points. */
static hs_status
fill_scaled(hs_account *account, hs_team *team, const hs_options *options,
            const hs_condensed *condensed, hs_scene *scene, hs_scene *asking, hs_failure *failure)
{
    /* Without points nothing has an image, however small the box is. */
    const bool empty = scene->n == 0 || (asking != NULL && asking->n == 0);
    if (condensed->has_turns) { /* more than the points themselves tell */
        scene->cloud.largest = INFINITY;
        if (asking != NULL) {
            asking->cloud.largest = INFINITY;
        }
    }
    const hs_box *box = empty ? NULL : condensed->box;
    hs_lattice_init(box, scene->ndim, scene->pending, &scene->lattice);
    if (scene->extreme) {
        restore_rows(condensed, &scene->lattice);
    }
    if (scene->is_kept && !empty && hs_scene_has_no_scale(scene, condensed)) {
        hs_scene_put_in_one_cell(scene);
    }
    hs_scene_set_radius(scene, options, hs_scale_apply(scene->pending, scene->cloud.largest));
    if (hs_scene_is_drowned(scene)) {
        hs_scene_name_farthest(scene, asking, failure);
        return HS_ERR_ROUNDING;
    }
    if (asking != NULL) {
        hs_scene_share(scene, asking);
    }
    return hs_scene_box_vanishes(scene)
               ? hs_scene_refuse_vanishing(scene, condensed, failure)
               : fill_scene(account, team, options, scene, asking, failure);
}

/* Chooses the scale of a scene whose points are as given, and fills it. */
static hs_status
scale_scene(hs_account *account, hs_team *team, const hs_options *options, const hs_box *box,
            hs_scene *scene, hs_scene *asking, hs_failure *failure)
{
    hs_condensed      condensed; /* large, and seldom used: not cleared */
    hs_cloud         *cloud = &scene->cloud;
    const hs_box_size size = hs_box_size_of(box);
    hs_status         status = HS_OK;
    condensed.box = condensed.given_box = box;
    condensed.is_scaled = condensed.has_turns = false;
    scene->sought = hs_scene_settle_cutoff(scene, &size, options->cutoff);
    const int unit = hs_unit_exponent(cloud, &size, scene->sought);
    if (hs_scene_may_condense(scene, asking, &size, unit)) {
        const int powers = scene->is_wide ? HS_FAR_BOUNDED_EXPONENT : HS_FAR_EXPONENT;
        status = hs_condense(account, options, box, unit, powers, cloud,
                             asking != NULL ? &asking->cloud : NULL, &condensed, failure);
    }
    if (status == HS_OK) {
        hs_scene_set_scale(condensed.box, condensed.is_scaled, unit, scene, asking);
        status = fill_scaled(account, team, options, &condensed, scene, asking, failure);
    }
    if (status == HS_OK) {
        add_turns(&condensed, 0, scene);
        if (asking != NULL) {
            add_turns(&condensed, 1, asking);
        }
    }
    hs_condensed_free(account, &condensed);
    return status;
}

hs_status
hs_scene_init_sets(hs_account *account, hs_team *team, const hs_sets *sets, const hs_box *box,
                   const hs_options *options, hs_scene *scene, hs_scene *asking,
                   hs_failure *failure)
{
    const bool follows = sets->follows && scene->is_ordinary && scene->sought == options->cutoff &&
                         scene->ndim == sets->points->ndim;
    start_scene(sets->points, scene);
    scene->is_ordinary = false;
    scene->is_kept = scene->is_asked = sets->is_kept;
    scene->is_plain = sets->is_plain;
    scene->is_wide = sets->is_wide;
    scene->least_cutoff = sets->least_cutoff;
    scene->within = sets->within;
    if (asking != NULL) {
        start_scene(sets->queries, asking);
    }
    if (!(options->cutoff >= 0.0) || !isfinite(options->cutoff)) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    hs_status status = hs_box_check(box, failure);
    if (status == HS_OK) {
        status = load_clouds(account, team, sets, options, scene, asking, failure);
    }
    scene->is_ordinary = status == HS_OK && hs_scene_stays(sets, box, options, scene);
    if (scene->is_ordinary) {
        status = hs_scene_fill_ordinary(options, follows, scene, failure);
    } else if (status == HS_OK) {
        status = scale_scene(account, team, options, box, scene, asking, failure);
    }
    if (status != HS_OK) {
        hs_scene_free(account, scene);
        if (asking != NULL) {
            hs_scene_free(account, asking);
        }
    }
    return status;
}

hs_status
hs_scene_init(hs_account *account, hs_team *team, const hs_points *points, const hs_box *box,
              const hs_options *options, hs_scene *scene, hs_failure *failure)
{
    const hs_sets alone = {.points = points};
    return hs_scene_init_sets(account, team, &alone, box, options, scene, NULL, failure);
}

void
hs_scene_free(hs_account *account, hs_scene *scene)
{
    hs_cloud_free(account, &scene->cloud);
    hs_free(account, scene->beside);
    scene->beside = NULL;
}
