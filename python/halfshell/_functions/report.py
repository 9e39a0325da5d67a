# SPDX-License-Identifier: BSD-3-Clause
"""`report`: signature and documentation; the work is done by `halfshell._report`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

from halfshell._convert.foreign import is_a, kind_of, shown, told
from halfshell._convert.lengths import as_number
from halfshell._machine import unknown_kernel

if TYPE_CHECKING:
    from halfshell._report.page.rows import ReportRow

__all__ = ["report"]


def report(
    scenes: Sequence[str] | Literal["all"] | None = None,
    *,
    methods: Sequence[str] | None = None,
    peers: Sequence[str] | Literal["all", "none"] | None = "none",
    size: str = "quick",
    patience: float | None = None,
) -> list[ReportRow]:
    """Measure error against run time, of this library and others, on hard scenes.

    Every list is compared with a truth that does not use this library's compiled core:
    SciPy's k-d tree over explicit images with a proven margin, and integers inside the margin.

    Parameters
    ----------
    scenes : sequence of str or "all", optional
        Names from `halfshell.scenes.names`, of any kind: one cutoff, a radius for each point, or
        a support for each. Default: all; of size "quick" one for each demand.
    methods : sequence of str, optional
        Any of "exact", "double" and "single" (the precisions of `pairs`), "float32" (points
        rounded to float32 first), "verlet" and "stale" (on scenes that move: a `VerletList`,
        and lists that are rebuilt by the clock, too late on purpose). Default: all.
    peers : sequence of str, "all" or "none", default "none"
        Other libraries to compare with, each in a separate process: any of "vesin",
        "cKDTree", "neighborlist-rs", "matscipy-neighbours", "matscipy", "MDAnalysis", "freud",
        "pymatgen", "ase", "NumPy" (all pairs in float64, if points have supports). None is
        "all". For a library that is not installed, the rows say so.
    size : {"quick", "full", "small"}, default "quick"
        Size of the scenes, as in `halfshell.scenes.load`, and care in timing. "quick" takes about
        20 s with ten other libraries.
    patience : float, optional
        Seconds that another library may take for one scene. Default: 60, and in "quick" 1, and
        2 for all scenes together, after which it is left out.

    Returns
    -------
    list of ReportRow
        One for each method on each scene, in this order. A row is a frozen dataclass: what
        was measured (``scene``, ``method``, ...), ``status`` ("ok", or why there are no figures),
        ``seconds``, ``missed``, ``spurious``, ``duplicate``, errors of d and D in units in the
        last place (ulp) and relative, errors of Lennard-Jones energy and forces, energy drift.
        Its docstring lists all fields; what was not measured is None.

    Raises
    ------
    ValueError
        If a name is not known, or `patience` is not positive, or HALFSHELL_KERNEL names no kernel
        of this CPU.
    TypeError
        If names are not a sequence of strings, or `patience` is not a number.
    ImportError
        If SciPy is not installed.

    See Also
    --------
    verify : check one list of your own.

    Notes
    -----
    ``halfshell report`` is the same from the command line; it also writes the rows as CSV and
    a page with figures.

    Examples
    --------
    >>> import halfshell as hs
    >>> rows = hs.report(["near-ties"], methods=["exact", "single"], size="small")
    >>> [(row.method, row.wrong > 0) for row in rows]
    [('exact', False), ('single', True)]
    """
    from halfshell._report.measure.run import plan_of, run

    plan = plan_of(
        "all" if is_a(scenes, str) and scenes == "all" else _names(scenes, "scenes"),
        _names(methods, "methods"),
        peers if is_a(peers, str) and peers in ("all", "none") else _names(peers, "peers"),
        _as_string(size),
        None if patience is None else as_number(
            patience, "patience", "be a positive number of seconds"
        ),
    )  # fmt: skip
    unknown = unknown_kernel()
    if unknown is not None:
        raise ValueError(unknown)
    return run(plan)


def _as_string(size: Any) -> str:
    if not is_a(size, str):
        raise TypeError(f"size must be a string, got {kind_of(size)}")
    return str(size)


def _names(given: Any, argument: str) -> tuple[str, ...] | None:
    """Strings, whatever sequence holds them; None where all are meant."""
    if given is None:
        return None
    must = f"{argument} must be a sequence of names"
    if is_a(given, (str, bytes)):
        raise TypeError(f"{must}, got the string {shown(given)}")
    try:
        names = tuple(given)
    except MemoryError:
        raise
    except Exception as error:
        raise TypeError(
            f"{must}: {kind_of(given)} raised {kind_of(error)}: {told(error)}"
        ) from error
    for k, name in enumerate(names):
        if not is_a(name, str):
            raise TypeError(f"{must}, got {argument}[{k}] = {shown(name)}")
    return names
