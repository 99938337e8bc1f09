"""Replacement of array indices in messages: spacecraft by names, thrusters by numbers from 1."""

import re
from collections.abc import Sequence


def named(text: str, names: Sequence[str]) -> str:
    """Return a text with names in place of indices, as in "craft 0 and 3"."""

    def called(found: re.Match[str]) -> str:
        return " and ".join(names[int(number)] for number in re.findall(r"\d+", found[0]))

    return re.sub(r"\bcraft \d+(?: and \d+\b)?", called, text)


def as_listed(text: str, names: Sequence[str]) -> str:
    """Return a text with names of spacecraft, and with thrusters numbered from 1."""
    return named(re.sub(r"\bthruster (\d+)", lambda one: f"thruster {int(one[1]) + 1}", text), names)
