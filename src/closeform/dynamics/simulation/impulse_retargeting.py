"""Retargeting: impulses changed so that they reach the planned states in a force model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import Feedback
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.force_model.hill_frame import ChiefFrame
from closeform.dynamics.infeasible import Infeasible
from closeform.dynamics.planned_paths import impulses_of
from closeform.dynamics.simulation.commands import SAME, Commands, nearest
from closeform.dynamics.simulation.propagate import propagate
from closeform.dynamics.simulation.random_errors import SampledErrors
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
    """Impulses of spacecraft, changed for a field, in order of spacecraft and time: M rows.

    Attributes
    ----------
    craft : array of int of shape (M,)
        Index of the spacecraft of each.
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


def retarget(paths: Path, field: Field | None, law: Feedback | None = None) -> tuple[Retargeted, Path]:
    """Return the impulses of paths (N,) changed for a field, if any, and the resulting paths.

    Each span in which impulses move a spacecraft starts from the planned state; elsewhere the resulting path
    is the plan. Under feedback by a `law` it holds long coasts. Simultaneous impulses of one spacecraft, at
    the junction of two plans, are changed by equal parts.
    """
    craft, times, planned = impulses_of(paths)
    if field is None or not len(craft):
        return Retargeted(craft, times, planned, planned), paths
    commands = Commands.of(paths, law, field)
    grid, frame = commands.grid, commands.frame_in(field)
    jumps, states = commands.jumps.copy(), paths.state(grid.output_times)
    for (first, last), which in _spans(commands).items():
        part, fired, shown = commands.among(which).alone(first, last)
        found = _solve(part, field._of(which), frame.during(slice(2 * first, 2 * last + 1)))
        jumps[np.ix_(which, fired)], states[np.ix_(which, shown)] = found
    before = states.copy()
    before[:, grid.outputs[grid.impulses >= 0], 3:] -= jumps
    slots = nearest(grid.impulse_times, times)
    at_once = ((craft == craft[:, None]) & (slots == slots[:, None])).sum(axis=1)
    changed = planned + (jumps - commands.jumps)[craft, slots] / at_once[:, None]
    own = paths.orbit._through(grid.output_times, states, before)
    path = stack([own[k] if k in craft else paths[k] for k in range(len(paths))])
    return Retargeted(craft, times, changed, planned), path


def _spans(commands: Commands) -> dict[tuple[int, int], list[int]]:
    """Return the first and the last node of each impulsive span, and its spacecraft."""
    nodes, found = commands.grid.nodes, dict[tuple[int, int], list[int]]()
    for k, moves in enumerate(commands.spans.impulsive):
        for begin, end in moves:
            first = int(np.searchsorted(nodes, begin - SAME))
            last = int(np.searchsorted(nodes, end + SAME, side="right")) - 1
            found.setdefault((first, last), []).append(k)
    return found


def _solve(commands: Commands, field: Field, frame: ChiefFrame) -> tuple[Floats, Floats]:
    """Return the impulses of a span (N, Q, 3) changed for a field, and the resulting states (N, T, 6).

    The end state is met as far as impulses can, and points along the path as closely as the remaining freedom
    allows. Newton's method, theory (89), with finite differences from simulations.
    """
    times, n = commands.grid.output_times, commands.path.orbit.mean_motion
    wanted = commands.path.state(times)
    begin = commands.path.state(commands.grid.nodes[0])
    if commands.grid.impulses[0] >= 0:
        begin[:, 3:] -= commands.jumps[:, 0]
    along = np.unique(np.linspace(0, len(times) - 1, ALONG + 1).astype(int)[1:])
    crafts = [np.flatnonzero(own.any(axis=1)) for own in commands.jumps]

    def off(states: Floats) -> Floats:
        """Return the end position, scaled end velocity, and points along the path of states (..., T, 6)."""
        end = states[..., -1, :] / np.repeat([1.0, n], 3)
        return np.concatenate([end, states[..., along, :3].reshape(*states.shape[:-2], -1)], axis=-1)

    def simulated(some: Commands, which: Any = slice(None)) -> Floats:
        """Return the states (N, T, 6) of spacecraft that result from the impulses."""
        still = SampledErrors.none(len(begin[which]))
        return np.asarray(propagate(some, field._of(which), still, begin[which], frame).states[0])

    states, effects = simulated(commands), []
    for k, own in enumerate(crafts):
        copies = np.full(3 * len(own), k)
        nudged = commands.among(copies)  # once for each impulse and axis
        nudged.jumps[np.arange(len(copies)), np.repeat(own, 3), np.tile(np.arange(3), len(own))] += NUDGE
        effects.append(n * off(simulated(nudged, copies) - states[k]).T / NUDGE)
    jumps = commands.jumps.copy()
    for _ in range(ROUNDS):
        moved = 0.0
        for k, (own, effect) in enumerate(zip(crafts, effects, strict=True)):
            changed = (jumps[k] - commands.jumps[k])[own].ravel() / n
            step = _step(effect, off(states[k] - wanted[k]), changed)
            jumps[k, own] += n * step.reshape(-1, 3)
            moved = max(moved, float(np.abs(step).max()))
        states = simulated(replace(commands, jumps=jumps))
        if moved < MET:
            return jumps, states
    raise Infeasible(
        f"plan: changes of its impulses for this field do not converge in {ROUNDS} rounds; plan shorter "
        "stages, or continuous thrust (cost 'energy')"
    )


def _step(effect: Floats, missed: Floats, changed: Floats) -> Floats:
    """Return the further change of impulses (3 M,), as lengths, for the errors `missed` (6 + P,).

    The first six errors are those at the end. Changes with little `effect` on the end are determined by
    points along the path.
    """
    push, singular, ways = np.linalg.svd(effect[:6])
    strong = int((singular > LEVER).sum())
    met = ways[:strong].T @ (push[:, :strong].T @ -missed[:6] / singular[:strong])
    free = ways[strong:].T
    pushed = np.vstack([effect[6:] @ free, FREE * free])
    rest = np.concatenate([missed[6:] + effect[6:] @ met, FREE * (changed + met)])
    return np.asarray(met - free @ np.linalg.lstsq(pushed, rest)[0])
