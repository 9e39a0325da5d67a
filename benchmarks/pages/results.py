# SPDX-License-Identifier: BSD-3-Clause
"""Reading a result file back: the same rows that `report.write_csv` wrote."""

from __future__ import annotations

import csv
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from pages.report import OURS, Measurement

__all__ = ["Row", "is_ours", "is_reference", "read_csv"]

# What plain numbers are compared with that are not searches: they show the machine.
_REFERENCES = ("writing the output", "rewriting the output")


@dataclass(frozen=True)
class Row:
    """One line of a result file: what was measured, where and with which kernel."""

    facts: dict[str, str]
    one: Measurement

    @property
    def kernel(self) -> str:
        """The kernel that our calls used."""
        return self.facts.get("kernel", "")


def is_ours(contestant: str) -> bool:
    """Whether a row is of our own search, a variant of it included."""
    return contestant.startswith(OURS) and not is_reference(contestant)


def is_reference(contestant: str) -> bool:
    """Whether a row is the time to write memory, which no search can beat."""
    return any(contestant == f"{OURS} [{name}]" for name in _REFERENCES)


def _value(text: str, kind: str) -> Any:
    """Read a cell as the type of its field."""
    if "None" in kind and text == "":
        return None
    if kind == "bool":
        return text == "True"
    if kind == "int":
        return int(text)
    if kind.startswith("float"):
        return float(text)
    return text


def read_csv(path: Path) -> list[Row]:
    """Read every row. Raises ValueError where a column is missing or a cell is no number."""
    kinds = {field.name: str(field.type) for field in fields(Measurement)}
    rows = []
    with path.open(newline="", encoding="utf-8") as file:
        for number, line in enumerate(csv.DictReader(file), start=2):
            lacking = [name for name in kinds if line.get(name) is None]
            if lacking:
                raise ValueError(f"{path}, line {number}: no column {', '.join(lacking)}")
            try:
                values = {name: _value(line[name], kind) for name, kind in kinds.items()}
            except ValueError as error:
                raise ValueError(f"{path}, line {number}: {error}") from error
            facts = {key: text for key, text in line.items() if key not in kinds}
            rows.append(Row(facts, Measurement(**values)))
    return rows
