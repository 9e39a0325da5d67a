/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * bypass.h: stores past the caches, where the processor has them: for output that does not fit the
 * caches, and of which a store that misses them would first read what is there. Threads that share
 * one memory gain most: nothing is read, and half as much goes over its bus.
 */
#ifndef HS_BYPASS_H
#define HS_BYPASS_H

#include "account.h"

#if defined(__SSE2__) || defined(_M_X64)
#include <emmintrin.h>
#define HS_HAS_BYPASS 1
#else
#define HS_HAS_BYPASS 0
#endif

/* Whole cache lines, to an aligned place. hs_bypass_end must follow. */
HS_ALWAYS_INLINE void
hs_bypass_lines(void *to, const void *from, size_t n_bytes)
{
#if HS_HAS_BYPASS
    for (size_t at = 0; at < n_bytes; at += sizeof(__m128i)) {
        _mm_stream_si128((void *)((char *)to + at),
                         _mm_loadu_si128((const void *)((const char *)from + at)));
    }
#else
    memcpy(to, from, n_bytes);
#endif
}

/* Other threads must not see later writes before those that went past the caches. */
HS_ALWAYS_INLINE void
hs_bypass_end(void)
{
#if HS_HAS_BYPASS
    _mm_sfence();
#endif
}

/* Any bytes: whole lines go past the caches, what is before and behind them does not. */
HS_ALWAYS_INLINE void
hs_bypass_copy(void *to, const void *from, size_t n_bytes)
{
    const size_t before = (size_t)(-(uintptr_t)to & (HS_ALIGNMENT - 1));
    const size_t head = before < n_bytes ? before : n_bytes;
    const size_t lines = (n_bytes - head) / HS_ALIGNMENT * HS_ALIGNMENT;
    memcpy(to, from, head);
    hs_bypass_lines((char *)to + head, (const char *)from + head, lines);
    memcpy((char *)to + head + lines, (const char *)from + head + lines, n_bytes - head - lines);
    hs_bypass_end();
}

#endif
