"""Compares what the docs show as printed with what is printed."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e-?\d+)?")
SHARE = 0.5
"""Fraction by which a number may differ: other processors round otherwise, and so go whole runs."""


def shown_lines(page):
    """Returns the lines of a page's blocks of output that have numbers."""
    blocks = re.findall(
        r"^```text\n(.*?)^```$", (ROOT / page).read_text(), re.DOTALL | re.MULTILINE
    )
    return [line for line in "".join(blocks).splitlines() if re.search(r"\d", line)]


def is_as_shown(shown, printed):
    """Tells whether a line is printed as shown: the same words, numbers alike.

    Times in ms are the machine's, and not compared.
    """
    if NUMBER.sub("#", shown).split() != NUMBER.sub("#", printed).split():
        return False
    pairs = zip(NUMBER.finditer(shown), NUMBER.findall(printed), strict=True)
    return all(
        is_like(one[0], other) or shown[one.end() :].startswith(" ms") for one, other in pairs
    )


def is_like(shown, printed):
    """Tells whether a number differs by no more than `SHARE`, or by one in its last digit."""
    digits = re.sub(r"e.*", "", shown).partition(".")[2]
    last = 10.0 ** -len(digits) * (float(f"1e{shown.partition('e')[2]}") if "e" in shown else 1.0)
    return abs(float(shown) - float(printed)) <= max(SHARE * abs(float(shown)), 1.01 * last)


def missing(shown, output):
    """Returns the shown lines that an output does not have."""
    printed = output.splitlines()
    return [line for line in shown if not any(is_as_shown(line, one) for one in printed)]
