/* SPDX-License-Identifier: BSD-3-Clause */
/* test_recorder.c: a recorder has the arrays that its columns need, and no others. */
#include "../../../csrc/core/collect/recorder.h"
#include "../support/harness.h"

void test_recorder(void);

static hs_account account;

static void
places_are_listed_for_what_is_measured(void)
{
    const unsigned measured = HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT;
    for (unsigned columns = 0; columns < 64; columns++)
        CHECK(hs_record_use(columns) ==
              (columns & measured ? HS_BLOCK_LISTS_PLACES : HS_BLOCK_LISTS_IDS));
}

static void
arrays_are_those_that_columns_need(void)
{
    const hs_options options = hs_options_default();
    for (unsigned columns = 0; columns < 64; columns++) {
        hs_output   output;
        hs_recorder recorder;
        hs_account_init(&account, &options);
        hs_output_init(&account, 3, columns, 8, &output);
        CHECK(hs_recorder_init(&account, &output, 100, &recorder) == HS_OK);
        const bool places = hs_record_use(columns) == HS_BLOCK_LISTS_PLACES;
        const bool distances = columns & (HS_WANT_DISTANCE | HS_WANT_VECTOR);
        CHECK(recorder.output == &output && recorder.columns == columns);
        CHECK((recorder.ids != NULL) == places && (recorder.distance != NULL) == distances);
        for (int side = 0; side < 2; side++)
            CHECK((recorder.ends[side] != NULL) == ((columns & HS_WANT_BOTH) != 0));
        for (int k = 0; k < HS_MAX_DIM; k++)
            CHECK((recorder.vector[k] != NULL) == (k < 3 && (columns & HS_WANT_VECTOR)));
        hs_recorder_free(&account, &recorder);
        CHECK(account.held == 0 && recorder.ids == NULL && recorder.output == NULL);
        hs_recorder_free(&account, &recorder); /* harmless twice */
        hs_output_free(&output);
        hs_account_close(&account);
    }
}

/* Whichever allocation is refused, those before it are freed. */
static void
any_allocation_may_be_refused(void)
{
    const hs_options options = hs_options_default();
    hs_status        status = HS_ERR_MEMORY;
    int              nth;
    for (nth = 1; status != HS_OK && nth < 20; nth++) {
        hs_output   output;
        hs_recorder recorder;
        hs_account_init(&account, &options);
        hs_output_init(&account, 3, HS_WANT_ALL, 8, &output);
        hs_test_fail_allocation(nth);
        status = hs_recorder_init(&account, &output, 100, &recorder);
        CHECK((status == HS_OK) == hs_test_failure_is_due());
        hs_test_fail_allocation(0);
        hs_recorder_free(&account, &recorder);
        CHECK(account.held == 0);
        hs_output_free(&output);
        hs_account_close(&account);
    }
    CHECK(nth == 9); /* ids, both ends, distances, three vectors; and none */
}

void
test_recorder(void)
{
    RUN(places_are_listed_for_what_is_measured);
    RUN(arrays_are_those_that_columns_need);
    RUN(any_allocation_may_be_refused);
}
