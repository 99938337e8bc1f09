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
from closeform.field.grounded import Grounded
from closeform.field.timetable import impulses_of
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.result import Rows

ROUNDS = 12
MET = 1e-6  # m, by which a round still changes what is met
NUDGE = 1e-4  # m/s, by which impulses differ to see what they do
ALONG = 64  # places along the path that are kept
LEVER = 0.02  # of the length that a change leads to in a radian of the orbit: an end is not met by less
FREE = 1e-2  # how much that length counts, beside places along the path


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
    """Impulses in the field, what is flown, and how far that is from the plan (N,) [m].

    Those of one craft at one instant, as two plans have where they meet, are changed by equal parts.
    """
    craft, times, planned = impulses_of(paths)
    deviation = np.zeros(len(paths))
    if not len(craft):
        return Retargeted(craft, times, planned, planned), paths, deviation
    plain = commands_of(paths, None, field, ballistics_of(field.drag, len(paths)))
    commands, done = retargeted(plain, field)
    when = plain.table.shown_times
    slots = np.searchsorted(plain.table.fired_times, times)
    at_once = ((craft == craft[:, None]) & (slots == slots[:, None])).sum(axis=1)
    changed = planned + (commands.jumps - plain.jumps)[craft, slots] / at_once[:, None]
    fires = np.unique(craft)
    off = done.states[0, ..., :3] - paths.position(when)
    deviation[fires] = np.linalg.norm(off, axis=2).max(axis=1)[fires]
    own = paths.orbit._through(when, done.states[0], done.arrivals[0])
    path = stack([own[k] if k in fires else paths[k] for k in range(len(paths))])
    return Retargeted(craft, times, changed, planned), path, deviation


def retargeted(commands: Commands, field: Field) -> tuple[Commands, Flights]:
    """The same with impulses changed for a field, and what they fly in it as reference; that flight.

    In which those without impulses coast, or thrust as planned.

    The state at the end is met as far as impulses lead there, and places along the path as nearly as that
    leaves free.  By Newton's method, theory (89): what impulses do is flown, by craft whose impulses differ.
    """
    times, n = commands.table.shown_times, commands.path.orbit.mean_motion
    frame, alone = commands.frame_in(field), replace(commands, known=None, law=None)
    wanted = commands.path.state(times)
    along = np.unique(np.linspace(0, len(times) - 1, ALONG + 1).astype(int)[1:])
    crafts = [np.flatnonzero(own.any(axis=1)) for own in commands.jumps]

    def off(states: Floats) -> Floats:
        """The end, its speed as a length, and places along the path, of states (..., T, 6)."""
        end = states[..., -1, :] / np.repeat([1.0, n], 3)
        return np.concatenate([end, states[..., along, :3].reshape(*states.shape[:-2], -1)], axis=-1)

    done = flown(alone, field, frame, exactly(len(crafts), 1))
    states = done.states[0]
    did = {k: n * off(some - states[k]).T / NUDGE for k, some in _nudged(alone, crafts, field, frame)}
    jumps = commands.jumps.copy()
    for _ in range(ROUNDS):
        moved = 0.0
        for k, lengths in did.items():
            own = crafts[k]
            changed = (jumps[k] - commands.jumps[k])[own].ravel() / n
            step = _step(lengths, off(states[k] - wanted[k]), changed)
            jumps[k, own] += n * step.reshape(-1, 3)
            moved = max(moved, float(np.abs(step).max()))
        done = flown(replace(alone, jumps=jumps), field, frame, exactly(len(crafts), 1))
        states = done.states[0]
        if moved < MET:
            break
    else:
        raise Grounded(
            f"plan: changes of its impulses for this field do not settle in {ROUNDS} rounds; plan in shorter "
            "stages, or thrust that lasts: cost 'energy'"
        )
    fires = np.isin(np.arange(len(crafts)), list(did))
    reference = np.where(fires[:, None, None], states, wanted)
    return replace(commands, jumps=jumps, reference=reference), done


def _step(did: Floats, missed: Floats, changed: Floats) -> Floats:
    """How impulses are to change further (3 M,), as lengths: places (6 + P,), first the end, are `missed`.

    What they hardly do to the end is not asked of them: such changes are left to places along the path.
    """
    push, singular, ways = np.linalg.svd(did[:6])
    strong = int((singular > LEVER).sum())
    met = ways[:strong].T @ (push[:, :strong].T @ -missed[:6] / singular[:strong])
    free = ways[strong:].T
    pushed = np.vstack([did[6:] @ free, FREE * free])
    rest = np.concatenate([missed[6:] + did[6:] @ met, FREE * (changed + met)])
    return np.asarray(met - free @ np.linalg.lstsq(pushed, rest)[0])


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
        beside = replace(commands.of(which), jumps=jumps)
        yield k, flown(beside, field, frame, exactly(len(which), 1)).states[0]
