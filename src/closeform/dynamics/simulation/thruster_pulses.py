"""Thruster pulses for a plan in a force model, and the reference path that they cause without errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import BY_IMPULSES, REPLACED, Feedback
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.infeasible import Infeasible
from closeform.dynamics.model_error import path_residuals
from closeform.dynamics.planned_paths import extended_paths, until_lost
from closeform.dynamics.simulation.commands import (
    BESIDE,
    SAME,
    Commands,
    ThrusterModel,
    ThrusterStages,
    ThrustSpans,
    TimeGrid,
    fires,
    impulse_until,
    merged,
    stages_at,
    thrust_jumps,
)
from closeform.dynamics.simulation.impulse_retargeting import Retargeted
from closeform.dynamics.simulation.propagate import propagate
from closeform.dynamics.simulation.random_errors import SampledErrors
from closeform.fuel.firing import ThrusterFiring, fire_thrusters, largest_distance
from closeform.fuel.pulses import Pulses, one_table
from closeform.fuel.thrusters import Thrusters, turn
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, PUSH, START, WIDTH
from closeform.motion.joining import linked, stack
from closeform.motion.path import Path, ends_of
from closeform.named_craft import named

PIECE = 30.0  # s: length of an arc that interpolates the command at four instants
INSIDE = np.array([BESIDE, 1.0 / 3.0, 2.0 / 3.0, 1.0 - BESIDE])
ROUNDING = 1e-9  # of an interval between plans
FLAT = 1e-9  # relative singular value below which directions span only a plane or a line


def shooters(thrusters: Sequence[ThrusterStages | None]) -> list[int]:
    """Return the indices of the spacecraft that have thrusters."""
    return [k for k, own in enumerate(thrusters) if own is not None]


def fire_plan(
    paths: Path,
    impulses: Retargeted,
    field: Field,
    thrusters: Sequence[ThrusterStages | None],
    mass: ArrayLike | None = None,
    specific_impulse: ArrayLike | None = None,
    law: Feedback | None = None,
) -> ThrusterFiring:
    """Return the thruster firing for planned paths (N,) in a field: plan minus model error, and `impulses`.

    The impulses are changed for the field. Spacecraft that coast, or are held on coasts under feedback by a
    `law`, fire nothing. Along axes without a thruster the model error is not compensated.
    """
    every, commanded, n = ThrustSpans.of(paths, law), [], paths.orbit.mean_motion
    bounds = np.concatenate([every.bounds, *(own.starts[1:] for own in thrusters if own is not None)])
    steady = _compensated(paths, field, bounds, thrusters)
    for k, own in enumerate(thrusters):
        if own is None:
            continue
        one, spans, arcs = paths[k], every.among([k]), paths[k].arcs.copy()
        mine, planned = impulses.craft == k, impulses.planned[impulses.craft == k]
        axes = controllable_in_stages(own, impulses.time[mine], n)
        changed = np.einsum("tij,tj->ti", axes, impulses.impulse[mine] - planned)
        arcs[fires(arcs), IMPULSE : IMPULSE + 3] = planned + changed
        if one.delta_v:
            by_thrust, compensated = (
                spans.compensated(some[:, [START, END]].mean(1))[0] for some in (arcs, steady[k])
            )
            arcs = np.concatenate([arcs[~by_thrust], steady[k][compensated]])
            arcs = arcs[np.lexsort((arcs[:, END], arcs[:, START]))]
        commanded.append(linked(one.orbit, arcs, ends_of(one)[0]))
    return _fire(stack(commanded), thrusters, mass, specific_impulse)


def _fire(
    paths: Path,
    thrusters: Sequence[ThrusterStages | None],
    mass: ArrayLike | None = None,
    specific_impulse: ArrayLike | None = None,
) -> ThrusterFiring:
    """Return the firing of the spacecraft that have thrusters. Raises Infeasible with the index among all."""
    own = [one for one in thrusters if one is not None]
    try:
        if any(len(one.sets) > 1 for one in own):
            return _fire_in_stages(paths, own)
        return fire_thrusters(paths, [one.thrusters[0] for one in own], mass, specific_impulse)
    except ValueError as error:
        raise Infeasible(named(str(error), [f"craft {k}" for k in shooters(thrusters)])) from None


def _fire_in_stages(paths: Path, thrusters: Sequence[ThrusterStages]) -> ThrusterFiring:
    """Return the firing of spacecraft (N,), some of which change thrusters; no bounds of their deviations."""
    real, pulses, dropped = list[Path](), list[Pulses](), list[Pulses]()
    for k, own in enumerate(thrusters):
        arcs, begin = list[Floats](), ends_of(paths[k])[0]
        for piece, used in own.pieces(paths[k]):
            if used is not None:
                try:
                    fired = fire_thrusters(piece, used)
                except ValueError as error:
                    name, _, words = str(error).partition(": ")
                    raise ValueError(f"{name}: craft {k}: {words}") from None
                early, late = fired.path.start < piece.start, fired.path.end > piece.end
                if (early and piece.start > paths[k].start) or (late and piece.end < paths[k].end):
                    raise ValueError(
                        f"thrusters: craft {k}: burns last beyond a change of thrusters, at "
                        f"{piece.start:g} or {piece.end:g} s; plan a longer coast there"
                    )
                piece = fired.path
                pulses.append(replace(fired.pulses, craft=np.full(len(fired.pulses), k)))
                dropped.append(replace(fired.dropped, craft=np.full(len(fired.dropped), k)))
            if not arcs:
                begin = ends_of(piece)[0]
            arcs.append(piece.arcs)
        real.append(linked(paths.orbit, np.concatenate(arcs), begin))
    span = np.array([min(one.start for one in real), max(one.end for one in real)])
    path, planned = extended_paths(stack(real), span), extended_paths(paths, span)
    table, unknown = one_table(pulses), np.full(len(real), np.nan)
    return ThrusterFiring(
        path=path,
        planned=planned,
        thrusters=tuple(own.thrusters[0] for own in thrusters),
        pulses=table,
        dropped=one_table(dropped),
        deviation=np.array([largest_distance(path[k], planned[k]) for k in range(len(real))]),
        deviation_bound=unknown,
        dropped_deviation=unknown,
        delta_v=np.bincount(table.craft, table.impulse, len(real)),
        propellant=unknown,
        conflicts=None,
    )


def _compensated(
    paths: Path, field: Field, bounds: Floats, thrusters: Sequence[ThrusterStages | None]
) -> Floats:
    """Return arcs (N, M, 30) of the thrust minus the model error; some end at `bounds` (B,) [s].

    The arcs have no states. The model error counts only along axes that `thrusters` control.
    """
    n, start, end = paths.orbit.mean_motion, float(paths.start[0]), float(paths.end[0])
    even = np.linspace(start, end, int(np.ceil((end - start) / PIECE)) + 1)
    edges = merged(even, np.concatenate([thrust_jumps(paths), bounds]))
    lengths = np.diff(edges)
    times = (edges[:-1, None] + lengths[:, None] * INSIDE).ravel()
    left_out = path_residuals(field, paths, times)
    for k, own in enumerate(thrusters):
        if own is not None:
            left_out[k] = np.einsum("tij,tj->ti", controllable_in_stages(own, times, n), left_out[k])
    thrust = paths.thrust(times) - left_out
    angle = n * lengths[:, None] * INSIDE
    # of 1, t, P1, P2
    basis = np.stack([angle**0, angle, 1.0 - np.cos(angle), angle - np.sin(angle)], axis=-1)
    met = np.linalg.solve(basis, thrust.reshape(len(paths), -1, 4, 3)) * n ** np.arange(4.0)[:, None]
    arcs = np.zeros((len(paths), len(lengths), WIDTH))
    arcs[..., START], arcs[..., END], arcs[..., MEAN_MOTION] = edges[:-1], edges[1:], n
    arcs[..., PUSH:] = met.reshape(len(paths), -1, 12)
    return arcs


def pulse_feedback(law: Feedback, thrusters: Sequence[ThrusterStages | None]) -> Feedback:
    """Return the feedback law for pulses: one pulse in each period of the spacecraft with the longest one.

    Raises Infeasible if thrusters would have to fire more often.
    """
    own = [one for stages in thrusters if stages is not None for one in stages.thrusters]
    longest = max((one.period or 0.0 for one in own), default=0.0)
    if law.delay:
        raise Infeasible("delay: requires continuous thrust, but thrusters fire pulses; remove it")
    if not law.impulses:
        return replace(law, impulses=max(int(law.horizon / longest), 2) if longest else BY_IMPULSES.impulses)
    if law.horizon / law.impulses < longest * (1.0 - REPLACED):
        raise Infeasible(
            f"feedback: pulses {law.horizon / law.impulses:g} s apart, but thrusters fire once in "
            f"{longest:g} s; give fewer impulses, or a longer horizon"
        )
    return law


def divide_interval(thrusters: Sequence[ThrusterStages | None], every: float) -> list[ThrusterStages | None]:
    """Return thrusters with periods, no shorter, of which a whole number fits between two plans [s].

    The pulses up to a new plan then equal the thrust of the old one. Raises Infeasible if no period fits.
    """

    def divided(own: Thrusters | None) -> Thrusters | None:
        if own is None or own.period is None:
            return own
        if own.period > every * (1.0 + ROUNDING):
            raise Infeasible(
                f"feedback: new plans {every:g} s apart, but thrusters fire once in {own.period:g} s; "
                "increase `every`"
            )
        return replace(own, period=every / int(every / own.period + ROUNDING))

    return [own and own._replace(sets=tuple(map(divided, own.sets))) for own in thrusters]


def planned_delta_v(paths: Path, thrusters: Sequence[ThrusterStages | None], lost: Floats) -> Floats:
    """Return the delta-v of planned paths (N,) in Hill's equations [m/s], until thrust is `lost` (N,) [s].

    That of spacecraft with thrusters is counted per thruster.
    """
    planned, firing = np.array(until_lost(paths, lost).delta_v), shooters(thrusters)
    pulses = _fire(paths[firing], thrusters).pulses if firing else None
    for j, k in enumerate(firing):
        own = thrusters[k]
        assert own is not None
        assert pulses is not None
        free = [stack([piece]) for piece, used in own.pieces(paths[k]) if used is None]
        planned[k] = impulse_until(pulses[pulses.craft == j], lost[k])
        planned[k] += sum(float(until_lost(piece, lost[[k]]).delta_v[0]) for piece in free)
    return planned


def pulsed_reference(
    plan: Path, fired: Path, model: ThrusterModel, field: Field, law: Feedback | None
) -> tuple[Path, list[tuple[float, Floats]]]:
    """Return the path of a plan (1,) that is `fired` (1,) in a field, and how held coasts begin off the plan.

    Each span of pulses starts from the planned state; without feedback there is one span. On coasts that
    feedback holds the path is that of the plan; they begin at times [s] with state errors (6,).
    """
    commands = Commands.of(fired, law, None, thrusters=model, pulsed=True, outputs=np.zeros(0))
    grid, frame, missed = commands.grid, commands.frame_in(field), list[tuple[float, Floats]]()
    states = plan.state(grid.output_times)
    arrivals = states.copy()
    spans, held = np.array([[grid.nodes[0], grid.nodes[-1]]]), ThrustSpans.of(plan, law)
    if law is not None:
        spans = np.concatenate([held.impulsive[0], held.continuous[0]])
    for first, last in _spans(grid, spans, model.pulses):
        part, _, shown = commands.alone(first, last)
        # a span that begins with an impulse starts before it
        begin = plan.state(grid.nodes[first]) if first else None
        during = frame.during(slice(2 * first, 2 * last + 1))
        found = propagate(part, field, SampledErrors.none(1), begin, during)
        missed.append((float(grid.nodes[last]), found.states[0, 0, -1] - states[0, shown[-1]]))
        states[0, shown], arrivals[0, shown] = found.states[0, 0], found.arrivals[0, 0]
    return plan.orbit._through(grid.output_times, states, arrivals), missed


def _spans(grid: TimeGrid, spans: Floats, pulses: Pulses) -> list[tuple[int, int]]:
    """Return the first and the last node of each span (M, 2) with planned thrust, up to its last pulse.

    Both nodes have outputs, and the first precedes all firing; spans that touch are merged.
    """
    shown = np.flatnonzero(grid.outputs >= 0)
    times, ends = grid.nodes[shown], pulses.start + pulses.duration
    found = list[tuple[int, int]]()
    for begin, end in spans[np.argsort(spans[:, 0])]:
        during = (pulses.start < end) & (ends > begin)
        begin, end = pulses.start[during].min(initial=begin), ends[during].max(initial=end)
        first = max(int(np.searchsorted(times, begin - SAME)) - 1, 0)
        last = min(int(np.searchsorted(times, end - SAME)), len(times) - 1)
        if found and first <= found[-1][1]:
            first, last = found[-1][0], max(last, found[-1][1])
            found.pop()
        found.append((first, last))
    return [(int(shown[first]), int(shown[last])) for first, last in found]


def controllable_axes(thrusters: Thrusters, angles: Floats) -> Floats:
    """Return projections (T, 3, 3) onto the span of the thrusters, after rotations by `angles` (T,) [rad].

    In the orbit's axes. For thrusters that control all axes the projection is the unit matrix.
    """
    sides, sizes, _ = np.linalg.svd(thrusters.directions.T, full_matrices=False)
    span = sides[:, sizes > FLAT * sizes[0]]
    turned = turn(angles if thrusters.frame == "inertial" else 0.0 * angles) @ span
    return np.asarray(turned @ turned.swapaxes(-1, -2))


def controllable_in_stages(own: ThrusterStages, times: Floats, n: float) -> Floats:
    """Return the projections (T, 3, 3) of `controllable_axes` at times (T,), for the set in use."""
    found, which = np.tile(np.eye(3), (len(times), 1, 1)), stages_at(own.starts, times)
    for k, used in enumerate(own.sets):
        if used is not None:
            found[which == k] = controllable_axes(used, n * times[which == k])
    return found


def lacks_axis(thrusters: Thrusters) -> bool:
    """Return True if there is an axis along which no thruster acts in either direction."""
    return bool(np.linalg.matrix_rank(thrusters.directions, tol=FLAT) < 3)
