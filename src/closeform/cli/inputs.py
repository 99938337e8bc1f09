"""Inputs of the commands: scenarios, a case of a study, ephemerides and quantities, with their errors."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from closeform.cli.console import complain

if TYPE_CHECKING:
    from closeform.exchange.common_frame import CommonFrame
    from closeform.scenario import Scenario
    from closeform.scenario.quantity import Kind


CLEAR, BAD_INPUT = 0, 2  # exit status; 1 stands for requirements that are not met


class UsageError(ValueError):
    """Invalid argument; the message is one line with the remedy."""


def read(file: Path, command: str) -> "Scenario | None":
    """Return the scenario of a file for a command, or None after printing all of its errors."""
    from closeform.scenario import ScenarioError, parse, text_of

    try:
        text = text_of(file)
        scenario = parse(text, str(file))
    except ScenarioError as error:
        complain(*error.lines)
        return None
    complain(*(f"{file}: warning: {line}" for line in scenario.doubts))
    if command != "check":  # `check` needs only three small kernels
        from closeform._jit import compile_ahead
        from closeform.cli.needed_kernels import modules_for

        compile_ahead(modules_for(scenario), complain)
    return scenario


def quantity(option: str, kind: "Kind", text: str | None) -> float | None:
    """Return the positive number in SI units that an option states with its unit; None without a text."""
    from closeform.scenario.quantity import Reader

    if text is None:
        return None
    try:
        return Reader(kind, least="positive").numbers(text)[0]
    except ValueError as error:
        raise UsageError(f"--{option}: {error}") from None


def check_present(*files: Path) -> None:
    """Raise UsageError if a file does not exist."""
    if missing := next((file for file in files if not os.path.exists(file)), None):
        raise UsageError(f"{missing}: no such file; check the path")


def ephemerides(files: Sequence[Path], interpolate: float | None = None) -> "CommonFrame":
    """Return the ephemerides of two or more files in a common frame.

    `interpolate` [m] is the largest accepted error of states that are interpolated to common epochs.
    """
    if len(files) < 2:
        raise UsageError("screen: needs two ephemerides or more; name another file")
    check_present(*files)
    from closeform.exchange.ccsds.oem import read_oem_segments
    from closeform.exchange.common_frame import common_frame

    try:
        return common_frame([read_oem_segments(file) for file in files], interpolate=interpolate)
    except ValueError as error:
        raise UsageError(str(error)) from None


def one_case(scenario: "Scenario", case: int | None, point: int | None = None) -> "Scenario | None":
    """Return the scenario with the sampled values of one case of its study, or as it is without a case.

    `point` selects a point of the study's sweep.  Return None after printing why the scenario, or this case,
    cannot be run.
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
