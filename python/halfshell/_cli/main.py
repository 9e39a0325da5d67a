# SPDX-License-Identifier: BSD-3-Clause
"""The command line: ``halfshell pairs``, ``neighbors``, ``coordination``, ``nearest``, ``rdf``,
``verify``, ``bench``, ``report``, ``info`` and ``selftest``; without any of these, the help.

Exit status: 0 done; 1 a check failed (``verify``, ``bench``, ``report``, ``selftest``); 2 the input
or an option is wrong, said in one line on standard error; 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import re
import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

import halfshell as hs
from halfshell._cli.errors import InputError, one_line, printable
from halfshell._convert.options import LETTERS, are_letters
from halfshell._machine import cpu_name, unknown_kernel, usable_cpus
from halfshell._unknown import nearest_word


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line, by these arguments or those of the process; its exit status."""
    if argv is None and hasattr(sys.stdout, "reconfigure"):
        # A name of a file may hold what the terminal cannot show, as on standard error.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        parser = _parser()
        args = parser.parse_args(argv)
        if args.run is None:
            parser.print_help()
            return 0
        module, _, name = args.run.partition(":")  # imported when it is called
        status = int(getattr(import_module(module), name)(args))
        sys.stdout.flush()
        return status
    except (InputError, MemoryError) as error:
        print(f"halfshell: error: {one_line(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("halfshell: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output went away, as in `halfshell ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


# ---- values of options, from their text ------------------------------------------------------

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


def count(text: str, least: int = 1) -> int:
    if not text.isdecimal() or int(text) < least:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from {least} on")
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


def frame(text: str) -> int:
    number = frames(text)
    if isinstance(number, slice):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not the number of a frame; only rdf reads several frames"
        )
    return number


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


# ---- options ---------------------------------------------------------------------------------

class _Parser(argparse.ArgumentParser):
    """An argument parser whose complaints are one line, and which guesses no option.

    It names the option or command that is spelled most like one that there is not. Options of
    `halfshell_report` are added by `fill` when they are to be parsed, so that other commands do
    not import it.
    """

    def __init__(self, fill: Callable[[Any], None] | None = None, **options: Any) -> None:
        super().__init__(**options, allow_abbrev=False)
        self._fill = fill

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        if self._fill is not None:
            fill, self._fill = self._fill, None
            fill(self)
        found, rest = super().parse_known_args(args, namespace)
        if rest and not rest[0].startswith("-") and getattr(found, "list", "") is None:
            found.list = rest.pop(0)  # argparse leaves a file that comes after options
        if rest:  # here, where the options of the command are known
            self.error(f"unrecognized arguments: {' '.join(rest)}{self._hint(rest)}")
        return found, rest

    def _hint(self, rest: Sequence[str]) -> str:
        if all(re.fullmatch(r"[-+.\deE]+", word) for word in rest):
            return "; numbers of one option are separated by commas"
        meant = nearest_word(rest[0].partition("=")[0], self._option_string_actions)
        return f"; did you mean {meant}?" if meant and rest[0].startswith("--") else ""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            meant = nearest_word(str(value), map(str, action.choices or ()))
            if meant:
                error.message += f"; did you mean {meant}?"
            raise

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see {self.prog} --help)")


#: What options of several commands are called, and what argparse is told of each.
_OPTIONS: dict[str, dict[str, Any]] = {
    "file": {
        "nargs": "?", "metavar": "FILE",
        "help": ".npy, .npz, text with one point per line, point clouds, or anything that ASE or "
        "MDAnalysis reads; - for standard input; default: alpha-quartz",
    },
    "--cutoff": {
        "type": cutoffs, "metavar": "R",
        "help": "largest distance of a pair, or of each two elements: Si-O=1.8,*-*=3; default: one "
        "with about 50 neighbours",
    },
    "--box": {
        "type": box, "metavar": "LX,LY,LZ",
        "help": "edge lengths, or one length for all edges; lengths and angles (six numbers); or "
        "all components of the edge vectors",
    },
    "--periodic": {
        "type": periodic, "metavar": "TTF",
        "help": "which axes are periodic, T or F for each, or one letter for all",
    },
    "--columns": {
        "type": columns, "metavar": "X,Y,Z",
        "help": "of text, the coordinates: names of columns, or numbers from 1 on",
    },
    "--trajectory": {
        "metavar": "FILE",
        "help": "frames of which the first FILE is the topology, as MDAnalysis reads both",
    },
    "--format": {
        "metavar": "NAME", "help": "format of ASE or MDAnalysis, if it is not recognised"
    },
    "--index": {"type": frame, "metavar": "N", "help": "frame; default: the last"},
    "--json": {"action": "store_true", "help": "print JSON for machines"},
    "--strict": {"action": "store_true", "help": "d < cutoff; default: d <= cutoff"},
    "--kernel": {"choices": hs.kernels(), "metavar": "NAME", "help": "see `halfshell info`"},
    "--threads": {
        "type": count, "metavar": "N", "help": "maximum number; default: as many as pay"
    },
    "--output": {
        "metavar": "OUT", "help": "write the columns: .npz, .csv, .parquet, or - for CSV here"
    },
    "--quantities": {
        "type": quantities, "metavar": "LETTERS",
        "help": "columns of OUT, any of i j d D S; default: ijdS, or ijd without a box",
    },
    "--max-output": {
        "type": size, "metavar": "SIZE",
        "help": "largest output, such as 500MB or 4GB; default: 1GB",
    },
    "--plot": {"metavar": "PNG", "help": "draw g(r): .png, .pdf or .svg"},
    "--queries": {
        "metavar": "FILE",
        "help": "whose neighbours are wanted, in the box of the points; default: the points",
    },
    "--by-type": {"action": "store_true", "help": "of each two elements of the file"},
    "--no-progress": {
        "dest": "progress", "action": "store_false", "help": "no progress bar"
    },
}  # fmt: skip

#: What says which points are meant, in which box.
_SCENE = (
    "file", "--cutoff", "--box", "--periodic", "--columns", "--trajectory", "--format", "--index",
    "--json",
)  # fmt: skip
_SEARCH = (*_SCENE, "--kernel", "--threads")
_COLUMNS = (*_SEARCH, "--output")
_ONE_CUTOFF = {"type": cutoff, "help": "largest distance of a pair; default: one with about "
               "50 neighbours"}  # fmt: skip


def _add(command: argparse.ArgumentParser, *names: str, **changed: dict[str, Any]) -> None:
    """Add options; `changed` is what some of them are told besides."""
    for name in names:
        short = ("-o",) if name == "--output" else ()
        told = changed.get(name.lstrip("-"), {})
        command.add_argument(*short, name, **{**_OPTIONS[name], **told})


def _parser() -> _Parser:
    parser = _Parser(
        prog="halfshell",
        description="Every pair of points within a cutoff, each decided exactly.",
    )
    parser.add_argument("--version", action="version", version=f"halfshell {hs.__version__}")
    parser.set_defaults(run=None)
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")

    def command(name: str, words: str, run: str = "", **how: Any) -> Any:
        made = commands.add_parser(name, help=words, **how)
        made.set_defaults(run=run or f"halfshell._cli.lists:run_{name}")
        return made

    pairs = command("pairs", "find the pairs of a file, summarise them, save them, plot g(r)")
    _add(
        pairs, *_COLUMNS, "--strict", "--quantities", "--max-output", "--plot", "--no-progress",
        output={"help": "write the pairs: .npz, .csv, .parquet, or - for CSV on standard output"},
        quantities={"help": "columns of OUT, any of i j d D S P; default: ijdS, or ijd without a "
                    "box"},
    )  # fmt: skip
    pairs.add_argument("--sort", action="store_true", help="sort OUT by (i, j, S)")
    pairs.add_argument(
        "--precision", choices=("exact", "double", "single"), default="exact",
        help="how a pair near the cutoff is decided; default: exact",
    )  # fmt: skip

    neighbors = command("neighbors", "find all neighbours of each point")
    _add(neighbors, *_COLUMNS, "--strict", "--queries", "--quantities", "--max-output")

    counts = command("coordination", "count the neighbours of each point")
    _add(counts, *_COLUMNS, "--strict", "--queries", "--by-type")

    nearest = command("nearest", "find the nearest neighbours of each point")
    _add(nearest, *[name for name in _COLUMNS if name != "--cutoff"], "--queries")
    nearest.add_argument("-k", type=count, default=1, help="how many; default: 1")

    rdf = command("rdf", "the radial distribution function g(r), up to the cutoff")
    _add(
        rdf, *_COLUMNS, "--plot", "--by-type", cutoff=_ONE_CUTOFF,
        index={"type": frames,
               "help": "frame, or frames to average: : for all, 100:, ::10; default: the last"},
    )  # fmt: skip
    rdf.add_argument("--bins", type=count, default=100, metavar="N", help="default: 100")
    rdf.add_argument(
        "--density", type=number, metavar="RHO",
        help="points per unit of volume, where the box has none or is not the whole",
    )  # fmt: skip

    verify = command(
        "verify", "check a list of pairs, of halfshell or another library, exactly",
        "halfshell._cli.verify:run",
    )  # fmt: skip
    _add(verify, *_SEARCH, "--strict", "--no-progress")
    verify.add_argument(
        "list", nargs="?", metavar="LIST",
        help="a saved list: .csv, .npz, .parquet with columns i and j, or the like, and shifts",
    )  # fmt: skip
    verify.add_argument(
        "--against", metavar="LIBRARY",
        help="whose list to check: ase, matscipy, matscipy-neighbours, scipy or vesin; default: "
        "our own",
    )  # fmt: skip
    verify.add_argument(
        "--sample", type=partial(count, least=0), metavar="N",
        help="most points to check by integers, 0 for all; default: 400, or what takes seconds",
    )  # fmt: skip

    # Options of `halfshell_report`, which is imported when these commands are called.
    def fill_bench(parser: argparse.ArgumentParser) -> None:
        _add(parser, *_SCENE, "--strict", cutoff=_ONE_CUTOFF)
        import_module("halfshell_report.cli").add_peers(parser)

    command(
        "bench", "run times on a file, ours and other libraries', whose answers come first",
        "halfshell_report.cli:run_bench", fill=fill_bench,
    )  # fmt: skip
    command(
        "report", "error against run time, of halfshell and other libraries, on hard scenes",
        "halfshell_report.cli:run",
        fill=lambda parser: import_module("halfshell_report.cli").add_options(parser),
    )  # fmt: skip
    info = command("info", "what this installation consists of", "halfshell._cli.main:run_info")
    info.add_argument("--json", action="store_true", help="the same for machines")
    command(
        "selftest", "check every kernel of this CPU against integers (under 5 s)",
        "halfshell._cli.main:run_selftest",
    )  # fmt: skip
    return parser


def run_info(args: argparse.Namespace) -> int:
    """Carry out ``halfshell info``."""
    from halfshell import _core

    build = dict(_core.build_info())
    unknown = unknown_kernel()
    facts: dict[str, Any] = {
        "halfshell": hs.__version__,
        "kernels": list(hs.kernels()),
        "kernel used": _core.default_kernel() if unknown is None else None,
        "python": f"{platform.python_version()} ({platform.python_implementation()})",
        "numpy": np.__version__,
        "platform": f"{platform.system()} {platform.machine()}",
        "cpu": cpu_name(),
        "cpus usable": usable_cpus(),
    }
    facts.update({name: value for name, value in build.items() if name != "kernels"})
    if args.json:
        print(json.dumps(facts, indent=2))
    else:
        for name, value in facts.items():
            text = ", ".join(value) if isinstance(value, (list, tuple)) else value
            print(printable(f"{name:<14}{'none' if value is None else text}"))
    if unknown is not None:
        raise InputError(f"{unknown}; searches that name none are refused")
    return 0


def run_selftest(_: argparse.Namespace) -> int:
    """Carry out ``halfshell selftest``."""
    return int(import_module("halfshell.selftest").main())
