# SPDX-License-Identifier: BSD-3-Clause
"""What the figures depend on besides the code: date, machine, versions."""

from __future__ import annotations

import platform
from datetime import UTC, datetime

import numpy as np

__all__ = ["machine_facts"]


def machine_facts() -> dict[str, str]:
    """Return columns for every row: when and where it was measured, and with what."""
    import scipy

    import halfshell as hs
    from halfshell import _core
    from halfshell._machine import cpu_name, usable_cpus

    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": f"{platform.system()} {platform.machine()}",
        "cpu": cpu_name(),
        "cores": str(usable_cpus()),
        "threads": "1",
        "kernel": str(_core.default_kernel()),
        "halfshell": hs.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
    }
