/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * form.h: how a block is scanned. Its extent decides form and thresholds of the scan; groups
 * of a search have few extents, and what follows from each is kept.
 */
#ifndef HS_FORM_H
#define HS_FORM_H

#include "scanner.h"

/*
 * What follows from an extent, kept for the next search of this thread: systems of a batch, all of
 * the same number of axes, have few different ones. HS_FORMS of them, zeros at first.
 */
typedef struct hs_kept_form {
    bool          is_set;
    double        cutoff, extent, error;
    hs_thresholds direct;
    hs_expanded   expanded;
} hs_kept_form;

/* None is known yet. */
void hs_forms_init(hs_scanner *scanner);

/* Sets scanner->form by the size of the present group and block. */
void hs_form_set(hs_scanner *scanner);

/* Lets candidates of the present group be left out that are beyond the cutoff of all its points, or
 * their limits, where the block has so many that this is worth it. */
void hs_form_prune(hs_scanner *scanner);

#endif
