"""Consistency checks between the tables of a scenario."""

from collections import Counter
from collections.abc import Iterator
from math import hypot, inf, pi
from operator import attrgetter
from typing import Any

import numpy as np

from closeform.motion.duration import MOST_TURNS, flaw
from closeform.motion.orbit import Orbit
from closeform.safety.failures import ThrustLost
from closeform.scenario.craft import MOST_TURN, Craft, SensorTable
from closeform.scenario.formation import Goal
from closeform.scenario.quantity import Reader, shown
from closeform.scenario.scenario import Scenario
from closeform.scenario.stages import (
    Avoid,
    Coast,
    Drifting,
    Gather,
    Joint,
    Reconfigure,
    Regather,
    Scatter,
    StageTable,
    Thrusting,
    Transfer,
)
from closeform.scenario.study import FAILS, NORMAL_REACH, TABLED, Draw, draw_error, readers
from closeform.scenario.table import alike, did_you_mean, dotted
from closeform.search.repeated_search import MOST_ROUNDS, repeated_search
from closeform.zones.combined_zones import REGION
from closeform.zones.pair_zones import portions_near
from closeform.zones.shapes import CYLINDER, FACES


def check(scenario: Scenario) -> list[str]:
    """Return one line for each disagreement between tables.

    Later checks rely on earlier ones, and run only if these find nothing.
    """
    lines = [*duplicate_names(scenario)] or [
        line
        for rule in (
            stage_errors,
            zero_covariances,
            search_errors,
            coincident_starts,
            in_flight,
            draw_errors,
            field_errors,
            drag_errors,
            hill_only_errors,
        )
        for line in rule(scenario)
    ]
    if lines:
        return lines
    try:
        orbit = scenario.orbit.build()
    except ValueError as error:
        return [f"orbit: {error}; check its numbers"]
    if scenario.orbit.deep_space is None and orbit.period == inf:
        return ["orbit: too wide; write deep_space = true instead"]
    return [*orbit_errors(scenario), *duration_errors(scenario, orbit)] or [
        *zone_conflicts(scenario, orbit),
        *navigation_errors(scenario, orbit),
    ]


def coincident_starts(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each craft of a search at the position of another."""
    if any(stage.searches for stage in scenario.stages) and not scenario.scattered:
        yield from scenario.coincident()


def duplicate_names(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each name that two craft or two stages share."""
    for key, names in (
        ("craft.name", list(scenario.names)),
        ("stage.name", [stage.name for stage in scenario.stages if stage.name is not None]),
    ):
        for name, count in Counter(names).items():
            if count > 1:
                yield f"{key}: {name} is given {count} times; name each one differently"


def stage_errors(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each stage that names an absent object or lacks a table."""
    earlier: list[str] = []
    for number, stage in enumerate(scenario.stages, 1):
        for key, names in stage.craft_named.items():
            for name in names:
                if name not in scenario.names:
                    yield f"stage[{number}].{key}: no craft {name}; {did_you_mean(name, scenario.names)}"
        if isinstance(stage, Coast):
            yield from follow_errors(scenario, number, stage)
        if isinstance(stage, Regather):
            yield from regather_errors(scenario, number, stage.as_before, earlier)
        earlier += [stage.name] if stage.name else []
        if isinstance(stage, Joint):
            yield from joint_errors(scenario, number, stage)
        if isinstance(stage, Transfer) and stage.craft is None and len(scenario.craft) > 1:
            line = "missing; name the craft that moves"
            yield f'stage[{number}].craft: {line}, for example "{scenario.names[0]}"'
        if isinstance(stage, Avoid | Joint | Transfer):
            yield from stage_engine_errors(scenario, number, stage)
            yield from missing_periods(scenario, number, stage)
            if any(isinstance(later, Gather) and not later.again for later in scenario.stages[number:]):
                yield (
                    f"stage[{number}].do: {stage.verb} needs craft that were found; put it after the gather, "
                    "or write again = true in a gather after a fault"
                )
        if isinstance(stage, Drifting) and stage.drift is not None:
            yield from passive_safety_errors(scenario, number, stage)
        beside = stage.keeps_out and len(scenario.craft) > 1
        if (beside or getattr(stage, "drift", None) is not None) and None in scenario.keep_out:
            yield f"craft.keep_out: {Craft.missing('keep_out')}"
        yield from uncertainty_errors(scenario, number, stage)
        if stage.verb == "avoid" and len(scenario.craft) < 2:
            yield f"stage[{number}].do: avoid needs another craft; add one, or coast"
        yield from missing_engines(scenario, number, stage)
        if stage.searches:
            yield from missing_search_tables(scenario)


def follow_errors(scenario: Scenario, number: int, stage: Coast) -> Iterator[str]:
    """Yield an error line for each craft that cannot follow the file of its start."""
    key = f"stage[{number}].follow"
    for name in stage.follow:
        if name not in scenario.names:
            yield f"{key}: no craft {name}; {did_you_mean(name, scenario.names)}"
            continue
        craft = scenario.craft[scenario.names.index(name)]
        if craft.states is None and (craft.start is None or craft.start.oem is None):
            remedy = f'give it start = {{ oem = "{name}.oem" }} or states = "states.csv"'
            yield f"{key}: {name} has no file to follow; {remedy}"
    if stage.follow and scenario.orbit.field is not None:
        yield f"{key}: cannot be combined with orbit.field; remove one of them"
    if stage.follow and scenario.study is not None and scenario.study.draws != "errors":
        yield f'{key}: a study displaces the craft from their files; write draws = "errors", or remove follow'


def missing_engines(scenario: Scenario, number: int, stage: StageTable) -> Iterator[str]:
    """Yield an error line for each stage that moves a craft without an engine."""
    idle = [craft.name for craft in scenario.craft if not craft.engine]
    named = {key: names for key, names in stage.craft_named.items() if key != "order"}
    for key, names in named.items():
        for name in names:
            if name in idle:
                yield f"stage[{number}].{key}: {name} has no engine; name another craft, or remove engine"
    if not idle or named or not isinstance(stage, Joint | Transfer | Gather):
        return
    if isinstance(stage, Reconfigure):
        others = ", ".join(f'"{name}"' for name in scenario.names if name not in idle)
        lacks = f"missing, and {idle[0]} has no engine"
        yield f"stage[{number}].craft: {lacks}; name the craft that move, for example craft = [{others}]"
        return
    remedy = "use reconfigure with craft" if isinstance(stage, Scatter | Regather) else "remove engine"
    yield f"stage[{number}].do: {stage.verb} moves all craft, and {idle[0]} has no engine; {remedy}"


def zero_covariances(scenario: Scenario) -> Iterator[str]:
    """Yield an error line if all given covariances are zero."""
    given = [craft.covariance for craft in scenario.craft if craft.covariance is not None]
    if given and all(one.exact for one in given):
        yield (
            "craft.covariance: is zero, so that the state is known exactly; "
            'give for example position = "3 6 3 m", or remove it'
        )


def missing_periods(scenario: Scenario, number: int, stage: Avoid | Joint | Transfer) -> Iterator[str]:
    """Yield an error line if thrusters without a firing period must realize continuous thrust."""
    each = scenario.craft_in(stage)
    endless = any(craft.thrusters is not None and craft.period is None for craft in each)
    if endless and stage.cost == "energy":
        section = "craft" if stage.thrusters is None else f"stage[{number}]"
        yield (
            f"{section}.period: missing, and on-off thrusters need it to realize continuous thrust; "
            'add for example period = "30 s", or write cost = "delta-v" in the stage'
        )


def stage_engine_errors(scenario: Scenario, number: int, stage: Thrusting) -> Iterator[str]:
    """Yield an error line for each engine key that requires a missing mass, thrust or exhaust speed."""
    for craft in scenario.craft if stage.given_keys else ():
        if craft.name not in stage.moving(scenario.names):
            continue
        known = {*craft.unfit()}
        for line in craft.using(stage).unfit():
            if line not in known:
                key, _, wrong = line.partition(" ")
                yield f"stage[{number}].{key}: {wrong}{' to [craft]' if ' mass = ' in wrong else ''}"
        if stage.specific_impulse is not None and craft.specific_impulse is None:
            yield (
                f"stage[{number}].specific_impulse: replaces that of [craft], which has none; "
                'add for example specific_impulse = "220 s" there'
            )


def regather_errors(scenario: Scenario, number: int, name: str, earlier: list[str]) -> Iterator[str]:
    """Yield an error line if the stage to return to is missing, is later, or precedes a `gather`."""
    key = f"stage[{number}].as_before"
    if name not in earlier:
        if name in [stage.name for stage in scenario.stages]:
            yield f"{key}: stage {name} does not come before this one; name an earlier stage"
        else:
            remedy = did_you_mean(name, earlier) if earlier else "give an earlier stage a name"
            yield f"{key}: no earlier stage {name}; {remedy}"
        return
    then = [stage.name for stage in scenario.stages].index(name)
    if any(stage.verb == "gather" for stage in scenario.stages[then : number - 1]):
        yield f"{key}: the craft were lost when stage {name} began; name a stage after the gather"


def joint_errors(scenario: Scenario, number: int, stage: Joint) -> Iterator[str]:
    """Yield an error line for each wrong entry of `order` and for a wrong number of craft or slots."""
    movers = stage.moving(scenario.names)
    for name in dict.fromkeys(stage.order or ()):
        if (stage.order or ()).count(name) > 1:
            yield f"stage[{number}].order: {name} is given twice; name each craft once"
        elif name in scenario.names and name not in movers:
            yield f"stage[{number}].order: {name} does not move in this stage; leave it out"
    if isinstance(stage, Scatter) and len(scenario.craft) < 2 and stage.factor is not None:
        yield f"stage[{number}].factor: there is only one craft; give from and distance"
    if not isinstance(stage, Reconfigure):
        return
    places, key = stage.slots, "slots"
    if isinstance(stage.to, tuple):
        places, key = len(stage.to), "to"
    elif stage.to.join is not None and movers[0] in stage.to.join:
        yield f"stage[{number}].to.join: {movers[0]} cannot join itself; name the others"
    if places is not None and places < len(movers):
        yield f"stage[{number}].{key}: {places} slots for {len(movers)} craft; give at least {len(movers)}"
    elif places is not None and places > len(movers) and not stage.assign:
        yield (
            f"stage[{number}].{key}: {places} states for {len(movers)} craft; "
            "give one each, or write assign = true"
        )


def missing_search_tables(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each table or key that a search for lost craft lacks."""
    if scenario.sensor is None:
        yield 'sensor: missing; add [sensor] with half_angle = "70 deg"'
    if scenario.search is None:
        yield 'search: missing; add [search] with method = "modified"'
    groups = [craft.group for craft in scenario.craft]
    if scenario.search is not None and scenario.search.bearing:
        if any(groups):
            yield "craft.group: search.bearing assigns the groups; remove group"
    elif None in groups:
        yield f"craft.group: {Craft.missing('group')}"
    elif len(set(groups)) == 1:
        empty = "B" if groups[0] == "A" else "A"
        yield f"craft.group: group {empty} is empty, and locks are between A and B; put a craft into {empty}"
    if scenario.orbit.deep_space is None:
        yield "orbit: a search is for deep space only; write deep_space = true instead"


def search_errors(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each search outside the published limits or with too many samples."""
    sensor, table = scenario.sensor, scenario.search
    if sensor is None or table is None or not any(stage.searches for stage in scenario.stages):
        return
    try:
        plan = table.build(sensor.build())
    except ValueError as error:
        key = str(error).split(":")[0]
        yield f"{'sensor' if key in SensorTable.model_fields else 'search'}.{error}"
        return
    if table.bearing:
        yield from bearing_errors(scenario)
    for number, stage in enumerate(scenario.stages, 1):
        if isinstance(stage, Gather):
            drawn = scenario.study.vary if scenario.study is not None else {}
            key = "craft.solar_acceleration"
            if key in drawn or any(scenario.given(key)):
                yield f"{key}: stage {number} gathers on straight lines; remove it"
            try:
                repeated_search(plan, 1, table.max_speed)
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
        yield "study.sampled: sampling requires that every stage is a lock stage; remove sampled"


def bearing_errors(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each feature that groups by bearings at the start do not support."""
    key = "search.bearing: groups from bearings at the start"
    if any(stage.searches for stage in scenario.stages[1:]):
        yield f"{key} require that only the first stage searches; remove bearing and give groups"
    if scenario.study is None or scenario.study.draws == "errors":
        return
    if any(stage.verb == "lock" for stage in scenario.stages) and len(scenario.craft) > 2:
        yield f"{key} require two craft in a study of `lock`; use `gather`, or give groups"
    if "craft.pointing_error" in scenario.study.vary or any(
        any(one.pointing_error) for one in scenario.craft
    ):
        yield f"{key} cannot be combined with pointing errors in a study; give groups"


def orbit_errors(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each key that requires an orbit in deep space, or deep space in an orbit."""
    deep = scenario.orbit.deep_space is not None
    no_orbits, row = "but deep space has no orbits", "a line is at rest in deep space only"
    for orbital in {craft.start.orbital for craft in scenario.craft if craft.start is not None}:
        if deep and orbital:
            yield f"craft.start: a relative orbit, {no_orbits}; give position and velocity, or line"
        if not deep and orbital is False:
            yield f"craft.start: {row}; give string_of_pearls or another relative orbit"
    for number, stage in enumerate(scenario.stages, 1):
        if deep and getattr(stage, "method", None) == "sauter-palmer":
            yield f'stage[{number}].method: sauter-palmer needs an orbit; write method = "exact"'
        for key, duration in stage.durations.items():
            if deep and duration.orbits:
                yield f'stage[{number}].{key}: deep space has no orbits; give a time, for example "30 min"'
        for key, target in stage.targets.items():
            if deep and target.orbital:
                instead = "line" if isinstance(target, Goal) else "position and velocity"
                yield f"stage[{number}].{key}: a relative orbit, {no_orbits}; give {instead}"
            if not deep and target.orbital is False:
                yield f"stage[{number}].{key}: {row}; give string_of_pearls or another relative orbit"


def hill_only_errors(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each key that holds for Hill's equations only, with an alternative."""
    if scenario.orbit.model == "hill":
        return
    only = f'holds for model = "hill" only, not "{scenario.orbit.model}"'
    tables = {"sensor": scenario.sensor, "search": scenario.search}
    for key, given in tables.items():
        if given is not None:
            yield f"{key}: {only}; remove it, or the model"
    if any(craft.start is not None and not craft.start.inertially for craft in scenario.craft):
        yield f"craft.start: a relative orbit {only}; give position and velocity, inertial or oem"
    if any(
        one.execution is not None and (one.execution.pointing or one.execution.noise)
        for one in scenario.craft
    ):
        yield f"craft.execution: pointing errors and noise {only}; remove them, or enlarge magnitude"
    for number, stage in enumerate(scenario.stages, 1):
        place = f"stage[{number}]"
        if stage.searches or stage.verb in ("scatter", "regather"):
            yield f"{place}.do: {stage.verb} {only}; use coast, transfer, avoid or reconfigure"
        for key, target in stage.targets.items():
            if isinstance(target, Goal) or target.position is None:
                yield f"{place}.{key}: a relative orbit {only}; give position and velocity"
        if getattr(stage, "follow", ()):
            yield f"{place}.follow: {only}; give burns"
        if isinstance(stage, Avoid) and any(one.frame == "inertial" for one in stage.thrust_exclusion):
            yield f'{place}.thrust_exclusion: frame = "inertial" {only}; give frame = "orbit"'
        if (
            isinstance(stage, Avoid | Joint)
            and stage.cost == "delta-v"
            and any(one.thrusters is not None for one in scenario.craft_in(stage))
        ):
            yield f'{place}.cost: "delta-v" with thrusters {only}; give acceleration, or cost = "energy"'
        if isinstance(stage, Avoid) and stage.cost == "energy" and stage.path_requirements:
            yield f'{place}.{stage.path_requirements[0]}: at minimum energy {only}; add cost = "delta-v"'
        if isinstance(stage, Avoid) and not stage.is_exact:
            yield f'{place}.method: "{stage.method}" {only}; remove it'
        if isinstance(stage, Drifting) and (stage.for_ever or stage.what_fails != ThrustLost()):
            which = "without an end, or after another failure than lost thrust,"
            yield f"{place}.drift: {which} {only}; give a time, and remove failure"
        if isinstance(stage, Transfer) and any(
            craft.limited for craft in scenario.craft_in(stage) if craft.name in stage.moving(scenario.names)
        ):
            yield f"{place}.do: a transfer within a thrust limit {only}; use reconfigure"


def duration_errors(scenario: Scenario, orbit: Orbit) -> Iterator[str]:
    """Yield an error line for each duration that is too short or too long to simulate."""
    for number, stage in enumerate(scenario.stages, 1):
        for key, duration in stage.durations.items():
            if (duration.orbits and orbit.period == inf) or (key == "drift" and not duration.seconds < inf):
                continue  # already reported
            if key == "drift" and duration.on(1.0) == 0.0:
                continue  # zero: the drift ends with the stage
            if wrong := flaw(np.array([duration.on(orbit.period)]), 2.0 * pi / orbit.period):
                yield f"stage[{number}].{key}: {wrong}; give another time"
        if isinstance(stage, Thrusting) and stage.cost == "delta-v" and "within" in stage.durations:
            turns = stage.durations["within"].on(orbit.period) / orbit.period
            if turns > MOST_TURNS:
                yield (
                    f"stage[{number}].within: the minimum delta-v is found over at most {MOST_TURNS:g} "
                    f"orbits, got {turns:g}; coast for the rest"
                )


def uncertainty_errors(scenario: Scenario, number: int, stage: StageTable) -> Iterator[str]:
    """Yield an error line for each `sigmas` or `max_probability` that lacks errors, other craft or sizes."""
    asked = [key for key in ("sigmas", "max_probability") if getattr(stage, key) is not None]
    for key in asked:
        if not scenario.uncertain:
            yield (
                f"stage[{number}].{key}: no craft has errors; add for example "
                f"covariance = {Craft.examples()['covariance']} to [craft]"
            )
        if len(scenario.craft) < 2:
            yield f"stage[{number}].{key}: needs another craft; add one, or remove {key}"
    sizes = [(craft.keep_out, craft.body_radius) for craft in scenario.craft]
    if stage.max_probability is not None and any(body is None for _, body in sizes):
        yield f"craft.hard_body: {Craft.missing('hard_body')}"
    if stage.sigmas is not None and any(zone is None and body is None for zone, body in sizes):
        yield f"craft.keep_out: {Craft.missing('keep_out')}"


def passive_safety_errors(scenario: Scenario, number: int, stage: Drifting) -> Iterator[str]:
    """Yield an error line for each `drift` without other craft, an end in deep space or finite thrust."""
    if len(scenario.craft) < 2:
        yield f"stage[{number}].drift: needs another craft to keep clear of; add one, or remove drift"
        return
    if stage.for_ever and scenario.orbit.deep_space is not None:
        yield f'stage[{number}].drift: "forever" needs an orbit; give a time, for example "24 h"'
    jumps = any(craft.unlimited for craft in scenario.craft_in(stage))
    if isinstance(stage, Thrusting) and stage.failure == "thrust stuck" and stage.cost == "delta-v" and jumps:
        yield (
            f"stage[{number}].failure: impulses have no thrust that could be stuck; "
            "give max_thrust in [craft], or another failure"
        )


REMEDY = "add field, with epoch and chief, to [orbit], or remove it"


def field_errors(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for a field of another planet, or for each key that requires a field."""
    table, chief = scenario.orbit.field, scenario.orbit.chief
    if table is not None:
        if chief is not None and (chief.center or "EARTH").upper() != "EARTH":
            yield f"orbit.field: models the Earth, but the chief orbits {chief.center}; remove field"
        return
    tables = {
        "feedback": scenario.feedback,
        "navigation": scenario.navigation,
        "simulation": scenario.flights,
    }
    for key, given in tables.items():
        if given is not None:
            yield f"{key}: requires a high-fidelity model; {REMEDY}"
    for number, stage in enumerate(scenario.stages, 1):
        if getattr(stage, "margin", None) == "auto":
            key = f"stage[{number}].margin"
            yield f"{key}: auto requires a high-fidelity model; add field to [orbit], or give a length"
    if any(any(craft.thrust_error) for craft in scenario.craft):
        yield f"craft.thrust_error: requires a high-fidelity model; {REMEDY}"


def drag_errors(scenario: Scenario) -> Iterator[str]:
    """Yield an error line if atmospheric drag lacks a ballistic coefficient, or the reverse."""
    table, chief = scenario.orbit.field, scenario.orbit.chief
    ballistics = [craft.ballistic for craft in scenario.craft]
    if table is None or table.air is None:
        if any(one is not None for one in ballistics):
            what = REMEDY if table is None else "add density, at_altitude and scale_height to field"
            yield f"craft.ballistic: requires an atmosphere; {what}"
        return
    if None in ballistics:
        yield f"craft.ballistic: {Craft.missing('ballistic')}"
    if chief is not None and chief.ballistic is None:
        yield (
            'orbit.chief: needs ballistic for atmospheric drag; add for example ballistic = "0.02 m^2/kg", '
            'or "0 m^2/kg" for an orbit without drag'
        )


def in_flight(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each setting that a simulation does not support."""
    if scenario.flights is None:
        return
    if scenario.flights.control == "replan":
        for why, without in not_anew(scenario):
            yield f'simulation.control: {why}; write control = "track", or give {without}'
    if scenario.study is not None and scenario.study.draws != "vary":
        yield "study.draws: cannot be combined with [simulation]; remove one of them"
    fails = scenario.study is not None and FAILS in scenario.study.vary
    if scenario.flights.control == "replan" and fails:
        remedy = 'write control = "track", or remove it'
        yield f"study.vary.{shown(FAILS)}: cannot be combined with replanning; {remedy}"


def not_anew(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Yield each reason why a simulation cannot replan, with the remedy."""
    if len(scenario.stages) > 1:
        yield f"replan supports one stage only, but there are {len(scenario.stages)}", "one stage"
    if any(scenario.plans_impulses(stage) for stage in scenario.stages):
        yield (
            "replan supports continuous thrust only, but impulses are planned",
            'cost = "energy" in the stage',
        )
    law = scenario.feedback
    if law is not None and law.impulses:
        yield "replan supports continuous thrust only, but feedback has impulses", "no impulses in [feedback]"
    if law is not None and law.delay:
        yield "replan supports no delay", "no delay in [feedback]"


def navigation_errors(scenario: Scenario, orbit: Orbit) -> Iterator[str]:
    """Yield an error line if the tracking error of a pair exceeds the smallest keep-out zone."""
    if scenario.field is None or scenario.navigation is None:
        return
    from closeform.dynamics.control.feedback import Feedback
    from closeform.dynamics.control.tracking_tube import tube

    flight = scenario.flight
    room = tube(orbit, flight["feedback"] or Feedback(), flight["navigation"])
    zones = [zone for zone in scenario.zones.zones if np.isfinite(zone.extents).all()]
    least = min((float(np.min(zone.extents)) for zone in zones), default=np.inf)
    if room.of_a_pair > least:
        yield (
            f"navigation: the tracking error of a pair is {room.of_a_pair:.3g} m ({room.sigmas:g} sigmas), "
            f"more than the {least:.3g} m of the smallest zone; give better navigation, another feedback "
            "or larger zones"
        )


NEAR = 3  # number of similar keys to suggest


def draw_errors(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each draw for a key that cannot vary, of the wrong kind or out of range."""
    if scenario.study is None:
        return
    if scenario.study.draws != "vary":
        yield from error_study_errors(scenario)
    if scenario.study.draws == "errors":
        yield from conflict_study_errors(scenario)
    for key, draw in scenario.study.vary.items():
        place, known = dotted(("study", "vary", key)), readers()
        section = key.rpartition(".")[0]
        if key not in known:
            near = [one for one in known if not one.startswith(TABLED) or has_table(scenario, one)]
            yield f"{place}: cannot vary; {did_you_mean(key, near, alike(key, near, NEAR))}"
        elif wrong := draw_error(key, draw):
            yield f"{place}: {wrong}"
        elif section != "craft" and not has_table(scenario, key):
            yield f"{place}: there is no [{section}]; add that table or remove the draw"
        elif wrong := range_error(scenario, key, draw):
            yield f"{place}: {wrong}"


def has_table(scenario: Scenario, key: str) -> bool:
    """Return True if the file has the table of a key outside [craft]."""
    return attrgetter(key.rpartition(".")[0])(scenario) is not None


def range_error(scenario: Scenario, key: str, draw: Draw) -> str | None:
    """Return the reason why some case of a draw exceeds the range of the key, or None."""
    reader, numbers = readers()[key], draw.numbers(key)
    if reader is None:
        return None
    given = scenario.given(key)
    if key == "craft.pointing_error":
        return pointing_range_error(given, draw, numbers)
    if reader.size != 1:
        return None
    if draw.choice is None and None in given:
        return f"{key} has no nominal value to add to; give it, or draw a choice"
    reach = {"choice": 0.0, "normal": NORMAL_REACH}.get(draw.kind, 1.0) * max(numbers)
    ends = numbers if draw.choice is not None else given
    for value in (min(ends) - reach, max(ends) + reach):
        if not can_have(scenario, key, reader, value):
            return f"a case can have {value:.6g} in SI units, out of range of {key}; reduce the draw"
    return None


def can_have(scenario: Scenario, key: str, reader: Reader, value: float) -> bool:
    """Return True if a key can have a value [SI] together with the other keys of its table."""
    try:
        reader.checked(value, [value])
    except ValueError:
        return False
    tables, field = scenario.tables_of(key)
    return not any([*table.model_copy(update={field: value}).flaws()] for table in tables)


def pointing_range_error(given: tuple[Any, ...], draw: Draw, numbers: tuple[Any, ...]) -> str | None:
    """Return a message if the pointing error of any case can reach 90 deg, or None."""
    if draw.choice is not None:
        most = max(hypot(*value) for value in numbers)
    else:
        corner = {"uniform": 3.0**0.5, "normal": 3.0**0.5 * NORMAL_REACH}.get(draw.kind, 1.0)
        most = max(hypot(*value) for value in given) + corner * numbers[-1]
    return None if most < MOST_TURN else "a pointing error can reach 90 deg; reduce the draw"


def error_study_errors(scenario: Scenario) -> Iterator[str]:
    """Yield an error line if a study draws errors that are absent or unsupported."""
    if not scenario.uncertain:
        yield (
            "study.draws: no craft has errors; add for example "
            f"covariance = {Craft.examples()['covariance']} to [craft]"
        )
    searches = [number for number, stage in enumerate(scenario.stages, 1) if stage.searches]
    replanned = scenario.study is not None and scenario.study.draws == "replanned"
    if scenario.noisy and replanned and searches:
        yield (
            f"study.draws: the search in stage {searches[0]} does not support process noise; remove "
            'noise from execution, or write draws = "errors"'
        )


def conflict_study_errors(scenario: Scenario) -> Iterator[str]:
    """Yield an error line if a study of conflicts has no zones or no second craft."""
    if all(craft.keep_out is None and craft.body_radius is None for craft in scenario.craft):
        yield f"craft.keep_out: {Craft.missing('keep_out')}"
    if len(scenario.craft) < 2:
        yield "study.draws: needs another craft; add one"


MOST_NAMED = 100  # largest number of pairs that are named


def zone_conflicts(scenario: Scenario, orbit: Orbit) -> Iterator[str]:
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
                f"craft.keep_out: stage[{number}] ({stage.verb}) supports only a sphere, box, ellipsoid or "
                "covariance zone; use one that encloses the present zones"
            )
    if scenario.scattered:  # every case has its own positions
        return
    places, remedy, count = scenario.states(orbit)[:, :3], "move one of them or make keep_out smaller", 0
    for zone, first, second in portions_near(kept, places):
        ratios = zone._norm(places[first] - places[second])
        for k in np.flatnonzero(ratios <= 1.0):
            if (count := count + 1) <= MOST_NAMED:
                made = "" if (rule := kept.rule(first[k], second[k])) == REGION else f" ({rule})"
                names = f"{scenario.names[first[k]]} and {scenario.names[second[k]]}"
                at = f"{ratios[k]:.2f} x zone{made}"
                yield f"craft.position: {names} start inside each other's zone, at {at}; {remedy}"
    if count > MOST_NAMED:
        yield f"craft.position: {count} pairs in all start inside each other's zone; {remedy}"
