# SPDX-License-Identifier: BSD-3-Clause
"""What a figure depends on besides the code: the machine, the kernel, the versions."""

from __future__ import annotations

import mmap
import os
import platform
import subprocess
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from halfshell._machine import cpu_name

__all__ = ["facts", "pin_to_cores", "touch_memory", "usable_cores"]


def pin_to_cores(cores: Sequence[int]) -> bool:
    """Keep this process on these cores. Returns whether the system offers it."""
    if not hasattr(os, "sched_setaffinity"):
        return False
    os.sched_setaffinity(0, cores)
    return True


def usable_cores() -> list[int]:
    """Return the cores that this process may use, the last one first."""
    if not hasattr(os, "sched_getaffinity"):
        return list(range(os.cpu_count() or 1))[::-1]
    return sorted(os.sched_getaffinity(0), reverse=True)


def touch_memory(n_bytes: int) -> None:
    """Write to `n_bytes` of memory once and give them back.

    On a virtual machine the first use of a page may be many times slower than any later one,
    which would be charged to whoever comes first. Mapped here, because an allocator would hand out
    memory that it has kept, and keep what it is given back.
    """
    least = 16 << 20  # some more than a huge page, which is all that small results need
    own = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS} if hasattr(mmap, "MAP_PRIVATE") else {}
    with mmap.mmap(-1, max(n_bytes, least), **own) as block:
        if hasattr(mmap, "MADV_HUGEPAGE"):
            block.madvise(mmap.MADV_HUGEPAGE)
        for at in range(0, len(block), mmap.PAGESIZE):
            block[at] = 1


def facts(label: str | None = None, simd: str = "", compiler: str = "") -> dict[str, Any]:
    """Return the columns that every row of a result file begins with."""
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": label or f"{platform.system()} {platform.machine()}",
        "cpu": cpu_name(),
        "cores": os.cpu_count() or 1,
        "kernel": simd,
        "compiler": compiler,
        "commit": _commit(),
        "os": platform.release().partition("-")[0],
        "python": platform.python_version(),
        "numpy": np.__version__,
        "huge_pages": _chosen(_read("/sys/kernel/mm/transparent_hugepage/enabled")),
        "governor": _read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor").strip(),
        "load": round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else "",
    }


def _read(path: str) -> str:
    """Return the text of a file, empty where it cannot be read."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError:
        return ""


def _chosen(text: str) -> str:
    """Return what stands in brackets: "always [madvise] never" gives "madvise"."""
    return text.partition("[")[2].partition("]")[0]


def _commit() -> str:
    """Return the commit of this checkout, marked where files have been changed since."""
    here = Path(__file__).resolve().parent
    try:
        said = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--abbrev=10"],
            cwd=here, capture_output=True, text=True, check=True, timeout=10,
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return said.stdout.strip()
