# SPDX-License-Identifier: BSD-3-Clause
# cython: language_level=3, boundscheck=False, cdivision=True
"""The Lennard-Jones energy of points in a box, summed in C over pairs that halfshell finds."""

from chalfshell cimport (
    HS_FLOAT64, HS_OK, HS_WANT_DISTANCE, hs_among, hs_box, hs_capi, hs_capi_import, hs_failure,
    hs_options, hs_pairs, hs_set, hs_status,
)
from libc.stdint cimport int64_t
from libc.string cimport memset

# Asked for once, when this module is imported; an ImportError if it does not fit.
cdef const hs_capi *halfshell = hs_capi_import()


cdef double sum_energies(const hs_pairs *pairs) noexcept nogil:
    """The sum over all distances."""
    cdef int64_t e, n = halfshell.pairs_length(pairs)
    cdef const double *d = <const double *> halfshell.pairs_array(pairs, HS_WANT_DISTANCE)
    cdef double sum = 0.0, sixth
    for e in range(n):
        sixth = 1.0 / (d[e] * d[e] * d[e] * d[e] * d[e] * d[e])
        sum += 4.0 * sixth * (sixth - 1.0)
    return sum


def energy(const double[:, :] points, double cutoff, const double[:] lengths):
    """Return the energy of all pairs within a cutoff and their number.

    points: (n, d), of any strides, d at most 8. lengths: (d,), the edges of the periodic box.
    """
    cdef int ndim = <int> points.shape[1]
    if not 1 <= ndim <= 8 or lengths.shape[0] != ndim:
        raise ValueError(f"points must be (n, d) and lengths (d,), d from 1 to 8, got d = {ndim}")
    cdef hs_set view
    memset(&view, 0, sizeof(view))
    view.at.data = &points[0, 0] if points.shape[0] > 0 else NULL
    view.at.n = points.shape[0]
    view.at.ndim = ndim
    view.at.real = HS_FLOAT64
    view.at.row_stride = points.strides[0]
    view.at.column_stride = points.strides[1]

    cdef hs_box box
    cdef int k, l
    box.ndim = ndim
    for l in range(ndim):
        box.periodic[l] = True
        for k in range(ndim):
            box.rows[l][k] = lengths[l] if k == l else 0.0

    cdef hs_among among
    memset(&among, 0, sizeof(among))
    among.points = &view
    among.box = &box

    cdef hs_options options = halfshell.options_default()
    options.cutoff = cutoff
    options.want = HS_WANT_DISTANCE
    cdef hs_pairs *pairs
    cdef hs_failure failure
    cdef hs_status status
    cdef double total
    with nogil:  # the search and the sum need no Python
        status = halfshell.pairs_find(&among, &options, &pairs, &failure)
    if status != HS_OK:
        raise ValueError(halfshell.status_text(status).decode())
    with nogil:
        total = sum_energies(pairs)
    n_pairs = halfshell.pairs_length(pairs)
    halfshell.pairs_free(pairs)
    return total, n_pairs
