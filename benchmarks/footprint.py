# SPDX-License-Identifier: BSD-3-Clause
"""What halfshell costs besides time: import, size on disk, memory beyond the output.

    python benchmarks/footprint.py [--wheel FILE] [--runs 21] [--scenes NAME ...]

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
from pathlib import Path
from statistics import median
from typing import Any

from report import duration, render
from scenes import SCENES, Scene, load

__all__ = ["allowance", "main"]

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
sys.path.insert(0, {here!r})
from contestant import Halfshell
from scenes import load

def kilobytes(key):
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith(key))

Halfshell().prepare(load("call-2"))()
call = Halfshell().prepare(load({scene!r}))
try:
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")
except OSError:
    pass
before = kilobytes("VmRSS:")
result = call()
print(json.dumps([before, kilobytes("VmHWM:"), kilobytes("VmRSS:")]))
"""

DEFAULT = ("pairs-1e5-k52", "pairs-1e5-k52-int32", "vectors-1e5-k52", "triclinic-1e4-k52",
           "plane-1e5-k20", "clusters-1e5", "fcc-shell", "count-1e5-k52")  # fmt: skip


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


def _report_memory(names: Sequence[str], plain: bool) -> None:
    if not Path("/proc/self/status").exists():
        print("memory is measured on Linux only")
        return
    body = []
    for name in names:
        scene = load(name)
        before, peak, after = _python(_MEMORY.format(here=str(_HERE), scene=name))
        beyond = (peak - before) * 1024 - scene.bytes_of_output()
        allowed = allowance(scene)
        body.append([
            name, f"{scene.bytes_of_output() / 1e6:.1f}", f"{(peak - before) * 1.024e-3:.1f}",
            f"{(after - before) * 1.024e-3:.1f}", f"{beyond / 1e6:.1f}",
            f"{beyond / scene.n:.0f}", f"{allowed / 1e6:.1f}",
            "reached" if beyond <= allowed else "over",
        ])  # fmt: skip
    head = ["scene", "output", "peak", "kept", "beyond output", "bytes/point", "allowed", ""]
    render(("Memory of one call, megabytes", head, body), rich=not plain)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--runs", type=int, default=21, help="processes that import (21)")
    parser.add_argument("--wheel", type=Path, help="a wheel to weigh")
    parser.add_argument("--scenes", nargs="*", choices=SCENES, default=DEFAULT, metavar="NAME")
    parser.add_argument("--plain", action="store_true", help="tables without the rich package")
    options = parser.parse_args(arguments)
    _report_import(options.runs)
    _report_size(options.wheel)
    _report_memory(options.scenes, options.plain)
    return 0


if __name__ == "__main__":
    sys.exit(main())
