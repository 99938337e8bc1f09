"""Words that count craft and thrusters, as arrays do, told as files do: by names, and from 1."""

import re
from collections.abc import Sequence


def named(text: str, names: Sequence[str]) -> str:
    """A text that counts, "craft 0 and 3", with names instead."""

    def called(found: re.Match[str]) -> str:
        return " and ".join(names[int(number)] for number in re.findall(r"\d+", found[0]))

    return re.sub(r"\bcraft \d+(?: and \d+\b)?", called, text)


def as_listed(text: str, names: Sequence[str]) -> str:
    """The same, which counts thrusters from 1, too."""
    return named(re.sub(r"\bthruster (\d+)", lambda one: f"thruster {int(one[1]) + 1}", text), names)
