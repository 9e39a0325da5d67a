/* SPDX-License-Identifier: BSD-3-Clause */
/* put_column.c: collects numbers in a small buffer, then writes whole cache lines by streaming
 * stores. */
#include "put_column.h"

#include "../memory/bypass.h"

#include <string.h>

void
hs_put_open(void *column, int index_bytes, hs_put_column *out)
{
    out->to = column;
    out->n = 0;
    out->index_bytes = index_bytes;
}

/* The first collected bytes, as far as they fill whole lines. */
static void
write_lines(hs_put_column *out)
{
    const size_t n_bytes = out->n / HS_ALIGNMENT * HS_ALIGNMENT;
    hs_bypass_lines(out->to, out->part.bytes, n_bytes);
    memcpy(out->part.bytes, out->part.bytes + n_bytes, HS_ALIGNMENT);
    out->to += n_bytes;
    out->n -= n_bytes;
}

/* How many of n numbers there is room for. */
static int64_t
make_room(hs_put_column *out, int64_t n)
{
    if (out->n >= HS_PUT_BYTES) {
        write_lines(out);
    }
    const int64_t room = (int64_t)(HS_PUT_BYTES - out->n) / out->index_bytes;
    return n < room ? n : room;
}

void
hs_put_numbers(hs_put_column *out, const int32_t *numbers, int64_t n)
{
    while (n > 0) {
        const int64_t part = make_room(out, n);
        if (out->index_bytes == 8) {
            int64_t *wide = out->part.wide + out->n / sizeof *out->part.wide;
            for (int64_t k = 0; k < part; k++) {
                wide[k] = (int64_t)(uint32_t)numbers[k]; /* cheaper than a sign */
            }
        } else {
            memcpy(out->part.bytes + out->n, numbers, (size_t)part * sizeof *numbers);
        }
        out->n += (size_t)part * (size_t)out->index_bytes;
        numbers += part;
        n -= part;
    }
}

void
hs_put_repeat(hs_put_column *out, int32_t number, int64_t n)
{
    while (n > 0) {
        const int64_t part = make_room(out, n);
        if (out->index_bytes == 8) {
            int64_t *wide = out->part.wide + out->n / sizeof *out->part.wide;
            for (int64_t k = 0; k < part; k++) {
                wide[k] = number;
            }
        } else {
            int32_t *narrow = out->part.narrow + out->n / sizeof *out->part.narrow;
            for (int64_t k = 0; k < part; k++) {
                narrow[k] = number;
            }
        }
        out->n += (size_t)part * (size_t)out->index_bytes;
        n -= part;
    }
}

void
hs_put_close(hs_put_column *out)
{
    write_lines(out);
    memcpy(out->to, out->part.bytes, out->n);
    hs_bypass_end();
}
