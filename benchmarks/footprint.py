# SPDX-License-Identifier: BSD-3-Clause
"""What halfshell costs besides time: import, size on disk, memory beyond the output.

    python benchmarks/footprint.py [--wheel FILE] [--runs 21] [--scenes NAME[:QUANTITIES] ...]

Each figure comes from new processes. Memory needs Linux (it is read from /proc).
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

from halfshell import _core
from measure.machine import facts
from pages import duration, render, write_rows
from scenes import SCENES, Scene, load

__all__ = ["COLUMNS", "allowance", "main", "parse_case"]

_HERE = Path(__file__).resolve().parent

_IMPORT = """
import json, sys, time
start = time.perf_counter()
import numpy
middle = time.perf_counter()
before = set(sys.modules)
import halfshell
end = time.perf_counter()
print(json.dumps([middle - start, end - middle, sorted(set(sys.modules) - before)]))
"""

# The peak is set back just before the call, so that neither the making of the points nor the
# imports count. Where that is not allowed the peak since the start is taken, which is more.
_MEMORY = """
import json, sys
from dataclasses import replace
sys.path.insert(0, {here!r})
from libraries.contestant import Halfshell
from measure.turns import bytes_held
from scenes import load

def kilobytes(key):
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith(key))

Halfshell().prepare(load("call-2"))()
scene = load({scene!r})
call = Halfshell().prepare(replace(scene, quantities={quantities!r} or scene.quantities))
try:
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")
except OSError:
    pass
before = kilobytes("VmRSS:")
result = call()
peak, after = kilobytes("VmHWM:"), kilobytes("VmRSS:")
print(json.dumps([before, peak, after, bytes_held(result)]))
"""

# A scene, or a scene and other quantities than its own.
DEFAULT = (
    "growth-1e4", "growth-1e5", "growth-1e6", "growth-1e7", "growth-1e4:ijdDS",
    "growth-1e5:ijdDS", "growth-1e6:ijdDS", "triclinic-1e4-k52", "plane-1e5-k20", "clusters-1e5",
    "two-clusters-open", "plummer-1e5", "fcc-shell", "count-1e5-k52", "count-1e5-k419",
)  # fmt: skip

COLUMNS = (
    "date", "cpu", "kernel", "commit", "scene", "quantities", "n", "output", "peak", "kept",
    "beyond", "allowed",
)  # fmt: skip


def allowance(scene: Scene) -> int:
    """Return how many bytes the search of a scene may take beyond its output."""
    return (48 if scene.orthorhombic else 72) * scene.n + 8_000_000


def _python(code: str) -> Any:
    """Run code in a new interpreter and return what it prints as JSON."""
    said = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=_HERE
    )
    return json.loads(said.stdout)


def _report_import(runs: int) -> None:
    seen = [_python(_IMPORT) for _ in range(runs)]
    numpy_alone = median(one[0] for one in seen)
    beyond = median(one[1] for one in seen)
    print(f"import numpy            {duration(numpy_alone)} (median of {runs} processes)")
    print(f"import halfshell after  {duration(beyond)}")
    modules = seen[-1][2]
    own = [name for name in modules if name.split(".")[0] == "halfshell"]
    print(f"modules of its own      {len(own)}: {', '.join(own)}")
    others = [name for name in modules if name not in own]
    print(f"other new modules       {len(others)}: {', '.join(others) or 'none'}")


def _report_size(wheel: Path | None) -> None:
    files = importlib.metadata.files("halfshell") or []
    sizes = {str(file): Path(str(file.locate())).stat().st_size for file in files
             if Path(str(file.locate())).exists()}  # fmt: skip
    print(f"installed               {sum(sizes.values()) / 1e3:.0f} kB in {len(sizes)} files")
    for name, size in sorted(sizes.items(), key=lambda item: -item[1])[:3]:
        print(f"    {size / 1e3:8.0f} kB  {name}")
    if wheel is not None:
        with zipfile.ZipFile(wheel) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        packed = wheel.stat().st_size
        print(f"wheel                   {packed / 1e3:.0f} kB, unpacked {unpacked / 1e3:.0f} kB")


def parse_case(text: str) -> tuple[str, str]:
    """Split NAME or NAME:QUANTITIES; raise argparse.ArgumentTypeError for no such scene."""
    name, _, quantities = text.partition(":")
    if name not in SCENES:
        raise argparse.ArgumentTypeError(f"no scene {name!r}")
    return name, quantities


def _measure_memory(name: str, quantities: str) -> dict[str, Any] | None:
    """Return the bytes of one call, None where the machine has too little memory for it."""
    scene = load(name)
    if quantities:
        scene = replace(scene, quantities=quantities)
    # Points, result and search must fit, with room to spare.
    if 2 * scene.bytes_of_output() + 200 * scene.n > _core.available_memory():
        return None
    before, peak, after, output = _python(
        _MEMORY.format(here=str(_HERE), scene=name, quantities=quantities)
    )
    return {
        "scene": name,
        "quantities": "count" if scene.task == "count" else scene.quantities,
        "n": scene.n,
        "output": output,
        "peak": (peak - before) * 1024,
        "kept": (after - before) * 1024,
        "beyond": (peak - before) * 1024 - output,
        "allowed": allowance(scene),
    }


def _report_memory(cases: Sequence[tuple[str, str]], plain: bool, output: Path | None) -> None:
    if not Path("/proc/self/status").exists():
        print("memory is measured on Linux only")
        return
    rows = []
    for name, quantities in cases:
        row = _measure_memory(name, quantities)
        if row is None:
            print(f"{name} {quantities}: left out, too little memory")
        else:
            rows.append(row)
    body = [
        [
            row["scene"], row["quantities"],
            *(f"{row[key] / 1e6:.1f}" for key in ("output", "peak", "kept", "beyond")),
            f"{row['beyond'] / row['n']:.0f}", f"{row['allowed'] / 1e6:.1f}",
            "reached" if row["beyond"] <= row["allowed"] else "over",
        ]
        for row in rows
    ]  # fmt: skip
    head = ["scene", "quantities", "output", "peak", "kept", "beyond output", "bytes/point",
            "allowed", ""]  # fmt: skip
    render(("Memory of one call, megabytes", head, body), rich=not plain)
    if output is not None:
        _write(output, rows)


def _write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    import halfshell as hs

    about = {key: value for key, value in facts(simd=hs.kernels()[0]).items() if key in COLUMNS}
    write_rows(path, COLUMNS, ({**about, **row} for row in rows))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--runs", type=int, default=21, help="processes that import; 0: none (21)")
    parser.add_argument("--wheel", type=Path, help="a wheel to weigh")
    parser.add_argument("--scenes", nargs="*", type=parse_case, metavar="NAME[:QUANTITIES]",
                        default=[parse_case(case) for case in DEFAULT])  # fmt: skip
    parser.add_argument("--output", type=Path, metavar="CSV", help="write the memory to a file")
    parser.add_argument("--plain", action="store_true", help="tables without the rich package")
    options = parser.parse_args(arguments)
    if options.runs:
        _report_import(options.runs)
    _report_size(options.wheel)
    _report_memory(options.scenes, options.plain, options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
