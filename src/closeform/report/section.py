"""Section: all that a report has to say of one stage, for the terminal, the page and the files."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from textwrap import shorten
from typing import TYPE_CHECKING, Any

from closeform.mission.mission_result import StageResult
from closeform.report.picture import Film, Picture
from closeform.report.table import Table

if TYPE_CHECKING:  # which a search can spare
    from closeform.planning.plan import Avoidance, Plan

REASON = 60  # letters in a picture, of why a stage failed


@dataclass(frozen=True)
class Section:
    """A stage: `lines`, the `tables` that are shown, `closing` lines and `pictures`.

    `figures` go into `summary.json`; the rows of `files` into the Parquet file of that name, below
    those of other stages.
    """

    title: str
    lines: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    closing: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()
    figures: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, Table] = field(default_factory=dict)


def not_filmed(pictures: Sequence[Picture], count: int) -> tuple[str, ...]:
    """That there is no film, since there are too many craft."""
    films = [picture for picture in pictures if isinstance(picture, Film) and picture.most < count]
    return tuple(
        f"Animation left out: {count} craft, and more than {film.most} are not shown" for film in films
    )


def plan_of(result: StageResult[Any, Any]) -> "Avoidance | Plan | None":
    """The plan of a stage that goes around zones, of one craft or of many; None of any other."""
    found: Avoidance | Plan | None = getattr(result.result, "plan", getattr(result.result, "avoidance", None))
    return found


def called(result: StageResult[Any, Any]) -> str:
    """Which stage that is, and what is done in it."""
    named = f' "{result.stage.name}"' if result.stage.name else ""
    return f"Stage {result.number}{named}: {result.stage.verb}"


def heading(result: StageResult[Any, Any], who: str = "") -> str:
    """The title of a stage; `who` moves."""
    moving = f", {who}" if who else ""
    return f"{called(result)}{moving}, {result.start:.1f} s to {result.end:.1f} s"


def not_flown(result: StageResult[Any, Any]) -> tuple[str, ...]:
    """That a stage is not flown, in its first line; all of why stands in the last of the run."""
    if result.flown or result.failure is None:
        return ()
    plan = plan_of(result)
    why = re.split("[:;]", result.failure)[0] if plan is None or plan.ok else str(plan.status)
    return (f"Not flown: {shorten(why, REASON, placeholder=' …')}",)


def fate(result: StageResult[Any, Any]) -> str:
    """Which stage a picture is of, and what has become of it where it failed."""
    if result.failure is None:
        return called(result)
    shown = "" if result.flown else "; these are the direct paths, which are not flown"
    why = shorten(re.split("[:;]", result.failure)[0], REASON, placeholder=" …")
    return f"{called(result)} failed: {why}{shown}"
