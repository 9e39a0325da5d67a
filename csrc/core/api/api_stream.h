/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * api_stream.h: pairs in blocks. A stream holds a search that is ready to be walked, a bookmark of
 * how far that has come, and the pairs that were found and not yet handed out. See halfshell.h.
 */
#ifndef HS_API_STREAM_H
#define HS_API_STREAM_H

#include "../scene/scene.h"

/* hs_stream_open for sets of points; a search that they were built by must outlive the stream. */
hs_status hs_stream_open_in(const hs_sets *sets, const hs_box *box, const hs_options *options,
                            int64_t max_pairs, hs_stream **stream, hs_failure *failure);

#endif
