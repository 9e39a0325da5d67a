# SPDX-License-Identifier: BSD-3-Clause
"""Types of arguments and results, for signatures and type checkers; nothing here is called.

Modules that `import halfshell` loads import this one, and `numpy.typing`, for type checkers only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, Protocol, TypedDict

import numpy as np
import numpy.typing as npt

Precision = Literal["exact", "double", "single"]
Algorithm = Literal["auto", "all-pairs", "grid", "hash", "hierarchy"]

FloatArray = npt.NDArray[np.float64]
PointArray = npt.NDArray[np.float32] | FloatArray

# What functions return that take `quantities`, and one of its letters.
Arrays = npt.NDArray[Any] | tuple[npt.NDArray[Any], ...]
Letter = Literal["i", "j", "d", "D", "S", "P", "k"]

# By what a pair of radii is compared; the last two go from i to j.
Rule = Literal["sum", "mean", "max", "min", "gather", "scatter"]


class _HandsOver(Protocol):
    """An array of another library, such as a tensor on the CPU."""

    @property
    def __dlpack__(self) -> Callable[..., Any]: ...


class _BringsBox(Protocol):
    """An object like ``ase.Atoms``."""

    @property
    def positions(self) -> Any: ...
    @property
    def cell(self) -> Any: ...
    @property
    def pbc(self) -> Any: ...


class _HasAtoms(Protocol):
    """A universe or a group of atoms of MDAnalysis."""

    @property
    def universe(self) -> Any: ...
    @property
    def atoms(self) -> Any: ...


class _HasVectors(Protocol):
    """An object like `Box`."""

    @property
    def vectors(self) -> Any: ...


class _HasMatrix(Protocol):
    """An object like ``freud.box.Box``."""

    def to_matrix(self) -> Any: ...


class _HasCells(Protocol):
    """A frame of mdtraj."""

    @property
    def unitcell_vectors(self) -> Any: ...


class _HasDimensions(Protocol):
    """A frame of MDAnalysis."""

    @property
    def triclinic_dimensions(self) -> Any: ...


class _IsPoints(Protocol):
    """`Points`, which import this module."""

    @property
    def n_systems(self) -> int: ...


class _KeepsCells(Protocol):
    """A `CellList`."""

    @property
    def cell_start(self) -> Any: ...


Number = float | np.floating[Any] | np.integer[Any]
ArrayLike = npt.ArrayLike | _HandsOver
OnePoints = ArrayLike | _IsPoints | _BringsBox | _HasAtoms | _KeepsCells
PointsLike = OnePoints | Sequence[OnePoints]
# A cutoff; several, or one for each system; one for each pair of types; none but what radii say.
CutoffLike = (
    Number | Sequence[float] | Sequence[Sequence[float]] | npt.NDArray[Any]
    | Mapping[tuple[int, int], float] | Mapping[tuple[str, str], float] | None
)  # fmt: skip
BoxLike = ArrayLike | _HasVectors | _HasMatrix | _HasCells | _HasDimensions
PeriodicLike = ArrayLike
ProgressLike = Callable[[float], object] | bool | None
Out = npt.NDArray[Any] | tuple[npt.NDArray[Any], ...]


class _AnyCutoff(TypedDict, total=False):
    exclude: ArrayLike | int | None
    min_distance: float | None
    threads: int | None
    progress: ProgressLike


class _Box(TypedDict, total=False):
    box: BoxLike | None
    periodic: PeriodicLike | None


class OptionsOfBins(_AnyCutoff, _Box, total=False):
    """The keywords that searches share which have bins of distance."""


class OptionsOfCells(_AnyCutoff, total=False):
    """For overloads and methods of a `CellList`: the keywords that all searches share."""

    rule: Rule | None
    inclusive: bool


class Options(OptionsOfCells, _Box, total=False):
    """The keywords that all searches share, with the box, which a `CellList` has itself."""


class OptionsOfPoints(Options, total=False):
    """For searches that also take `indices`."""

    indices: npt.ArrayLike | None


class ListOptions(TypedDict, total=False):
    """For overloads: the keywords of a list of pairs that is kept, without `quantities`."""

    sort: bool
    index_dtype: npt.DTypeLike
    out: Out | None


class CountOptions(OptionsOfPoints, total=False):
    """For overloads: the keywords of `count_pairs`."""

    queries: PointsLike | None


class MethodOptions(OptionsOfCells, total=False):
    """Of methods of a `CellList`, with what only some of them take, and refuse otherwise."""

    quantities: str
    index_dtype: npt.DTypeLike
    user_data: Any
    thread_safe: bool


class NearestOptions(OptionsOfBins, total=False):
    """Of `nearest`, without `quantities`."""

    max_distance: ArrayLike
    queries: PointsLike | None
    indices: npt.ArrayLike | None
    inclusive: bool
    index_dtype: npt.DTypeLike
