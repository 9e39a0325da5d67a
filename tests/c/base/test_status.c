/* SPDX-License-Identifier: BSD-3-Clause */
/* test_status.c: each status has a sentence of its own, and the version is that of the header. */
#include "../../../csrc/halfshell.h"
#include "../support/harness.h"

void test_status(void);

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

void
test_status(void)
{
    RUN(every_status_has_a_sentence);
    RUN(the_version_is_that_of_the_header);
}
