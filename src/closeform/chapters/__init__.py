"""What a run has to say, the same for the terminal and for `report.html`: a chapter for each stage."""

from dataclasses import replace
from math import pi

from closeform.arrays import Floats
from closeform.chapters.formations import reshaped
from closeform.chapters.gatherings import conflicts_known, gathered
from closeform.chapters.limits import strained
from closeform.chapters.moves import coast, encounters, move, nearest
from closeform.chapters.searches import locked
from closeform.chapters.sheet import Chapter, Sheet, counted
from closeform.mission import Mission
from closeform.search.gathering import Gathering
from closeform.stage_results import Change, FirstLocks, Leg, Reshaping

__all__ = ["Chapter", "Sheet", "chapters", "conflicts_known", "encounters", "nearest", "opening", "verdict"]


def opening(mission: Mission) -> str:
    """One line on who flies where."""
    n = mission.orbit.mean_motion
    where = f"an orbit of {2 * pi / n / 60.0:.2f} min" if n else "deep space"
    craft = counted(len(mission.scenario.craft), "craft", "craft")
    return f"{craft} in {where}, {mission.legs[-1].end if mission.legs else 0.0:.1f} s"


def verdict(mission: Mission) -> str:
    """The last line: clear, or what remains."""
    if mission.stopped is not None:
        return f"stopped in {mission.stopped}"
    remaining = sum(len(leg.after.encounters) for leg in mission.legs)
    if remaining:
        return f"{counted(remaining, 'conflict')} remain{'s' * (remaining == 1)}"
    searched = any(leg.stage.searches for leg in mission.legs)
    watched = any(leg.after.nearest for leg in mission.legs) or not searched
    found = ["nobody is lost"] * searched
    found.append("no conflict remains" if watched else "conflicts were not looked for")
    return f"clear: {', '.join(found)}"


def chapters(mission: Mission) -> tuple[Chapter, ...]:
    """One chapter for each stage flown."""
    written = []
    for place, leg in enumerate(mission.legs):
        found = chapter(leg, mission.propellant[place])
        if leg.deed is not None:
            found = replace(found, closing=found.closing + strained(mission, place))
        written.append(found)
    return tuple(written)


def chapter(leg: Leg, burnt: Floats) -> Chapter:
    """A stage: what it set out with, what it did, what came of it; `burnt` is each craft's propellant."""
    named = f' "{leg.name}"' if leg.name else ""
    deed = leg.deed
    who = f", {movers(deed)}" if isinstance(deed, Change | Reshaping) else ""
    title = f"Stage {leg.number}{named}: {leg.verb}{who}, {leg.start:.1f} s to {leg.end:.1f} s"
    if isinstance(deed, Change):
        return move(title, leg, deed)
    if isinstance(deed, Reshaping):
        return reshaped(title, leg, deed, burnt)
    if isinstance(deed, Gathering):
        return gathered(title, leg, deed)
    if isinstance(deed, FirstLocks):
        return locked(title, leg, deed)
    return coast(title, leg)


def movers(deed: Change | Reshaping) -> str:
    """Who moves."""
    if isinstance(deed, Change):
        return f"{deed.craft} moves"
    return f"{deed.movers[0]} moves" if len(deed.movers) == 1 else f"{len(deed.movers)} craft move"
