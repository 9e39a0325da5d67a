/* SPDX-License-Identifier: BSD-3-Clause */
/* columns_touch.c: see columns_touch.h. */
#include "columns_touch.h"

#include "../base/poll.h"

/* Of the smallest pages there are. Larger ones are written to several times, which costs little. */
#define PAGE 4096
/* What one thread touches between two questions: some 10 milliseconds. */
#define PART_BYTES ((size_t)1 << 23)
/* So many parts: less is cleared in a tenth of a second. */
#define LEAST_PARTS 8

#ifdef HS_TESTING
static size_t part_bytes = PART_BYTES;

size_t
hs_test_touch_parts(size_t bytes)
{
    const size_t before = part_bytes;
    part_bytes = bytes;
    return before;
}
#else
enum { part_bytes = PART_BYTES };
#endif

typedef struct toucher {
    volatile char *bytes; /* volatile: what is written is never read, and written all the same */
    size_t         first, end;
} toucher;

/* A hs_task_fn: part number `task` from the first byte on. */
static void
touch_part(void *context, int64_t task)
{
    const toucher *doing = context;
    const size_t   begin = doing->first + (size_t)task * part_bytes;
    const size_t   left = doing->end - begin;
    const size_t   end = begin + (left < part_bytes ? left : part_bytes);
    for (size_t at = begin; at < end; at += PAGE) {
        doing->bytes[at] = 0;
    }
}

static hs_status
touch(hs_team *team, const hs_options *options, void *bytes, size_t n_bytes)
{
    const int n_workers = hs_team_size(team);
    toucher   doing = {.bytes = bytes, .end = n_bytes};
    hs_status status = HS_OK;
    while (status == HS_OK && doing.first < n_bytes) {
        const size_t  parts = (n_bytes - doing.first + part_bytes - 1) / part_bytes;
        const int64_t n = parts < (size_t)n_workers ? (int64_t)parts : n_workers;
        hs_team_run(team, n, touch_part, &doing);
        doing.first += (size_t)n * part_bytes;
        status = hs_poll(options, 0.0);
    }
    return status;
}

hs_status
hs_touch_output(hs_team *team, const hs_options *options, hs_output *output)
{
    hs_status status = HS_OK;
    for (int k = 0; k < HS_COLUMNS && status == HS_OK; k++) {
        const unsigned bit = 1u << k;
        void          *column = hs_output_column(output, bit);
        const size_t   n_bytes = (size_t)output->n_pairs * hs_output_width(output, bit);
        if (column != NULL && n_bytes >= LEAST_PARTS * part_bytes) {
            status = touch(team, options, column, n_bytes);
        }
    }
    return status;
}
