# SPDX-License-Identifier: BSD-3-Clause
"""What to say where a package that is optional is not installed."""

from __future__ import annotations

__all__ = ["how_to_install", "needs"]


def how_to_install(*packages: str) -> str:
    """Return the command that brings them, whether or not there is a release of ours."""
    return f"pip install {' '.join(packages)}"


def needs(what: str, *packages: str) -> str:
    """Return a sentence for what cannot be done without these packages."""
    return f"{what} needs {' and '.join(packages)}: {how_to_install(*packages)}"
