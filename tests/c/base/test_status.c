/* SPDX-License-Identifier: BSD-3-Clause */
/* test_status.c: every status and every quantity has a name and a meaning. */
#include "../../../csrc/core/base/status.h"
#include "../../../csrc/halfshell.h"
#include "../support/harness.h"

void test_status(void);

/* ---- each status has a sentence of its own, and the version is that of the header ---- */

/* Each code has a sentence of its own; other numbers have one, too. */
static void
every_status_has_a_sentence(void)
{
    const char *unknown = hs_status_text(HS_STATUS_END);
    for (int code = HS_OK; code < HS_STATUS_END; code++) {
        const char *text = hs_status_text((hs_status)code);
        CHECK(strcmp(text, unknown) != 0);
        for (int other = HS_OK; other < code; other++) {
            CHECK(strcmp(text, hs_status_text((hs_status)other)) != 0);
        }
    }
    CHECK(strcmp(hs_status_text((hs_status)(HS_STATUS_END + 1)), unknown) == 0);
}

static void
the_version_is_that_of_the_header(void)
{
    CHECK(hs_version() == HS_VERSION);
}

/* ---- bytes and purpose of each quantity ---- */

static void
quantities_have_the_widths_of_their_arrays(void)
{
    for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
        for (int bytes = 4; bytes <= 8; bytes += 4) {
            const size_t index = (size_t)bytes, d = (size_t)ndim;
            const size_t widths[] = {index, index, 8, 8 * d, 4 * d, 2 * index, 4};
            for (unsigned want = 0; want < 1u << HS_QUANTITIES; want++) {
                size_t sum = 0;
                for (int k = 0; k < HS_QUANTITIES; k++)
                    sum += want >> k & 1u ? widths[k] : 0;
                CHECK(hs_want_bytes(want, ndim, bytes) == (int64_t)sum);
            }
            for (int k = 0; k < HS_QUANTITIES; k++)
                CHECK(hs_want_bytes(1u << k, ndim, bytes) == (int64_t)widths[k]);
        }
    }
}

static void
bits_have_numbers_and_purposes(void)
{
    static const struct {
        unsigned   bit;
        hs_purpose purpose;
    } of[] = {{HS_WANT_I, HS_FOR_INDICES},          {HS_WANT_J, HS_FOR_INDICES},
              {HS_WANT_DISTANCE, HS_FOR_DISTANCES}, {HS_WANT_VECTOR, HS_FOR_VECTORS},
              {HS_WANT_SHIFT, HS_FOR_SHIFTS},       {HS_WANT_BOTH, HS_FOR_INDICES},
              {HS_WANT_SHELL, HS_FOR_INDICES}};
    for (int k = 0; k < HS_QUANTITIES; k++) {
        CHECK(of[k].bit == 1u << k && hs_want_number(of[k].bit) == k);
        CHECK(hs_want_purpose(k) == of[k].purpose);
    }
    CHECK(hs_want_number(0) == HS_QUANTITIES && hs_want_number(3) == HS_QUANTITIES);
    CHECK(hs_want_number(1u << HS_QUANTITIES) == HS_QUANTITIES);
    CHECK(HS_WANT_ALL == (HS_WANT_SHELL - 1));
}

void
test_status(void)
{
    RUN(every_status_has_a_sentence);
    RUN(the_version_is_that_of_the_header);
    RUN(quantities_have_the_widths_of_their_arrays);
    RUN(bits_have_numbers_and_purposes);
}
