# SPDX-License-Identifier: BSD-3-Clause
"""A short basis of the lattice that a box repeats on, by exact arithmetic.

A sheared box of width 1 may be a million long; the images of a point near another one would
then have to be looked for in a million places. The lattice has a basis of short vectors as
well, and this finds one (Lenstra, Lenstra and Lovasz 1982), with the integers that lead back.
"""

from __future__ import annotations

from fractions import Fraction

__all__ = ["short_basis"]

_Row = list[int]
_LOVASZ = Fraction(3, 4)  # the value of the paper; any between 1/4 and 1 gives a basis


def short_basis(rows: list[_Row]) -> tuple[list[_Row], list[_Row]]:
    """Return short rows B that span the lattice of `rows`, and U with ``B = U @ rows``.

    Parameters
    ----------
    rows : list of list of int, k rows of d integers
        Linearly independent.

    Returns
    -------
    (list of list of int, list of list of int)
        B, k rows of d, and U, k rows of k, of determinant 1 or -1.

    Raises
    ------
    ValueError
        If the rows are linearly dependent.

    Examples
    --------
    >>> short_basis([[1, 0], [1000000, 1]])
    ([[1, 0], [0, 1]], [[1, 0], [-1000000, 1]])
    """
    basis = [list(row) for row in rows]
    steps = [[int(a == b) for b in range(len(rows))] for a in range(len(rows))]
    k = 1
    ortho, along = _orthogonal(basis)
    while k < len(basis):
        for m in range(k - 1, -1, -1):
            times = round(along[k][m])
            if times:
                basis[k] = [x - times * y for x, y in zip(basis[k], basis[m])]
                steps[k] = [x - times * y for x, y in zip(steps[k], steps[m])]
                along[k] = [
                    x - times * (y if n < m else int(n == m))
                    for n, (x, y) in enumerate(zip(along[k], along[m]))
                ]
        if ortho[k] >= (_LOVASZ - along[k][k - 1] ** 2) * ortho[k - 1]:
            k += 1
            continue
        for table in (basis, steps):
            table[k], table[k - 1] = table[k - 1], table[k]
        ortho, along = _orthogonal(basis)
        k = max(k - 1, 1)
    return basis, steps


def _orthogonal(basis: list[_Row]) -> tuple[list[Fraction], list[list[Fraction]]]:
    """Gram-Schmidt: squared lengths, and each row's parts along the ones before it."""
    vectors: list[list[Fraction]] = []
    squares: list[Fraction] = []
    along: list[list[Fraction]] = []
    for row in basis:
        rest = [Fraction(x) for x in row]
        parts = [Fraction(0)] * len(basis)
        for m, (other, square) in enumerate(zip(vectors, squares)):
            parts[m] = sum((x * y for x, y in zip(row, other)), Fraction(0)) / square
            rest = [x - parts[m] * y for x, y in zip(rest, other)]
        square = sum((x * x for x in rest), Fraction(0))
        if square == 0:
            raise ValueError("the periodic rows of the box are linearly dependent")
        vectors.append(rest)
        squares.append(square)
        along.append(parts)
    return squares, along
