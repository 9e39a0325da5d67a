/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * halfshell_dynamic.h: points that come, go and move one at a time, each under a key, and exact
 * answers to which of them lie within a ball: for Monte Carlo. The words and rules of halfshell.h
 * hold; docs/dynamic.md explains the rest.
 *
 * Threads: any number of calls that take a `const hs_dynamic *` may run at once; one that changes
 * the list waits for them, and they for it, as all do for the thread that holds it. A child process
 * goes on with its copy, unless another thread was changing the list when it was forked off.
 */
#ifndef HALFSHELL_DYNAMIC_H
#define HALFSHELL_DYNAMIC_H

#include "halfshell.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Opaque, owned by the caller. */
typedef struct hs_dynamic hs_dynamic;

/* The name of a point. Two keys are one if both members are equal: owned and ghost sites may have
 * tags 0 and 1. */
typedef struct hs_key {
    int64_t id;
    int32_t tag; /* 0 where there is one kind of points only */
} hs_key;

typedef enum hs_storage {
    HS_STORE_HASH,     /* occupied cells only */
    HS_STORE_DENSE,    /* every cell between the outermost that were ever occupied */
    HS_STORE_ALL_PAIRS /* no cells; keys may have no position */
} hs_storage;

typedef struct hs_dynamic_options {
    int           ndim; /* 1 ... HS_MAX_DIM */
    const hs_box *box;  /* borrowed for the call; NULL: open space */
    hs_storage    storage;
    double        cell_size;  /* least width of cells; 2^-300 to 2^300, as box entries that are not
                               * 0 on periodic axes */
    double        max_radius; /* of queries; 0: cell_size. At most 2^300, and 2^20 images */
    bool          inclusive;  /* whether a point at exactly the radius is within */
    double        grid_bytes; /* most bytes of the cells of HS_STORE_DENSE */
} hs_dynamic_options;

/* Three dimensions, open space, HS_STORE_HASH, cells of width 1, inclusive, cells of 1 GB. */
hs_dynamic_options hs_dynamic_options_default(void);

/* failure->column of HS_ERR_CUTOFF: which length is out of range. */
typedef enum hs_length_column {
    HS_LENGTH_CELL_SIZE,
    HS_LENGTH_MAX_RADIUS,
    HS_LENGTH_BOX /* an entry of a periodic box vector */
} hs_length_column;

/* failure->column of HS_ERR_KEY, for many points at once. */
typedef enum hs_key_column {
    HS_KEY_REPEATED, /* it came before */
    HS_KEY_ABSENT    /* it is not there */
} hs_key_column;

/* HS_ERR_ARGUMENT, HS_ERR_BOX_*, HS_ERR_MEMORY, HS_ERR_CUTOFF. *list is NULL on failure. */
hs_status hs_dynamic_new(const hs_dynamic_options *options, hs_dynamic **list, hs_failure *failure);
void      hs_dynamic_free(hs_dynamic *list); /* NULL-safe */

/* Another list with the same points, which takes no more memory than they need. */
hs_status hs_dynamic_copy(const hs_dynamic *list, hs_dynamic **copy);

/*
 * Adds a point, or moves the one of this key. position: ndim numbers, anywhere; NULL, with
 * HS_STORE_ALL_PAIRS only: none. HS_ERR_NOT_FINITE names the column; HS_ERR_SHIFT_RANGE: 2^51 boxes
 * away or more, also along directions in which the box does not repeat, where these are oblique to
 * the coordinate axes; HS_ERR_CAPACITY: the dense cells would take failure->expected_bytes.
 * On failure the list is as it was.
 */
hs_status hs_dynamic_insert(hs_dynamic *list, hs_key key, const double *position,
                            hs_failure *failure);

/* As hs_dynamic_insert, but HS_ERR_KEY for a key that is not there. */
hs_status hs_dynamic_move(hs_dynamic *list, hs_key key, const double *position,
                          hs_failure *failure);

/* Returns whether it was there. */
bool hs_dynamic_remove(hs_dynamic *list, hs_key key);

/* Many at once, all or none. ids: n; tags: n, or NULL: all 0. HS_ERR_KEY: failure->row is that of a
 * key that came before (HS_KEY_REPEATED), or for hs_dynamic_move_many is not there (HS_KEY_ABSENT).
 * removed: n, or NULL. */
hs_status hs_dynamic_insert_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                                 const hs_points *positions, hs_failure *failure);
hs_status hs_dynamic_move_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                               const hs_points *positions, hs_failure *failure);
hs_status hs_dynamic_remove_many(hs_dynamic *list, const int64_t *ids, const int32_t *tags,
                                 int64_t n, bool *removed, hs_failure *failure);

/* Removes all points, and gives their memory back. */
void hs_dynamic_clear(hs_dynamic *list);

/* Gives memory back that the points do not need; it takes some meanwhile. */
hs_status hs_dynamic_shrink_to_fit(hs_dynamic *list);

int64_t hs_dynamic_length(const hs_dynamic *list);
bool    hs_dynamic_has(const hs_dynamic *list, hs_key key);

/* position: ndim numbers, as they were given. HS_ERR_KEY: not there; HS_ERR_ARGUMENT: it has none,
 * as for the next. */
hs_status hs_dynamic_position(const hs_dynamic *list, hs_key key, double *position);

/* The cell that a point is in. cell: ndim indices: floor(coordinate / cell_size) along open axes
 * but for rounding, from 0 along periodic ones; HS_STORE_ALL_PAIRS has one cell. */
hs_status hs_dynamic_cell(const hs_dynamic *list, hs_key key, int64_t *cell);

/* The cell that a position is in, whether or not it holds a point; errors as for
 * hs_dynamic_insert. */
hs_status hs_dynamic_cell_of(const hs_dynamic *list, const double *position, int64_t *cell,
                             hs_failure *failure);

/* Called for a key, with the position as it was given (NULL: none) and S over the box vectors where
 * that is wanted (else NULL); both are borrowed. Not 0: no more of them. It must not change the
 * list. */
typedef int (*hs_dynamic_fn)(hs_key key, const double *position, const int64_t *shift, void *user);

/*
 * The keys of all points in cells that the closed ball meets in some image, each once: no distance
 * is computed. With HS_STORE_ALL_PAIRS there is one cell, else they are the same for each storage.
 * 0 <= radius <= max_radius, or HS_ERR_CUTOFF; HS_ERR_SHIFT_RANGE as for hs_dynamic_insert, and
 * where the ball spans more than 2^24 images; HS_ERR_INTERRUPTED. Nothing is allocated, as for the
 * next two.
 */
hs_status hs_dynamic_near(const hs_dynamic *list, const double *position, double radius,
                          hs_dynamic_fn visit, void *user, hs_failure *failure);

/*
 * Those within the ball exactly: |r + S * box - position| <= radius, or < where the list is not
 * inclusive; a key once for each such S. Cells come nearest first. HS_ERR_KEY: some key has no
 * position.
 */
hs_status hs_dynamic_within(const hs_dynamic *list, const double *position, double radius,
                            bool with_shift, hs_dynamic_fn visit, void *user, hs_failure *failure);

/* Whether there is one, up to the first. skip: NULL, or a key whose image S = 0 does not count;
 * HS_ERR_KEY when it is not there. */
hs_status hs_dynamic_any_within(const hs_dynamic *list, const double *position, double radius,
                                const hs_key *skip, bool *any, hs_failure *failure);

/* The keys, up to n at a time: *cursor is 0 at first. Returns how many; 0: no more. All of them as
 * long as the list does not change in between. */
int64_t hs_dynamic_keys(const hs_dynamic *list, int64_t *cursor, hs_key *keys, int64_t n);

/*
 * Until hs_dynamic_release calls of other threads wait, and this thread rounds to nearest without
 * flushing: its own calls need not see to either, which is a good part of their time. A second
 * hs_dynamic_hold does nothing, nor does hs_dynamic_release in a thread that does not hold it.
 */
void hs_dynamic_hold(hs_dynamic *list);
void hs_dynamic_release(hs_dynamic *list);

/*
 * poll: queries that take long call it every now and then, with the `user` of the visit (NULL for
 * hs_dynamic_any_within) and 0; false: they end with HS_ERR_INTERRUPTED. So do insertions and moves
 * of many points, with NULL, as long as they have changed nothing. Changes wait meanwhile, and the
 * list must not be used. A change that has to wait for queries calls `pause` before each
 * wait, and then `resume` with what that returned: for a lock that `poll` needs, as that of an
 * interpreter.
 * Any may be NULL, `resume` with `pause`. Copies have none.
 */
typedef struct hs_dynamic_hooks {
    hs_poll_fn poll;
    void *(*pause)(void);
    void (*resume)(void *paused);
} hs_dynamic_hooks;

/* hooks: copied; NULL: none. Not while the list is in use. */
void hs_dynamic_hook(hs_dynamic *list, const hs_dynamic_hooks *hooks);

typedef struct hs_dynamic_state {
    int     ndim;
    int64_t n_points;
    int64_t n_without; /* of these: without a position */
    int64_t n_cells;   /* that are stored, occupied or not */
    int64_t n_empty;   /* of these: without a point; counted only with HS_STORE_HASH */
    int64_t bytes;     /* allocated */
    int64_t changes;   /* grows whenever the list changes */
    double  max_radius;
    double  cell_size[HS_MAX_DIM]; /* of grid axes: across the faces; infinity: one cell */
} hs_dynamic_state;

hs_dynamic_state hs_dynamic_look(const hs_dynamic *list);

/* What calls have done since this was switched on; not for several threads at once. */
typedef struct hs_dynamic_counters {
    int64_t wraps;      /* positions brought into the box */
    int64_t lookups;    /* cells looked up by hash */
    int64_t cells;      /* cells looked at */
    int64_t candidates; /* points whose distance was compared */
    int64_t exact;      /* of these: not decided by the first float64 test */
} hs_dynamic_counters;

/* counters: borrowed until it is called with NULL. */
void hs_dynamic_count(hs_dynamic *list, hs_dynamic_counters *counters);

#ifdef __cplusplus
}
#endif
#endif
