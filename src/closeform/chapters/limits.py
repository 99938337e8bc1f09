"""How near craft come to what they have: thrust, delta-v, propellant."""

from collections.abc import Iterator
from dataclasses import dataclass

from closeform.mission import Mission


@dataclass(frozen=True)
class Strain:
    """The craft that uses the greatest share of its limit, both in the `unit`."""

    what: str
    unit: str
    craft: str
    used: float
    limit: float

    def __str__(self) -> str:
        return f"{self.what} {self.used:.4g} of {self.limit:g} {self.unit} ({self.craft})"


def strained(mission: Mission, place: int) -> tuple[str, ...]:
    """Lines on the strains in the leg at a `place`, if any."""
    flown = mission.legs[place].flown
    strains = {
        "At most" if flown else "The direct paths would need": thrusts(mission, place),
        "So far at most": spendings(mission, place),
    }
    lines = {title: ", ".join(map(str, found)) for title, found in strains.items()}
    return tuple(f"{title}: {line}" for title, line in lines.items() if line)


def thrusts(mission: Mission, place: int) -> Iterator[Strain]:
    """Of the thrust in the leg at a `place`."""
    peaks = mission.legs[place].after.paths.peak_thrust
    limits = [
        Strain("thrust", "N", craft.name, peak * craft.mass, craft.max_thrust)
        for craft, peak in zip(mission.scenario.craft, peaks.tolist(), strict=True)
        if craft.max_thrust is not None and craft.mass is not None
    ]
    yield from greatest(limits)


def spendings(mission: Mission, place: int) -> Iterator[Strain]:
    """Of what is on board, from the start to the end of the leg at a `place`; none if nobody flies it."""
    if not mission.legs[place].flown:
        return
    for what, spent, key, unit in (
        ("delta-v", mission.delta_v, "delta_v_budget", "m/s"),
        ("propellant", mission.propellant, "propellant", "kg"),
    ):
        total = spent[: place + 1].sum(axis=0).tolist()
        limits = [
            Strain(what, unit, craft.name, used, has)
            for craft, used in zip(mission.scenario.craft, total, strict=True)
            if (has := getattr(craft, key)) is not None
        ]
        yield from greatest(limits)


def greatest(strains: list[Strain]) -> Iterator[Strain]:
    """The one of the greatest share; none where nobody uses anything."""
    used = [one for one in strains if one.used > 0.0]
    if used:
        yield max(used, key=lambda one: one.used / one.limit)
