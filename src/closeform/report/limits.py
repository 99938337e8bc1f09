"""How near craft come to what they have: thrust, delta-v, propellant."""

from collections.abc import Iterable
from typing import Any

from closeform.mission_result import Mission, StageResult
from closeform.verdict import Use


def greatest(mission: Mission, result: StageResult[Any, Any]) -> dict[str, tuple[Use, ...]]:
    """Who uses the greatest share of each kind of limit: in this stage, and in all up to its end if flown."""
    if not result.flown:
        return {"The direct paths would need": first_of_each(mission.thrusts(result))}
    return {
        "At most": first_of_each(mission.thrusts(result)),
        "So far at most": first_of_each(mission.spent(slice(result.number))),
    }


def first_of_each(uses: Iterable[Use]) -> tuple[Use, ...]:
    """The greatest share of each kind of limit; none where nobody uses anything."""
    found: dict[str, Use] = {}
    for use in uses:
        if use.used > 0.0 and use.share > (found[use.what].share if use.what in found else 0.0):
            found[use.what] = use
    return tuple(found.values())


def lines(mission: Mission, result: StageResult[Any, Any]) -> tuple[str, ...]:
    """The same in words."""
    return tuple(
        f"{title}: "
        + ", ".join(f"{use.what} {use.used:.4g} of {use.limit:g} {use.unit} ({use.craft})" for use in uses)
        for title, uses in greatest(mission, result).items()
        if uses
    )


def figures(mission: Mission, result: StageResult[Any, Any]) -> dict[str, Any]:
    """The same for `summary.json`."""
    found = {
        f"{use.what}_{use.unit}".replace("-", "_").replace("/", "_"): {
            "craft": use.craft,
            "used": use.used,
            "limit": use.limit,
        }
        for uses in greatest(mission, result).values()
        for use in uses
    }
    return {"limits": found} if found else {}
