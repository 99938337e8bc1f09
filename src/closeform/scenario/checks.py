"""What must fit together between the tables of a scenario."""

from collections.abc import Iterator
from math import nan

import numpy as np

from closeform.orbit import Orbit
from closeform.scenario.craft import SearchTable, SensorTable
from closeform.scenario.errors import did_you_mean, dotted
from closeform.scenario.scenario import Scenario
from closeform.scenario.stages import Gather
from closeform.scenario.study import draw_error, readers
from closeform.search.rounds import MOST_ROUNDS, all_rounds

MOST_SAMPLES = 1e7


def check(scenario: Scenario) -> list[str]:
    """Every disagreement between tables that are each valid, one line for each."""
    lines = [*duplicates(scenario), *stages(scenario), *study(scenario)]
    if scenario.orbit.deep_space is None:
        try:
            orbit = scenario.orbit.build()
        except ValueError as error:
            return [*lines, f"orbit: {error}; check its numbers"]
        if not orbit.mean_motion > 0.0:
            return [*lines, "orbit: so wide that nothing turns; write deep_space = true instead"]
    else:
        orbit = scenario.orbit.build()
        lines += deep_space(scenario)
    return lines or list(zones(scenario, orbit))


def duplicates(scenario: Scenario) -> Iterator[str]:
    """Names that two craft or two stages share."""
    for key, names in (
        ("craft.name", list(scenario.names)),
        ("stage.name", [stage.name for stage in scenario.stages if stage.name is not None]),
    ):
        for name in dict.fromkeys(names):
            if names.count(name) > 1:
                yield f"{key}: {name} is given {names.count(name)} times; name each one differently"


def stages(scenario: Scenario) -> Iterator[str]:
    """Stages that name what is not there or need a table that is missing."""
    earlier: list[str] = []
    for number, stage in enumerate(scenario.stages, 1):
        for key, names in stage.craft_named.items():
            for name in names:
                if name not in scenario.names:
                    yield f"stage[{number}].{key}: no craft {name}; {did_you_mean(name, scenario.names)}"
        before = getattr(stage, "as_before", None)
        if before is not None and before not in earlier:
            remedy = did_you_mean(before, earlier) if earlier else "give an earlier stage a name"
            yield f"stage[{number}].as_before: no earlier stage {before}; {remedy}"
        earlier += [stage.name] if stage.name else []
        if stage.keeps_out and any(craft.keep_out is None for craft in scenario.craft):
            yield 'craft.keep_out: missing; add for example keep_out = { sphere = "20 m" }'
        if stage.verb == "avoid" and len(scenario.craft) < 2:
            yield f"stage[{number}].do: avoid needs another craft; add one, or coast"
        if stage.searches:
            yield from searching(scenario)


def searching(scenario: Scenario) -> Iterator[str]:
    """What the search for lost craft needs."""
    if scenario.sensor is None:
        yield 'sensor: missing; add [sensor] with half_angle = "70 deg"'
    if scenario.search is None:
        yield 'search: missing; add [search] with method = "modified"'
    groups = [craft.group for craft in scenario.craft]
    if None in groups:
        yield 'craft.group: missing; add for example group = ["A", "B"]'
    elif len(set(groups)) == 1:
        empty = "B" if groups[0] == "A" else "A"
        yield f"craft.group: nobody is in group {empty}, locks are between A and B; put a craft into {empty}"
    if scenario.sensor is not None and scenario.search is not None:
        yield from search(scenario, scenario.sensor, scenario.search)
    if scenario.orbit.deep_space is None:
        yield "orbit: a search is for deep space only; write deep_space = true instead"
    elif not scenario.scattered:
        yield from scenario.coincident()


def search(scenario: Scenario, sensor: SensorTable, table: SearchTable) -> Iterator[str]:
    """What the papers refuse, and samples without number."""
    try:
        plan = table.build(sensor.build())
    except ValueError as error:
        key = str(error).split(":")[0]
        yield f"{'sensor' if key in SensorTable.model_fields else 'search'}.{error}"
        return
    for number, stage in enumerate(scenario.stages, 1):
        if isinstance(stage, Gather):
            try:
                all_rounds(plan, 1, table.max_speed)
            except ValueError as error:
                yield f"search.{error}"
            if stage.rounds > MOST_ROUNDS:
                text = f"{stage.rounds} is above {MOST_ROUNDS}; write for example rounds = 3"
                yield f"stage[{number}].rounds: {text}"
    if (
        scenario.study is not None
        and scenario.study.sampled
        and any(s.verb != "lock" for s in scenario.stages)
    ):
        yield "study.sampled: samples are for stages that lock only; remove sampled"
    for step in scenario.study.sampled if scenario.study is not None else ():
        if plan.duration / step > MOST_SAMPLES:
            yield (
                f"study.sampled: {step:g} s is too short for a search of {plan.duration:g} s; "
                f"at most {MOST_SAMPLES:g} samples"
            )


def deep_space(scenario: Scenario) -> Iterator[str]:
    """What only an orbit gives a meaning."""
    orbital = ("palmer", "projected_circular")
    remedy = "give position and velocity"
    if any(craft.start is not None and craft.start.oem is None for craft in scenario.craft):
        yield f"craft.start: a relative orbit, but deep space has no orbits; {remedy}"
    for number, stage in enumerate(scenario.stages, 1):
        if getattr(stage, "method", None) == "sauter-palmer":
            yield f'stage[{number}].method: sauter-palmer needs an orbit; write method = "exact"'
        for key, duration in stage.durations.items():
            if duration.orbits:
                name = "for" if key == "length" else key
                yield f'stage[{number}].{name}: deep space has no orbits; give a time, for example "30 min"'
        for key, target in stage.targets.items():
            if any(getattr(target, name) is not None for name in orbital):
                yield f"stage[{number}].{key}: a relative orbit, but deep space has no orbits; {remedy}"


def zones(scenario: Scenario, orbit: Orbit) -> Iterator[str]:
    """Pairs without a larger zone, and craft that start inside another's zone."""
    try:
        groups = scenario.zones
    except ValueError as error:
        yield f"craft.keep_out: {error}"
        return
    if scenario.scattered:
        return  # every case has its own positions
    positions = np.array([[nan] * 3 if craft.unbuilt else craft.state(orbit)[:3] for craft in scenario.craft])
    for zone, pairs in groups:
        ratios = zone.norm(positions[pairs[:, 1]] - positions[pairs[:, 0]])
        for (one, other), ratio in zip(pairs[ratios <= 1.0], ratios[ratios <= 1.0], strict=True):
            names = f"{scenario.names[one]} and {scenario.names[other]}"
            yield (
                f"craft.position: {names} start inside each other's zone, at {ratio:.2f} x zone; "
                "move one of them or make keep_out smaller"
            )


def study(scenario: Scenario) -> Iterator[str]:
    """Draws for keys that cannot vary, or of the wrong kind."""
    if scenario.study is None:
        return
    known = readers()
    for key, draw in scenario.study.vary.items():
        place = dotted(("study", "vary", key))
        if key not in known:
            yield f"{place}: cannot vary; {did_you_mean(key, known)}"
        elif wrong := draw_error(key, draw):
            yield f"{place}: {wrong}"
        elif key.startswith(("sensor.", "search.")) and getattr(scenario, key.split(".")[0]) is None:
            yield f"{place}: there is no [{key.split('.')[0]}]; add that table or remove the draw"
