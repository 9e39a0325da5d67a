/* SPDX-License-Identifier: BSD-3-Clause */
/* new_list.h: lists as a whole: made from options, copied, emptied. */
#ifndef HS_NEW_LIST_H
#define HS_NEW_LIST_H

#include "dynamic.h"

/* HS_OK, or what is wrong with the options; failure->column as halfshell_dynamic.h says. */
hs_status hs_list_check(const hs_dynamic_options *options, hs_failure *failure);

/* options: checked. HS_ERR_MEMORY, HS_ERR_BOX_SKEWED, or HS_ERR_CUTOFF when a ball would meet too
 * many images. */
hs_status hs_list_new(const hs_dynamic_options *options, hs_dynamic **list, hs_failure *failure);

void      hs_list_free(hs_dynamic *list);
hs_status hs_list_copy(const hs_dynamic *list, hs_dynamic **copy);
void      hs_list_clear(hs_dynamic *list);

/* On failure the list is as it was. */
hs_status hs_list_shrink(hs_dynamic *list);

#endif
