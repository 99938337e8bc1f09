"""What a command is given: scenarios, a case of a study, ephemerides; what is said where it does not fit."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from closeform.cli.console import complain

if TYPE_CHECKING:
    from closeform.exchange.common_frame import CommonFrame
    from closeform.scenario import Scenario
    from closeform.scenario.quantity import Kind


CLEAR, BAD_INPUT = 0, 2  # exit status; 1 is of what was asked for and is not met


class UsageError(ValueError):
    """An argument that does not fit; one line with the remedy."""


def read(file: Path, command: str) -> "Scenario | None":
    """The scenario for a command, or None after saying everything that is wrong with it."""
    from closeform.scenario import ScenarioError, parse, text_of

    try:
        text = text_of(file)
        scenario = parse(text, str(file), command)
    except ScenarioError as error:
        complain(*error.lines)
        return None
    complain(*(f"{file}: warning: {line}" for line in scenario.doubts))
    if command != "check":  # which needs three small kernels
        from closeform._jit import compile_ahead
        from closeform.cli.needed_kernels import modules_for

        compile_ahead(modules_for(scenario), complain)
    return scenario


def quantity(option: str, kind: "Kind", text: str | None) -> float | None:
    """A positive number in SI that an option gives with its unit."""
    from closeform.scenario.quantity import Reader

    if text is None:
        return None
    try:
        return Reader(kind, least="positive").numbers(text)[0]
    except ValueError as error:
        raise UsageError(f"--{option}: {error}") from None


def check_present(*files: Path) -> None:
    """Refuse a file that is not there."""
    if missing := next((file for file in files if not os.path.exists(file)), None):
        raise UsageError(f"{missing}: no such file; check the path")


def ephemerides(files: Sequence[Path], interpolate: float | None = None) -> "CommonFrame":
    """What ephemeris files say, in a common frame."""
    if len(files) < 2:
        raise UsageError("screen: needs two ephemerides or more; name another file")
    check_present(*files)
    from closeform.exchange.common_frame import common_frame
    from closeform.exchange.oem import read_oem_segments

    try:
        return common_frame([read_oem_segments(file) for file in files], interpolate=interpolate)
    except ValueError as error:
        raise UsageError(str(error)) from None


def one_case(scenario: "Scenario", case: int | None, point: int | None = None) -> "Scenario | None":
    """The scenario with what one case of its study draws, or as it is where none was asked for.

    Of a sweep at one of its points.

    None after saying why there is no such case, or why it cannot be flown.
    """
    if point is not None:
        if not 0 <= point < len(scenario.points):
            last = f"points 0 to {len(scenario.points) - 1}" if scenario.points else "no [study.sweep]"
            raise UsageError(f"--point: {scenario.file} has {last}, got {point}; give one of them, or none")
        scenario = scenario.points[point]
    if case is not None:
        from closeform.campaign import case_of
        from closeform.campaign.campaign import MOST_CASES
        from closeform.scenario import ScenarioError

        if case >= MOST_CASES:
            last = f"{MOST_CASES - 1}, the last case that a study can have"
            raise UsageError(f"--case: {case} is above {last}; give a lower one")
        try:
            return case_of(scenario, case)
        except ScenarioError as error:
            complain(*error.lines)
            return None
        except ValueError as error:
            raise UsageError(f"--case: {error}") from None
    if lines := scenario.refused("run"):
        complain(*(f"{scenario.file}: {line}" for line in lines))
        return None
    return scenario
