"""Retargeting: impulses changed so that they reach in a field the states planned with Hill's equations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.chief_frame import ChiefFrame
from closeform.dynamics.drag import ballistics_of
from closeform.dynamics.drawn import exactly
from closeform.dynamics.feedback import Feedback
from closeform.dynamics.field import Field
from closeform.dynamics.infeasible import Grounded
from closeform.dynamics.reference_trajectory import Commands, commands_of, flown
from closeform.dynamics.timetable import SAME, impulses_of
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.result import Rows

ROUNDS = 12  # of Newton's method
MET = 1e-6  # m, change of a round at convergence
NUDGE = 1e-4  # m/s, step of the finite differences
ALONG = 64  # points along the path that are fitted
LEVER = 0.02  # least relative effect of an impulse on the end, per radian of the orbit
FREE = 1e-2  # weight of the change of impulses relative to points along the path


@dataclass(frozen=True, eq=False, repr=False)
class Retargeted(Rows):
    """Impulses of craft, changed for a field, in order of craft and time: M rows.

    Attributes
    ----------
    craft : array of int of shape (M,)
        Index of the craft of each.
    time : array of shape (M,) [s]
        Time since the chief's epoch.
    impulse : array of shape (M, 3) [m/s]
        Radial, along-track and cross-track impulse, in the chief's axes.
    planned : array of shape (M, 3) [m/s]
        Impulse of the plan, in the same axes.
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


def changed_impulses(
    paths: Path, field: Field, law: Feedback | None = None
) -> tuple[Retargeted, Path, Floats]:
    """Return impulses changed for the field, the resulting paths, and their deviation (N,) [m].

    Simultaneous impulses of one craft, at the junction of two plans, are changed by equal parts. Under
    feedback the paths are its reference.
    """
    craft, times, planned = impulses_of(paths)
    deviation = np.zeros(len(paths))
    if not len(craft):
        return Retargeted(craft, times, planned, planned), paths, deviation
    plain = commands_of(paths, law, field, ballistics_of(field.drag, len(paths)))
    commands = retargeted(plain, field)
    assert commands.reference is not None
    table = plain.table
    when, before = table.shown_times, commands.reference.copy()
    before[:, table.shown[table.fires >= 0], 3:] -= commands.jumps
    slots = np.searchsorted(table.fired_times, times)
    at_once = ((craft == craft[:, None]) & (slots == slots[:, None])).sum(axis=1)
    changed = planned + (commands.jumps - plain.jumps)[craft, slots] / at_once[:, None]
    fires = np.unique(craft)
    off = commands.reference[..., :3] - paths.position(when)
    deviation[fires] = np.linalg.norm(off, axis=2).max(axis=1)[fires]
    own = paths.orbit._through(when, commands.reference, before)
    path = stack([own[k] if k in fires else paths[k] for k in range(len(paths))])
    return Retargeted(craft, times, changed, planned), path, deviation


def retargeted(commands: Commands, field: Field) -> Commands:
    """Return commands with impulses changed for a field, and their path in it as reference.

    Each span in which impulses move a craft starts from the planned state; elsewhere the reference is the
    plan.
    """
    frame = commands.frame_in(field)
    jumps, reference = commands.jumps.copy(), commands.path.state(commands.table.shown_times)
    for (first, last), who in _spans(commands).items():
        part, fired, shown = commands.of(who).alone(first, last)
        changed, states = _retargeted(part, field, frame.during(slice(2 * first, 2 * last + 1)))
        jumps[np.ix_(who, fired)], reference[np.ix_(who, shown)] = changed, states
    return replace(commands, jumps=jumps, reference=reference)


def _spans(commands: Commands) -> dict[tuple[int, int], list[int]]:
    """Return the first and the last node of each impulsive span, and its craft."""
    nodes, found = commands.table.nodes, dict[tuple[int, int], list[int]]()
    for k, moves in enumerate(commands.holding.moves):
        for begin, end in moves:
            first = int(np.searchsorted(nodes, begin - SAME))
            last = int(np.searchsorted(nodes, end + SAME, side="right")) - 1
            found.setdefault((first, last), []).append(k)
    return found


def _retargeted(commands: Commands, field: Field, frame: ChiefFrame) -> tuple[Floats, Floats]:
    """Return the impulses of a span (N, Q, 3) changed for a field, and the resulting states (N, T, 6).

    Impulses reach the end state as far as possible, and pass points along the path as closely as the
    remaining degrees of freedom allow. Newton's method, theory (89), with finite differences from
    simulations.
    """
    times, n = commands.table.shown_times, commands.path.orbit.mean_motion
    wanted = commands.path.state(times)
    begin = commands.path.state(commands.table.nodes[0])
    if commands.table.fires[0] >= 0:
        begin[:, 3:] -= commands.jumps[:, 0]
    along = np.unique(np.linspace(0, len(times) - 1, ALONG + 1).astype(int)[1:])
    crafts = [np.flatnonzero(own.any(axis=1)) for own in commands.jumps]

    def off(states: Floats) -> Floats:
        """Return the end position, scaled end velocity, and points along the path of states (..., T, 6)."""
        end = states[..., -1, :] / np.repeat([1.0, n], 3)
        return np.concatenate([end, states[..., along, :3].reshape(*states.shape[:-2], -1)], axis=-1)

    def led(some: Commands, begin: Floats) -> Floats:
        """Return the states (N, T, 6) that result from the impulses."""
        return np.asarray(flown(some, field, frame, exactly(len(begin), 1), begin).states[0])

    states = led(commands, begin)
    did = []
    for k, own in enumerate(crafts):
        nudged = _nudged(commands, k, own)
        did.append(n * off(led(nudged, np.tile(begin[k], (len(nudged.path), 1))) - states[k]).T / NUDGE)
    jumps = commands.jumps.copy()
    for _ in range(ROUNDS):
        moved = 0.0
        for k, (own, lengths) in enumerate(zip(crafts, did, strict=True)):
            changed = (jumps[k] - commands.jumps[k])[own].ravel() / n
            step = _step(lengths, off(states[k] - wanted[k]), changed)
            jumps[k, own] += n * step.reshape(-1, 3)
            moved = max(moved, float(np.abs(step).max()))
        states = led(replace(commands, jumps=jumps), begin)
        if moved < MET:
            return jumps, states
    raise Grounded(
        f"plan: changes of its impulses for this field do not converge in {ROUNDS} rounds; plan shorter "
        "stages, or continuous thrust (cost 'energy')"
    )


def _step(did: Floats, missed: Floats, changed: Floats) -> Floats:
    """Return the further change of impulses (3 M,), as lengths, for the errors `missed` (6 + P,).

    The first six components of the error are those of the end state. Changes with little effect on the end
    are determined by points along the path.
    """
    push, singular, ways = np.linalg.svd(did[:6])
    strong = int((singular > LEVER).sum())
    met = ways[:strong].T @ (push[:, :strong].T @ -missed[:6] / singular[:strong])
    free = ways[strong:].T
    pushed = np.vstack([did[6:] @ free, FREE * free])
    rest = np.concatenate([missed[6:] + did[6:] @ met, FREE * (changed + met)])
    return np.asarray(met - free @ np.linalg.lstsq(pushed, rest)[0])


def _nudged(commands: Commands, craft: int, own: Any) -> Commands:
    """Return 3 M copies of a craft, each with one component of one of its `own` impulses (M,) increased."""
    which = np.full(3 * len(own), craft)
    some = commands.of(which)
    some.jumps[np.arange(len(which)), np.repeat(own, 3), np.tile(np.arange(3), len(own))] += NUDGE
    return some
