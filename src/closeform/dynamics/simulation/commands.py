"""Commands of spacecraft in a simulation: planned thrust, feedback, engines and thrusters, on a time grid.

Impulses and continuous thrust move a spacecraft in spans. On the long coasts between them feedback holds it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, number
from closeform.dynamics.control.feedback import Feedback, slots_before_next
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.force_model.hill_frame import ChiefFrame
from closeform.dynamics.planned_paths import impulses_of
from closeform.dynamics.simulation.integrator import BIT, FACET, STRENGTH, THRUSTER
from closeform.fuel.allocation import Allocation
from closeform.fuel.pulses import Pulses
from closeform.fuel.thrusters import Thrusters, each_set
from closeform.motion.arc import END, IMPULSE, START, THRUST
from closeform.motion.joining import linked
from closeform.motion.path import Path, ends_of, path_of, runs_of
from closeform.uncertainty.error_columns import burn_ranges

# s: maximum step for pulses, for continuous thrust, for impulses alone
PULSED, CONTINUOUS, IMPULSIVE = 5.0, 10.0, 20.0
OUTPUTS = 20_000  # number of instants with stored states, about
BESIDE = 1e-6  # of a step: distance from a discontinuity of thrust
SAME = 1e-6  # s: tolerance of equal times
JUMP, BEND = 1e-6, 0.05  # of the peak thrust: a discontinuity, and a bend within a step
NEIGHBOURHOOD = 10.0  # s: half-interval in which a bend is measured
NEGLIGIBLE = 1e-9  # m/s: tolerance along an axis without a thruster


class ThrustSpans(NamedTuple):
    """Spans (M, 2) [s] of each spacecraft (N) that are `impulsive`, and those of `continuous` thrust.

    In the remaining time it coasts and is held on its path. If feedback is `by_thrust`, the hold compensates
    the model error.
    """

    impulsive: tuple[Floats, ...]
    continuous: tuple[Floats, ...]
    by_thrust: bool

    @classmethod
    def of(cls, paths: Path, law: Feedback | None) -> Self:
        """Return the spans of paths (N,) under feedback; without it impulses move a spacecraft throughout.

        A coast is held if it begins without an impulse and is as long as the horizon or an orbit. A coast
        after an impulse belongs to the transfer.
        """
        each = [paths.arcs[a:b] for a, b in zip(paths.offsets, paths.offsets[1:], strict=False)]
        if law is None:
            whole = tuple(_times(arcs, [(0, len(arcs))] if fires(arcs).any() else []) for arcs in each)
            return cls(whole, (np.zeros((0, 2)),) * len(each), True)
        long = min(law.horizon, 2.0 * np.pi / paths.orbit.mean_motion)
        impulsive, continuous = zip(*(_spans(arcs, long) for arcs in each), strict=True)
        return cls(impulsive, continuous, not law.impulses)

    def among(self, which: Any) -> Self:
        """Return the spans of the selected spacecraft."""
        some = np.arange(len(self.impulsive))[which]
        return self._replace(
            impulsive=tuple(self.impulsive[k] for k in some),
            continuous=tuple(self.continuous[k] for k in some),
        )

    @property
    def bounds(self) -> Floats:
        """Start and end times of the spans of all spacecraft [s]."""
        return np.unique(np.concatenate([np.zeros(0), *map(np.ravel, self.impulsive + self.continuous)]))

    def impulsive_at(self, times: Floats) -> Any:
        """Return which spacecraft are moved by impulses (N, T) at given times."""
        return np.array([_inside(spans, times) for spans in self.impulsive])

    def compensated(self, times: Floats) -> Any:
        """Return which spacecraft compensate the model error (N, T) at given times."""
        thrusting = self.by_thrust | np.array([_inside(spans, times) for spans in self.continuous])
        return np.asarray(thrusting & ~self.impulsive_at(times))


def fires(arcs: Floats) -> Any:
    """Return which arcs (M,) begin with an impulse."""
    return np.asarray(arcs[:, IMPULSE : IMPULSE + 3].any(axis=1))


def _spans(arcs: Floats, long: float) -> tuple[Floats, Floats]:
    """Return the impulsive and the continuous spans of one spacecraft; coasts of `long` [s] are neither."""
    fired, thrusts = fires(arcs), np.asarray(arcs[:, THRUST:].any(axis=1))
    held = ~fired & ~thrusts & (arcs[:, END] - arcs[:, START] >= long)
    continuous = []
    for a, b in runs_of(~fired & ~held):
        burning = np.flatnonzero(thrusts[a:b])
        if not len(burning):
            continue
        if b < len(arcs) and fired[b]:  # the wait before the impulse belongs to its span
            b = a + int(burning[-1]) + 1
        continuous.append((a, b))
        held[a:b] = True
    impulsive = [(a, b) for a, b in runs_of(~held) if fired[a:b].any()]
    return _times(arcs, impulsive), _times(arcs, continuous)


def _times(arcs: Floats, runs: list[tuple[int, int]]) -> Floats:
    """Return the start and end times of runs of arcs (R, 2) [s]."""
    return np.array([(arcs[a, START], arcs[b - 1, END]) for a, b in runs]).reshape(-1, 2)


def _inside(spans: Floats, times: Floats) -> Any:
    """Return which times (T,) lie in any of the spans (M, 2), both ends included."""
    return ((spans[:, :1] - SAME <= times) & (times <= spans[:, 1:] + SAME)).any(axis=0)


class TimeGrid(NamedTuple):
    """K steps, and the events at the K + 1 nodes between them; an index is -1 if there is no event."""

    times: Floats  # (2 K + 1,) [s], half steps
    measurements: Any  # (K + 1,) index of a measurement
    updates: Any  # (K + 1,) index of a measurement that takes effect
    feedback_impulses: Any  # (K + 1,) index of a feedback impulse after a measurement
    impulses: Any  # (K + 1,) row of impulses
    outputs: Any  # (K + 1,) row of output states
    rows: Any  # (K,) row of `since` at the start of each step
    since: Floats  # (L,) [s] after a measurement: start, middle and end of each kind of step

    @property
    def nodes(self) -> Floats:
        """Start and end times of the steps (K + 1,) [s]."""
        return self.times[::2]

    @property
    def output_times(self) -> Floats:
        """Times of output states (T,) [s]."""
        return np.asarray(self.nodes[self.outputs >= 0])

    @property
    def impulse_times(self) -> Floats:
        """Times of impulses (Q,) [s]."""
        return np.asarray(self.nodes[self.impulses >= 0])

    @property
    def measurement_count(self) -> int:
        """Number of measurements."""
        return int(self.measurements.max()) + 1

    @property
    def interval(self) -> float:
        """Time between measurements [s]."""
        return float(self.times[-1] - self.times[0]) / max(self.measurement_count, 1)

    def without_feedback(self, first: int, last: int) -> TimeGrid:
        """Return the grid between two nodes, both included, without measurements and corrections."""
        nodes, never = slice(first, last + 1), np.full(last + 1 - first, -1)
        impulses, outputs = (
            np.where(rows >= 0, np.cumsum(rows >= 0) - 1, -1)
            for rows in (self.impulses[nodes], self.outputs[nodes])
        )
        return self._replace(
            times=self.times[2 * first : 2 * last + 1],
            measurements=never,
            updates=never,
            feedback_impulses=never,
            impulses=impulses,
            outputs=outputs,
            rows=self.rows[first:last],
        )

    @classmethod
    def of(
        cls,
        span: tuple[float, float],
        law: Feedback | None,
        impulses: Floats,
        edges: Floats,
        outputs: Floats,
        longest: float,
    ) -> TimeGrid:
        """Return a grid with steps of at most `longest` [s], some of which end at given times.

        These are the times of planned `impulses`, thrust discontinuities (`edges`), and required `outputs`.
        Measurements are at equal intervals of at most the law's, from the start onward.
        """
        start, end = span
        looks = 1 if law is None else intervals_in(end - start, law.every)
        each = int(np.ceil((end - start) / looks / longest))
        thin = int(np.ceil(looks * each / OUTPUTS))
        each = thin * int(np.ceil(each / thin))
        base = np.linspace(start, end, looks * each + 1)
        measured = updated = base[:0] if law is None else base[:-1:each]
        corrected = measured[:, None]
        if law is not None:
            every = (end - start) / looks
            updated, corrected = measured + min(law.delay, every), corrected + slots_before_next(law, every)
        firing = np.concatenate([corrected.ravel(), impulses])
        outputs = np.concatenate([base[::thin], firing, outputs])
        nodes = merged(base, np.concatenate([updated, edges, outputs]))
        times = np.empty(2 * len(nodes) - 1)
        times[::2], times[1::2] = nodes, 0.5 * (nodes[:-1] + nodes[1:])
        seen, used, fired, shown = (_numbered(nodes, one) for one in (measured, updated, firing, outputs))
        slots = np.full(len(nodes), -1)
        slots[nearest(nodes, corrected)] = np.arange(corrected.shape[1])
        kinds: tuple[Any, Floats] = np.zeros(len(nodes) - 1, dtype=np.int64), np.zeros(3)
        if law is not None and not law.impulses:
            kinds = _kinds(nodes, nodes[used >= 0])
        return cls(times, seen, used, slots, fired, shown, *kinds)


def _kinds(nodes: Floats, updated: Floats) -> tuple[Any, Floats]:
    """Return `rows` and `since` of a grid, for continuous feedback that is `updated` at given times."""
    last = np.maximum(np.searchsorted(updated, nodes[:-1], side="right") - 1, 0)
    begin = np.maximum(nodes[:-1] - updated[last], 0.0)
    kinds = np.round(np.stack([begin, np.diff(nodes)], axis=1) / SAME).astype(np.int64)
    _, first, which = np.unique(kinds, axis=0, return_index=True, return_inverse=True)
    since = begin[first][:, None] + np.diff(nodes)[first][:, None] * np.array([0.0, 0.5, 1.0])
    return 3 * which.ravel(), since.ravel()


def merged(base: Floats, times: Floats) -> Floats:
    """Return the times of a base and those between its ends, sorted; of equal times the last."""
    start, end = base[0], base[-1]
    found = np.unique(np.concatenate([base, times]))
    found = found[(found > start + SAME) & (found < end - SAME)]
    return np.concatenate([[start], found[np.diff(found, append=np.inf) > SAME], [end]])


def nearest(nodes: Floats, times: Floats) -> Any:
    """Return the indices of the nodes nearest to given times."""
    return np.searchsorted(0.5 * (nodes[1:] + nodes[:-1]), times)


def _numbered(nodes: Floats, times: Floats) -> Any:
    """Return the indices at the nodes (K + 1,) of times, sorted and each counted once; -1 at other nodes."""
    within = (times > nodes[0] - SAME) & (times < nodes[-1] + SAME)
    rows, out = np.unique(nearest(nodes, times[within])), np.full(len(nodes), -1)
    out[rows] = np.arange(len(rows))
    return out


def intervals_in(duration: float, every: float) -> int:
    """Return the number of equal intervals between measurements, none longer than `every` [s]."""
    return int(np.ceil(duration / every - SAME))


def thrust_jumps(path: Path) -> Floats:
    """Return the times at which the thrust of any spacecraft jumps [s]."""
    found = [np.zeros(0)]
    for k in np.flatnonzero(path.peak_thrust):
        one = path[int(k)]
        times, lengths = one.arcs[:, START], one.arcs[:, END] - one.arcs[:, START]
        # short enough to resolve a brief pulse in a simulation of days
        near = min(BESIDE * (one.end - one.start), 0.25 * lengths[lengths > SAME].min())
        times = times[(times > one.start + near) & (times < one.end - near)]
        change = one.thrust(times + near) - one.thrust(times - near)
        found.append(times[np.linalg.norm(change, axis=1) > JUMP * one.peak_thrust])
    return np.concatenate(found)


def thrust_bends(path: Path) -> Floats:
    """Return the times at which the thrust of any spacecraft bends too sharply for one step [s]."""
    found = [np.zeros(0)]
    for k in np.flatnonzero(path.peak_thrust):
        one = path[int(k)]
        times = one.arcs[:, START]
        aside = np.minimum(NEIGHBOURHOOD, np.minimum(times - one.start, one.end - times))
        bend = one.thrust(times + aside) + one.thrust(times - aside) - 2.0 * one.thrust(times)
        found.append(times[np.linalg.norm(bend, axis=1) > BEND * one.peak_thrust])
    return np.concatenate(found)


def stages_at(starts: Floats, times: ArrayLike) -> Any:
    """Return the index of the stage (T,) that lasts from given times onward, by start times (M,)."""
    return np.searchsorted(starts, np.asarray(times) + SAME) - 1


class Engines(NamedTuple):
    """Engines of N spacecraft: largest thrust in M stages, time of failure, and minimum impulse bit of all.

    A spacecraft without an engine has limit 0 and ignores all commands; one that loses its thrust ignores
    them from that time on.
    """

    starts: Floats  # (M,) [s] of stages, the first -inf
    limits: Floats  # (N, M) [m/s^2]
    lost: Floats  # (N,) [s], inf for an engine that does not fail
    minimum_bit: float  # [m/s]

    @classmethod
    def unlimited(cls, count: int) -> Engines:
        """Return engines without limits, which do not fail."""
        return cls(np.array([-np.inf]), np.full((count, 1), np.inf), np.full(count, np.inf), 0.0)

    @property
    def running(self) -> Any:
        """Spacecraft that have an engine (N,)."""
        return self.limits.any(axis=1)

    def limits_at(self, times: Floats) -> Floats:
        """Return the thrust limits (N, T) [m/s^2] from given times onward, 0 after a failure."""
        return np.where(times < self.lost[:, None] - SAME, self.limits[:, stages_at(self.starts, times)], 0.0)

    def among(self, which: Any) -> Engines:
        """Return the engines of the selected spacecraft."""
        return self._replace(limits=self.limits[which], lost=self.lost[which])


class ThrusterStages(NamedTuple):
    """Thrusters of one spacecraft: `sets[k]` from the time `starts[k]` [s] on, None for free thrust."""

    starts: Floats  # (M,), the first -inf
    sets: tuple[Thrusters | None, ...]

    @classmethod
    def of_each(cls, thrusters: Any, paths: Path) -> list[ThrusterStages | None]:
        """Return the argument `thrusters` for each of the paths (N,); None for free thrust throughout."""
        if thrusters is None:
            return [None] * len(paths)
        found = list[ThrusterStages | None]()
        for k, own in enumerate(each_set(thrusters, len(paths), Thrusters, dict, type(None))):
            stages = own if isinstance(own, dict) else {-np.inf: own}
            some = any(one is not None for one in stages.values())
            found.append(cls._of_stages(k, stages, paths[k]) if some else None)
        return found

    @classmethod
    def _of_stages(cls, craft: int, given: dict[float, Thrusters | None], path: Path) -> Self:
        """Return sets given by start times; they change in the middle of the coast about each time."""
        times = [number("thrusters", time) for time in given]
        if times != sorted(times) or not all(isinstance(one, Thrusters | None) for one in given.values()):
            raise ValueError(f"thrusters: craft {craft}: expected thrusters or None by start time, in order")
        arcs, kicks = path.arcs, fires(path.arcs)
        thrusts = arcs[:, THRUST:].any(axis=1)
        begins = np.concatenate([arcs[kicks, START], arcs[thrusts, START]])
        ends = np.concatenate([arcs[kicks, START], arcs[thrusts, END]])
        starts = [-np.inf]
        for time in times[1:]:
            before = begins < time - SAME
            last, first = ends[before].max(initial=path.start), begins[~before].min(initial=path.end)
            if last > time + SAME:
                raise ValueError(f"thrusters: craft {craft}: change at {time:g} s, within a burn of the plan")
            starts.append(0.5 * (last + first))  # burns about impulses last into the coasts beside them
        return cls(np.array(starts), tuple(given.values()))

    @property
    def thrusters(self) -> list[Thrusters]:
        """Sets of thrusters, without stages of free thrust."""
        return [one for one in self.sets if one is not None]

    def pieces(self, path: Path) -> Iterator[tuple[Path, Thrusters | None]]:
        """Yield the parts of one spacecraft's path, each with its set."""
        arcs = path.arcs
        for time in self.starts[1:]:
            k = int(np.searchsorted(arcs[:, START], time))
            if k > 0 and time < arcs[k - 1, END]:
                arcs = np.insert(arcs, k, arcs[k - 1], axis=0)
                arcs[k - 1, END] = arcs[k, START] = time
                arcs[k, IMPULSE : IMPULSE + 3] = 0.0
        arcs = linked(path.orbit, arcs.copy(), ends_of(path)[0]).arcs
        which = stages_at(self.starts, arcs[:, START])
        for k, own in enumerate(self.sets):
            if len(some := arcs[which == k]):
                yield path_of(path.orbit, some, np.array([0, len(some)]), ()), own


class ThrusterModel(NamedTuple):
    """Thrusters of one spacecraft in M `stages` as the integrator uses them, and their planned `pulses`.

    Six absent thrusters complete the axes. The frame of a set `rotates` in the chief's axes if it is
    inertial.
    """

    thrusters: Floats  # (M, J, 5)
    facets: Floats  # (M, F, 12)
    rotates: Any  # (M,) of bool
    stages: ThrusterStages
    pulses: Pulses

    @classmethod
    def of(cls, stages: ThrusterStages, pulses: Pulses) -> Self:
        """Return the model of thrusters with planned pulses."""
        every = [(own, Allocation.of(own.directions)) for own in stages.thrusters]
        most = max(allocation.count for _, allocation in every) + 6
        longest = max(len(allocation.corners) for _, allocation in every)
        rows, facets = np.zeros((len(every), most, THRUSTER)), np.zeros((len(every), longest, FACET))
        rows[:, :, BIT] = NEGLIGIBLE
        for k, (own, allocation) in enumerate(every):
            rows[k, : allocation.count, :BIT] = own.directions
            rows[k, : allocation.count, BIT] = own.minimum_bit
            rows[k, : allocation.count, STRENGTH] = own.acceleration
            found = np.hstack([allocation.corners.astype(float), allocation.inverses.reshape(-1, 9)])
            facets[k] = np.resize(found, (longest, FACET))  # some facets twice
        return cls(rows, facets, np.array([own.frame == "inertial" for own, _ in every]), stages, pulses)

    def used(self, times: Floats) -> Any:
        """Return the row of the set (T,) that is used from given times onward, -1 for free thrust."""
        real = np.array([own is not None for own in self.stages.sets])
        return np.where(real, np.cumsum(real) - 1, -1)[stages_at(self.stages.starts, times)]

    def free(self, times: Floats) -> Floats:
        """Return the time (M, J, T) [s] without planned firing of each thruster since the first time."""
        found = np.tile(times - times[0], (*self.thrusters.shape[:2], 1))
        sets = self.used(self.pulses.start + 0.5 * self.pulses.duration)
        for k, j in {*zip(sets.tolist(), self.pulses.thruster.tolist(), strict=True)}:
            own = self.pulses[(sets == k) & (self.pulses.thruster == j)]
            edges = np.stack([own.start, own.start + own.duration], axis=1)
            on = np.concatenate([[0.0], np.cumsum(np.diff(edges, axis=1))])
            since = np.interp(times, edges.ravel(), np.repeat(on, 2)[1:-1])
            found[k, j] -= since - since[0]
        return found


def impulse_until(pulses: Pulses, time: float) -> float:
    """Return the total impulse of pulses up to a time [m/s], counted per thruster."""
    return float(pulses.impulse @ np.clip((time - pulses.start) / pulses.duration, 0.0, 1.0))


class ErrorEvents(NamedTuple):
    """Burns and impulses of N spacecraft in K steps, each with an independent error.

    `planned` (N, K) and `feedback` (K,) are the indices of the planned and the feedback thrust in a step, and
    `impulses` (K + 1,) those of impulses; -1 for none. `counts` are the numbers of the three kinds.
    """

    planned: Any
    feedback: Any
    impulses: Any
    counts: tuple[int, int, int]


def burn_edges(path: Path) -> Floats:
    """Return the times at which burns of one spacecraft begin and end, within its path [s].

    The thrust between two burns counts as one burn.
    """
    found = [time for a, b in burn_ranges(path) for time in (path.arcs[a, START], path.arcs[b - 1, END])]
    edges = np.unique(np.array(found))
    return np.asarray(edges[(edges > path.start) & (edges < path.end)])


@dataclass(frozen=True, eq=False)
class Commands:
    """Commands of spacecraft along `path` (N,) on a time grid.

    `known` is the force model whose model error is compensated, or None; `spans` determine when, and `frame`
    is its chief's frame at half steps. `jumps` (N, Q, 3) are planned impulses, one for each of the grid's.
    Feedback by a `law` returns to the `reference` (N,). `thrusters` fire the feedback of one spacecraft.
    """

    path: Path
    grid: TimeGrid
    known: Field | None
    frame: ChiefFrame | None
    spans: ThrustSpans
    jumps: Floats
    reference: Path
    law: Feedback | None
    engines: Engines
    thrusters: ThrusterModel | None

    @classmethod
    def of(
        cls,
        path: Path,
        law: Feedback | None,
        known: Field | None,
        engines: Engines | None = None,
        *,
        impulses: Floats | None = None,
        reference: Path | None = None,
        thrusters: ThrusterModel | None = None,
        pulsed: bool = False,
        span: tuple[float, float] | None = None,
        outputs: Floats | None = None,
    ) -> Commands:
        """Return the commands of planned paths (N,), with the planned `impulses` (M, 3) or others.

        They cover the whole path, or a `span` without impulses. `pulsed`: some spacecraft have thrusters.
        Steps end at the times of `outputs`; by default where thrust bends, and where spans begin or end.
        """
        craft, when, planned = impulses_of(path)
        longest = PULSED if pulsed else CONTINUOUS
        if not pulsed and not path.peak_thrust.any() and (law is None or law.impulses):
            longest = IMPULSIVE
        engines = engines or Engines.unlimited(len(path))
        spans, edges = ThrustSpans.of(path, law), np.concatenate([thrust_jumps(path), engines.starts[1:]])
        if outputs is None:
            outputs = np.union1d(thrust_bends(path), spans.bounds)
        whole = float(path.start[0]), float(path.end[0])
        if thrusters is not None:
            edges = np.concatenate([edges, thrusters.stages.starts[1:]])
        grid = TimeGrid.of(span or whole, law, when, edges, outputs, longest)
        fired = np.zeros((len(path), int(grid.impulses.max()) + 1, 3))
        slots = nearest(grid.impulse_times, when)
        np.add.at(fired, (craft, slots), planned if impulses is None else impulses)  # several at one instant
        frame = None if known is None else ChiefFrame.of(known, grid.times)
        target = path if reference is None else reference
        return cls(path, grid, known, frame, spans, fired, target, law, engines, thrusters)

    def among(self, which: Any) -> Commands:
        """Return the commands of the selected spacecraft (M,)."""
        each = {name: getattr(self, name)[which] for name in ("path", "jumps", "reference")}
        known = self.known and self.known._of(which)
        spans, engines = self.spans.among(which), self.engines.among(which)
        return replace(self, known=known, spans=spans, engines=engines, **each)

    def alone(self, first: int, last: int) -> tuple[Commands, Any, Any]:
        """Return the plan alone between two nodes, without feedback and compensation.

        With the rows of its impulses and of its output states among all.
        """
        nodes = slice(first, last + 1)
        fired, shown = (rows[nodes][rows[nodes] >= 0] for rows in (self.grid.impulses, self.grid.outputs))
        grid, jumps = self.grid.without_feedback(first, last), self.jumps[:, fired]
        return replace(self, grid=grid, jumps=jumps, known=None, frame=None, law=None), fired, shown

    @property
    def events(self) -> ErrorEvents:
        """Burns and impulses with independent errors."""
        grid, middle = self.grid, self.grid.times[1::2]
        edges = [burn_edges(self.path[k]) for k in range(len(self.path))]
        planned = np.array([np.searchsorted(own, middle) for own in edges])
        begins = (grid.feedback_impulses >= 0) & (self.thrusters is not None)
        if self.law is not None and not self.law.impulses:
            begins = grid.updates >= 0
        counts = max(map(len, edges)) + 1, int(begins.sum()), int(grid.impulses.max()) + 1
        feedback = np.cumsum(begins)[:-1] - 1
        feedback = np.where(feedback >= 0, counts[0] + feedback, -1)
        impulses = np.where(grid.impulses >= 0, counts[0] + counts[1] + grid.impulses, -1)
        return ErrorEvents(planned, feedback, impulses, counts)

    def frame_in(self, field: Field) -> ChiefFrame:
        """Return the chief's frame in a field at half steps."""
        if self.frame is not None and self.known is field:
            return self.frame
        return ChiefFrame.of(field, self.grid.times)
