# SPDX-License-Identifier: BSD-3-Clause
"""What the caller of the command line can put right, said in one line.

Names of files and arrays may hold what a terminal would obey: all that is printed is escaped.
"""

from __future__ import annotations

from halfshell._errors import needs

MOST_CHARACTERS = 1000  # of a line that says what is wrong


class InputError(Exception):
    """What the caller of the command can put right, in one line."""


def one_line(error: BaseException) -> str:
    """Return the message of an exception on one line, or its kind if it has none.

    What is in it that a terminal would obey is escaped.
    """
    if isinstance(error, OSError) and error.strerror:
        return printable(error.strerror)
    if isinstance(error, MemoryError) and not str(error):
        return "not enough memory"
    # Messages of ours are of one line; line breaks in them are those of a name.
    text = str(error) if isinstance(error, InputError) else " ".join(str(error).split())
    text = printable(text) or type(error).__name__
    # What was wrong stands at the beginning or at the end; between them may be a very long name.
    half = MOST_CHARACTERS // 2
    return text if len(text) <= MOST_CHARACTERS else f"{text[:half]} ... {text[-half:]}"


def missing_extra(what: str, *packages: str) -> InputError:
    """Return the error for optional packages that are not installed."""
    return InputError(needs(what, *packages))


# ---- text for a terminal ---------------------------------------------------------------------

def printable(text: str) -> str:
    r"""Return one line of text with control characters and their like escaped, as in ``\x1b``."""
    if text.isprintable():
        return text
    return "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode()
        for letter in text
    )
