# SPDX-License-Identifier: BSD-3-Clause
"""What compiled modules know of halfshell.h, halfshell_nodes.h, halfshell_dynamic.h and
halfshell_capi.h, kept in capi_layout.json: a module that was compiled against an older header must
not misread what a newer core hands out.

    python tests/capi_layout.py            compare
    python tests/capi_layout.py --write    after structs or functions were added, or after
                                           HS_CAPI_VERSION was raised because something changed

Sizes and places of struct members, values of enums, and the order of the functions in the table.
--write refuses to write a change under the same HS_CAPI_VERSION. Until the first release nobody has
compiled anything: delete the file, and it may be written anew.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
CSRC = ROOT / "csrc"
FILE = Path(__file__).with_name("capi_layout.json")
GROWING = {"HS_STATUS_END", "HS_RULE_END"}  # the number of those before it

Layout = dict[str, Any]


def bare(name: str) -> str:
    """The text of a header without its comments."""
    return re.sub(r"/\*.*?\*/", "", (CSRC / name).read_text(), flags=re.DOTALL)


def public() -> str:
    """The text of the public headers without comments."""
    return "".join(map(bare, ("halfshell.h", "halfshell_nodes.h", "halfshell_dynamic.h")))


def structs() -> dict[str, list[str]]:
    """The members of each struct in the public headers."""
    found = {}
    for name, body in re.findall(r"typedef struct (\w+) \{(.*?)\n\}", public(), re.S):
        declarations = re.sub(r"\[\w+\]", "", body).split(";")
        members = [m for text in declarations for m in re.findall(r"(\w+)\s*(?:,|$)", text.strip())]
        found[name] = members
    return found


def constants() -> list[str]:
    """The names of all members of enums in the public headers."""
    bodies = re.findall(r"enum[ \w]*\{(.*?)\}", public(), re.DOTALL)
    return [name for body in bodies for name in re.findall(r"\bHS_\w+", body)]


def declared() -> list[str]:
    """The functions of the public headers, without their prefix, in order."""
    text = re.sub(r"\{[^{}]*\}", "", re.sub(r"^#.*", "", public(), flags=re.MULTILINE))
    return re.findall(r"^(?!typedef)[\w ]+[ *]hs_(\w+)\(", text, re.MULTILINE)


def table() -> list[str]:
    """The functions of the table in halfshell_capi.h, in order."""
    return re.findall(r"\(\*(\w+)\)\(", bare("halfshell_capi.h"))


def version() -> int:
    """HS_CAPI_VERSION."""
    return int(re.search(r"#define HS_CAPI_VERSION (\d+)", bare("halfshell_capi.h"))[1])


def measured() -> Layout:
    """What a compiler says of structs and constants."""
    headers = ('"halfshell_dynamic.h"', '"halfshell_nodes.h"', "<stdio.h>")
    lines = [*(f"#include {header}" for header in headers), "int main(void) {"]
    show = '    printf("%s %lld\\n", "{}", (long long)({}));'
    for name, members in structs().items():
        lines.append(show.format(name, f"sizeof({name})"))
        lines += [show.format(f"{name}.{m}", f"offsetof({name}, {m})") for m in members]
    lines += [show.format(name, name) for name in constants() if name not in GROWING]
    with tempfile.TemporaryDirectory() as folder:
        source, program = Path(folder, "layout.c"), Path(folder, "layout")
        source.write_text("\n".join([*lines, "}", ""]))
        command = [os.environ.get("CC", "cc"), f"-I{CSRC}", str(source), "-o", str(program)]
        subprocess.run(command, check=True)
        output = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout
    return {name: int(value) for name, value in map(str.split, output.splitlines())}


def layout() -> Layout:
    """What is kept."""
    return {"version": version(), "functions": table(), "numbers": measured()}


def read() -> Layout:
    """What was kept."""
    return json.loads(FILE.read_text())


def changes(old: Layout, new: Layout) -> list[str]:
    """What modules that were compiled for the old one would misread."""
    found = [
        f"{name} was {value}, is {new['numbers'].get(name)}"
        for name, value in old["numbers"].items()
        if new["numbers"].get(name) != value
    ]
    if new["functions"][: len(old["functions"])] != old["functions"]:
        found.append("functions of the table were moved or taken away")
    return found


def main(arguments: list[str]) -> int:
    """Compare or write; 1 if there are changes that may not be written, or are not."""
    new, old = layout(), read() if FILE.exists() else None
    if old is not None and old["version"] == new["version"]:
        for change in changes(old, new):
            print(f"{change}: raise HS_CAPI_VERSION")
        if changes(old, new):
            return 1
    if arguments == ["--write"]:
        FILE.write_text(json.dumps(new, indent=1) + "\n")
    elif old != new:
        print("tests/capi_layout.json is not up to date: python tests/capi_layout.py --write")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
