# SPDX-License-Identifier: BSD-3-Clause
"""What is printed for people: names of files and arrays may hold what a terminal would obey."""

from __future__ import annotations

__all__ = ["printable"]


def printable(text: str) -> str:
    r"""Return one line of text with control characters and their like escaped, as in ``\x1b``."""
    if text.isprintable():
        return text
    return "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode()
        for letter in text
    )
