# SPDX-License-Identifier: BSD-3-Clause
"""Hashes of the results of fixed scenes, kept in golden.json: no answer and no order may change
by accident.

    python tests/golden.py                  compare
    python tests/golden.py --write          after the order of unsorted results changed on purpose
    python tests/golden.py --write-answers  after answers changed on purpose: d or D in the last bit

Each scene has two hashes. "sorted" is that of the answer: pairs, shifts, and every bit of d and D.
"unsorted" also depends on the order in which the search meets the pairs, that is on the sizes of
cells and groups. So --write refuses to touch the file if an answer differs. Run it only when the
order was meant to change. Scenes that have "rows" or "blocks" are also asked for the rows of all
points, which have one order, and for streams in blocks of these sizes.

Scenes are made by Python's own random numbers, multiplication and addition, so they are the same
bits everywhere.
"""

from __future__ import annotations

import hashlib
import json
import random
import sys
from pathlib import Path
from typing import Any

import numpy as np

import halfshell as hs

FILE = Path(__file__).with_name("golden.json")
ABOUT = "SHA-256 of results; written by tests/golden.py, which says when it may be written again"

# What is known of the points, and arguments of hs.pairs; "rows": hs.neighbors as well;
# "blocks": hs.iter_pairs as well, for each of these numbers of pairs a block.
Scene = dict[str, Any]


def cloud(n: int, ndim: int, seed: int, size: float = 1.0) -> np.ndarray:
    """Random points in [0, size)^ndim."""
    numbers = random.Random(seed)
    return size * np.array([numbers.random() for _ in range(n * ndim)]).reshape(n, ndim)


def crystal(cells: int, pitch: float) -> np.ndarray:
    """A simple cubic lattice of cells^3 points."""
    axis = pitch * np.arange(float(cells))
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def scenes() -> dict[str, Scene]:
    """All scenes by name."""
    cube = np.eye(3)
    tilted = np.array([[1.0, 0.0, 0.0], [0.375, 0.875, 0.0], [-0.25, 0.125, 1.125]])
    sheared = np.array([[1.0, 0.0, 0.0], [7.25, 1.0, 0.0], [-3.5, 5.0, 1.0]])
    steep = np.eye(5) + 0.125 * np.eye(5, k=-1)
    systems = {
        "points": cloud(900, 3, 19),
        "box": np.stack([cube, tilted, 0.5 * cube] * 10),
        "batch": np.arange(900) // 30,
    }
    return {
        "open": {"points": cloud(5000, 3, 1), "cutoff": 0.09},
        "open, far away": {"points": cloud(900, 3, 2) + 2.0**40, "cutoff": 0.2},
        "periodic": {"points": cloud(20000, 3, 3), "cutoff": 0.05, "box": cube},
        "slab": {
            "points": cloud(2000, 3, 4),
            "cutoff": 0.13,
            "box": cube,
            "periodic": (True, True, False),
        },
        "triclinic": {"points": cloud(1500, 3, 5, 3.0), "cutoff": 0.13, "box": tilted},
        "sheared": {"points": cloud(300, 3, 6), "cutoff": 0.3, "box": sheared},
        "images": {"points": cloud(12, 3, 7), "cutoff": 3.75, "box": tilted},
        "1-D": {"points": cloud(500, 1, 8), "cutoff": 0.03, "box": np.eye(1)},
        "2-D": {"points": cloud(3000, 2, 9), "cutoff": 0.05, "box": np.eye(2)},
        "5-D": {"points": cloud(400, 5, 10), "cutoff": 0.5, "box": steep},
        "8-D": {"points": cloud(200, 8, 11), "cutoff": 0.9},
        # Distances of 3 are (3, 0, 0) and (2, 2, 1): many pairs exactly at the cutoff.
        "crystal, cutoff on a shell": {
            "points": crystal(10, 1.0),
            "cutoff": 3.0,
            "box": 10.0 * cube,
        },
        # 0.1 is no binary number: what is near the cutoff needs the last stages of the decision.
        "crystal of 0.1": {"points": crystal(10, 0.1), "cutoff": 0.3},
        "crystal of 0.1, strict": {
            "points": crystal(10, 0.1),
            "cutoff": 0.3,
            "box": cube,
            "inclusive": False,
        },
        "float32": {
            "points": cloud(2000, 3, 12).astype(np.float32),
            "cutoff": 0.1,
            "box": tilted,
        },
        "int32": {
            "points": cloud(2000, 3, 13),
            "cutoff": 0.1,
            "box": cube,
            "index_dtype": np.int32,
        },
        "rows and streams": {
            "points": cloud(4000, 3, 14),
            "cutoff": 0.09,
            "box": tilted,
            "rows": True,
            "blocks": (50, 3000, 1 << 20),
        },
        "rows and streams of images": {
            "points": cloud(40, 3, 15),
            "cutoff": 1.3,
            "box": sheared,
            "periodic": (True, True, False),
            "rows": True,
            "blocks": (50, 3000, 1 << 20),
        },
        "rows and streams by radii": {
            "points": cloud(1500, 3, 16),
            "cutoff": None,
            "box": cube,
            "radii": 0.005 * 20.0 ** cloud(1500, 1, 17)[:, 0],
            "rows": True,
            "blocks": (50, 3000, 1 << 20),
        },
        "rows and streams by types": {
            "points": cloud(2000, 3, 18),
            "cutoff": {(0, 0): 0.05, (0, 1): 0.15, (1, 1): 0.03, (2, 2): 0.2},
            "types": np.arange(2000) % 3,
            "rows": True,
            "blocks": (50, 3000, 1 << 20),
        },
        "systems": {**systems, "cutoff": 0.25, "rows": True},
        "systems by radii": {
            **systems,
            "cutoff": None,
            "radii": 0.02 * 8.0 ** cloud(900, 1, 20)[:, 0],
            "rows": True,
        },
    }


def digest(arrays: tuple[np.ndarray, ...]) -> str:
    """Of dtypes, shapes and bytes."""
    hashed = hashlib.sha256()
    for array in arrays:
        hashed.update(f"{array.dtype.str} {array.shape}\n".encode())
        hashed.update(array.tobytes())
    return hashed.hexdigest()


def hashes(scene: Scene, **how: Any) -> dict[str, Any]:
    """The entry of a scene in the file; `how`, settings, must not matter."""
    known = scene.keys() & {"box", "periodic", "radii", "types", "batch"}
    points = hs.Points(scene["points"], **{name: scene[name] for name in known})
    given = {name: scene[name] for name in scene.keys() - {"points", "rows", "blocks", *known}}
    with hs.settings(**how):
        unsorted = hs.pairs(points, **given, quantities="ijdDSP")
        ascending = hs.pairs(points, **given, quantities="ijdDSP", sort=True)
        if "rows" in scene:
            table = hs.neighbors(points, **given, quantities="jdDS")
            ascending += table.offsets, table.indices, table.distances, table.vectors, table.shifts
        for most in scene.get("blocks", ()):
            for block in hs.iter_pairs(points, **given, quantities="ijdDSP", max_pairs=most):
                unsorted += block
    return {"pairs": len(unsorted[0]), "sorted": digest(ascending), "unsorted": digest(unsorted)}


def read() -> dict[str, Any]:
    """The entries of the file by scene."""
    return dict(json.loads(FILE.read_text())["scenes"]) if FILE.exists() else {}


def main(arguments: list[str]) -> int:
    if arguments not in ([], ["--write"], ["--write-answers"]):
        print(__doc__, file=sys.stderr)
        return 2
    kept = read()
    found = {name: hashes(scene) for name, scene in scenes().items()}
    answers = [
        name
        for name, entry in found.items()
        if name in kept and any(entry[key] != kept[name][key] for key in ("pairs", "sorted"))
    ]
    others = [name for name in found if name not in answers and found[name] != kept.get(name)]
    for name in answers:
        print(f"answer differs  {name}")
    for name in others:
        print(f"{'order differs' if name in kept else 'new':<16}{name}")
    if not arguments:
        return 1 if answers or found != kept else 0
    if answers and arguments != ["--write-answers"]:
        print("not written: answers differ")
        return 1
    FILE.write_text(json.dumps({"about": ABOUT, "scenes": found}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
