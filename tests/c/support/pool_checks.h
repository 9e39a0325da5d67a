/* SPDX-License-Identifier: BSD-3-Clause */
/* pool_checks.h: results that come from the pool and go back to it. */
#ifndef HS_POOL_CHECKS_H
#define HS_POOL_CHECKS_H

#include "../../../csrc/core/memory/pool.h"
#include "../../../csrc/core/memory/region.h"
#include "harness.h"

#define MB ((size_t)1 << 20)

/* A result of `bytes` bytes, all of them `mark`. */
static inline char *
make_result(size_t bytes, int mark)
{
    hs_region region = {0};
    CHECK(hs_region_reserve(&region, bytes));
    memset(region.data, mark, bytes);
    region.used = bytes;
    return hs_region_detach(&region, bytes);
}

static inline bool
is_all(const char *data, size_t bytes, int mark)
{
    for (size_t k = 0; k < bytes; k++)
        if (data[k] != (char)mark)
            return false;
    return true;
}

static inline void
reset_pool(void)
{
    hs_pool_clear();
    hs_pool_set_limit(HS_POOL_LIMIT);
}

#endif
