"""Random samples of a study: each varied key has its own stream (`uncertainty.random_streams`).

Craft c of N takes block c of N of its case; a value common to all craft takes block 0 of 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.scenario import Scenario
from closeform.scenario.study import FAILS, SEARCHED, STATES, TABLED, Draw
from closeform.search.search_errors import SearchErrors
from closeform.uncertainty.random_streams import uniform, words


def drawn(scenario: Scenario, seed: int, first: int, last: int) -> Floats:
    """Return states (last - first, N, 6) of the craft in the cases from `first` to `last`, exclusive."""
    nominal = scenario.states(scenario.orbit.build())
    states = np.repeat(nominal[None], last - first, axis=0)
    for key, draw in varied(scenario).items():
        if key in STATES:
            random = uniform(seed, key, len(nominal), first, last)
            part = states[..., 3 * STATES.index(key) :][..., :3]
            values = spread(draw, draw.numbers(key), random, 3)
            part[...] = values if draw.choice is not None else part + values
    return states


def varied(scenario: Scenario) -> dict[str, Draw]:
    """Return the distributions of a scenario's study, by key."""
    return scenario.study.vary if scenario.study is not None else {}


def values(scenario: Scenario, seed: int, key: str, first: int, last: int) -> Any:
    """Return the values of a key in the given cases: (C, N), vectors (C, N, 3).

    Tables common to all craft give (C, 1). State keys are sampled by `drawn`.
    """
    given = np.array(scenario.given(key))
    count, size = 1 if key.startswith(TABLED) else len(scenario.craft), 3 if given.ndim > 1 else 1
    draw = varied(scenario).get(key)
    if draw is None:
        return np.broadcast_to(given, (last - first, count, *given.shape[1:]))
    random = uniform(seed, key, count, first, last)
    found = spread(draw, draw.numbers(key), random, size)
    return found if draw.choice is not None or draw.chance is not None else given + found


def searching(scenario: Scenario, seed: int, first: int, last: int) -> SearchErrors | None:
    """Return the search errors (C, N) of the craft in cases `first` to `last`; None if no craft has any."""
    keys = varied(scenario)
    if scenario.sensor is None or scenario.search is None:
        return None
    if not any(craft.astray for craft in scenario.craft) and not {*SEARCHED} & {*keys}:
        return None

    def of(key: str) -> Any:
        return values(scenario, seed, key, first, last)

    pace = of("search.slew_rate") / scenario.search.slew_rate
    ranged = scenario.sensor.range is not None or "sensor.range" in keys
    return SearchErrors(
        of("craft.pointing_error"),
        (1.0 + of("craft.slew_rate_error")) * pace - 1.0,
        of("craft.start_offset"),
        of("sensor.half_angle") - scenario.sensor.half_angle,
        of("sensor.range") if ranged else None,
        of("craft.slew_acceleration") if "craft.slew_acceleration" in keys else scenario.ramps,
        of("craft.silent") if "craft.silent" in keys else scenario.silent,
        of("craft.solar_acceleration"),
        scenario.outages,
    )


def failures(scenario: Scenario, seed: int, first: int, last: int) -> Floats:
    """Return the fraction of the mission after which each craft loses thrust (C, N); nan if it does not."""
    draw = varied(scenario)[FAILS]
    random = uniform(seed, FAILS, len(scenario.craft), first, last)
    lost = spread(draw, draw.numbers(FAILS), random, 1)
    return np.where(lost, random[..., 1], np.nan)


def failing(scenario: Scenario, seed: int, case: int) -> tuple[float, ...]:
    """Return the fractions (N,) of `failures` for one case; empty if the study does not vary them."""
    return tuple(failures(scenario, seed, case, case + 1)[0]) if FAILS in varied(scenario) else ()


def lost_by(name: str) -> str:
    """Return the name of the column with the time at which a craft loses its thrust."""
    return f"{name}_fails_s"


def flight_seed(seed: int, case: int) -> int:
    """Return the seed of the simulation of a case: 53 bits of its random block."""
    return int(words(seed, "flight", 1, case, case + 1)[0, 0, 0])


def spread(draw: Draw, numbers: tuple[Any, ...], random: Floats, size: int) -> Any:
    """Return samples (...) or vectors (..., 3), by `size`, of a distribution from random numbers (..., 4)."""
    some = random[..., 0] if size == 1 else random[..., :3]
    if draw.chance is not None:
        return random[..., 0] < numbers[0]
    if draw.choice is not None:
        return np.asarray(np.array(numbers)[(random[..., 0] * len(numbers)).astype(int)])
    if draw.uniform is not None:
        return np.asarray(numbers[0] * (2.0 * some - 1.0))
    if draw.normal is not None:
        from scipy.special import ndtri  # imported late: slow to import

        return np.asarray(numbers[0] * ndtri(some))
    inner, outer = numbers if draw.shell is not None else (0.0, numbers[0])
    radius = np.cbrt(inner**3 + (outer**3 - inner**3) * random[..., 0]).clip(inner, outer)
    height, longitude = 2.0 * random[..., 1] - 1.0, 2.0 * np.pi * random[..., 2]
    across = np.sqrt(1.0 - height * height)
    direction = np.stack([across * np.cos(longitude), across * np.sin(longitude), height], axis=-1)
    return np.asarray(radius[..., None] * direction)
