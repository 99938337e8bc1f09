"""Time grid of a simulation: its steps, measurements, impulses and output times."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import Feedback, slots_before_next
from closeform.motion.arc import END, START
from closeform.motion.path import Path

# s: maximum step for pulses, for continuous thrust, for impulses alone
PULSED, CONTINUOUS, IMPULSIVE = 5.0, 10.0, 20.0
OUTPUTS = 20_000  # number of instants with stored states, about
BESIDE = 1e-6  # of a step: distance from a discontinuity of thrust
SAME = 1e-6  # s: tolerance of equal times
JUMP, BEND = 1e-6, 0.05  # of the peak thrust: a discontinuity, and a bend within a step
NEIGHBOURHOOD = 10.0  # s: half-interval in which a bend is measured


class TimeGrid(NamedTuple):
    """K steps, and what happens at the K + 1 nodes between them; an index is -1 where nothing happens."""

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

    def during(self, first: int, last: int) -> TimeGrid:
        """Return the grid between two nodes, both included."""
        nodes, steps = slice(first, last + 1), slice(first, last)
        each = ("measurements", "updates", "feedback_impulses", "impulses", "outputs")
        numbers = {name: _from_first(getattr(self, name)[nodes]) for name in each}
        return self._replace(times=self.times[2 * first : 2 * last + 1], rows=self.rows[steps], **numbers)

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
        Measurements are at equal intervals of at most the law's, from the start on.
        """
        start, end = span
        impulses = _merged(impulses)
        looks = 1 if law is None else intervals_in(end - start, law.every)
        each = int(np.ceil((end - start) / looks / longest))
        thin = int(np.ceil(looks * each / OUTPUTS))
        each = thin * int(np.ceil(each / thin))
        base = snapped(np.linspace(start, end, looks * each + 1), impulses)
        measured = base[:-1:each]
        inside = np.zeros(0) if law is None else slots_before_next(law, (end - start) / looks)
        corrected = snapped(measured[:, None] + inside, np.union1d(base, impulses))
        firing = np.unique(np.concatenate([corrected.ravel(), impulses]))
        edges = np.concatenate([edges, outputs])
        edges = joined(edges[edges > start + SAME], np.union1d(base, firing))
        outputs = joined(outputs[outputs > start + SAME], np.union1d(edges, np.union1d(base, firing)))
        wait = 0.0 if law is None else min(law.delay, (end - start) / looks)
        updated = joined(measured + wait, base)
        nodes = np.unique(np.concatenate([base, firing, edges, updated]))
        times = np.empty(2 * len(nodes) - 1)
        times[::2], times[1::2] = nodes, 0.5 * (nodes[:-1] + nodes[1:])
        numbers = [
            _numbered(nodes, measured if law else nodes[:0]),
            _numbered(nodes, updated if law else nodes[:0]),
            _numbered(nodes, corrected),
            _numbered(nodes, firing),
            _numbered(nodes, np.unique(np.concatenate([base[::thin], firing, outputs]))),
        ]
        if law is None or law.impulses or not len(updated):
            return cls._make([times, *numbers, np.zeros(len(nodes) - 1, dtype=np.int64), np.zeros(3)])
        return cls._make([times, *numbers, *_kinds(nodes, updated)])


def _kinds(nodes: Floats, updated: Floats) -> tuple[Any, Floats]:
    """Return `rows` and `since` of a grid, for continuous feedback that is `updated` at given times."""
    last = np.maximum(np.searchsorted(updated, nodes[:-1], side="right") - 1, 0)
    begin = np.maximum(nodes[:-1] - updated[last], 0.0)
    kinds = np.round(np.stack([begin, np.diff(nodes)], axis=1) / SAME).astype(np.int64)
    _, first, which = np.unique(kinds, axis=0, return_index=True, return_inverse=True)
    since = begin[first][:, None] + np.diff(nodes)[first][:, None] * np.array([0.0, 0.5, 1.0])
    return 3 * which.ravel(), since.ravel()


def _from_first(rows: Any) -> Any:
    """Return indices at nodes, counted from the first of them; -1 at the others."""
    return np.where(rows >= 0, rows - rows[rows >= 0].min(initial=rows.max()), -1)


def _numbered(nodes: Floats, times: Floats) -> Any:
    """Return the indices, along the last axis, of times at the nodes (K + 1,); -1 at the others."""
    out = np.full(len(nodes), -1)
    if times.size:
        out[np.searchsorted(nodes, times)] = np.arange(times.shape[-1])
    return out


def intervals_in(duration: float, every: float) -> int:
    """Return the number of equal intervals between measurements, none longer than `every` [s]."""
    return int(np.ceil(duration / every - SAME))


def snapped(times: Floats, base: Floats) -> Floats:
    """Return times, replaced by a time of a base where they differ from it by rounding."""
    if not len(base):
        return times
    near = base[np.minimum(np.searchsorted(base, times - SAME), len(base) - 1)]
    return np.where(np.abs(times - near) <= SAME, near, times)


def joined(times: Floats, base: Floats) -> Floats:
    """Return times before the end of a base, each once, equal to the base where they differ by rounding."""
    times = np.unique(snapped(times, base))
    apart = np.diff(times, prepend=-np.inf) > SAME
    return np.asarray(times[apart & (times < base[-1] - SAME)])


def _merged(times: Floats) -> Floats:
    """Return times in order; of times that differ by rounding, the last."""
    times = np.unique(times)
    return np.asarray(times[np.diff(times, append=np.inf) > SAME])


def thrust_discontinuities(path: Path) -> Floats:
    """Return the times of thrust discontinuities of any spacecraft [s]."""
    found = [np.zeros(0)]
    for k in np.flatnonzero(path.peak_thrust):
        one = path[int(k)]
        lengths = one.arcs[:, END] - one.arcs[:, START]
        # short enough to resolve a brief pulse in a simulation of days
        shortest = lengths[lengths > SAME].min()
        near = min(BESIDE * (one.end - one.start), 0.25 * shortest)
        times = one.arcs[:, START]
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
