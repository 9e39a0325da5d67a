# SPDX-License-Identifier: BSD-3-Clause
"""Small changes of C text that a test should notice, for mutants.py.

A change stays within a function's body and outside comments, strings, assertions and the
preprocessor. It keeps the number of lines, so that assertions elsewhere in the file compile to the
same code. It relies on how the files are laid out: braces of functions are in the first column.
"""

import re
from dataclasses import dataclass

OPERATORS = {
    "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==",
    "&&": "||", "||": "&&", "+": "-", "-": "+", "+=": "-=", "-=": "+=",
    "<<": ">>", ">>": "<<",
}  # fmt: skip
WORDS = {
    "true": "false", "false": "true", "hs_larger": "hs_smaller", "hs_smaller": "hs_larger",
    "fmax": "fmin", "fmin": "fmax", "floor": "ceil", "ceil": "floor",
}  # fmt: skip

NOT_CODE = re.compile(r'/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.DOTALL)
LEFT_ALONE = re.compile(r"\b(HS_ASSERT|assert|HS_PREFETCH\w*)\(|^\s*#")
OPERATOR = re.compile(r"(?<= )(<<|>>|[<>=!]=|&&|\|\||[+-]=|[<>+-])(?= |$)")
INTEGER = re.compile(r"(?<![\w.])(\d+)(?=[uU]?(?![\w.]))")
ZERO = re.compile(r"(?<![\w.])0\.0(?![\w.])")
STEP = re.compile(r"(?<=[\w\])])(\+\+|--)|(\+\+|--)(?=\w)")
CONDITION = re.compile(r"\b(if|while) \((.*)\) \{$")
STATUS = re.compile(r"\bstatus = (\w+\(.*\));$")
RETURN = re.compile(r"\breturn (status|\w*status\w*|HS_ERR_\w+);$")
RETURN_CALL = re.compile(r"\breturn (hs_\w+\(.*\));$")
WORD = re.compile(r"\b(" + "|".join(WORDS) + r")\b")
STATEMENT = re.compile(
    r"^\s+(?:\(void\))?(?:\*?[A-Za-z_][\w.\[\]]*(?:->[\w.\[\]]+|\[[^\]]*\])*\s*"
    r"(?:\(|[-+*/|&^]?= |<<= |>>= |\+\+;|--;)|\+\+\w|--\w|break;|continue;)"
)
NO_STATEMENT = re.compile(r"^\s+(if|for|while|switch|return|sizeof|do|else|case|default)\b")


@dataclass(frozen=True)
class Mutation:
    """Characters `start` to `end` of a file's text become `text`."""

    file: str
    line: int
    start: int
    end: int
    text: str
    what: str

    def apply(self, source):
        return source[: self.start] + self.text + source[self.end :]


def masked(source):
    """The source with comments and literals blanked: the same positions, the same lines."""
    return NOT_CODE.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), source)


def functions(source):
    """First and last line of every function's body, from 1."""
    first, found = None, []
    for number, line in enumerate(source.splitlines(), 1):
        if line == "{":
            first = number
        elif line.startswith("}") and first is not None:
            found.append((first, number))
            first = None
    return found


def statement_end(code, start):
    """Position after the semicolon that ends the statement that begins at start; None if a block
    begins first."""
    depth = 0
    for at in range(start, len(code)):
        if code[at] in "([":
            depth += 1
        elif code[at] in ")]":
            depth -= 1
        elif code[at] in "{}" and depth == 0:
            return None
        elif code[at] == ";" and depth == 0:
            return at + 1
    return None


def in_line(line):
    """Changes within one masked line: start, end, new text, name."""
    for found in OPERATOR.finditer(line):
        old = found.group()
        yield (*found.span(), OPERATORS[old], f"{old} -> {OPERATORS[old]}")
    for found in () if line.lstrip().startswith("for (") else STEP.finditer(line):
        new = "--" if found.group() == "++" else "++"
        yield (*found.span(), new, f"{found.group()} -> {new}")
    for found in INTEGER.finditer(line):
        new = str(int(found.group(1)) + 1)
        yield (*found.span(1), new, f"{found.group(1)} -> {new}")
    for found in ZERO.finditer(line):
        yield (*found.span(), "1.0", "0.0 -> 1.0")
    for found in WORD.finditer(line):
        yield (*found.span(), WORDS[found.group()], f"{found.group()} -> {WORDS[found.group()]}")
    found = CONDITION.search(line)
    if found:
        yield (*found.span(2), f"!({found.group(2)})", "condition negated")
    found = STATUS.search(line)
    if found:
        yield (*found.span(1), f"({found.group(1)}, HS_OK)", "status ignored")
    found = RETURN.search(line)
    if found:
        yield (*found.span(1), "HS_OK", f"{found.group(1)} -> HS_OK")
    found = RETURN_CALL.search(line)
    if found:
        yield (*found.span(1), f"({found.group(1)}, 0)", "returned value -> 0")


def mutations(name, source):
    """All mutations of a file's text, in the order of its lines."""
    code = masked(source)
    lines = code.split("\n")
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line) + 1)
    found = []
    for first, last in functions(code):
        skipped_to = 0
        for number in range(first + 1, last):
            line, at = lines[number - 1], starts[number - 1]
            if at < skipped_to:
                continue
            if LEFT_ALONE.search(line) or (line.endswith("\\") and not line.strip("\\ ")):
                skipped_to = statement_end(code, at) or 0
                continue
            for start, end, text, what in in_line(line):
                found.append(Mutation(name, number, at + start, at + end, text, what))
            before = lines[number - 2].rstrip()
            if STATEMENT.match(line) and not NO_STATEMENT.match(line) and before[-1:] in ";{}:":
                end = statement_end(code, at)
                if end is not None:
                    start = at + len(line) - len(line.lstrip())
                    empty = ";" + "\n" * source.count("\n", start, end)
                    found.append(Mutation(name, number, start, end, empty, "statement removed"))
    return found
