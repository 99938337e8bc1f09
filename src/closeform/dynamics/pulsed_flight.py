"""Simulations with thruster pulses: the firing for a plan in a force model, and the resulting paths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.dynamics.chief_frame import ChiefFrame
from closeform.dynamics.drag import ballistics_of
from closeform.dynamics.drawn import Draws, nothing_drawn
from closeform.dynamics.engines import Engines
from closeform.dynamics.feedback import BY_IMPULSES, Feedback
from closeform.dynamics.field import Field
from closeform.dynamics.flown_plan import spanning
from closeform.dynamics.holding import Holding, fires
from closeform.dynamics.infeasible import Grounded
from closeform.dynamics.lost_thrust import flown_by_each, losses, until_lost
from closeform.dynamics.pulsed_way import PulsedWay
from closeform.dynamics.reachable import reachable
from closeform.dynamics.reference_trajectory import Flights, commands_of, flown, in_order
from closeform.dynamics.residual import residuals
from closeform.dynamics.retargeted import Retargeted, changed_impulses, retargeted
from closeform.dynamics.thruster_model import nozzles_of
from closeform.dynamics.timetable import BESIDE, edges_of, impulses_of, joined
from closeform.fuel.chunks import PUSHES
from closeform.fuel.firing import ThrusterFiring, fire_thrusters
from closeform.fuel.pulses import Pulses, linked
from closeform.fuel.thrusters import Thrusters
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, PUSH, START, WIDTH
from closeform.motion.joining import stack
from closeform.motion.path import Path, ends_of
from closeform.named_craft import named

PIECE = 30.0  # s: length of an arc that interpolates the command at four instants
INSIDE = np.array([BESIDE, 1.0 / 3.0, 2.0 / 3.0, 1.0 - BESIDE])


def fired_in(
    paths: Path,
    jumps: Retargeted,
    field: Field,
    thrusters: Sequence[Thrusters | None],
    mass: ArrayLike | None = None,
    specific_impulse: ArrayLike | None = None,
    law: Feedback | None = None,
) -> ThrusterFiring:
    """Return the thruster firing for planned paths (N,) in a field: plan minus residual, and `jumps`.

    `jumps` are impulses changed for the field. Craft that coast, or are held on coasts under feedback by a
    `law`, fire nothing. Along axes without a thruster the residual is not compensated.
    """
    holding, asked = Holding.of(paths, law), []
    steady, n = _commanded(paths, field, holding.bounds, thrusters), paths.orbit.mean_motion
    shooters = [k for k, own in enumerate(thrusters) if own is not None]
    for k in shooters:
        one, own, arcs = paths[k], holding.among([k]), paths[k].arcs.copy()
        fitted = thrusters[k]
        assert fitted is not None
        mine, planned = jumps.craft == k, jumps.planned[jumps.craft == k]
        pushed = reachable(fitted, n * jumps.time[mine])
        changed = np.einsum("tij,tj->ti", pushed, jumps.impulse[mine] - planned)
        arcs[fires(arcs), IMPULSE : IMPULSE + 3] = planned + changed
        if one.delta_v:
            lasting, opposed = (own.opposed(some[:, [START, END]].mean(1))[0] for some in (arcs, steady[k]))
            arcs = np.concatenate([arcs[~lasting], steady[k][opposed]])
            arcs = arcs[np.lexsort((arcs[:, END], arcs[:, START]))]
        asked.append(linked(one.orbit, arcs, ends_of(one)[0]))
    try:
        return _fired(stack(asked), shooters, thrusters, mass, specific_impulse)
    except Grounded as error:
        if PUSHES not in str(error) or not _can_fire(paths[shooters], thrusters):
            raise
        reason = str(error).replace(PUSHES, "the correction of the plan for this field requires thrust")
        raise Grounded(f"{reason.partition(';')[0]}; add one there, or omit thrusters") from None


def _can_fire(paths: Path, thrusters: Sequence[Thrusters | None]) -> bool:
    """Return True if the thrusters can fire the planned paths in Hill's equations."""
    try:
        fire_thrusters(paths, [one for one in thrusters if one is not None])
    except ValueError:
        return False
    return True


def _fired(
    paths: Path,
    shooters: Sequence[int],
    thrusters: Sequence[Thrusters | None],
    mass: ArrayLike | None = None,
    specific_impulse: ArrayLike | None = None,
) -> ThrusterFiring:
    """Return the firing of the craft `shooters`. Raises Grounded with the index among all craft."""
    try:
        return fire_thrusters(paths, [one for one in thrusters if one is not None], mass, specific_impulse)
    except ValueError as error:
        raise Grounded(named(str(error), [f"craft {k}" for k in shooters])) from None


def _commanded(paths: Path, field: Field, bounds: Floats, thrusters: Sequence[Thrusters | None]) -> Floats:
    """Return arcs (N, M, 30) of the thrust minus the residual; some end at `bounds` (B,) [s].

    The arcs have no states. The residual counts only along axes that `thrusters` control.
    """
    n, start, end = paths.orbit.mean_motion, float(paths.start[0]), float(paths.end[0])
    even = np.linspace(start, end, int(np.ceil((end - start) / PIECE)) + 1)
    edges = np.union1d(even, joined(np.concatenate([edges_of(paths), bounds]), even))
    lengths = np.diff(edges)
    within = edges[:-1, None] + lengths[:, None] * INSIDE
    times = within.ravel()
    left_out = residuals(field, ChiefFrame.of(field, times), paths.state(times), n)
    for k, own in enumerate(thrusters):
        if own is not None:
            left_out[k] = np.einsum("tij,tj->ti", reachable(own, n * times), left_out[k])
    thrust = paths.thrust(times) - left_out
    angle = n * lengths[:, None] * INSIDE
    # of 1, t, P1, P2
    basis = np.stack([angle**0, angle, 1.0 - np.cos(angle), angle - np.sin(angle)], axis=-1)
    met = np.linalg.solve(basis, thrust.reshape(len(paths), -1, 4, 3)) * n ** np.arange(4.0)[:, None]
    arcs = np.zeros((len(paths), len(lengths), WIDTH))
    arcs[..., START], arcs[..., END], arcs[..., MEAN_MOTION] = edges[:-1], edges[1:], n
    arcs[..., PUSH:] = met.reshape(len(paths), -1, 12)
    return arcs


def led_by_pulses(law: Feedback, thrusters: Sequence[Thrusters | None]) -> Feedback:
    """Return the feedback law for pulses: one pulse in each period of the craft with the longest one.

    Raises Grounded if thrusters would have to fire more often.
    """
    longest = max((one.period or 0.0 for one in thrusters if one is not None), default=0.0)
    if law.delay:
        raise Grounded("delay: requires continuous thrust, but thrusters fire pulses; remove it")
    if not law.impulses:
        return replace(law, impulses=max(int(law.horizon / longest), 2) if longest else BY_IMPULSES.impulses)
    if law.horizon / law.impulses < longest * (1.0 - BESIDE):
        raise Grounded(
            f"feedback: pulses {law.horizon / law.impulses:g} s apart, but thrusters fire once in "
            f"{longest:g} s; give fewer impulses, or a longer horizon"
        )
    return law


def fly_pulses(
    paths: Path,
    thrusters: Sequence[Thrusters | None],
    fields: tuple[Field, Field],
    law: Feedback | None,
    draws: Draws,
    lost: Floats,
    engines: Engines,
) -> tuple[ThrusterFiring, Floats, Floats, Floats, Flights]:
    """Return the firing for planned paths (N,), its planned cost (N,) [m/s], and `flown_pulses`.

    The cost is that of the firing in Hill's equations, counted per thruster, until thrust is `lost` (N,) [s].
    """
    law = law and led_by_pulses(law, thrusters)
    jumps, _, _ = changed_impulses(paths, fields[1], law)
    firing = fired_in(paths, jumps, fields[1], thrusters, law=law)
    planned = planned_by_pulses(paths, thrusters, lost)
    return firing, planned, *flown_pulses(paths, firing, thrusters, fields, law, draws, lost, engines)


def planned_by_pulses(paths: Path, thrusters: Sequence[Thrusters | None], lost: Floats) -> Floats:
    """Return the cost of planned paths (N,) in Hill's equations [m/s], per thruster, until thrust is lost."""
    shooters = [k for k, own in enumerate(thrusters) if own is not None]
    planned = np.array(until_lost(paths, lost).delta_v)
    by_plan = _fired(paths[shooters], shooters, thrusters).pulses
    for j, k in enumerate(shooters):
        planned[k] = given_until(by_plan[by_plan.craft == j], lost[k])
    return planned


def given_until(pulses: Pulses, time: float) -> float:
    """Return the total impulse of the given pulses up to a time [m/s]."""
    return float(pulses.impulse @ np.clip((time - pulses.start) / pulses.duration, 0.0, 1.0))


def each_counts(done: Flights, given: float) -> Flights:
    """Return one craft's simulations, with the delta-v of planned pulses summed over thrusters."""
    asked = np.array([given])
    return replace(done, spent=done.spent - done.asked + asked, asked=asked)


def flown_exactly(
    paths: Path, firing: ThrusterFiring, thrusters: Sequence[Thrusters | None], field: Field
) -> tuple[Floats, Floats]:
    """Return times (T,), and states (N, T, 6) that result from the firing, without errors."""
    nothing = nothing_drawn(len(paths))
    times, _, done = flown_pulses(
        paths, firing, thrusters, (field, field), None, nothing, losses(None, len(paths))
    )
    return times, done.states[0]


def pulsed_ways(
    paths: Path, firing: ThrusterFiring, thrusters: Sequence[Thrusters], field: Field, law: Feedback
) -> tuple[Floats, list[PulsedWay]]:
    """Return times (T,), and the reference paths (N,) of feedback for craft with thrusters."""
    plan = spanning(paths, np.array([firing.path.start.min(), firing.path.end.max()]))
    drag, found = ballistics_of(field.drag, len(paths)), []
    for k, own in enumerate(thrusters):
        pulses = firing.pulses[firing.pulses.craft == k]
        arguments = firing.path[k : k + 1], law, None, drag[[k]]
        commands = commands_of(*arguments, nozzles=nozzles_of(own, pulses), beside=np.zeros(0))
        frame, holding = commands.frame_in(field), Holding.of(paths[k : k + 1], law)
        found.append(PulsedWay.of(commands, plan[k], holding, pulses, field, frame))
    return commands.table.shown_times, found


def flown_pulses(
    paths: Path,
    firing: ThrusterFiring,
    thrusters: Sequence[Thrusters | None],
    fields: tuple[Field, Field],
    law: Feedback | None,
    draws: Draws,
    lost: Floats,
    engines: Engines | None = None,
) -> tuple[Floats, Floats, Flights]:
    """Return times (T,), times of thruster orders (Q,), and simulations of planned paths (N,) by pulses.

    The simulation is in the first of two `fields`; guidance uses the second. Craft with thrusters have their
    own steps, and feedback returns them to the path of their pulses, or to the plan on held coasts. Craft
    without thrusters are simulated with continuous thrust or impulses. `draws` holds the errors, and `lost`
    (N,) [s] the times at which thrust is lost.
    """
    field, believed = fields
    span = np.array([firing.path.start.min(), firing.path.end.max()])
    rest = [k for k, one in enumerate(thrusters) if one is None]
    shooters = [k for k, one in enumerate(thrusters) if one is not None]
    beside = lost[np.isfinite(lost)]
    if rest:
        held = Holding.of(paths[rest], law).bounds
        beside = np.concatenate([beside, impulses_of(paths[rest])[1], held])
    felt, expected = (ballistics_of(one.drag, len(paths)) for one in fields)
    each, measured, planned = [], None, spanning(paths, span)
    for j, k in enumerate(shooters):
        pulses = firing.pulses[firing.pulses.craft == j]
        nozzles = nozzles_of(firing.thrusters[j], pulses)
        own, some = firing.path[j : j + 1], [k]
        led = plain = commands_of(own, law, None, expected[some], nozzles=nozzles, beside=beside)
        frame = plain.frame_in(field)
        measured = measured or draws.measured(plain.table)  # of all craft, measured together
        if law is not None and len(pulses):
            known = frame if believed is field else ChiefFrame.of(believed, plain.table.times)
            way = PulsedWay.of(plain, planned[k], Holding.of(paths[k : k + 1], law), pulses, believed, known)
            led = replace(plain, reference=way.states[None])
        own_commands = replace(led, ballistics=felt[some], lost=lost[k])
        done = flown(own_commands, field, frame, draws.of(led, some, measured))
        each.append(each_counts(done, given_until(pulses, lost[k])))
    if rest:
        own = planned[rest]
        bounds = engines and engines.among(rest)
        commands = commands_of(own, law, believed._of(rest), expected[rest], bounds, beside=beside)
        frame = commands.frame_in(field)
        if len(beside):
            commands = retargeted(commands, believed)
        own_commands = replace(commands, ballistics=felt[rest])
        done = flown_by_each(own_commands, field, frame, draws, rest, lost, measured)
        orders = np.zeros((len(done.spent), len(rest), *each[0].fired.shape[2:]))
        each.append(replace(done, fired=orders))
    return plain.table.shown_times, plain.table.fired_times, in_order(each, shooters + rest)
