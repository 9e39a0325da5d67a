# SPDX-License-Identifier: BSD-3-Clause
"""How many pairs each stage of the decision settles, and what the search allocates.

    python benchmarks/stages.py [--scenes NAME ...] [--output CSV]

Most pairs are settled by the float32 filter; the few that lie too near the cutoff go on to
float64, then to double words, then to integers. The counts come from the search itself, so
they show whether a scene takes the path that it is meant to take. Nothing is timed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pages import render, write_rows
from scenes import SCENES, Scene, load

__all__ = ["COLUMNS", "main", "shares"]

STAGES = ("by_float64", "by_double_word", "by_integers")
COLUMNS = ("scene", "pairs", "candidates_per_pair", "ambiguous", *STAGES, "groups", "bytes_peak")

DEFAULT = (
    "pairs-1e5-k52", "pairs-1e5-k419", "triclinic-1e4-k52", "open-1e4", "plane-1e5-k20",
    "clusters-1e5", "images-64", "silicon-8", "fcc-shell", "fcc-tie", "diamond-shell",
)  # fmt: skip


def shares(scene: str, measured: dict[str, Any]) -> dict[str, Any]:
    """Turn the counters of one search into a row.

    The stages are shares of the pairs that were found, so they tell what a pair costs on
    average; an ambiguous pair may also turn out to lie outside.
    """
    pairs = max(int(measured["pairs"]), 1)
    row: dict[str, Any] = {
        "scene": scene,
        "pairs": measured["pairs"],
        "candidates_per_pair": measured["candidates"] / pairs,
        "groups": measured["groups"],
        "bytes_peak": measured["bytes_peak"],
    }
    row.update({key: measured[key] / pairs for key in ("ambiguous", *STAGES)})
    return row


def _explain(scene: Scene, kernel: str | None) -> dict[str, Any]:
    import halfshell as hs

    box = {} if scene.box is None else {"box": scene.box, "periodic": scene.periodic}
    with hs.settings(kernel=kernel):
        found = hs.explain(
            scene.points, scene.cutoff, quantities=scene.quantities,
            index_dtype=np.dtype(scene.index_dtype), measure=True, **box,
        )  # fmt: skip
    return dict(found.measured)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=DEFAULT, metavar="NAME")
    parser.add_argument("--kernel", help="one of halfshell.kernels(); default: the best")
    parser.add_argument("--output", type=Path, metavar="CSV")
    parser.add_argument("--plain", action="store_true", help="tables without the rich package")
    options = parser.parse_args(arguments)

    rows, sizes = [], []
    for name in options.scenes:
        scene = load(name)
        measured = _explain(scene, options.kernel)
        rows.append(shares(name, measured))
        used = {key: count for key, count in measured["bytes"].items() if count}
        sizes.append([name, *(f"{key} {count / scene.n:.1f}" for key, count in used.items())])
    body = [
        [
            row["scene"], str(row["pairs"]), f"{row['candidates_per_pair']:.2f}",
            *(f"{row[key]:.3g}" for key in ("ambiguous", *STAGES)),
            str(row["groups"]), str(row["bytes_peak"]),
        ]
        for row in rows
    ]  # fmt: skip
    render(("Shares of the pairs found", list(COLUMNS), body), rich=not options.plain)
    print("\nBytes allocated over the whole call, for each point")
    for line in sizes:
        print("  " + ", ".join(line))
    if options.output:
        write_rows(options.output, COLUMNS, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
