"""Propagation of commanded spacecraft with sampled errors: stretches of steps for the integrator."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import delay_transitions, impulse_gains, optimal_return
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.force_model.hill_frame import ChiefFrame
from closeform.dynamics.model_error import residuals
from closeform.dynamics.simulation.commands import Commands
from closeform.dynamics.simulation.integrator import FACET, THRUSTER, Stretch, integrate
from closeform.dynamics.simulation.random_errors import ErrorEvents, SampledErrors
from closeform.dynamics.simulation.thruster_model import impulse_until
from closeform.dynamics.simulation.time_grid import BESIDE, SAME
from closeform.motion.arc import IMPULSE, STATE
from closeform.motion.path import Path

ROUNDS = 2  # rounds of a simulation with a user function; the first has an error from the force gradient
FEW = 8  # fewer simulations do not justify a thread of their own
STRETCH = 20_000  # steps in memory at the same time, about


@dataclass(frozen=True, eq=False)
class Trajectories:
    """S simulations of N spacecraft at T output times.

    `states` (S, N, T, 6) are those after impulses, and `arrivals` before. `fired` (S, N, Q, 3) [m/s] are the
    impulses, or the delta-v of thruster orders, at Q `fired_times`. `spent` (S, N) [m/s] is the delta-v,
    `nominal` (N,) that of the plan without errors, and `limited` (S, N) [s] the time at the thrust limit.
    """

    times: Floats
    states: Floats
    arrivals: Floats
    fired_times: Floats
    fired: Floats
    spent: Floats
    nominal: Floats
    limited: Floats


def propagate(
    commands: Commands,
    field: Field,
    errors: SampledErrors,
    begin: Floats | None = None,
    frame: ChiefFrame | None = None,
    around: Path | None = None,
) -> Trajectories:
    """Simulate commands with sampled errors in a field.

    The simulation starts from states `begin` (N, 6) before impulses; by default from those of the path plus
    errors. A user function minus its zonals is evaluated `around` paths: those of a simulation without
    errors, found in two rounds.
    """
    grid, count, flights = commands.grid, len(commands.path), len(errors.measured)
    frame = frame or commands.frame_in(field)
    if field.acceleration is not None and around is None:
        around, still = commands.path, SampledErrors.none(count, grid.measurement_count)
        for _ in range(ROUNDS):
            alone = propagate(commands, field, still, begin, frame, around)
            around = commands.path.orbit._through(alone.times, alone.states[0], alone.arrivals[0])
    if begin is None:
        first = commands.path.arcs[commands.path.offsets[:-1]]
        begin = first[:, STATE : STATE + 6].copy()
        begin[:, 3:] -= first[:, IMPULSE : IMPULSE + 3]
        begin = begin + errors.start
    now = np.zeros((flights, count, 18))
    now[..., :6] = begin
    states = np.empty((flights, count, int(grid.outputs.max()) + 1, 6))
    fired = np.zeros((flights, count, int(grid.impulses.max()) + 1, 3))
    spent, nominal, step = np.zeros((flights, count, 2)), np.zeros(count), 0
    for stretch in stretches(commands, field, frame, around, errors):
        noise = np.ascontiguousarray(errors.noise[:, :, step : step + len(stretch.lengths)])
        rows = errors.measured, errors.thrust, errors.events, noise, now, states, fired, spent
        _in_threads(field, stretch, rows)
        step += len(stretch.lengths)
        size = np.minimum(np.linalg.norm(stretch.thrust, axis=3), stretch.limits[:, None, None])
        nominal += size @ [1.0, 4.0, 1.0] @ stretch.lengths / 6.0  # the quadrature of the kernel
        nominal += np.linalg.norm(stretch.planned_impulses, axis=2).sum(axis=1) * (stretch.limits > 0.0)
    arrivals = states
    if commands.thrusters is not None:  # the integrator counts simultaneous pulses as their sum
        over = min(float(grid.nodes[-1]), float(commands.engines.lost[0]))
        pulses = commands.thrusters.pulses
        given = impulse_until(pulses, over) - impulse_until(pulses, min(float(grid.nodes[0]), over))
        spent[..., 0] += given - nominal
        nominal = np.array([given])
    elif fired.size:
        arrivals = states.copy()
        arrivals[:, :, grid.outputs[grid.impulses >= 0], 3:] -= fired
    delta_v, limited = spent[..., 0], spent[..., 1]
    return Trajectories(
        grid.output_times, states, arrivals, grid.impulse_times, fired, delta_v, nominal, limited
    )


def _in_threads(field: Field, stretch: Stretch, each: tuple[Floats, ...]) -> None:
    """Integrate a stretch of all simulations on all cores; arrays of `each` are (S, N, ...)."""
    flights, count = each[0].shape[:2]
    flat = [rows.reshape(flights * count, *rows.shape[2:]) for rows in each]

    def some(part: slice) -> None:
        of_each = slice(part.start * count, part.stop * count)
        integrate(field._constants, stretch, *(rows[of_each] for rows in flat))

    size = max(FEW, -(-flights // (os.cpu_count() or 1)))
    parts = [slice(k, k + size) for k in range(0, flights, size)]
    if len(parts) == 1:
        some(parts[0])
        return
    with ThreadPoolExecutor(len(parts)) as pool:
        list(pool.map(some, parts))


def stretches(
    commands: Commands, field: Field, frame: ChiefFrame, around: Path | None, errors: SampledErrors
) -> Iterator[Stretch]:
    """Yield the stretches of a simulation, each up to a measurement or a loss of thrust."""
    grid, law, orbit = commands.grid, commands.law, commands.path.orbit
    rules, gains = np.zeros((len(grid.since), 3, 6)), np.zeros((0, 3, 6))
    late = np.stack([np.eye(6), np.zeros((6, 6))])
    if law is not None and law.impulses:
        gains = impulse_gains(orbit, law, commands.thrusters is not None)[1]
    elif law is not None:
        rules = optimal_return(orbit, law.horizon, grid.since)[2]
    if law is not None and law.delay > 0.0:
        late = np.stack(delay_transitions(orbit, law, grid.interval))
    own_errors = errors.events.size
    events = commands.events if own_errors else ErrorEvents.none(len(commands.path), grid)
    ends = np.flatnonzero((grid.outputs if law is None else grid.measurements)[:-1] >= 0)[1:]
    lost = np.searchsorted(grid.nodes, commands.engines.lost - SAME)
    lost = lost[(lost > 0) & (lost < len(grid.rows))]
    last, stops = 0, np.unique([*ends, len(grid.rows), *lost]).tolist()
    for here, after in zip(stops, [*stops[1:], np.inf], strict=True):
        if after - last > STRETCH or here in lost:
            steps = slice(last, here)
            own = *events.during(steps), errors.gates
            yield _stretch(commands, field, frame, around, (rules, gains, late), steps, own)
            last = here


def _stretch(
    commands: Commands,
    field: Field,
    frame: ChiefFrame,
    around: Path | None,
    feedback: tuple[Floats, Floats, Floats],
    steps: slice,
    errors: tuple[Any, Any, Any, Floats],
) -> Stretch:
    """Return the stretch of the given steps, with feedback rules, gains and delay matrices.

    `errors`: the error events of burns and impulses, and their Gates parameters.
    """
    grid, path, count = commands.grid, commands.path, len(commands.path)
    halves, nodes = slice(2 * steps.start, 2 * steps.stop + 1), slice(steps.start, steps.stop + 1)
    times, begins = grid.times[halves], grid.nodes[nodes]
    lengths = np.diff(begins)
    within = begins[:-1, None] + lengths[:, None] * np.array([BESIDE, 0.5, 1.0 - BESIDE])
    commanded = path.thrust(within.ravel()).reshape(count, -1, 3, 3)
    compensated = commands.spans.compensated(times[1::2])
    if commands.known is not None and commands.frame is not None and compensated.any():
        there, n = commands.frame.during(halves), path.orbit.mean_motion
        left_out = residuals(commands.known, there, path.state(times), n)
        commanded -= _stepwise(left_out) * compensated[..., None, None]
    here, unknown = frame.during(halves), np.zeros((count, 0, 3, 3))
    if around is not None:
        unknown = _stepwise(_beyond_zonals(field, here, around.state(times)))
    each = grid.measurements, grid.updates, grid.feedback_impulses, grid.impulses, grid.outputs
    which = [part[nodes].copy() for part in each]
    if steps.stop < len(grid.rows):  # what happens at the last node belongs to the next stretch
        for part in which:
            part[-1] = -1
    if commands.law is None:
        for part in which[:3]:
            part[:] = -1
    measured, updates, feedback_impulses, impulses, outputs = which
    jumps, planned = np.zeros((count, len(begins), 3)), np.zeros((count, len(begins), 6))
    jumps[:, impulses >= 0] = commands.jumps[:, impulses[impulses >= 0]]
    if (seen := measured >= 0).any():
        planned[:, seen] = commands.reference.state(begins[seen])
    chief = here.states[:, :3], here.states[:, 3:], here.acceleration, here.axes, here.rotation
    floats = [
        np.ascontiguousarray(part, dtype=float)
        for part in (lengths, *chief, commanded, unknown, jumps, planned)
    ]
    running = commands.engines.lost - SAME > begins[0]
    limits = np.where(running, commands.engines.limits, 0.0)
    bits = np.where(running, commands.engines.bits, np.inf)
    rules, gains, late = feedback
    laws = measured, updates, late, grid.rows[steps], rules, feedback_impulses, gains, outputs, impulses
    orders = _thruster_rows(commands, steps, begins, feedback_impulses)
    return Stretch._make([*floats, *laws, commands.ballistics, limits, bits, *orders, *errors])


def _thruster_rows(
    commands: Commands, steps: slice, begins: Floats, feedback_impulses: Any
) -> tuple[Any, ...]:
    """Return thrusters, facets, angles, free times and ends of orders of a stretch."""
    grid, count, model = commands.grid, len(commands.path), commands.thrusters
    ordered, coming = (
        np.flatnonzero(feedback_impulses >= 0),
        np.flatnonzero(grid.feedback_impulses[steps.stop :] >= 0),
    )
    over = steps.stop + coming[0] if len(coming) else len(grid.nodes) - 1
    now = np.append(begins, grid.nodes[over])  # also the end of the last order
    rows = np.zeros((0, THRUSTER)), np.zeros((0, FACET)), np.zeros(len(now)), np.zeros((0, len(now)))
    if model is not None:
        angles = commands.path.orbit.mean_motion * now * model.rotates
        rows = model.thrusters, model.facets, angles, model.free(now)
    slots = np.zeros(len(begins), dtype=np.int64)
    slots[ordered] = [*ordered[1:], len(begins)][: len(ordered)]
    return *(np.broadcast_to(one, (count, *one.shape)).copy() for one in rows), slots


def _stepwise(values: Floats) -> Floats:
    """Return values (N, 2 K + 1, 3) at half steps as start, middle and end of each step (N, K, 3, 3)."""
    return np.stack([values[:, :-2:2], values[:, 1::2], values[:, 2::2]], axis=2)


def _beyond_zonals(field: Field, frame: ChiefFrame, states: Floats) -> Floats:
    """Return the acceleration of a user function minus its zonals (N, T, 3) [m/s^2], inertial."""
    there = frame.inertial(states)
    zonal = replace(field, acceleration=None)
    return field.accelerations(frame.times, there) - zonal.accelerations(frame.times, there)
