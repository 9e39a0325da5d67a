/* SPDX-License-Identifier: BSD-3-Clause */
/* repeated_key.h: is a key twice among those that a caller gives? */
#ifndef HS_REPEATED_KEY_H
#define HS_REPEATED_KEY_H

#include <stdint.h>

/* The first of n keys that came before among them, or -1; -2: out of memory. tags: or NULL. */
int64_t hs_repeated_key(const int64_t *ids, const int32_t *tags, int64_t n);

#endif
