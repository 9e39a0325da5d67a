# SPDX-License-Identifier: BSD-3-Clause
"""What every measured library is to the runner, and our own search as one of them.

How a library is called is said in `halfshell_report.peers`; here is what the runner needs besides:
rows to compare answers by, counts, batches, and how far rounding may lead it astray.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from functools import partial
from typing import Any, ClassVar

import numpy as np

from halfshell_report.peers import Call, Library, pin_threads
from libraries.agreement import Rows, half_rows
from scenes import Scene

__all__ = ["Call", "Contestant", "Halfshell", "Looped", "pin_threads"]

class Contestant(Library):
    """What the runner needs to know about a library."""

    most_pairs: ClassVar[float] = np.inf  # half pairs that it can list in reasonable time

    def refuses(self, scene: Scene) -> str | None:
        """Say why this library cannot do `scene`, or return None."""
        reason = super().refuses(scene)
        if reason is None and scene.task == "pairs" and (scene.n_pairs or 0) > self.most_pairs:
            return "too many pairs for its speed"
        return reason

    def rows(self, scene: Scene, result: Any) -> Rows:
        """Turn a result into rows that can be compared."""
        shift = self.shifts(result) if scene.has_images else None
        return half_rows(*self.indices(result), shift, self.full)

    def count(self, scene: Scene, result: Any) -> int:
        """Return the number of pairs of a result, each counted once."""
        if isinstance(result, (int, np.integer)):
            return int(result)
        return len(self.indices(result)[0]) // (2 if self.full else 1)

    def nearest(self, scene: Scene, result: Any) -> tuple[Any, Any]:
        """Return distances and numbers of the nearest, shape (n, k), where it finds these."""
        raise ValueError(f"{self.name} finds no nearest points")

    def for_batch(self) -> Contestant:
        """Return the contestant for scenes of many systems. Default: a loop over them."""
        return Looped(self)

    def band(self, scene: Scene) -> float:
        """Return how far off the cutoff its rounding may misplace a pair, as a fraction."""
        if scene.n == 0 or scene.cutoff == 0.0:
            return 0.0
        extent = float(np.abs(scene.points).max()) + scene.cutoff
        return 8.0 * 2.0**-self.float_bits * extent / scene.cutoff + self.tolerance


class Looped(Contestant):
    """A library that knows no batches: one call for each system, one after the other."""

    def __init__(self, one: Contestant) -> None:
        self.one = one
        self.name = one.name  # type: ignore[misc]
        self.inclusive = one.inclusive  # type: ignore[misc]

    def version(self) -> str | None:
        """Return the version of the library."""
        return self.one.version()

    def refuses(self, scene: Scene) -> str | None:
        """Say why the library cannot do one of the systems, or return None."""
        if scene.has_images and not self.one.images:
            return "several images of one pair"
        return self.one.refuses(scene.systems()[0])

    def prepare(self, scene: Scene) -> Call:
        """Convert the input of each system beforehand."""
        calls = [self.one.prepare(system) for system in scene.systems()]
        return lambda: [call() for call in calls]

    def rows(self, scene: Scene, result: Any) -> Rows:
        """Number the points of all systems through, and join the lists."""
        sizes = [system.n for system in scene.systems()]
        starts = np.cumsum([0, *sizes[:-1]])
        parts = [self.one.indices(part) for part in result]
        i = np.concatenate([start + part[0] for start, part in zip(starts, parts)])
        j = np.concatenate([start + part[1] for start, part in zip(starts, parts)])
        shift = None
        if scene.has_images:
            shift = np.concatenate([self.one.shifts(part) for part in result])
        return half_rows(i, j, shift, self.one.full)

    def count(self, scene: Scene, result: Any) -> int:
        """Return the number of pairs in all systems."""
        return sum(self.one.count(scene, part) for part in result)

    def band(self, scene: Scene) -> float:
        """Return what rounding may misplace, by the extent of all systems."""
        return self.one.band(scene)


SETTINGS = ("kernel", "algorithm", "precision", "memory_limit")


class Halfshell(Contestant):
    """Our own search; `options` are keywords of the call, or set around it."""

    name = "halfshell"
    distribution = module = "halfshell"
    inclusive = True
    quantities = "ijdDSP"
    dims = tuple(range(1, 9))

    def __init__(self, options: Mapping[str, Any] | None = None) -> None:
        self.options = dict(options or {})

    def for_batch(self) -> Contestant:
        """Return itself: a batch is one call."""
        return self

    def refuses(self, scene: Scene) -> str | None:
        """Refuse nothing."""
        return None

    def prepare(self, scene: Scene) -> Call:
        """Return our call with the keywords of the scene."""
        if scene.task == "count":
            return self.call("count_pairs", scene, scene.points, scene.cutoff)
        return self.call("pairs", scene, scene.points, scene.cutoff, **self.listed(scene))

    def listed(self, scene: Scene) -> dict[str, Any]:
        """Return the keywords that say what is listed."""
        return {"quantities": scene.quantities, "index_dtype": np.dtype(scene.index_dtype)}

    def call(self, function: str, scene: Scene, points: Any, *arguments: Any, **more: Any) -> Call:
        """Return a call of a function of ours: what is known of points is told beforehand."""
        hs = importlib.import_module("halfshell")
        under = importlib.import_module("halfshell_report.measure").under
        box = {} if scene.box is None else {"box": scene.box, "periodic": scene.periodic}
        fields = {"batch": scene.batch, "radii": scene.radii, "types": scene.types}
        fields = {name: values for name, values in fields.items() if values is not None}
        if fields:
            points, box = hs.Points(points, **box, **fields), {}
        options = {"threads": scene.threads, **box, **more, **self.options}
        if function in ("nearest", "pair_histogram"):  # whose bins and ranks have no rule
            options.pop("inclusive", None)
        around = {name: options.pop(name) for name in SETTINGS if name in options}
        found: Call = under(around, partial(getattr(hs, function), points, *arguments, **options))
        return found
