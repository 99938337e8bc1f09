"""Consistency checks between the tables of a scenario."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from math import inf, pi

import numpy as np

from closeform.motion.duration import MOST_TURNS, flaw
from closeform.motion.orbit import Orbit
from closeform.scenario.asked import doubted, drifting
from closeform.scenario.clear_ends import ends, zones
from closeform.scenario.craft import SearchTable, SensorTable
from closeform.scenario.errors import did_you_mean, key_of, meant_by
from closeform.scenario.flown import in_air, in_field, in_flight, too_blind
from closeform.scenario.formation import Goal
from closeform.scenario.scenario import Scenario
from closeform.scenario.stage_table import Drifting, StageTable, Thrusting
from closeform.scenario.stages import Avoid, Coast, Gather, Joint, Reconfigure, Regather, Scatter, Transfer
from closeform.scenario.studied import study
from closeform.search.rounds import MOST_ROUNDS, all_rounds

MOST_SAMPLES = 1e7
ORBIT = r"orbit(\.(?!field).*)?"  # keys that define the orbit; the field does not
PLACED = "position|velocity|start|keep_out"  # keys of [craft] that place craft and their zones


def check(scenario: Scenario, wrong: Sequence[str], command: str) -> list[str]:
    """Return one line for each disagreement between tables, and for each unsupported need of `command`.

    `wrong` holds the lines about errors within single tables; checks that depend on those keys are skipped.
    """
    found = Findings(wrong)
    fit(scenario, found)
    if found.said:
        found.add(scenario.unbuilt_study() if command != "run" else ())
    return found.new


def fit(scenario: Scenario, found: "Findings") -> None:
    """Add every disagreement between tables to `found`."""
    circular = scenario.orbit.deep_space is None
    known = found.sound(ORBIT)
    searches = any(stage.searches for stage in scenario.stages)
    if scenario.craft:
        found.add(duplicates(scenario), r"craft\.name|stage\[\d+\]\.name")
        found.add(stages(scenario), r"craft\.name")
        found.add(exact(scenario))
    if searches and scenario.sensor is not None and scenario.search is not None:
        found.add(search(scenario, scenario.sensor, scenario.search), "sensor.*|search.*|study.*")
    if searches and scenario.craft and known and not circular and not scenario.scattered:
        found.add(at_one_place(scenario), r"craft\.(position|velocity|start)")
    found.add(in_flight(scenario))
    found.add(study(scenario, found.sound))
    found.add(in_field(scenario), r"orbit\.field")
    found.add(in_air(scenario), r"orbit\.field|craft\.(name|ballistic)")
    if not known:
        return
    try:
        orbit = scenario.orbit.build()
    except ValueError as error:
        found.add([f"orbit: {error}; check its numbers"])
        return
    if circular and not orbit.mean_motion > 0.0:
        found.add(["orbit: so wide that nothing turns; write deep_space = true instead"])
        return
    found.add(in_orbit(scenario) if circular else deep_space(scenario))
    found.add(spans(scenario, orbit))
    if scenario.craft:
        found.add(zones(scenario, orbit), rf"craft\.({PLACED})")
        found.add(too_blind(scenario, orbit), r"orbit.*|craft\.(name|keep_out)|feedback.*|navigation.*")
        for number, stage in enumerate(scenario.stages, 1):
            if isinstance(stage, Reconfigure):
                found.add(
                    ends(scenario, orbit, number, stage), rf"craft\.(name|keep_out)|stage\[{number}\].*"
                )


class Findings:
    """Collected error lines: the keys already reported (`said`) and the `new` lines."""

    def __init__(self, said: Sequence[str]) -> None:
        self.said = {key_of(line) for line in said}
        for line in said:
            section, _, key = key_of(line).partition(".")
            if not key:  # a line about a whole table: its words are the keys
                self.said |= {f"{section}.{word}" for word in re.findall(r"\w+", line)}
            elif line.startswith(f"{section}.{key}:") and (meant := meant_by(line)):
                self.said.add(f"{section}.{meant}")
        self.new: list[str] = []

    def sound(self, keys: str) -> bool:
        """Return True if no reported key matches this pattern."""
        return not any(re.fullmatch(keys, key) for key in self.said)

    def add(self, lines: Iterable[str], needed: str = "") -> None:
        """Add lines if the `needed` keys are sound; skip lines about keys already reported."""
        if self.sound(needed):
            more = [line for line in lines if key_of(line) not in self.said]
            self.new += more
            self.said |= {key_of(line) for line in more}


def duplicates(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each name that two craft or two stages share."""
    for key, names in (
        ("craft.name", list(scenario.names)),
        ("stage.name", [stage.name for stage in scenario.stages if stage.name is not None]),
    ):
        for name, count in Counter(names).items():
            if count > 1:
                yield f"{key}: {name} is given {count} times; name each one differently"


def stages(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each stage that names an absent object or lacks a table."""
    earlier: list[str] = []
    for number, stage in enumerate(scenario.stages, 1):
        for key, names in stage.craft_named.items():
            for name in names:
                if name not in scenario.names:
                    yield f"stage[{number}].{key}: no craft {name}; {did_you_mean(name, scenario.names)}"
        if isinstance(stage, Coast):
            yield from following(scenario, number, stage)
        if isinstance(stage, Regather):
            yield from as_before(scenario, number, stage.as_before, earlier)
        earlier += [stage.name] if stage.name else []
        if isinstance(stage, Joint):
            yield from together(scenario, number, stage)
        if isinstance(stage, Transfer) and stage.craft is None and len(scenario.craft) > 1:
            yield f'stage[{number}].craft: missing; name who moves, for example "{scenario.names[0]}"'
        if isinstance(stage, Avoid | Joint | Transfer):
            yield from thrusting(scenario, number, stage)
            yield from firing(scenario, number, stage)
            if any(later.verb == "gather" for later in scenario.stages[number:]):
                yield f"stage[{number}].do: {stage.verb} needs craft that were found; put it after the gather"
        if isinstance(stage, Drifting) and stage.drift is not None:
            yield from drifting(scenario, number, stage)
        beside = stage.keeps_out and len(scenario.craft) > 1
        if (beside or getattr(stage, "drift", None) is not None) and None in scenario.keep_out:
            yield 'craft.keep_out: missing; add for example keep_out = { sphere = "20 m" }'
        yield from doubted(scenario, number, stage)
        if stage.verb == "avoid" and len(scenario.craft) < 2:
            yield f"stage[{number}].do: avoid needs another craft; add one, or coast"
        yield from engines(scenario, number, stage)
        if stage.searches:
            yield from searching(scenario)


def following(scenario: Scenario, number: int, stage: Coast) -> Iterator[str]:
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
        yield f'{key}: a study moves the craft off their files; write draws = "errors", or remove follow'


def engines(scenario: Scenario, number: int, stage: StageTable) -> Iterator[str]:
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
        yield f"stage[{number}].craft: {lacks}; name who moves, for example craft = [{others}]"
        return
    remedy = "use reconfigure with craft" if isinstance(stage, Scatter | Regather) else "remove engine"
    yield f"stage[{number}].do: {stage.verb} moves everybody, and {idle[0]} has no engine; {remedy}"


def exact(scenario: Scenario) -> Iterator[str]:
    """Yield an error line if all given covariances are zero."""
    given = [craft.covariance for craft in scenario.craft if craft.covariance is not None]
    if given and all(one.exact for one in given):
        yield (
            "craft.covariance: says that the state is known exactly; "
            'give for example position = "3 6 3 m", or remove it'
        )


def firing(scenario: Scenario, number: int, stage: Avoid | Joint | Transfer) -> Iterator[str]:
    """Yield an error line if thrusters without a firing period must realize continuous thrust."""
    each = scenario.craft_in(stage)
    endless = any(craft.thrusters is not None and craft.period is None for craft in each)
    if endless and stage.cost == "energy":
        section = "craft" if stage.thrusters is None else f"stage[{number}]"
        yield (
            f"{section}.period: missing, in which thrusters fire once while a plan of least energy thrusts; "
            'add for example period = "30 s", or write cost = "delta-v" in the stage'
        )


def thrusting(scenario: Scenario, number: int, stage: Thrusting) -> Iterator[str]:
    """Yield an error line for each engine key of a stage that lacks a mass, a thrust or an exhaust speed."""
    for craft in scenario.craft if stage.told else ():
        if craft.name not in stage.moving(scenario.names):
            continue
        known = {*craft.unfit()}
        for line in craft.using(stage).unfit():
            if line not in known:
                key, _, wrong = line.partition(" ")
                yield f"stage[{number}].{key}: {wrong}{' to [craft]' if ' mass = ' in wrong else ''}"
        if stage.specific_impulse is not None and craft.specific_impulse is None:
            yield (
                f"stage[{number}].specific_impulse: stands for that of [craft], which has none; "
                'add for example specific_impulse = "220 s" there'
            )


def as_before(scenario: Scenario, number: int, name: str, earlier: list[str]) -> Iterator[str]:
    """Yield an error line if the stage to return to is absent, is later or precedes a gather."""
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


def together(scenario: Scenario, number: int, stage: Joint) -> Iterator[str]:
    """Yield an error line for each wrong entry of `order` and for a wrong number of craft or slots."""
    movers = stage.moving(scenario.names)
    for name in dict.fromkeys(stage.order or ()):
        if (stage.order or ()).count(name) > 1:
            yield f"stage[{number}].order: {name} stands in it twice; name each craft once"
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


def searching(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each table or key that a search for lost craft lacks."""
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
    if scenario.orbit.deep_space is None:
        yield "orbit: a search is for deep space only; write deep_space = true instead"


def at_one_place(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each craft that shares its position with another."""
    yield from scenario.coincident()


def search(scenario: Scenario, sensor: SensorTable, table: SearchTable) -> Iterator[str]:
    """Yield an error line for each search outside the published limits or with too many samples."""
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
    """Yield an error line for each key that requires an orbit."""
    if any(craft.start is not None and craft.start.orbital for craft in scenario.craft):
        yield (
            "craft.start: a relative orbit, but deep space has no orbits; give position and velocity, or line"
        )
    for number, stage in enumerate(scenario.stages, 1):
        if getattr(stage, "method", None) == "sauter-palmer":
            yield f'stage[{number}].method: sauter-palmer needs an orbit; write method = "exact"'
        for key, duration in stage.durations.items():
            if duration.orbits:
                name = "for" if key == "length" else key
                yield f'stage[{number}].{name}: deep space has no orbits; give a time, for example "30 min"'
        for key, target in stage.targets.items():
            if target.orbital:
                instead = "line" if isinstance(target, Goal) else "position and velocity"
                yield f"stage[{number}].{key}: a relative orbit, but deep space has no orbits; give {instead}"


def in_orbit(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each key that requires deep space."""
    remedy = "give string_of_pearls or another relative orbit"
    if any(craft.start is not None and craft.start.orbital is False for craft in scenario.craft):
        yield f"craft.start: a line is at rest in deep space only; {remedy}"
    for number, stage in enumerate(scenario.stages, 1):
        for key, target in stage.targets.items():
            if target.orbital is False:
                yield f"stage[{number}].{key}: a line is at rest in deep space only; {remedy}"


def spans(scenario: Scenario, orbit: Orbit) -> Iterator[str]:
    """Yield an error line for each duration that is too short or too long to simulate."""
    for number, stage in enumerate(scenario.stages, 1):
        for key, duration in stage.durations.items():
            if (duration.orbits and not orbit.mean_motion) or (key == "drift" and not duration.seconds < inf):
                continue  # already reported
            if key == "drift" and duration.on(1.0) == 0.0:
                continue  # zero: the drift ends with the stage
            if wrong := flaw(np.array([duration.on(orbit.mean_motion)]), orbit.mean_motion):
                name = "for" if key == "length" else key
                yield f"stage[{number}].{name}: {wrong}; give another time"
        if isinstance(stage, Thrusting) and stage.cost == "delta-v" and "within" in stage.durations:
            turns = stage.durations["within"].on(orbit.mean_motion) * orbit.mean_motion / (2.0 * pi)
            if turns > MOST_TURNS:
                yield (
                    f"stage[{number}].within: the least delta-v is found over at most {MOST_TURNS:g} "
                    f"orbits, got {turns:g}; coast for the rest"
                )
