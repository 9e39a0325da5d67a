# SPDX-License-Identifier: BSD-3-Clause
"""The machine that this process runs on, and what is installed there."""

from __future__ import annotations

import os
import platform
from pathlib import Path

from halfshell import _core


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


HEADER = "halfshell.h"


def get_include() -> str:
    """Return the directory of the C headers, for ``include_dirs`` or ``-I``.

    `halfshell.h` declares the C interface of the core, for programs that compile the core
    themselves. `halfshell_capi.h` has the same functions as a table that an extension module asks
    this package for, and links nothing.

    Returns
    -------
    str
        An absolute path. In an installed package the headers lie in it, in an editable one in the
        checkout.

    Raises
    ------
    FileNotFoundError
        If they were not installed.

    Examples
    --------
    >>> import os
    >>> import halfshell as hs
    >>> sorted(name for name in os.listdir(hs.get_include()) if name.startswith("halfshell"))
    ['halfshell.h', 'halfshell_capi.h', 'halfshell_dynamic.h', 'halfshell_nodes.h']
    """
    package = Path(__file__).resolve().parent
    installed, checkout = package / "include", package.parents[1] / "csrc"
    for folder in (installed, checkout):
        if (folder / HEADER).is_file():
            return str(folder)
    raise FileNotFoundError(f"{HEADER} is missing from {installed}: install halfshell again")
