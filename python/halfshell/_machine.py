# SPDX-License-Identifier: BSD-3-Clause
"""The machine that this process runs on."""

from __future__ import annotations

import os
import platform

from halfshell import _core

__all__ = ["cpu_name", "unknown_kernel", "usable_cpus"]


def cpu_name() -> str:
    """Return what the processor calls itself."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            for line in lines:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def usable_cpus() -> int:
    """Return how many processors this process may run on."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def unknown_kernel() -> str | None:
    """Return what is wrong with HALFSHELL_KERNEL, which no call checks before it searches."""
    named, known = _core.default_kernel(), _core.kernels()
    if named in known:
        return None
    return f"HALFSHELL_KERNEL={named}: is not a kernel of this CPU ({', '.join(known)})"
