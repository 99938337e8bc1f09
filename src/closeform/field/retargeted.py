"""Retargeting: impulses that lead in a field where the planned ones lead in Hill's equations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import Floats
from closeform.field.chief_frame import ChiefFrame
from closeform.field.course import Commands, commands_of, exactly, flown
from closeform.field.drag import ballistics_of
from closeform.field.field import Field
from closeform.field.timetable import impulses_of
from closeform.motion.joining import stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.result import Rows

ROUNDS = 30
MET = 1e-6  # m, by which a round still changes what is met
ALONG = 64  # places along the path that are kept
HARD = 1e4  # how much the end counts, beside a place before it
FREE = 1e-7  # how little a change of impulses counts, as the length that it leads to in a radian of the orbit


@dataclass(frozen=True, eq=False, repr=False)
class Retargeted(Rows):
    """Impulses of craft, changed for a field, in order of craft and time: M rows; made by `thrust`.

    Attributes
    ----------
    craft : array of int of shape (M,)
        Whose each is, by index.
    time : array of shape (M,) [s]
        Since the chief's epoch.
    impulse : array of shape (M, 3) [m/s]
        Radial, along-track and cross-track, in the chief's axes.
    planned : array of shape (M, 3) [m/s]
        Those of the plan, in the same axes.
    """

    _columns: ClassVar = {
        "craft": "craft",
        "time": "time_s",
        "impulse": "vx_m_s vy_m_s vz_m_s",
        "planned": "planned_vx_m_s planned_vy_m_s planned_vz_m_s",
    }

    craft: Any
    time: Floats
    impulse: Floats
    planned: Floats

    def __len__(self) -> int:
        return len(self.time)


def changed_impulses(paths: Path, field: Field) -> tuple[Retargeted, Path, Floats]:
    """Impulses in the field, what is flown, and how far that is from the plan (N,) [m]."""
    craft, times, planned = impulses_of(paths)
    deviation = np.zeros(len(paths))
    if not len(craft):
        return Retargeted(craft, times, planned, planned), paths, deviation
    plain = commands_of(paths, None, field, ballistics_of(field.drag, len(paths)))
    frame = ChiefFrame.of(field, plain.table.times)
    commands = retargeted(plain, field, frame)
    done = flown(commands, field, frame, *exactly(len(paths), 1))
    when = plain.table.shown_times
    changed = commands.jumps[craft, np.searchsorted(plain.table.fired_times, times)]
    fires = np.unique(craft)
    off = done.states[0, ..., :3] - paths.position(when)
    deviation[fires] = np.linalg.norm(off, axis=2).max(axis=1)[fires]
    own = paths.orbit._through(when, done.states[0], done.arrivals[0])
    path = stack([own[k] if k in fires else paths[k] for k in range(len(paths))])
    return Retargeted(craft, times, changed, planned), path, deviation


def retargeted(commands: Commands, field: Field, frame: ChiefFrame) -> Commands:
    """The same with impulses changed for a field, and what they fly in it as reference.

    The state at the end is met, and places along the path as nearly as that leaves free.  By Newton's method
    with Hill's transition, which is that of the field to some parts in a thousand.           # theory (89)
    """
    table, orbit = commands.table, commands.path.orbit
    still = exactly(len(commands.path), 1)
    alone = replace(commands, known=None, law=None)
    times = table.shown_times
    fired = table.fired_times
    wanted = commands.path.state(times)
    where = np.unique(np.linspace(0, len(times) - 1, ALONG + 1).astype(int)[1:])
    jumps = commands.jumps.copy()
    crafts = [np.flatnonzero(own.any(axis=1)) for own in jumps]
    pushes = [_responses(orbit, fired[own], times[where], float(times[-1])) for own in crafts]
    for _ in range(ROUNDS):
        states = flown(replace(alone, jumps=jumps), field, frame, *still).states[0]
        moved = 0.0
        for k, (own, push) in enumerate(zip(crafts, pushes, strict=True)):
            if not len(own):
                continue
            off = states[k] - wanted[k]
            end = HARD * off[-1] * np.repeat([1.0, 1.0 / orbit.mean_motion], 3)
            change = (jumps[k] - commands.jumps[k])[own] * (FREE / orbit.mean_motion)
            missed = np.concatenate([off[where, :3].ravel(), end, change.ravel()])
            step = np.linalg.lstsq(push, -missed)[0].reshape(-1, 3)
            jumps[k, own] += step
            moved = max(moved, float(np.abs(step).max()) / orbit.mean_motion)
        if moved < MET:
            break
    fires = np.array([len(own) > 0 for own in crafts])
    return replace(commands, jumps=jumps, reference=np.where(fires[:, None, None], states, wanted))


def _responses(orbit: Orbit, fired: Floats, times: Floats, end: float) -> Floats:
    """What impulses at times (M,) do to places at times (T,), to the end, and to themselves: (., 3 M)."""
    n, count, rows = orbit.mean_motion, len(fired), 3 * len(times)
    out = np.zeros((rows + 6 + 3 * count, 3 * count))
    for j, time in enumerate(fired):
        own = slice(3 * j, 3 * j + 3)
        moved = orbit.transition(np.maximum(np.append(times, end) - time, 0.0))[..., 3:]
        out[:rows, own] = moved[:-1, :3].reshape(-1, 3)
        out[rows : rows + 6, own] = HARD * moved[-1] * np.repeat([1.0, 1.0 / n], 3)[:, None]
        out[rows + 6 + 3 * j : rows + 9 + 3 * j, own] = FREE / n * np.eye(3)
    return out
