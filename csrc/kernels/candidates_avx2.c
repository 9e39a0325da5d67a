/* SPDX-License-Identifier: BSD-3-Clause */
/* candidates_avx2.c: candidates of writers (write.h) from columns, four at a time: the rows of
 * 4 x 4 matrices become their columns. For x86-64 CPUs with AVX2; wider vectors gain nothing. */
#include "kernel.h"
#include "target.h"

#if HS_X86_64
#include <immintrin.h>
HS_TARGET_BEGIN("avx2,fma,popcnt")

/* Entries a, b, d and e of four candidates, from their first or their fifth one on. */
HS_ALWAYS_INLINE void
store_four(double *to, __m256d a, __m256d b, __m256d d, __m256d e)
{
    const __m256d ab_even = _mm256_unpacklo_pd(a, b), ab_odd = _mm256_unpackhi_pd(a, b);
    const __m256d de_even = _mm256_unpacklo_pd(d, e), de_odd = _mm256_unpackhi_pd(d, e);
    _mm256_storeu_pd(to, _mm256_permute2f128_pd(ab_even, de_even, 0x20));
    _mm256_storeu_pd(to + 2 * HS_RECORD, _mm256_permute2f128_pd(ab_odd, de_odd, 0x20));
    _mm256_storeu_pd(to + 4 * HS_RECORD, _mm256_permute2f128_pd(ab_even, de_even, 0x31));
    _mm256_storeu_pd(to + 6 * HS_RECORD, _mm256_permute2f128_pd(ab_odd, de_odd, 0x31));
}

/* One component of S of four; `whole`: of consecutive points. */
HS_ALWAYS_INLINE __m128i
load_S(const hs_candidate_run *run, const int32_t *place, int k, const bool whole)
{
    const int32_t *turns = run->turns[k];
    const __m128i  image = _mm_set1_epi32(run->image[k]);
    if (turns == NULL) {
        return image;
    }
    return _mm_sub_epi32(image, whole ? _mm_loadu_si128((const __m128i *)(turns + place[0]))
                                      : _mm_setr_epi32(turns[place[0]], turns[place[1]],
                                                       turns[place[2]], turns[place[3]]));
}

/* Two int32 of each of four, as the bits of one double. */
HS_ALWAYS_INLINE __m256d
pair_up(__m128i a, __m128i b)
{
    const __m128i low = _mm_unpacklo_epi32(a, b), high = _mm_unpackhi_epi32(a, b);
    return _mm256_castsi256_pd(_mm256_inserti128_si256(_mm256_castsi128_si256(low), high, 1));
}

HS_ALWAYS_INLINE bool
load(const hs_candidate_run *run, hs_candidate *to, const bool whole)
{
    const __m256d grid = _mm256_set1_pd(run->by.grid), fine = _mm256_set1_pd(run->by.fine);
    __m256d       coarse = _mm256_setzero_pd();
    int32_t       c = 0;
    for (; c + 4 <= run->n; c += 4) {
        const int32_t *place = run->place + c;
        const __m128i  number = _mm_loadu_si128((const __m128i *)(run->number + c));
        __m256d        large[3], small[3];
        for (int k = 0; k < 3; k++) {
            const double *x = run->x[k];
            const __m256d q =
                whole ? _mm256_loadu_pd(x + place[0])
                      : _mm256_setr_pd(x[place[0]], x[place[1]], x[place[2]], x[place[3]]);
            const __m256d most = _mm256_sub_pd(_mm256_add_pd(q, grid), grid);
            const __m256d left = _mm256_sub_pd(q, most);
            const __m256d rounded = _mm256_sub_pd(_mm256_add_pd(left, fine), fine);
            coarse = _mm256_or_pd(coarse, _mm256_cmp_pd(rounded, left, _CMP_NEQ_UQ));
            large[k] = _mm256_add_pd(most, _mm256_set1_pd(run->moved.large[k]));
            small[k] = _mm256_add_pd(left, _mm256_set1_pd(run->moved.small[k]));
        }
        store_four(to[c].large, large[0], large[1], large[2],
                   pair_up(number, load_S(run, place, 0, whole)));
        store_four(to[c].small, small[0], small[1], small[2],
                   pair_up(load_S(run, place, 1, whole), load_S(run, place, 2, whole)));
    }
    return hs_candidates_from(run, 3, c, to) && _mm256_movemask_pd(coarse) == 0;
}

bool
hs_candidates_avx2(const hs_candidate_run *run, hs_candidate *to)
{
    return run->place[run->n - 1] - run->place[0] == run->n - 1 ? load(run, to, true)
                                                                : load(run, to, false);
}

HS_TARGET_END
#else
typedef int hs_candidates_avx2_is_for_x86_64; /* a translation unit must not be empty */
#endif
