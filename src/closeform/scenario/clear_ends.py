"""Checks for craft that start or end inside a keep-out zone, and for pairs without a common zone."""

from collections.abc import Iterator, Sequence

import numpy as np

from closeform.arrays import Floats
from closeform.motion.orbit import Orbit
from closeform.scenario.scenario import Scenario
from closeform.scenario.stages import Gather, Reconfigure
from closeform.zones.combined_zones import REGION
from closeform.zones.pair_zones import PairZones, portions_near
from closeform.zones.shapes import CYLINDER, FACES

MOST_NAMED = 100  # largest number of pairs that are named


def zones(scenario: Scenario, orbit: Orbit) -> Iterator[str]:
    """Yield an error line for each pair without a common zone or with a conflict at the start."""
    try:
        kept = scenario.zones
    except ValueError as error:
        yield f"craft.keep_out: {error}"
        return
    unlike = any(zone.shape in (CYLINDER, FACES) for zone in kept.zones)
    for number, stage in enumerate(scenario.stages, 1):
        if unlike and isinstance(stage, Gather):
            yield (
                f"craft.keep_out: {stage.verb} in stage[{number}] keeps clear of a sphere, box, ellipsoid or "
                "covariance only; give one that holds the others"
            )
    if not scenario.scattered:  # otherwise every case has its own positions
        places = scenario.states(orbit)
        remedy = "move one of them or make keep_out smaller"
        deep, count = inside(places, kept)
        for one, other, ratio in deep:
            names = f"{scenario.names[one]} and {scenario.names[other]}"
            yield f"craft.position: {names} start inside each other's zone, at {ratio}; {remedy}"
        if count > len(deep):
            yield f"craft.position: {count} pairs in all start inside each other's zone; {remedy}"


def inside(states: Floats, kept: PairZones) -> tuple[list[tuple[int, int, str]], int]:
    """Return the first pairs in conflict, each with its clearance ratio as text, and the count of all."""
    found: list[tuple[int, int, str]] = []
    count = 0
    for zone, first, second in portions_near(kept, states[:, :3]):
        ratios = zone._norm(states[first, :3] - states[second, :3])
        deep = np.flatnonzero(ratios <= 1.0)
        count += len(deep)
        for k in deep[: MOST_NAMED - len(found)]:
            one, other = int(first[k]), int(second[k])
            made = "" if (rule := kept.rule(one, other)) == REGION else f" ({rule})"
            found.append((one, other, f"{ratios[k]:.2f} x zone{made}"))
    return found, count


def ends(scenario: Scenario, orbit: Orbit, number: int, stage: Reconfigure) -> Iterator[str]:
    """Yield an error line for each pair in conflict at final states that are known before planning."""
    movers = stage.moving(scenario.names)
    finals = stage.known(orbit, len(movers))
    if finals is None or len(finals) < len(movers):
        return
    own = [scenario.keep_out[scenario.names.index(name)] for name in movers]
    called: Sequence[str] = movers
    if stage.assign:
        # the assignment is open: final states are known only if like craft take all slots
        if len(finals) > len(movers) or len(set(PairZones.of(own, called).kinds.tolist())) > 1:
            return
        called = [f"slot {k}" for k in range(1, len(finals) + 1)]
    deep, count = inside(finals, PairZones.of(own, called))
    remedy = "move them apart or make keep_out smaller"
    for one, other, ratio in deep:
        names = f"{called[one]} and {called[other]}"
        yield f"stage[{number}].to: {names} end inside each other's zone, at {ratio}; {remedy}"
    if count > len(deep):
        yield f"stage[{number}].to: {count} pairs in all end inside each other's zone; {remedy}"
