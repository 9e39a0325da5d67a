/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * halfshell_capi.h: the functions of halfshell.h, halfshell_nodes.h and halfshell_dynamic.h for
 * other extension modules, without linking: a table of pointers that the Python package holds out
 * in a capsule. Include Python.h before it.
 *
 *     static const hs_capi *halfshell;                      once, when the module is initialised:
 *     halfshell = hs_capi_import();                         NULL: an exception is set
 *     status = halfshell->pairs_find(&among, &options, &pairs, &failure);
 *
 * Member `pairs_find` is hs_pairs_find, and so on: the headers say what each does. Do not call the
 * functions by their own names, unless you link a core of your own; never free by one of the two
 * what came from the other.
 *
 * The table is constant, shared by all threads, and stays as long as the process, also when modules
 * are removed from sys.modules. Its functions need no GIL: release it around those that search. A
 * hs_poll_fn, hs_pair_fn or hs_pairs_fn that uses Python must take it back first; it is called from
 * threads that Python has not seen only if hs_visit.thread_safe allows it.
 */
#ifndef HALFSHELL_CAPI_H
#define HALFSHELL_CAPI_H

#ifndef Py_PYTHON_H
#error "include Python.h before halfshell_capi.h"
#endif

#include "halfshell_dynamic.h"
#include "halfshell_nodes.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Of the structs, enums and signatures in halfshell.h. It grows when one changes such that modules
 * that were compiled before would misread it; not when functions are appended to the table. */
#define HS_CAPI_VERSION 8

#define HS_CAPI_NAME "halfshell._core._C_API"

/* New members are appended, and only there; none is taken away. */
typedef struct hs_capi {
    uint32_t abi_version; /* HS_CAPI_VERSION of the core; the first two members stay for ever */
    uint32_t size;        /* bytes of this table: what lies beyond is not there */
    int (*version)(void);
    const char *(*status_text)(hs_status status);
    hs_options (*options_default)(void);
    hs_status (*pairs_find)(const hs_among *among, const hs_options *options, hs_pairs **pairs,
                            hs_failure *failure);
    hs_status (*pairs_count)(const hs_among *among, const hs_options *options, int64_t *count,
                             hs_failure *failure);
    hs_status (*neighbors_find)(const hs_among *among, const hs_options *options, hs_pairs **rows,
                                hs_failure *failure);
    hs_status (*neighbors_count)(const hs_among *among, const hs_options *options, int64_t *counts,
                                 hs_failure *failure);
    hs_status (*pairs_histogram)(const hs_among *among, const hs_options *options,
                                 const hs_histogram *histogram, hs_failure *failure);
    hs_status (*nearest_find)(const hs_among *among, int64_t k, const hs_options *options,
                              hs_pairs **rows, hs_failure *failure);
    int64_t (*pairs_rows)(const hs_pairs *pairs);
    const int64_t *(*pairs_offsets)(const hs_pairs *pairs);
    int64_t *(*pairs_take_offsets)(hs_pairs *pairs);
    int64_t (*pairs_length)(const hs_pairs *pairs);
    const void *(*pairs_array)(const hs_pairs *pairs, unsigned which);
    void *(*pairs_take)(hs_pairs *pairs, unsigned which);
    void (*array_free)(void *array);
    void (*pairs_free)(hs_pairs *pairs);
    hs_status (*stream_open)(const hs_among *among, const hs_options *options, int64_t max_pairs,
                             hs_stream **stream, hs_failure *failure);
    hs_status (*stream_next)(hs_stream *stream, hs_poll_fn poll, void *context, hs_pairs **block,
                             hs_failure *failure);
    void (*stream_free)(hs_stream *stream);
    hs_status (*pairs_visit)(const hs_among *among, const hs_options *options,
                             const hs_visit *visit, int64_t *n_visited, hs_failure *failure);
    hs_status (*cells_build)(const hs_points *points, const hs_box *box, const hs_options *options,
                             hs_cells **cells, hs_failure *failure);
    void (*cells_free)(hs_cells *cells);
    void (*cells_points)(const hs_cells *cells, hs_points *points);
    const hs_box *(*cells_box)(const hs_cells *cells);
    void (*cells_layout)(const hs_cells *cells, hs_layout *layout);
    void (*cells_indices)(const hs_cells *cells, int64_t *indices);
    hs_status (*cells_find)(const hs_cells *cells, const hs_points *points, int64_t *cell,
                            hs_failure *failure);
    hs_status (*cells_candidates)(const hs_cells *cells, const hs_points *queries,
                                  const hs_options *options, hs_pairs **ranges,
                                  hs_failure *failure);
    hs_verlet *(*verlet_new)(void);
    hs_status (*verlet_update)(hs_verlet *list, const hs_points *points, const hs_box *box,
                               const hs_options *options, double skin, bool rebuild, bool *rebuilt,
                               hs_failure *failure);
    hs_status (*verlet_find)(const hs_verlet *list, const hs_options *options, hs_pairs **pairs,
                             hs_failure *failure);
    hs_verlet_state (*verlet_look)(const hs_verlet *list);
    void (*verlet_free)(hs_verlet *list);
    hs_status (*plan_make)(const hs_among *among, const hs_options *options, hs_plan *plan,
                           hs_failure *failure);
    hs_status (*box_measure)(const hs_box *box, double *heights, double *volume,
                             hs_failure *failure);
    hs_status (*box_wrap)(const hs_box *box, const hs_points *points, double *wrapped,
                          int64_t *shift, hs_failure *failure);
    size_t (*pool_limit)(void);
    void (*pool_set_limit)(size_t bytes);
    size_t (*pool_held)(void);
    void (*pool_clear)(void);
    int (*kernel_names)(const char **names, int capacity);
    hs_status (*connectivity_build)(const hs_among *among, const hs_node_lists *lists,
                                    const hs_options *options, hs_connectivity **connectivity,
                                    hs_failure *failure);
    hs_status (*connectivity_link)(const hs_half_list *pairs, const hs_node_lists *lists,
                                   const hs_options *options, hs_connectivity **connectivity,
                                   hs_failure *failure);
    hs_pairs *(*connectivity_rows)(hs_connectivity *connectivity);
    hs_pairs *(*connectivity_pairs)(hs_connectivity *connectivity);
    hs_pairs *(*connectivity_lists)(hs_connectivity *connectivity);
    void (*connectivity_free)(hs_connectivity *connectivity);
    hs_status (*connectivity_pair)(const hs_list_rows *rows, const hs_node_lists *lists,
                                   const hs_options *options, hs_connectivity **connectivity,
                                   hs_failure *failure);
    hs_status (*rows_keep)(const hs_list_rows *rows, const hs_node_change *change,
                           const int64_t *source, int64_t n, const hs_options *options,
                           hs_pairs **result, hs_failure *failure);
    hs_status (*rows_without)(const hs_list_rows *rows, const hs_list_rows *without, bool ascend,
                              const hs_options *options, hs_pairs **result, hs_failure *failure);
    hs_status (*connectivity_overlap)(const hs_points *points, const hs_index_rows *gather,
                                      const hs_node_lists *lists, const hs_options *options,
                                      hs_pairs **rows, hs_failure *failure);
    hs_status (*connectivity_intersect)(const hs_points *points, const hs_box *box,
                                        const hs_half_list *pairs, const hs_node_lists *lists,
                                        const hs_options *options, hs_pairs **result,
                                        hs_failure *failure);
    hs_status (*feet_between)(const hs_points *points, const double *p, const double *q,
                              bool *between, hs_failure *failure);
    hs_status (*morton_keys)(const hs_points *points, const double *low, const double *high,
                             uint64_t *keys, hs_failure *failure);
    hs_dynamic_options (*dynamic_options_default)(void);
    hs_status (*dynamic_new)(const hs_dynamic_options *options, hs_dynamic **list,
                             hs_failure *failure);
    void (*dynamic_free)(hs_dynamic *list);
    hs_status (*dynamic_copy)(const hs_dynamic *list, hs_dynamic **copy);
    hs_status (*dynamic_insert)(hs_dynamic *list, hs_key key, const double *position,
                                hs_failure *failure);
    hs_status (*dynamic_move)(hs_dynamic *list, hs_key key, const double *position,
                              hs_failure *failure);
    bool (*dynamic_remove)(hs_dynamic *list, hs_key key);
    hs_status (*dynamic_insert_many)(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                                     const hs_points *positions, hs_failure *failure);
    hs_status (*dynamic_move_many)(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                                   const hs_points *positions, hs_failure *failure);
    hs_status (*dynamic_remove_many)(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                                     int64_t n, bool *removed, hs_failure *failure);
    void (*dynamic_clear)(hs_dynamic *list);
    hs_status (*dynamic_shrink_to_fit)(hs_dynamic *list);
    int64_t (*dynamic_length)(const hs_dynamic *list);
    bool (*dynamic_has)(const hs_dynamic *list, hs_key key);
    hs_status (*dynamic_position)(const hs_dynamic *list, hs_key key, double *position);
    hs_status (*dynamic_cell)(const hs_dynamic *list, hs_key key, int64_t *cell);
    hs_status (*dynamic_near)(const hs_dynamic *list, const double *position, double radius,
                              hs_dynamic_fn visit, void *user, hs_failure *failure);
    hs_status (*dynamic_within)(const hs_dynamic *list, const double *position, double radius,
                                bool with_shift, hs_dynamic_fn visit, void *user,
                                hs_failure *failure);
    hs_status (*dynamic_any_within)(const hs_dynamic *list, const double *position, double radius,
                                    const hs_key *skip, bool *any, hs_failure *failure);
    int64_t (*dynamic_keys)(const hs_dynamic *list, int64_t *cursor, hs_key *keys, int64_t n);
    void (*dynamic_hold)(hs_dynamic *list);
    void (*dynamic_release)(hs_dynamic *list);
    hs_dynamic_state (*dynamic_look)(const hs_dynamic *list);
    void (*dynamic_count)(hs_dynamic *list, hs_dynamic_counters *counters);
    hs_status (*clusters_find)(const hs_among *among, const hs_options *options,
                               const uint8_t *core, int64_t *labels, uint8_t *winding,
                               int64_t *n_clusters, hs_failure *failure);
    hs_status (*measure)(const hs_points *points, const hs_box *box, const hs_pair_numbers *pairs,
                         const hs_options *options, hs_pairs **result, hs_failure *failure);
    void (*dynamic_hook)(hs_dynamic *list, const hs_dynamic_hooks *hooks);
    hs_status (*box_places)(const hs_box *box, const hs_points *points, double cutoff,
                            double largest, double *places, int64_t stride, hs_box_axes *axes,
                            hs_failure *failure);
    hs_status (*dynamic_cell_of)(const hs_dynamic *list, const double *position, int64_t *cell,
                                 hs_failure *failure);
    int (*few_pairs)(const hs_few *few, int32_t *i, int32_t *j, double *d);
} hs_capi;

/* The table, or NULL with an ImportError (also that of halfshell itself) when halfshell is not
 * installed, was compiled for other structs, or is too old to have all that this header declares.
 * Needs the GIL; call it once and keep the pointer, which is borrowed for ever. */
static inline const hs_capi *
hs_capi_import(void)
{
    const hs_capi *table = (const hs_capi *)PyCapsule_Import(HS_CAPI_NAME, 0);
    if (table == NULL) {
        return NULL;
    }
    if (table->abi_version != HS_CAPI_VERSION) {
        PyErr_Format(PyExc_ImportError,
                     "this module was compiled for version %d of the C interface of halfshell, "
                     "the installed one has version %lu: compile the module again",
                     HS_CAPI_VERSION, (unsigned long)table->abi_version);
        return NULL;
    }
    if (table->size < sizeof(hs_capi)) {
        PyErr_Format(PyExc_ImportError,
                     "this module was compiled for halfshell %d.%d or later, the installed one "
                     "lacks functions: update halfshell",
                     HS_VERSION_MAJOR, HS_VERSION_MINOR);
        return NULL;
    }
    return table;
}

#ifdef __cplusplus
}
#endif
#endif
