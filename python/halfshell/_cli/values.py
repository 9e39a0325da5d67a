# SPDX-License-Identifier: BSD-3-Clause
"""What options of the command line hold: each function reads one kind of value from its text."""

from __future__ import annotations

import argparse
import math

import numpy as np
from numpy.typing import NDArray

import halfshell as hs
from halfshell._convert.options import LETTERS, are_letters


def cutoff(text: str) -> float:
    value = number(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is negative")
    return value


def cutoffs(text: str) -> float | dict[tuple[str, str], float]:
    """A cutoff, or one for each two elements, as in ``Si-O=1.8,*-*=3``."""
    if "=" not in text:
        return cutoff(text)
    found: dict[tuple[str, str], float] = {}
    for part in text.split(","):
        names, _, length = part.partition("=")
        one, between, other = (word.strip() for word in names.partition("-"))
        if not (one and between and other and length):
            raise argparse.ArgumentTypeError(f"{part!r} is not like Si-O=1.8, or *-*=3")
        found[one, other] = cutoff(length)
    return found


def number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a finite number")
    return value


def box(text: str) -> NDArray[np.float64]:
    return np.array([number(part) for part in text.replace(",", " ").split()])


def columns(text: str) -> tuple[str, ...]:
    names = tuple(part.strip() for part in text.split(","))
    if not all(names):
        raise argparse.ArgumentTypeError(f"{text!r} is not made of names or numbers of columns")
    return names


def periodic(text: str) -> tuple[bool, ...]:
    if not text or set(text.upper()) - set("TF"):
        raise argparse.ArgumentTypeError(f"{text!r} is not made of the letters T and F")
    return tuple(letter == "T" for letter in text.upper())


def quantities(text: str) -> str:
    if not are_letters(text):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not some of the letters {' '.join(LETTERS)}, each at most once"
        )
    return text


def kernel(text: str) -> str:
    if text not in hs.kernels():
        known = ", ".join(hs.kernels())
        raise argparse.ArgumentTypeError(f"{text!r} is not a kernel of this CPU ({known})")
    return text


def count(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number above 0")
    return int(text)


def size(text: str) -> float:
    """Bytes, of a number with kB, MB, GB or TB behind it, or with none."""
    number = text.strip().upper().removesuffix("B")
    power = "KMGT".find(number[-1:]) + 1 if number[-1:] else 0
    try:
        value = float(number[:-1] if power else number) * 1000.0**power
    except ValueError:
        value = 0.0
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 500MB or 4GB")
    return value


def sample(text: str) -> int:
    if text[:1] == "-" and text[1:].isdecimal():
        raise argparse.ArgumentTypeError(f"{text} is negative")
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number")
    return int(text)


def frame(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        only = "; only rdf reads several frames" if ":" in text else ""
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a whole number, the number of a frame{only}"
        ) from None


def frames(text: str) -> int | slice:
    """The number of a frame, or a range as in ``frames[first:end:step]``."""
    parts = text.split(":")
    try:
        numbers = [int(part) if part.strip() else None for part in parts]
    except ValueError:
        numbers = [None]
    if len(parts) == 1 and numbers[0] is not None:
        return numbers[0]
    if not 2 <= len(parts) <= 3 or numbers[2:] == [0]:
        raise argparse.ArgumentTypeError(f"{text!r} is not a frame, nor frames such as 10:, ::5")
    return slice(*numbers)
