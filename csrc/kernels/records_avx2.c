/* SPDX-License-Identifier: BSD-3-Clause */
/* records_avx2.c: records of candidates (write.h) from columns, four at a time: the rows of a 4 x 4
 * matrix become its columns. For x86-64 CPUs with AVX2; wider vectors would gain nothing. */
#include "kernel.h"
#include "target.h"

#include <string.h>

#if HS_X86_64
#include <immintrin.h>
HS_TARGET_BEGIN("avx2,fma,popcnt")
void
hs_point_records_avx2(const double *const *x, const int32_t *order, int32_t n, double *to)
{
    int32_t c = 0;
    for (; c + 4 <= n; c += 4, to += 4 * HS_RECORD) {
        const __m128i numbers = _mm_loadu_si128((const __m128i *)(order + c));
        const __m256d a = _mm256_loadu_pd(x[0] + c), b = _mm256_loadu_pd(x[1] + c);
        const __m256d d = _mm256_loadu_pd(x[2] + c);
        const __m256d e = _mm256_castsi256_pd(_mm256_cvtepi32_epi64(numbers));
        const __m256d ab_even = _mm256_unpacklo_pd(a, b), ab_odd = _mm256_unpackhi_pd(a, b);
        const __m256d de_even = _mm256_unpacklo_pd(d, e), de_odd = _mm256_unpackhi_pd(d, e);
        _mm256_storeu_pd(to, _mm256_permute2f128_pd(ab_even, de_even, 0x20));
        _mm256_storeu_pd(to + HS_RECORD, _mm256_permute2f128_pd(ab_odd, de_odd, 0x20));
        _mm256_storeu_pd(to + 2 * HS_RECORD, _mm256_permute2f128_pd(ab_even, de_even, 0x31));
        _mm256_storeu_pd(to + 3 * HS_RECORD, _mm256_permute2f128_pd(ab_odd, de_odd, 0x31));
    }
    for (; c < n; c++, to += HS_RECORD) {
        const int64_t number = order[c];
        for (int k = 0; k < 3; k++) {
            to[k] = x[k][c];
        }
        memcpy(to + 3, &number, sizeof number);
    }
}

void
hs_shift_records_avx2(const int32_t *image, const int32_t *const *turns, int32_t n, int32_t *to)
{
    const __m128i zero = _mm_setzero_si128();
    int32_t       c = 0;
    for (; c + 4 <= n; c += 4, to += 4 * HS_RECORD) {
        const __m128i a = _mm_sub_epi32(_mm_set1_epi32(image[0]),
                                        _mm_loadu_si128((const __m128i *)(turns[0] + c)));
        const __m128i b = _mm_sub_epi32(_mm_set1_epi32(image[1]),
                                        _mm_loadu_si128((const __m128i *)(turns[1] + c)));
        const __m128i d = _mm_sub_epi32(_mm_set1_epi32(image[2]),
                                        _mm_loadu_si128((const __m128i *)(turns[2] + c)));
        const __m128i ab_low = _mm_unpacklo_epi32(a, b), ab_high = _mm_unpackhi_epi32(a, b);
        const __m128i d_low = _mm_unpacklo_epi32(d, zero), d_high = _mm_unpackhi_epi32(d, zero);
        __m128i      *record = (__m128i *)to;
        _mm_storeu_si128(record, _mm_unpacklo_epi64(ab_low, d_low));
        _mm_storeu_si128(record + 1, _mm_unpackhi_epi64(ab_low, d_low));
        _mm_storeu_si128(record + 2, _mm_unpacklo_epi64(ab_high, d_high));
        _mm_storeu_si128(record + 3, _mm_unpackhi_epi64(ab_high, d_high));
    }
    for (; c < n; c++, to += HS_RECORD) {
        for (int r = 0; r < 3; r++) {
            to[r] = image[r] - turns[r][c];
        }
    }
}
HS_TARGET_END
#else
typedef int hs_records_avx2_is_for_x86_64; /* a translation unit must not be empty */
#endif
