# SPDX-License-Identifier: BSD-3-Clause
"""The command line: ``halfshell pairs``, ``neighbors``, ``coordination``, ``nearest``, ``rdf``,
``verify``, ``bench``, ``report``, ``info`` and ``selftest``; without any of these, the help.

Exit status: 0 done; 1 a check failed (``verify``, ``bench``, ``report``, ``selftest``); 2 the input
or an option is wrong, said in one line on standard error; 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, NoReturn

import numpy as np

import halfshell as hs
from halfshell._cli import values
from halfshell._cli.errors import InputError, one_line, printable
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
        status = 0 if args.run is None else int(args.run(args))
        if args.run is None:
            parser.print_help()
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


# Options -----------------------------------------------------------------------------------


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


def _parser() -> _Parser:
    parser = _Parser(
        prog="halfshell",
        description="Every pair of points within a cutoff, each decided exactly.",
    )
    parser.add_argument("--version", action="version", version=f"halfshell {hs.__version__}")
    parser.set_defaults(run=None)
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    _add_pairs(commands)
    _add_lists(commands)
    _add_verify(commands)
    _add_measuring(commands)
    info = commands.add_parser("info", help="what this installation consists of")
    info.add_argument("--json", action="store_true", help="the same for machines")
    info.set_defaults(run=_run_info)
    selftest = commands.add_parser(
        "selftest", help="check every kernel of this CPU against integers (under 5 s)"
    )
    selftest.set_defaults(run=lambda args: import_module("halfshell.selftest").main())
    return parser


def _add_scene_options(
    command: argparse.ArgumentParser,
    has_cutoff: bool = True,
    has_rule: bool = True,
    has_kernel: bool = True,
    has_frames: bool = False,
    by_elements: bool = False,
) -> None:
    """Add what says which points are meant, in which box."""
    command.add_argument(
        "file",
        nargs="?",
        metavar="FILE",
        help=".npy, .npz, text with one point per line, point clouds, or anything that ASE or "
        "MDAnalysis reads; - for standard input; default: alpha-quartz",
    )
    if has_cutoff:
        command.add_argument(
            "--cutoff",
            type=values.cutoffs if by_elements else values.cutoff,
            metavar="R",
            help="largest distance of a pair"
            + (", or of each two elements: Si-O=1.8,*-*=3" if by_elements else "")
            + "; default: one with about 50 neighbours",
        )
    command.add_argument(
        "--box",
        type=values.box,
        metavar="LX,LY,LZ",
        help="edge lengths, or one length for all edges; lengths and angles (six numbers); or all "
        "components of the edge vectors",
    )
    command.add_argument(
        "--periodic",
        type=values.periodic,
        metavar="TTF",
        help="which axes are periodic, T or F for each, or one letter for all",
    )
    command.add_argument(
        "--columns", type=values.columns, metavar="X,Y,Z",
        help="of text, the coordinates: names of columns, or numbers from 1 on"
    )  # fmt: skip
    command.add_argument(
        "--trajectory", metavar="FILE",
        help="frames of which the first FILE is the topology, as MDAnalysis reads both"
    )  # fmt: skip
    command.add_argument(
        "--format", metavar="NAME", help="format of ASE or MDAnalysis, if it is not recognised"
    )
    if has_frames:
        command.add_argument(
            "--index", type=values.frames, metavar="N",
            help="frame, or frames to average: : for all, 100:, ::10; default: the last"
        )  # fmt: skip
    else:
        command.add_argument(
            "--index", type=values.frame, metavar="N", help="frame; default: the last"
        )
    if has_rule:
        command.add_argument(
            "--strict", action="store_true", help="d < cutoff; default: d <= cutoff"
        )
    if has_kernel:
        command.add_argument(
            "--kernel", type=values.kernel, metavar="NAME", help="see `halfshell info`"
        )
    command.add_argument("--json", action="store_true", help="print JSON for machines")


def _add_threads(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--threads", type=values.count, metavar="N", help="maximum number; default: as many as pay"
    )


def _add_max_output(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--max-output", type=values.size, metavar="SIZE",
        help="largest output, such as 500MB or 4GB; default: 1GB"
    )  # fmt: skip


def _add_no_progress(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--no-progress", dest="progress", action="store_false", help="no progress bar"
    )


def _add_pairs(commands: Any) -> None:
    command = commands.add_parser(
        "pairs", help="find the pairs of a file, summarise them, save them, plot g(r)"
    )
    _add_scene_options(command, by_elements=True)
    _add_threads(command)
    command.add_argument(
        "-o", "--output", metavar="OUT",
        help="write the pairs: .npz, .csv, .parquet, or - for CSV on standard output"
    )
    command.add_argument(
        "--quantities",
        type=values.quantities,
        metavar="LETTERS",
        help="columns of OUT, any of i j d D S P; default: ijdS, or ijd without a box",
    )
    command.add_argument("--sort", action="store_true", help="sort OUT by (i, j, S)")
    _add_max_output(command)
    command.add_argument("--plot", metavar="PNG", help="draw g(r): .png, .pdf or .svg")
    command.add_argument(
        "--precision",
        choices=("exact", "double", "single"),
        default="exact",
        help="how a pair near the cutoff is decided; default: exact",
    )
    _add_no_progress(command)
    command.set_defaults(run=_later("halfshell._cli.lists", "run_pairs"))


def _add_lists(commands: Any) -> None:
    """Commands that write columns, and sum them up."""
    told = {
        "neighbors": "find all neighbours of each point",
        "coordination": "count the neighbours of each point",
        "nearest": "find the nearest neighbours of each point",
        "rdf": "the radial distribution function g(r), up to the cutoff",
    }
    for name, words in told.items():
        command = commands.add_parser(name, help=words)
        _add_scene_options(
            command, name != "nearest", name in ("neighbors", "coordination"),
            has_frames=name == "rdf", by_elements=name != "rdf",
        )  # fmt: skip
        _add_threads(command)
        command.add_argument(
            "-o", "--output", metavar="OUT", help="write the columns: .npz, .csv, .parquet, or - "
            "for CSV here"
        )  # fmt: skip
        if name != "rdf":
            command.add_argument(
                "--queries", metavar="FILE",
                help="whose neighbours are wanted, in the box of the points; default: the points"
            )  # fmt: skip
        command.set_defaults(run=_later("halfshell._cli.lists", f"run_{name}"))
        if name == "neighbors":
            command.add_argument(
                "--quantities", type=values.quantities, metavar="LETTERS",
                help="columns of OUT, any of i j d D S; default: ijdS, or ijd without a box",
            )  # fmt: skip
            _add_max_output(command)
        if name == "nearest":
            command.add_argument("-k", type=values.count, default=1, help="how many; default: 1")
        if name == "rdf":
            command.add_argument(
                "--bins", type=values.count, default=100, metavar="N", help="default: 100"
            )
            command.add_argument(
                "--density", type=values.number, metavar="RHO",
                help="points per unit of volume, where the box has none or is not the whole",
            )  # fmt: skip
            command.add_argument("--plot", metavar="PNG", help="draw it: .png, .pdf or .svg")
        if name in ("rdf", "coordination"):
            command.add_argument(
                "--by-type", action="store_true", help="of each two elements of the file"
            )


def _add_verify(commands: Any) -> None:
    command = commands.add_parser(
        "verify", help="check a list of pairs, of halfshell or another library, exactly"
    )
    _add_scene_options(command, by_elements=True)
    _add_threads(command)
    command.add_argument(
        "list", nargs="?", metavar="LIST",
        help="a saved list: .csv, .npz, .parquet with columns i and j, or the like, and shifts"
    )  # fmt: skip
    command.add_argument(
        "--against",
        metavar="LIBRARY",
        help="whose list to check: ase, matscipy, matscipy-neighbours, scipy or vesin; "
        "default: our own",
    )
    command.add_argument(
        "--sample",
        type=values.sample,
        metavar="N",
        help="most points to check by integers, 0 for all; default: 400, or what takes seconds",
    )
    _add_no_progress(command)
    command.set_defaults(run=_later("halfshell._cli.verify"))


def _add_measuring(commands: Any) -> None:
    """Commands of `halfshell_report`, which is imported when they are called."""

    def fill_bench(command: argparse.ArgumentParser) -> None:
        from halfshell_report.cli import add_peers

        _add_scene_options(command, has_kernel=False)
        add_peers(command)

    def fill_report(command: argparse.ArgumentParser) -> None:
        from halfshell_report.cli import add_options

        add_options(command)

    bench = commands.add_parser(
        "bench", help="run times on a file, ours and other libraries', whose answers come first",
        fill=fill_bench,
    )  # fmt: skip
    bench.set_defaults(run=_later("halfshell_report.cli", "run_bench"))
    report = commands.add_parser(
        "report", help="error against run time, of halfshell and other libraries, on hard scenes",
        fill=fill_report,
    )  # fmt: skip
    report.set_defaults(run=_later("halfshell_report.cli"))


# Commands ----------------------------------------------------------------------------------


def _later(module: str, name: str = "run") -> Callable[[argparse.Namespace], int]:
    """What carries out a command: a function that is imported when it is called."""

    def run(args: argparse.Namespace) -> int:
        return int(getattr(import_module(module), name)(args))

    return run


def _run_info(args: argparse.Namespace) -> int:
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
