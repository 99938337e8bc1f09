"""Commands of simulations of N craft, and their division into stretches for the kernels."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.batch_integration import Course, fly_all
from closeform.dynamics.chief_frame import ChiefFrame
from closeform.dynamics.drawn import Drawn, exactly
from closeform.dynamics.engines import Engines
from closeform.dynamics.executed import Events, nothing_of
from closeform.dynamics.feedback import Feedback, delayed, kicks_back, slots_of, way_back
from closeform.dynamics.field import Field
from closeform.dynamics.holding import Holding
from closeform.dynamics.residual import beyond, residuals
from closeform.dynamics.thruster_commands import FACET, THRUSTER
from closeform.dynamics.timetable import (
    BESIDE,
    COAST,
    PULSED,
    SAME,
    STEP,
    Timetable,
    bends_of,
    edges_of,
    impulses_of,
)
from closeform.motion.arc import IMPULSE, STATE
from closeform.motion.path import Path

if TYPE_CHECKING:
    from closeform.dynamics.thruster_model import Nozzles

ROUNDS = 2  # rounds of a simulation with a user function; the first has an error from the force gradient
FEW = 8  # fewer simulations do not justify a thread of their own
STRETCH = 20_000  # steps in memory at the same time, about
NEVER = np.array([np.inf])  # s


class Known(NamedTuple):
    """Force model known to guidance, with its chief's frame at half steps of a table."""

    field: Field
    frame: ChiefFrame


@dataclass(frozen=True, eq=False)
class Commands:
    """Commands of craft along `path` (N,) at the times of a `table`.

    `known` is the field whose model error is compensated, or None, and `holding` the times. `jumps` (N, Q, 3)
    are planned impulses, one for each of the table's. `reference` (N, T, 6) holds the states to which
    feedback returns, at output times, if they differ from those of the path. `limits` and `bits` (N,) bound
    thrust and impulses. `nozzles` fire the feedback of one craft. From `lost` [s] on there is no thrust.
    """

    path: Path
    table: Timetable
    known: Known | None
    holding: Holding
    jumps: Floats
    reference: Floats | None
    law: Feedback | None
    limits: Floats
    bits: Floats
    ballistics: Floats
    nozzles: Nozzles | None
    lost: float = np.inf

    def of(self, which: Any) -> Commands:
        """Return the commands of the selected craft (M,)."""
        each = {
            name: getattr(self, name)[which] for name in ("path", "jumps", "limits", "bits", "ballistics")
        }
        each["holding"] = self.holding.among(which)
        if self.known is not None:
            each["known"] = self.known._replace(field=self.known.field._of(which))
        if self.reference is not None:
            each["reference"] = self.reference[which]
        return replace(self, **each)

    def alone(self, first: int, last: int) -> tuple[Commands, Any, Any]:
        """Return the plan alone between two nodes, without feedback and compensation.

        Also returns the rows of its impulses and of its states among all.
        """
        nodes = slice(first, last + 1)
        fired, shown = (rows[nodes][rows[nodes] >= 0] for rows in (self.table.fires, self.table.shown))
        part = replace(self, table=self.table.during(first, last), jumps=self.jumps[:, fired])
        return replace(part, known=None, law=None, reference=None), fired, shown

    @property
    def events(self) -> Events:
        """Burns and impulses that have errors of their own."""
        lasting = self.law is not None and not self.law.impulses
        return Events.of(self.path, self.table, lasting, self.nozzles is not None)

    def frame_in(self, field: Field) -> ChiefFrame:
        """Return the chief's frame in a field at half steps."""
        if self.known is not None and self.known.field is field:
            return self.known.frame
        return ChiefFrame.of(field, self.table.times)


@dataclass(frozen=True, eq=False)
class Flights:
    """Results of S simulations: `states` (S, N, T, 6) at the output times, after impulses.

    `arrivals` are the states just before impulses.

    `fired` (S, N, Q, 3) [m/s] are impulses at the times of the table, or thruster orders then. The delta-v
    `spent` (S, N) [m/s], the delta-v `asked` (N,) without errors, and the time at the limit `limited` (S, N)
    [s].
    """

    states: Floats
    arrivals: Floats
    fired: Floats
    spent: Floats
    asked: Floats
    limited: Floats


OF_FLIGHTS = "states", "arrivals", "fired", "spent", "limited"  # (S, N, ...)


def flown(
    commands: Commands,
    field: Field,
    frame: ChiefFrame,
    drawn: Drawn,
    begin: Floats | None = None,
    around: Path | None = None,
) -> Flights:
    """Simulate commands with given errors in a field.

    The simulation starts from states `begin` (N, 6) before impulses; by default from those of the path plus
    errors. A user function minus its zonals is evaluated `around` paths: those of a simulation without
    errors, found in two rounds.
    """
    if field.acceleration is not None and around is None:
        around, still = commands.path, exactly(len(commands.path), commands.table.measurements)
        for _ in range(ROUNDS):
            alone = flown(commands, field, frame, still, begin, around)
            times = commands.table.shown_times
            around = commands.path.orbit._through(times, alone.states[0], alone.arrivals[0])
    table, count = commands.table, len(commands.path)
    flights = len(drawn.seen)
    if begin is None:
        first = commands.path.arcs[commands.path.offsets[:-1]]
        begin = first[:, STATE : STATE + 6].copy()
        begin[:, 3:] -= first[:, IMPULSE : IMPULSE + 3]
        begin = begin + drawn.start
    now = np.zeros((flights, count, 18))
    now[..., :6] = begin
    states = np.empty((flights, count, int(table.shown.max()) + 1, 6))
    fired = np.zeros((flights, count, int(table.fires.max()) + 1, 3))
    spent, asked = np.zeros((flights, count, 2)), np.zeros(count)
    each, step = (now, states, fired, spent), 0
    for begin_s, planned in courses(commands, field, frame, around, drawn):
        course = planned if begin_s < commands.lost - SAME else _silent(planned)
        pushes = np.ascontiguousarray(drawn.pushes[:, :, step : step + len(course.steps)])
        _side_by_side(field, course, (drawn.seen, drawn.thrust, drawn.events, pushes, *each))
        step += len(course.steps)
        size = np.minimum(np.linalg.norm(course.commanded, axis=3), commands.limits[:, None, None])
        asked += size @ [1.0, 4.0, 1.0] @ course.steps / 6.0  # the quadrature of the kernel
        asked += np.linalg.norm(course.jumps, axis=2).sum(axis=1)
    arrivals = states
    if fired.size and commands.nozzles is None:
        arrivals = states.copy()
        arrivals[:, :, table.shown[table.fires >= 0], 3:] -= fired
    return Flights(states, arrivals, fired, spent[..., 0], asked, spent[..., 1])


def _silent(course: Course) -> Course:
    """Return a course without any thrust or feedback."""
    never = np.full(len(course.fires), -1)
    nothing = {name: np.zeros_like(getattr(course, name)) for name in ("commanded", "jumps", "law")}
    return course._replace(looks=never, answers=never, kicks=never, **nothing)


def _side_by_side(field: Field, course: Course, each: tuple[Floats, ...]) -> None:
    """Simulate a stretch of all simulations on all cores; arrays of `each` are (S, N, ...)."""
    flights, count = each[0].shape[:2]
    flat = [rows.reshape(flights * count, *rows.shape[2:]) for rows in each]

    def some(part: slice) -> None:
        of_each = slice(part.start * count, part.stop * count)
        fly_all(field._constants, course, *(rows[of_each] for rows in flat))

    size = max(FEW, -(-flights // (os.cpu_count() or 1)))
    parts = [slice(k, k + size) for k in range(0, flights, size)]
    if len(parts) == 1:
        some(parts[0])
        return
    with ThreadPoolExecutor(len(parts)) as pool:
        list(pool.map(some, parts))


def commands_of(
    path: Path,
    law: Feedback | None,
    known: Field | None,
    ballistics: Floats,
    engines: Engines | None = None,
    nozzles: Nozzles | None = None,
    span: tuple[float, float] | None = None,
    beside: Floats | None = None,
    lost: Floats = NEVER,
) -> Commands:
    """Return the commands of planned paths (N,), with impulses as planned; or in a span without impulses.

    States are also shown at the times `beside` of other craft with pulses. Steps end at the times of `lost`
    thrust.
    """
    craft, when, sizes = impulses_of(path)
    offsets = np.zeros(0) if law is None or not law.impulses else slots_of(law)[0]
    pulses = nozzles is not None or beside is not None
    longest = PULSED if pulses else STEP
    if not pulses and not path.peak_thrust.any() and (law is None or law.impulses):
        longest = COAST
    edges, holding = edges_of(path), Holding.of(path, law)
    # with other craft beside, or a continuation, all are shown at the same times
    bends = np.union1d(bends_of(path), holding.bounds) if span is None and not pulses else edges[:0]
    bends = bends if beside is None else beside
    span = span or (float(path.start[0]), float(path.end[0]))
    bends = np.concatenate([bends, lost[np.isfinite(lost)]])
    edges = np.concatenate([edges, bends])
    table = Timetable.of(span, law, offsets, edges, when, longest, bends)
    count = len(path)
    jumps = np.zeros((count, int(table.fires.max()) + 1, 3))
    np.add.at(jumps, (craft, np.searchsorted(table.fired_times, when)), sizes)  # several at one instant
    limits, bits = engines or Engines.of(np.ones(count, dtype=bool))
    against = None if known is None else Known(known, ChiefFrame.of(known, table.times))
    return Commands(path, table, against, holding, jumps, None, law, limits, bits, ballistics, nozzles)


def together(parts: Sequence[Flights], axis: int) -> Flights:
    """Return simulations with the same times, concatenated: other seeds (axis 0) or other craft (axis 1)."""
    joined = {name: np.concatenate([getattr(one, name) for one in parts], axis) for name in OF_FLIGHTS}
    return replace(parts[0], **joined)


def in_order(parts: Sequence[Flights], craft: Any) -> Flights:
    """Return simulations of other craft (N,) with the same times, sorted by the craft's index."""
    found, back = together(parts, 1), np.argsort(craft)
    asked = np.concatenate([one.asked for one in parts])[back]
    return replace(found, asked=asked, **{name: getattr(found, name)[:, back] for name in OF_FLIGHTS})


def courses(
    commands: Commands, field: Field, frame: ChiefFrame, around: Path | None, drawn: Drawn
) -> Iterator[tuple[float, Course]]:
    """Yield the start time [s] and the course of each stretch, up to a measurement or a loss of thrust."""
    table, law, orbit = commands.table, commands.law, commands.path.orbit
    rules, gains = np.zeros((len(table.since), 3, 6)), np.zeros((0, 3, 6))
    late = np.stack([np.eye(6), np.zeros((6, 6))])
    if law is not None and law.impulses:
        gains = kicks_back(orbit, law, commands.nozzles is not None)[1]
    elif law is not None:
        rules = way_back(orbit, law.horizon, table.since)[2]
    if law is not None and law.delay > 0.0:
        late = np.stack(delayed(orbit, law, table.interval))
    events = commands.events if drawn.events.size else nothing_of(len(commands.path), table)
    ends = np.flatnonzero((table.shown if law is None else table.looks)[:-1] >= 0)[1:]
    last = 0
    lost = int(np.searchsorted(table.nodes, commands.lost - SAME))
    stops = np.unique([*ends, len(table.rows), *[lost] * (0 < lost < len(table.rows))]).tolist()
    for here, after in zip(stops, [*stops[1:], np.inf], strict=True):
        if after - last > STRETCH or here == lost:
            stretch = slice(last, here)
            own = *events.during(stretch), drawn.gates
            yield (
                float(table.nodes[last]),
                _course(commands, field, frame, around, (rules, gains, late), stretch, own),
            )
            last = here


def _course(
    commands: Commands,
    field: Field,
    frame: ChiefFrame,
    around: Path | None,
    answers_by: tuple[Floats, Floats, Floats],
    steps: slice,
    drawn: tuple[Any, Any, Any, Floats],
) -> Course:
    """Return the course of the given steps, with feedback rules, gains and delay matrices.

    `drawn` holds the error events of burns and impulses, and their Gates parameters.
    """
    table, path, count = commands.table, commands.path, len(commands.path)
    halves, nodes = slice(2 * steps.start, 2 * steps.stop + 1), slice(steps.start, steps.stop + 1)
    times = table.times[halves]
    lengths = times[2::2] - times[:-2:2]
    within = times[:-2:2, None] + lengths[:, None] * np.array([BESIDE, 0.5, 1.0 - BESIDE])
    commanded = path.thrust(within.ravel()).reshape(count, -1, 3, 3)
    opposed = commands.holding.opposed(times[1::2])
    if (known := commands.known) is not None and opposed.any():
        there = known.frame.during(halves)
        left_out = residuals(known.field, there, path.state(times), path.orbit.mean_motion)
        commanded -= _stepwise(left_out) * opposed[..., None, None]
    here, pulled = frame.during(halves), np.zeros((count, 0, 3, 3))
    if around is not None:
        pulled = _stepwise(beyond(field, here, around.state(times)))
    which = [
        part[nodes].copy() for part in (table.looks, table.answers, table.kicks, table.fires, table.shown)
    ]
    if steps.stop < len(table.rows):  # these belong to the next stretch
        for part in which:
            part[-1] = -1
    looks, answers, kicks, fires, shown = which
    if commands.law is None:
        looks[:], answers[:], kicks[:] = -1, -1, -1
    jumps = np.zeros((count, len(fires), 3))
    jumps[:, fires >= 0] = commands.jumps[:, fires[fires >= 0]]
    planned = path.state(table.nodes[nodes])
    if commands.reference is not None:
        planned[:, shown >= 0] = commands.reference[:, shown[shown >= 0]]
    chief = here.states[:, :3], here.states[:, 3:], here.felt, here.axes, here.turn
    floats = [
        np.ascontiguousarray(part, dtype=float)
        for part in (lengths, *chief, commanded, pulled, jumps, planned)
    ]
    bounds = commands.ballistics, commands.limits, commands.bits
    fire = commands.nozzles
    begun, coming = np.flatnonzero(kicks >= 0), np.flatnonzero(table.kicks[steps.stop :] >= 0)
    over = steps.stop + coming[0] if len(coming) else len(table.nodes) - 1
    now = np.append(table.nodes[nodes], table.nodes[over])  # also the end of the last order
    sides = np.zeros((0, THRUSTER)), np.zeros((0, FACET)), np.zeros(len(now)), np.zeros((0, len(now)))
    if fire is not None:
        sides = fire.thrusters, fire.facets, path.orbit.mean_motion * now * fire.turns, fire.free(now)
    slots = np.zeros(len(fires), dtype=np.int64)
    slots[begun] = [*begun[1:], len(fires)][: len(begun)]
    of_each = (np.broadcast_to(one, (count, *one.shape)).copy() for one in sides)
    rules, gains, late = answers_by
    rules_of = looks, answers, late, table.rows[steps], rules, kicks, gains, shown, fires
    return Course(*(*floats, *rules_of, *bounds, *of_each, slots, *drawn))


def _stepwise(values: Floats) -> Floats:
    """Return values (N, 2 K + 1, 3) at half steps as start, middle and end of each step (N, K, 3, 3)."""
    return np.stack([values[:, :-2:2], values[:, 1::2], values[:, 2::2]], axis=2)
