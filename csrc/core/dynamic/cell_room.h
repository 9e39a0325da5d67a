/* SPDX-License-Identifier: BSD-3-Clause */
/* cell_room.h: room for the entries of a cell. */
#ifndef HS_CELL_ROOM_H
#define HS_CELL_ROOM_H

#include "dynamic.h"

/* The size of the smallest block for so many entries: it has 2^size. */
int hs_block_size(int64_t count);

/* Makes room for `count` entries in a cell; those that are there move to a larger block. False when
 * memory is refused: then nothing has changed. */
bool hs_cell_reserve(hs_dynamic *list, uint32_t number, int64_t count);

#endif
