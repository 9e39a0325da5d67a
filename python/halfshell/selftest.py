# SPDX-License-Identifier: BSD-3-Clause
"""Check every kernel of this CPU against integers: ``halfshell selftest``.

The answers come from `halfshell._check.reference`, which uses Python integers and no compiled
code. The scenes are chosen to reveal errors in rounding, wrapping or overflow: ties at
the cutoff, skewed boxes, points far away, subnormal numbers.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import halfshell as hs
from halfshell._check.reference import (
    exact_square,
    reach_by_radii,
    reference_pairs,
    ulp_error,
)

__all__ = ["Case", "cases", "main", "run"]


@dataclass(frozen=True)
class Case:
    """A scene whose pairs are found by the kernels and by integers."""

    name: str
    points: NDArray[Any]
    cutoff: float
    box: NDArray[np.float64] | None = None
    periodic: tuple[bool, ...] | None = None
    inclusive: bool = True
    radii: NDArray[np.float64] | None = None  # of which sums are compared, within the cutoff

    def find(self, kernel: str | None, quantities: str, sort: bool = False) -> Any:
        """Run the search on this scene."""
        points = hs.Points(self.points, box=self.box, periodic=self.periodic, radii=self.radii)
        with hs.settings(kernel=kernel):
            return hs.pairs(
                points, self.cutoff, quantities=quantities, inclusive=self.inclusive, sort=sort
            )

    @property
    def expected(self) -> list[Any]:
        """The pairs by integers."""
        reach: Any = self.cutoff
        if self.radii is not None:
            reach = reach_by_radii(self.radii.tolist(), cutoff=self.cutoff)
        return reference_pairs(self.points, reach, self.box, self.periodic, self.inclusive)


def cases() -> Iterator[Case]:
    """Yield the scenes, the same in every run."""
    random = np.random.default_rng(20240229)
    lattice = np.indices((5, 5, 5)).reshape(3, -1).T
    yield Case("ties: cubic lattice of 0.25, d <= 0.75", lattice * 0.25, 0.75)
    yield Case("ties: cubic lattice of 0.25, d < 0.75", lattice * 0.25, 0.75, inclusive=False)
    yield Case("near ties: cubic lattice of 0.1", lattice * 0.1, 0.3)
    small = np.indices((3, 3, 3)).reshape(3, -1).T
    yield Case("near ties: several images of each point", small * 0.1, 0.4, np.array([0.3] * 3))

    cloud = random.random((150, 3))
    yield Case("random: open, 3-D", cloud, 0.3)
    yield Case("random: open, float32", cloud.astype(np.float32), 0.3)
    yield Case("random: periodic, 2-D", cloud[:, :2].copy(), 0.2, np.ones(2))
    yield Case("random: open, 5-D", random.random((100, 5)), 0.5)
    yield Case("random: slab, box of 3 lengths", cloud, 0.3, np.ones(3), (True, True, False))
    yield Case("coincident points, cutoff 0", np.repeat(cloud[:20], 3, axis=0), 0.0, np.ones(3))

    skewed = np.array([[1.0, 0.0, 0.0], [7.3, 1.1, 0.0], [-3.9, 12.7, 0.9]])
    yield Case("skewed: triclinic", cloud[:60] @ skewed, 0.5, skewed)
    left_handed = skewed[[1, 0, 2]]
    flags = (True, False, True)
    yield Case("skewed: left-handed, two axes", cloud[:60] @ left_handed, 1.5, left_handed, flags)

    far = random.integers(-(10**6), 10**6, size=(60, 3)) * np.array([1.0, 1.25, 0.75])
    box = np.array([1.0, 1.25, 0.75])
    yield Case("far: up to a million boxes away", cloud[:60] + far, 0.3, box)
    yield Case("far: all at 2**52", np.floor(cloud * 8) + 2.0**52, 2.0)
    tiny = np.floor(cloud * 9) * 5e-324
    yield Case("subnormal coordinates and cutoff", tiny, 2 * 5e-324)
    yield Case("huge coordinates: squares overflow", (cloud - 0.5) * 1e300, 3e299)

    radii: Any = random.integers(0, 4, len(lattice)) * 0.125
    yield Case("ties: balls on a lattice that touch", lattice * 0.25, 0.5, radii=radii)
    sizes: Any = 0.4 * 10.0 ** -random.uniform(0, 6, len(cloud))
    yield Case("random: balls of six decades", cloud, 0.5, np.ones(3), radii=sizes)


def check_case(case: Case) -> str:
    """Compare all kernels with the integers; return how many pairs there are."""
    expected = case.expected
    for kernel in hs.kernels():
        i, j, S, d = case.find(kernel, "ijSd", sort=True)
        found = list(zip(i.tolist(), j.tolist(), map(tuple, S.tolist()), strict=True))
        if found != expected:
            missed, spurious = set(expected) - set(found), set(found) - set(expected)
            raise AssertionError(
                f"kernel {kernel}: {len(missed)} missed, {len(spurious)} spurious, "
                f"{len(found) - len(set(found))} duplicate; "
                f"first: {min(missed | spurious, default=None)}"
            )
        beyond = d > case.cutoff if case.inclusive else d >= case.cutoff
        if beyond.any():
            raise AssertionError(f"kernel {kernel}: a distance contradicts its pair's decision")
        for k in range(0, len(d), max(1, len(d) // 20)):
            error = ulp_error(d[k], exact_square(case.points, i[k], j[k], S[k], case.box))
            if error > 1 + 2.0**-60:
                raise AssertionError(f"kernel {kernel}: distance {d[k]!r} is off by > 1 ulp")
    return f"{len(expected):,} pairs"


def check_large() -> str:
    """Compare all kernels with one another on more points, to the last bit and in order."""
    points = np.random.default_rng(7).random((20_000, 3))
    case = Case("", points, 0.06, np.ones(3))
    first, *others = hs.kernels()
    expected = case.find(first, "ijdDS")
    for kernel in others:
        for letter, a, b in zip("ijdDS", expected, case.find(kernel, "ijdDS"), strict=True):
            if a.tobytes() != b.tobytes():
                raise AssertionError(f"{letter} of kernels {first} and {kernel} differ")
    return f"{len(expected[0]):,} pairs"


def run(write: Callable[[str], Any] = print) -> int:
    """Run all checks.

    Parameters
    ----------
    write : callable, default print
        Called with one line for each check, and one at the end.

    Returns
    -------
    int
        Number of failed checks.
    """
    kernels = ", ".join(hs.kernels())
    write(f"halfshell {hs.__version__}, kernels {kernels}, each against Python integers")
    start = time.perf_counter()
    checks: list[tuple[str, Callable[[], str]]] = [
        (case.name, partial(check_case, case)) for case in cases()
    ]
    checks.append(("large: kernels agree bit for bit", check_large))
    failures = 0
    for name, check in checks:
        try:
            write(f"  ok    {name:<42}{check():>16}")
        except Exception as error:  # whatever goes wrong in a check is a failed check
            failures += 1
            text = " ".join(str(error).split())
            write(f"  FAIL  {name}: {type(error).__name__}: {text}")
    seconds = time.perf_counter() - start
    write(f"{len(checks) - failures} passed, {failures} failed in {seconds:.1f} s")
    return failures


def main() -> int:
    """Run all checks; return the exit status."""
    return 1 if run() else 0


if __name__ == "__main__":
    sys.exit(main())
