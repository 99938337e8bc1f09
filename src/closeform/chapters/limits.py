"""How near craft come to what they have: thrust, delta-v, propellant."""

from collections.abc import Iterator

from closeform.mission import Mission


def strained(mission: Mission, place: int) -> tuple[str, ...]:
    """Who uses most of the limits in the leg at a `place`, and of what is on board up to its end."""
    lines = {"At most": ", ".join(thrusts(mission, place))}
    if not mission.legs[place].flown:
        lines = {"The direct paths would need": lines["At most"]}
    else:
        lines["So far at most"] = ", ".join(spendings(mission, place))
    return tuple(f"{title}: {line}" for title, line in lines.items() if line)


def thrusts(mission: Mission, place: int) -> Iterator[str]:
    """The greatest share of a thrust limit."""
    peaks = mission.legs[place].after.paths.peak_thrust
    limits = [
        (peak * craft.mass, craft.max_thrust, craft.name)
        for craft, peak in zip(mission.scenario.craft, peaks.tolist(), strict=True)
        if craft.max_thrust is not None and craft.mass is not None
    ]
    yield from most("thrust", limits, "N")


def spendings(mission: Mission, place: int) -> Iterator[str]:
    """The greatest shares of what is on board, over all legs so far."""
    for what, spent, key, unit in (
        ("delta-v", mission.delta_v, "delta_v_budget", "m/s"),
        ("propellant", mission.propellant, "propellant", "kg"),
    ):
        total = spent[: place + 1].sum(axis=0).tolist()
        limits = [
            (used, has, craft.name)
            for craft, used in zip(mission.scenario.craft, total, strict=True)
            if (has := getattr(craft, key)) is not None
        ]
        yield from most(what, limits, unit)


def most(what: str, limits: list[tuple[float, float, str]], unit: str) -> Iterator[str]:
    """What is used, the limit and the name of the greatest share; nothing where nobody uses any."""
    used, has, name = max(limits, key=lambda one: one[0] / one[1], default=(0.0, 1.0, ""))
    if used > 0.0:
        yield f"{what} {used:.4g} of {has:g} {unit} ({name})"
