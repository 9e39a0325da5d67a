# SPDX-License-Identifier: BSD-3-Clause
# chalfshell.pxd: what the example uses of halfshell.h and halfshell_capi.h. Cython takes the sizes
# and the order of members from the headers themselves, so that nothing else need be listed.
from libc.stddef cimport ptrdiff_t
from libc.stdint cimport int64_t

cdef extern from "<stdbool.h>":
    ctypedef bint c_bool "bool"

cdef extern from "halfshell_capi.h" nogil:
    enum: HS_WANT_DISTANCE

    ctypedef enum hs_status:
        HS_OK

    ctypedef enum hs_real:
        HS_FLOAT64

    ctypedef struct hs_failure:
        int64_t row
        int64_t column

    ctypedef struct hs_points:
        const void *data
        int64_t n
        int ndim
        hs_real real
        ptrdiff_t row_stride
        ptrdiff_t column_stride

    ctypedef struct hs_set:
        hs_points at

    ctypedef struct hs_box:
        int ndim
        c_bool periodic[8]
        double rows[8][8]

    ctypedef struct hs_cells:
        pass

    ctypedef struct hs_reach:
        pass

    ctypedef struct hs_selection:
        pass

    ctypedef struct hs_among:
        const hs_set *points
        const hs_box *box
        const hs_set *queries
        const hs_cells *cells
        const hs_reach *reach
        const hs_selection *selection

    ctypedef struct hs_options:
        double cutoff
        unsigned want
        int threads

    ctypedef struct hs_pairs:
        pass

    ctypedef struct hs_capi:
        const char *(*status_text)(hs_status) noexcept nogil
        hs_options (*options_default)() noexcept nogil
        hs_status (*pairs_find)(const hs_among *, const hs_options *, hs_pairs **,
                                hs_failure *) noexcept nogil
        int64_t (*pairs_length)(const hs_pairs *) noexcept nogil
        const void *(*pairs_array)(const hs_pairs *, unsigned) noexcept nogil
        void (*pairs_free)(hs_pairs *) noexcept nogil

cdef extern from "halfshell_capi.h":
    const hs_capi *hs_capi_import() except NULL
