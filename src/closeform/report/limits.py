"""How near craft come to what they have: thrust, delta-v, propellant."""

from collections.abc import Iterable
from typing import Any

from closeform.mission_result import Mission, StageResult, Use


def greatest(uses: Iterable[Use]) -> tuple[Use, ...]:
    """Of each kind of limit the use of the greatest share; none where nobody uses anything."""
    found: dict[str, Use] = {}
    for use in uses:
        best = found.get(use.what)
        if use.used > 0.0 and (best is None or use.used / use.limit > best.used / best.limit):
            found[use.what] = use
    return tuple(found.values())


def thrusts(mission: Mission, result: StageResult[Any, Any]) -> tuple[Use, ...]:
    """Who comes closest to its thrust in this stage."""
    return greatest(mission.thrusts(result))


def spent(mission: Mission, result: StageResult[Any, Any]) -> tuple[Use, ...]:
    """Who comes closest to what is on board, up to the end of this stage; none if nobody flies it."""
    return greatest(mission.spent(slice(result.number))) if result.flown else ()


def lines(mission: Mission, result: StageResult[Any, Any]) -> tuple[str, ...]:
    """The same in words."""
    titles = "At most" if result.flown else "The direct paths would need", "So far at most"
    uses = thrusts(mission, result), spent(mission, result)
    told = (
        ", ".join(f"{use.what} {use.used:.4g} of {use.limit:g} {use.unit} ({use.craft})" for use in some)
        for some in uses
    )
    return tuple(f"{title}: {text}" for title, text in zip(titles, told, strict=True) if text)


def figures(mission: Mission, result: StageResult[Any, Any]) -> dict[str, Any]:
    """The same for `summary.json`."""
    found = {
        f"{use.what}_{use.unit}".replace("-", "_").replace("/", "_"): {
            "craft": use.craft,
            "used": use.used,
            "limit": use.limit,
        }
        for use in (*thrusts(mission, result), *spent(mission, result))
    }
    return {"limits": found} if found else {}
