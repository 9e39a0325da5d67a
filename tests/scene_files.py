# SPDX-License-Identifier: BSD-3-Clause
"""What is written down about `halfshell_report.scenes`: `tests/scenes.json` and `docs/scenes.md`.

    python tests/scene_files.py            compare
    python tests/scene_files.py --write    after scenes were added or changed on purpose

`tests/scenes.json` holds, for each scene and size, the number of pairs and a hash of everything
that decides the answer. The table of `docs/scenes.md` is made of the titles and docstrings.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

import halfshell as hs
from halfshell_report import scenes

FILE = Path(__file__).with_name("scenes.json")
PAGE = Path(__file__).resolve().parents[1] / "docs" / "scenes.md"
NAMES = (*scenes.names(), *scenes.names(radii=True, supports=True, updates=True))
ABOUT = "pairs and SHA-256 of scenes; written by tests/scene_files.py"
BEGIN, END = "<!-- scenes: begin -->\n", "<!-- scenes: end -->\n"


def digest(scene: scenes.Scene) -> str:
    """SHA-256 of everything that decides the answer, the same on every machine."""
    hashed = hashlib.sha256()
    limit = scene.rule if scene.cutoff is None else scene.cutoff.hex()
    hashed.update(f"{limit} {scene.periodic} {scene.inclusive}\n".encode())
    add(hashed, scene.points)
    add(hashed, scene.box)
    if scene.radii is not None:
        add(hashed, scene.radii)
    if scene.supports is not None:
        add(hashed, scene.supports)
        add(hashed, scene.extent)
    if scene.motion is not None:
        for value in vars(scene.motion).values():
            add(hashed, value)
    if scene.updates is not None:
        for value in vars(scene.updates).values():
            add(hashed, value)
    return hashed.hexdigest()


def add(hashed: Any, value: Any) -> None:
    """Add a number or an array to a hash."""
    if value is None:
        hashed.update(b"none\n")
        return
    array = np.asarray(value)
    array = array.astype(array.dtype.newbyteorder("<"))
    hashed.update(f"{array.dtype.str} {array.shape}\n".encode())
    hashed.update(array.tobytes())


def entry(scene: scenes.Scene) -> dict[str, Any]:
    """What the file says about one scene in one size."""
    pairs = hs.count_pairs(**scene.arguments)
    return {"n": scene.n_points, "pairs": pairs, "digest": digest(scene)}


def read() -> dict[str, Any]:
    """The entries of the file by scene and size."""
    return dict(json.loads(FILE.read_text())["scenes"]) if FILE.exists() else {}


def table() -> str:
    """The scenes as a table in Markdown: a row for each docstring."""
    rows: dict[str, list[scenes.Scene]] = {}
    for name in NAMES:
        scene = scenes.load(name, "small")
        rows.setdefault(" ".join(scene.stresses.split()), []).append(scene)
    lines = ["| scene | what it is | what it stresses |", "| --- | --- | --- |"]
    for stresses, family in rows.items():
        names = "<br>".join(f"`{scene.name}`" for scene in family)
        titles = "<br>".join(scene.title for scene in family)
        lines.append(f"| {names} | {titles} | {stresses} |")
    return "\n".join(lines) + "\n"


def page(text: str) -> str:
    """The page with the table as it should be."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return before + BEGIN + table() + END + after


def main(arguments: list[str]) -> int:
    """Run the command line; return the exit status."""
    if arguments not in ([], ["--write"]):
        print(__doc__, file=sys.stderr)
        return 2
    kept = read()
    found = {
        name: {size: entry(scenes.load(name, size)) for size in scenes.SIZES}
        for name in NAMES
    }
    for name in {**kept, **found}:
        if kept.get(name) != found.get(name):
            print(f"{'differs' if name in kept else 'new':<9}{name}")
    text = PAGE.read_text()
    if page(text) != text:
        print(f"differs  {PAGE.name}")
    if arguments:
        FILE.write_text(json.dumps({"about": ABOUT, "scenes": found}, indent=1) + "\n")
        PAGE.write_text(page(text))
    return 0 if arguments or (found == kept and page(text) == text) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
