"""Retargeting: impulses that lead in a field where the planned ones lead in Hill's equations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import Floats
from closeform.field.chief_frame import ChiefFrame
from closeform.field.course import Commands, Flights, commands_of, flown
from closeform.field.drag import ballistics_of
from closeform.field.drawn import exactly
from closeform.field.field import Field
from closeform.field.timetable import impulses_of
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.result import Rows

ROUNDS = 12
MET = 1e-6  # m, by which a round still changes what is met
NUDGE = 1e-4  # m/s, by which impulses differ to see what they do
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
    commands, done = retargeted(plain, field)
    when = plain.table.shown_times
    changed = commands.jumps[craft, np.searchsorted(plain.table.fired_times, times)]
    fires = np.unique(craft)
    off = done.states[0, ..., :3] - paths.position(when)
    deviation[fires] = np.linalg.norm(off, axis=2).max(axis=1)[fires]
    own = paths.orbit._through(when, done.states[0], done.arrivals[0])
    path = stack([own[k] if k in fires else paths[k] for k in range(len(paths))])
    return Retargeted(craft, times, changed, planned), path, deviation


def retargeted(commands: Commands, field: Field) -> tuple[Commands, Flights]:
    """The same with impulses changed for a field, and what they fly in it as reference; that flight.

    In which those without impulses coast, or thrust as planned.

    The state at the end is met, and places along the path as nearly as that leaves free.  By Newton's method:
    what impulses do is flown, by craft whose impulses differ.                                # theory (89)
    """
    times, orbit = commands.table.shown_times, commands.path.orbit
    frame, free = commands.frame_in(field), FREE / orbit.mean_motion
    alone = replace(commands, known=None, law=None)
    wanted = commands.path.state(times)
    along = np.unique(np.linspace(0, len(times) - 1, ALONG + 1).astype(int)[1:])
    crafts = [np.flatnonzero(own.any(axis=1)) for own in commands.jumps]

    def off(states: Floats) -> Floats:
        """Places along the path, and the end as it counts, of states (..., T, 6)."""
        end = HARD * states[..., -1, :] * np.repeat([1.0, 1.0 / orbit.mean_motion], 3)
        return np.concatenate([states[..., along, :3].reshape(*states.shape[:-2], -1), end], axis=-1)

    done = flown(alone, field, frame, exactly(len(crafts), 1))
    states = done.states[0]
    did = {k: off(some - states[k]) / NUDGE for k, some in _nudged(alone, crafts, field, frame)}
    jumps = commands.jumps.copy()
    for _ in range(ROUNDS):
        moved = 0.0
        for k, responses in did.items():
            own = crafts[k]
            pushed = np.vstack([responses.T, free * np.eye(3 * len(own))])
            changed = free * (jumps[k] - commands.jumps[k])[own].ravel()
            missed = np.concatenate([off(states[k] - wanted[k]), changed])
            step = np.linalg.lstsq(pushed, -missed)[0].reshape(-1, 3)
            jumps[k, own] += step
            moved = max(moved, float(np.abs(step).max()) / orbit.mean_motion)
        done = flown(replace(alone, jumps=jumps), field, frame, exactly(len(crafts), 1))
        states = done.states[0]
        if moved < MET:
            break
    else:
        raise ValueError(
            "plan: no change of its impulses was found with which it ends in this field where it should; "
            "plan in shorter stages, or burns"
        )
    fires = np.isin(np.arange(len(crafts)), list(did))
    reference = np.where(fires[:, None, None], states, wanted)
    return replace(commands, jumps=jumps, reference=reference), done


def _nudged(
    commands: Commands, crafts: list[Any], field: Field, frame: ChiefFrame
) -> Iterator[tuple[int, Floats]]:
    """Each craft that fires, and states (3 M, T, 6) with each of its M impulses larger along each axis."""
    for k, own in enumerate(crafts):
        if not len(own):
            continue
        which = np.full(3 * len(own), k)
        jumps = commands.jumps[which]
        jumps[np.arange(len(which)), np.repeat(own, 3), np.tile(np.arange(3), len(own))] += NUDGE
        some = {
            name: getattr(commands, name)[which] for name in ("cancelled", "limits", "bits", "ballistics")
        }
        beside = replace(commands, path=commands.path[which], jumps=jumps, **some)
        yield k, flown(beside, field, frame, exactly(len(which), 1)).states[0]
