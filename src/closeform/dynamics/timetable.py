"""Timetable of a simulation: its steps, measurements and impulses."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.feedback import Feedback
from closeform.motion.arc import END, IMPULSE, START
from closeform.motion.path import Path

# s: maximum step for pulses, for continuous thrust, for impulses alone
PULSED, STEP, COAST = 5.0, 10.0, 20.0
SHOWN = 20_000  # number of instants with stored states, about
BESIDE = 1e-6  # of a step: distance from a discontinuity of thrust
SAME = 1e-6  # s: tolerance of equal times
JUMP, BEND = 1e-6, 0.05  # of the peak thrust: a discontinuity, and a bend within a step


class Timetable(NamedTuple):
    """K steps, with the measurements, impulses and shown states at the K + 1 nodes between them."""

    times: Floats  # (2 K + 1,) [s], half steps
    looks: Any  # (K + 1,) index of a measurement, or -1
    answers: Any  # (K + 1,) index of a measurement that takes effect, or -1
    kicks: Any  # (K + 1,) index of an impulse after a measurement, or -1
    fires: Any  # (K + 1,) row of impulses, or -1
    shown: Any  # (K + 1,) row of states, or -1
    rows: Any  # (K,) row of `since` at the start of each step
    since: Floats  # (L,) [s] after a measurement: start, middle and end of each kind of step

    @property
    def nodes(self) -> Floats:
        """Start and end times of the steps (K + 1,) [s]."""
        return self.times[::2]

    @property
    def shown_times(self) -> Floats:
        """Times of shown states (T,) [s]."""
        return np.asarray(self.nodes[self.shown >= 0])

    @property
    def fired_times(self) -> Floats:
        """Times of impulses (Q,) [s]."""
        return np.asarray(self.nodes[self.fires >= 0])

    @property
    def measurements(self) -> int:
        """Number of measurements."""
        return int(self.looks.max()) + 1

    @property
    def interval(self) -> float:
        """Time between measurements [s]."""
        return float(self.times[-1] - self.times[0]) / max(self.measurements, 1)

    def during(self, first: int, last: int) -> Timetable:
        """Return the timetable between two nodes, both included."""
        nodes, steps = slice(first, last + 1), slice(first, last)
        each = ("looks", "answers", "kicks", "fires", "shown")
        numbers = {name: _from_first(getattr(self, name)[nodes]) for name in each}
        return self._replace(times=self.times[2 * first : 2 * last + 1], rows=self.rows[steps], **numbers)

    @classmethod
    def of(
        cls,
        span: tuple[float, float],
        law: Feedback | None,
        offsets: Floats,
        edges: Floats,
        fired: Floats,
        longest: float,
        looked_at: Floats,
    ) -> Timetable:
        """Return a timetable with steps of at most `longest` [s], some ending at `edges` and `fired`.

        From the start on, measurements have equal intervals, which are at most that of the feedback law.
        Impulses are fired `offsets` (J,) [s] after each measurement. States are also shown at the times
        `looked_at`, which are step ends.
        """
        start, end = span
        fired = merged(fired)
        looks = 1 if law is None else intervals_in(end - start, law.every)
        each = int(np.ceil((end - start) / looks / longest))
        thin = int(np.ceil(looks * each / SHOWN))
        each = thin * int(np.ceil(each / thin))
        base = snapped(np.linspace(start, end, looks * each + 1), fired)
        measured = base[:-1:each]
        inside = offsets[offsets < (end - start) / looks * (1.0 - BESIDE)]
        kicked = snapped(measured[:, None] + inside, np.union1d(base, fired))
        firing = np.unique(np.concatenate([kicked.ravel(), fired]))
        edges = joined(edges[edges > start + SAME], np.union1d(base, firing))
        looked_at = joined(looked_at[looked_at > start + SAME], np.union1d(edges, np.union1d(base, firing)))
        wait = 0.0 if law is None else min(law.delay, (end - start) / looks)
        answered = joined(measured + wait, base)
        nodes = np.unique(np.concatenate([base, firing, edges, answered]))
        times = np.empty(2 * len(nodes) - 1)
        times[::2], times[1::2] = nodes, 0.5 * (nodes[:-1] + nodes[1:])
        shown = np.unique(np.concatenate([base[::thin], firing, looked_at]))
        table = cls(
            times,
            _numbered(nodes, measured if law else nodes[:0], np.arange(looks)),
            _numbered(nodes, answered if law else nodes[:0], np.arange(len(answered))),
            _numbered(nodes, kicked, np.arange(len(inside))),
            _numbered(nodes, firing, np.arange(len(firing))),
            _numbered(nodes, shown, np.arange(len(shown))),
            np.zeros(len(nodes) - 1, dtype=np.int64),
            np.zeros(3),
        )
        return table if law is None or law.impulses or not len(answered) else table._measured(nodes, answered)

    def _measured(self, nodes: Floats, answered: Floats) -> Timetable:
        """Return the timetable with the rows of a law, one for each kind of step."""
        last = np.maximum(np.searchsorted(answered, nodes[:-1], side="right") - 1, 0)
        begin = np.maximum(nodes[:-1] - answered[last], 0.0)
        kinds = np.round(np.stack([begin, np.diff(nodes)], axis=1) / SAME).astype(np.int64)
        _, first, which = np.unique(kinds, axis=0, return_index=True, return_inverse=True)
        since = begin[first][:, None] + np.diff(nodes)[first][:, None] * np.array([0.0, 0.5, 1.0])
        return self._replace(rows=3 * which.ravel(), since=since.ravel())


def _from_first(rows: Any) -> Any:
    """Return indices at nodes, counted from the first of them; -1 at the others."""
    return np.where(rows >= 0, rows - rows[rows >= 0].min(initial=rows.max()), -1)


def intervals_in(duration: float, every: float) -> int:
    """Return the number of equal intervals between measurements, none longer than `every` [s]."""
    return int(np.ceil(duration / every - SAME))


def snapped(times: Floats, base: Floats) -> Floats:
    """Return times, replaced by a time of a base where they differ from it by rounding."""
    if not len(base):
        return times
    near = base[np.minimum(np.searchsorted(base, times - SAME), len(base) - 1)]
    return np.where(np.abs(times - near) <= SAME, near, times)


def merged(times: Floats) -> Floats:
    """Return times in order; of times that differ by rounding, the last."""
    times = np.unique(times)
    return np.asarray(times[np.diff(times, append=np.inf) > SAME])


def joined(times: Floats, base: Floats) -> Floats:
    """Return times before the end of a base, each once, equal to the base where they differ by rounding."""
    times = np.unique(snapped(times, base))
    apart = np.diff(times, prepend=-np.inf) > SAME
    return np.asarray(times[apart & (times < base[-1] - SAME)])


def _numbered(nodes: Floats, times: Floats, numbers: Any) -> Any:
    """Return the given numbers at the nodes (K + 1,) at the given times; -1 at the others."""
    out = np.full(len(nodes), -1)
    if times.size:
        out[np.searchsorted(nodes, times)] = numbers
    return out


def edges_of(path: Path) -> Floats:
    """Return the times of thrust discontinuities of any craft [s]."""
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


def bends_of(path: Path) -> Floats:
    """Return the times at which the thrust of any craft bends too sharply for one step [s]."""
    found = [np.zeros(0)]
    for k in np.flatnonzero(path.peak_thrust):
        one = path[int(k)]
        times = one.arcs[:, START]
        aside = np.minimum(STEP, np.minimum(times - one.start, one.end - times))
        bend = one.thrust(times + aside) + one.thrust(times - aside) - 2.0 * one.thrust(times)
        found.append(times[np.linalg.norm(bend, axis=1) > BEND * one.peak_thrust])
    return np.concatenate(found)


def impulses_of(path: Path) -> tuple[Any, Floats, Floats]:
    """Return the craft (M,), times (M,) [s] and sizes (M, 3) [m/s] of all impulses of paths (N,)."""
    jumps = path.arcs[:, IMPULSE : IMPULSE + 3]
    rows = np.flatnonzero(jumps.any(axis=1))
    craft = np.searchsorted(path.offsets, rows, side="right") - 1
    return craft, path.arcs[rows, START], jumps[rows]
