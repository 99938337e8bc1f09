"""Section: the content of a report on one stage, for the terminal, the page and the files."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from textwrap import shorten
from typing import TYPE_CHECKING, Any

from closeform.mission.mission_result import StageResult
from closeform.report.picture import Film, Picture
from closeform.report.table import Table

if TYPE_CHECKING:  # a search does not need these
    from closeform.planning.plan import Avoidance, Plan

REASON = 60  # maximum characters of the reason for a failure, in a picture


@dataclass(frozen=True)
class Section:
    """Section on a stage: `lines`, the `tables` that are shown, `closing` lines and `pictures`.

    `figures` go into `summary.json`; the rows of `files` are appended to the Parquet file of that name.
    """

    title: str
    lines: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    closing: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()
    figures: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, Table] = field(default_factory=dict)


def not_filmed(pictures: Sequence[Picture], count: int) -> tuple[str, ...]:
    """Return a note that an animation is left out, if there are too many spacecraft."""
    films = [picture for picture in pictures if isinstance(picture, Film) and picture.most < count]
    return tuple(
        f"Animation left out: {count} craft, and more than {film.most} are not shown" for film in films
    )


def plan_of(result: StageResult[Any, Any]) -> "Avoidance | Plan | None":
    """Return the avoidance plan of a stage, of one spacecraft or of many; None for any other stage."""
    found: Avoidance | Plan | None = getattr(result.result, "plan", getattr(result.result, "avoidance", None))
    return found


def called(result: StageResult[Any, Any]) -> str:
    """Return the number, the name and the verb of a stage."""
    named = f' "{result.stage.name}"' if result.stage.name else ""
    return f"Stage {result.number}{named}: {result.stage.verb}"


def heading(result: StageResult[Any, Any], who: str = "") -> str:
    """Return the title of a stage; `who` names the spacecraft that move."""
    moving = f", {who}" if who else ""
    return f"{called(result)}{moving}, {result.start:.1f} s to {result.end:.1f} s"


def not_flown(result: StageResult[Any, Any]) -> tuple[str, ...]:
    """Return a line with a short reason why a stage was not executed; the verdict has the full reason."""
    if result.flown or result.failure is None:
        return ()
    plan = plan_of(result)
    why = re.split("[:;]", result.failure)[0] if plan is None or plan.ok else str(plan.status)
    return (f"Not flown: {shorten(why, REASON, placeholder=' …')}",)


def fate(result: StageResult[Any, Any]) -> str:
    """Return the stage of a picture, with the reason if it failed."""
    if result.failure is None:
        return called(result)
    shown = "" if result.flown else "; these are the direct paths, which are not flown"
    why = shorten(re.split("[:;]", result.failure)[0], REASON, placeholder=" …")
    return f"{called(result)} failed: {why}{shown}"
