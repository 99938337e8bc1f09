"""Draws: the initial states of a study's cases, the same for case K whichever range it is drawn in.

Each varied key has its own stream of random numbers, a Philox generator keyed by the seed and the
key's name; craft c of N in case K takes the block of counter K N + c from it.  So a case depends
neither on other cases nor on other keys.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import ndtri

from closeform.arrays import Floats
from closeform.scenario import Scenario, ScenarioError
from closeform.scenario.study import Draw

PARTS = {"craft.position": slice(0, 3), "craft.velocity": slice(3, 6)}  # of a state
WORDS = 4  # random numbers in one block of Philox


def drawn(scenario: Scenario, seed: int, first: int, last: int) -> Floats:
    """States (last - first, N, 6) of the craft in the cases from `first` to `last`, without that one."""
    nominal = scenario.states(scenario.orbit.build())
    states = np.repeat(nominal[None], last - first, axis=0)
    for key, draw in (scenario.study.vary if scenario.study is not None else {}).items():
        random = uniform(seed, key, len(nominal), first, last)
        values = spread(draw, draw.numbers(key), random)
        part = states[..., PARTS[key]]
        part[...] = values if draw.choice is not None else part + values
    return states


def uniform(seed: int, key: str, blocks: int, first: int, last: int) -> Floats:
    """Random numbers (last - first, blocks, 4) above 0 and below 1, of a key in some cases."""
    stream = np.random.SeedSequence(seed, spawn_key=tuple(key.encode()))
    philox = np.random.Philox(key=stream.generate_state(2, np.uint64), counter=first * blocks)
    words = philox.random_raw((last - first) * blocks * WORDS).reshape(last - first, blocks, WORDS)
    return np.asarray(((words >> np.uint64(11)) + 0.5) * 2.0**-53)


def spread(draw: Draw, numbers: tuple[Any, ...], random: Floats) -> Floats:
    """Vectors (..., 3) of a distribution from random numbers (..., 4)."""
    if draw.choice is not None:
        return np.asarray(np.array(numbers)[(random[..., 0] * len(numbers)).astype(int)])
    if draw.uniform is not None:
        return np.asarray(numbers[0] * (2.0 * random[..., :3] - 1.0))
    if draw.normal is not None:
        return np.asarray(numbers[0] * ndtri(random[..., :3]))
    inner, outer = numbers if draw.shell is not None else (0.0, numbers[0])
    radius = np.cbrt(inner**3 + (outer**3 - inner**3) * random[..., 0])
    height, longitude = 2.0 * random[..., 1] - 1.0, 2.0 * np.pi * random[..., 2]
    across = np.sqrt(1.0 - height * height)
    direction = np.stack([across * np.cos(longitude), across * np.sin(longitude), height], axis=-1)
    return np.asarray(radius[..., None] * direction)


def case_of(scenario: Scenario, case: int) -> Scenario:
    """The scenario with the states that the craft have in one `case` of its study, by the file's seed.

    Raises ScenarioError for what is not built, or craft at one place in that case, and
    ValueError for a scenario without a study or a case below 0.
    """
    if scenario.study is None:
        raise ValueError(f"{scenario.file} has no cases; add a [study] table, or leave the case out")
    if case < 0:
        raise ValueError(f"{case} is negative, cases count from 0; give 0 or more")
    if scenario.study.draws == "errors":
        raise ValueError(f"{scenario.file} draws errors, whose cases only a study flies; leave the case out")
    if lines := scenario.refused("run --case"):
        raise ScenarioError(scenario.file, lines)
    states = drawn(scenario, scenario.study.seed, case, case + 1)[0].tolist()
    craft = tuple(
        one.model_copy(
            update={"start": None, "states": None, "position": tuple(state[:3]), "velocity": tuple(state[3:])}
        )
        for one, state in zip(scenario.craft, states, strict=True)
    )
    found = replace(scenario, title=f"{scenario.title}: case {case}", craft=craft, case=case)
    if lines := found.coincident():
        raise ScenarioError(scenario.file, lines)
    return found
