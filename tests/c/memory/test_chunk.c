/* SPDX-License-Identifier: BSD-3-Clause */
/* test_chunk.c: memory from malloc in the pool, and columns that grow where little is left. */
#if !defined(_WIN32)
#define _GNU_SOURCE
#endif
#include "../support/address_space.h"

#include "../../../csrc/core/collect/columns.h"
#include "../../../csrc/core/memory/chunk.h"
#include "../../../csrc/core/memory/pages.h"
#include "../../../csrc/core/memory/pool.h"

void test_chunk(void);

#define MB ((size_t)1 << 20)

#if !HS_WATCHED_MALLOC

/* A chunk as hs_chunk_new makes it where there are no pages. */
static void *
chunk_from_malloc(size_t bytes)
{
    char *raw = malloc(bytes + 2 * sizeof(hs_chunk) + 64);
    CHECK(raw != NULL);
    char *data = raw + sizeof(hs_chunk);
    data += (64 - (uintptr_t)data % 64) % 64;
    *hs_chunk_of(data) =
        (hs_chunk){.raw = raw, .lead = (size_t)(data - raw), .capacity = bytes, .touched = bytes};
    return data;
}

/* It cannot be shrunk for sure: what wants less than half of it gets none of it, but for scratch,
 * which comes back at once. */
static void
the_pool_wastes_no_more_than_half_of_a_chunk(void)
{
    const size_t sizes[] = {4 * MB - 64, 4 * MB, 5 * MB, 8 * MB, 8 * MB + 64, MB, MB + 64};
    const bool   suits[] = {false, true, true, true, false, true, false};
    hs_pool_clear();
    void *data = chunk_from_malloc(8 * MB);
    CHECK(hs_pool_give(data) && hs_pool_held() == 8 * MB);
    for (int s = 0; s < 7; s++) {
        void *taken = hs_pool_take(sizes[s]);
        CHECK((taken == data) == suits[s] && (taken == NULL) == !suits[s]);
        CHECK(hs_pool_held() == (taken == NULL ? 8 * MB : 0));
        CHECK(taken == NULL || hs_pool_give(taken));
    }
    hs_pool_clear();
    CHECK(hs_pool_held() == 0);
}

#endif

/* From malloc, that is: then the next list of about this length finds room in it. */
static void
little_is_not_cut_off(void)
{
    const size_t least = MB - MB / 8;
    void        *data = hs_chunk_new(MB);
    CHECK(data != NULL);
    data = hs_chunk_cut(data, least, NULL);
    CHECK(hs_chunk_of(data)->capacity == MB);
    data = hs_chunk_cut(data, least - 1, NULL);
    CHECK(hs_chunk_of(data)->capacity == least - 1);
    hs_chunk_free(data);
}

/* Of pages that are to be huge the last one counts whole, of the small ones behind them only what
 * is used. */
static void
a_huge_page_is_touched_as_a_whole(void)
{
    char     *data = hs_chunk_new(16 * MB);
    hs_chunk *chunk = hs_chunk_of(data);
    CHECK(data != NULL);
    if (chunk->length > 0) { /* pages, that is */
        hs_chunk_expect(data, 8 * MB);
        CHECK(chunk->huge > 4 * MB && chunk->huge <= 8 * MB);
        hs_chunk_touch(data, 0);
        CHECK(chunk->touched == 0);
        hs_chunk_touch(data, 1);
        CHECK(chunk->touched > 1 && chunk->touched <= HS_PAGES_FROM);
        CHECK(((uintptr_t)data + chunk->touched) % HS_PAGES_FROM == 0);
        hs_chunk_touch(data, chunk->huge);
        CHECK(chunk->touched == chunk->huge);
        hs_chunk_touch(data, chunk->huge + 1);
        CHECK(chunk->touched == chunk->huge + 1);
        hs_chunk_touch(data, 1);
        CHECK(chunk->touched == chunk->huge + 1);
    }
    hs_chunk_free(data);
}

#if CAN_LIMIT_ADDRESSES

/* What the pool has no room for is given back, oldest first. */
static void
what_is_too_much_for_the_pool_is_freed(void)
{
    hs_pool_clear();
    const size_t before = mapped();
    for (int n = 0; n < 4 * HS_POOL_CHUNKS; n++) {
        void *data = hs_chunk_new(8 * MB);
        CHECK(data != NULL && hs_pool_give(data));
    }
    CHECK(mapped() >= before + (HS_POOL_CHUNKS - 1) * 8 * MB);
    CHECK(mapped() <= before + (HS_POOL_CHUNKS + 2) * 8 * MB);
    hs_pool_clear();
    CHECK(mapped() <= before + 8 * MB);
}

/* Half as much again is refused, what is needed now is not. */
static void
columns_grow_by_little_where_little_is_left(void)
{
    hs_output output;
    hs_pool_clear();
    hs_output_init(NULL, 3, HS_WANT_I, 8, &output);
    CHECK(hs_output_reserve(&output, 4 << 20, 0.0) == HS_OK);
    const int64_t capacity = output.capacity;
    CHECK(capacity >= 4 << 20);
    output.n_pairs = capacity;
    const rlim_t before = limit_addresses(8 * MB);
    CHECK(hs_output_reserve(&output, 1, 0.0) == HS_OK);
    CHECK(output.capacity > capacity && output.capacity < capacity + capacity / 4);
    output.n_pairs = output.capacity;
    CHECK(hs_output_reserve(&output, 4 << 20, 0.0) == HS_ERR_MEMORY);
    set_address_limit(before);
    CHECK(hs_output_reserve(&output, 1, 0.0) == HS_OK);
    CHECK(output.capacity >= capacity + capacity / 2);
    output.n_pairs = 0;
    hs_output_free(&output);
    hs_pool_clear();
}

#endif

static double
no_room(void *context)
{
    ++*(int *)context;
    return 0.0;
}

/* What is charged ahead may be what makes the account ask for its limit, which then leaves no room
 * for what is needed either. */
static void
a_limit_may_be_heard_of_while_it_is_passed(void)
{
    int        asked = 0;
    hs_options options = hs_options_default();
    hs_account account;
    hs_output  output;
    options.find_limit = no_room;
    options.find_context = &asked;
    hs_account_init(&account, &options);
    hs_output_init(&account, 3, HS_WANT_I, 8, &output);
    CHECK(hs_output_reserve(&output, 4 << 20, 0.0) == HS_OK && asked == 0);
    output.n_pairs = 4 << 20;
    const int64_t left = HS_LIMIT_FREE / 8 - output.n_pairs - 100;
    CHECK(hs_output_reserve(&output, left, 0.0) == HS_ERR_MEMORY && asked == 1);
    CHECK(account.held < HS_LIMIT_FREE && account.limit == (double)account.held);
    CHECK(hs_output_reserve(&output, left, 0.0) == HS_ERR_MEMORY && asked == 1);
    output.n_pairs = 0;
    hs_output_free(&output);
    CHECK(account.held == 0);
    hs_pool_clear();
}

void
test_chunk(void)
{
    RUN(little_is_not_cut_off);
    RUN(a_huge_page_is_touched_as_a_whole);
    RUN(a_limit_may_be_heard_of_while_it_is_passed);
#if !HS_WATCHED_MALLOC
    RUN(the_pool_wastes_no_more_than_half_of_a_chunk);
#endif
#if CAN_LIMIT_ADDRESSES
    RUN(what_is_too_much_for_the_pool_is_freed);
    RUN(columns_grow_by_little_where_little_is_left);
#endif
}
