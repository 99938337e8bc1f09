"""Propagation of commanded spacecraft with sampled errors."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import delay_transitions, impulse_gains, optimal_return
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.force_model.hill_frame import ChiefFrame
from closeform.dynamics.model_error import residuals
from closeform.dynamics.simulation.commands import BESIDE, Commands, ErrorEvents, impulse_until
from closeform.dynamics.simulation.integrator import FACET, THRUSTER, Steps, integrate
from closeform.dynamics.simulation.random_errors import SampledErrors
from closeform.motion.arc import IMPULSE, STATE
from closeform.motion.path import Path

ROUNDS = 2  # rounds of a simulation with a user function; the first has an error from the force gradient
AT_ONCE = 20_000  # steps whose model error is computed together: more do not fit into caches
FEW = 8  # fewer simulations do not justify a thread of their own
NONE, NONE_OF_EACH = np.empty(0, dtype=np.int64), np.empty((0, 0), dtype=np.int64)
NO_EVENTS = ErrorEvents(NONE_OF_EACH, NONE, NONE, (0, 0, 0))


@dataclass(frozen=True, eq=False)
class Trajectories:
    """S simulations of N spacecraft at T output times.

    `states` (S, N, T, 6) are those after impulses, and `arrivals` before. `orders` (S, N, Q, 3) [m/s] are the
    delta-v of feedback orders to thrusters at Q times `ordered`, 0 without thrusters. `spent` (S, N) [m/s] is
    the delta-v, `nominal` (N,) that of the plan without errors, and `limited` (S, N) [s] the time at the
    thrust limit.
    """

    times: Floats
    states: Floats
    arrivals: Floats
    ordered: Floats
    orders: Floats
    spent: Floats
    nominal: Floats
    limited: Floats

    @classmethod
    def joined(cls, parts: Sequence[Trajectories], axis: int, order: Any = slice(None)) -> Trajectories:
        """Return the trajectories of seeds (axis 0) or of spacecraft (axis 1) as one, in an `order`."""
        if len(parts) == 1:
            return parts[0]
        names, where = ("states", "arrivals", "orders", "spent", "limited"), (slice(None),) * axis + (order,)
        each = {name: np.concatenate([getattr(one, name) for one in parts], axis)[where] for name in names}
        nominal = np.concatenate([one.nominal for one in parts])[order] if axis else parts[0].nominal
        return replace(parts[0], nominal=nominal, **each)


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
    steps = _steps(commands, field, frame, around, errors)
    starts = np.broadcast_to(begin, (flights, count, 6)).copy()
    states = np.empty((flights, count, int(grid.outputs.max()) + 1, 6))
    fired = np.zeros((flights, count, int(grid.impulses.max()) + 1, 3))
    spent = np.zeros((flights, count, 2))
    given = errors.measured, errors.thrust, errors.events, np.ascontiguousarray(errors.noise)
    _in_threads(field, steps, (starts, *given, states, fired, spent))
    nominal, arrivals, free = _planned_delta_v(steps), states, steps.sets < 0
    if commands.thrusters is not None:
        over = min(float(grid.nodes[-1]), float(commands.engines.lost[0]))
        pulses = commands.thrusters.pulses
        pulsed = impulse_until(pulses, over) - impulse_until(pulses, min(float(grid.nodes[0]), over))
        spent[..., 0] += pulsed
        nominal = nominal + pulsed
    if (kicks := free[grid.impulses >= 0]).any():
        arrivals = states.copy()
        arrivals[:, :, grid.outputs[(grid.impulses >= 0) & free], 3:] -= fired[:, :, kicks]
        fired[:, :, kicks] = 0.0  # only orders are reported
    at = grid.feedback_impulses[grid.impulses >= 0] >= 0
    ordered, orders = grid.impulse_times[at], fired[:, :, at]
    delta_v, limited = spent[..., 0], spent[..., 1]
    return Trajectories(grid.output_times, states, arrivals, ordered, orders, delta_v, nominal, limited)


def _in_threads(field: Field, steps: Steps, each: tuple[Floats, ...]) -> None:
    """Integrate all simulations on all cores; arrays of `each` are (S, N, ...)."""
    flights, count = each[0].shape[:2]
    flat = [rows.reshape(flights * count, *rows.shape[2:]) for rows in each]

    def some(part: slice) -> None:
        of_each = slice(part.start * count, part.stop * count)
        integrate(field._constants, steps, *(rows[of_each] for rows in flat))

    size = max(FEW, -(-flights // (os.cpu_count() or 1)))
    parts = [slice(k, k + size) for k in range(0, flights, size)]
    if len(parts) == 1:
        some(parts[0])
        return
    with ThreadPoolExecutor(len(parts)) as pool:
        list(pool.map(some, parts))


def _planned_delta_v(steps: Steps) -> Floats:
    """Return the delta-v of planned free thrust and impulses (N,) [m/s], as the integrator counts it."""
    running = (steps.limits > 0.0) & (steps.sets < 0)
    size = np.minimum(np.linalg.norm(steps.thrust, axis=3), steps.limits[:, :-1, None])
    thrust = size @ [1.0, 4.0, 1.0] * running[:, :-1] @ steps.lengths / 6.0
    return np.asarray(thrust + (np.linalg.norm(steps.planned_impulses, axis=2) * running).sum(axis=1))


def _steps(
    commands: Commands, field: Field, frame: ChiefFrame, around: Path | None, errors: SampledErrors
) -> Steps:
    """Return the steps of simulations of commands, for the integrator."""
    grid, path, law, engines = commands.grid, commands.path, commands.law, commands.engines
    count, orbit, nodes = len(path), path.orbit, len(grid.nodes)
    rules, gains = np.zeros((len(grid.since), 3, 6)), np.zeros((0, 3, 6))
    late = np.stack([np.eye(6), np.zeros((6, 6))])
    if law is not None and law.impulses:
        kinds = (False,) if commands.thrusters is None else (False, True)
        gains = np.concatenate([impulse_gains(orbit, law, burns)[1] for burns in kinds])
    elif law is not None:
        rules = optimal_return(orbit, law.horizon, grid.since)[2]
    if law is not None and law.delay > 0.0:
        late = np.stack(delay_transitions(orbit, law, grid.interval))
    beyond = np.zeros((count, 0, 3, 3))
    if around is not None:
        beyond = _stepwise(_beyond_zonals(field, frame, around.state(grid.times)))
    jumps, planned = np.zeros((count, nodes, 3)), np.zeros((count, nodes, 6))
    jumps[:, grid.impulses >= 0] = commands.jumps
    if (seen := grid.measurements >= 0).any():
        planned[:, seen] = commands.reference.state(grid.nodes[seen])
    chief = frame.states[:, :3], frame.states[:, 3:], frame.acceleration, frame.axes, frame.rotation
    floats = np.diff(grid.nodes), *chief, _commanded_thrust(commands), beyond, jumps, planned
    thrusters, sets, ends = _thruster_rows(commands)
    corrections = np.where((grid.feedback_impulses >= 0) & (sets >= 0), len(gains) // 2, 0)
    corrections += grid.feedback_impulses  # impulses, then burns of thrusters
    laws = grid.measurements, grid.updates, late, grid.rows, rules, corrections, gains
    of_engines = field._ballistics(count), engines.limits_at(grid.nodes), engines.minimum_bit
    events = commands.events if errors.events.size else NO_EVENTS
    return Steps._make(
        [
            *(np.ascontiguousarray(part, dtype=float) for part in floats),
            *laws,
            *(grid.outputs, grid.impulses, *of_engines, *thrusters, sets, ends),
            *(events.planned, events.feedback, events.impulses, errors.gates),
        ]
    )


def _commanded_thrust(commands: Commands) -> Floats:
    """Return the thrust (N, K, 3, 3) [m/s^2] at the start, middle and end of each step, without feedback."""
    grid, path = commands.grid, commands.path
    within = grid.nodes[:-1, None] + np.diff(grid.nodes)[:, None] * np.array([BESIDE, 0.5, 1.0 - BESIDE])
    thrust = path.thrust(within.ravel()).reshape(len(path), -1, 3, 3)
    if commands.known is None or commands.frame is None:
        return thrust
    compensated = commands.spans.compensated(grid.times[1::2])
    those, size = np.flatnonzero(compensated.any(axis=1)), max(AT_ONCE // len(grid.rows), 1)
    for some in (those[k : k + size] for k in range(0, len(those), size)):
        states, known = path[some].state(grid.times), commands.known._of(some)
        left_out = residuals(known, commands.frame, states, path.orbit.mean_motion)
        thrust[some] -= _stepwise(left_out) * compensated[some][..., None, None]
    return thrust


def _thruster_rows(commands: Commands) -> tuple[tuple[Floats, ...], Any, Any]:
    """Return thrusters, facets, angles and free times, then the set in use, and the ends of orders."""
    nodes, model = commands.grid.nodes, commands.thrusters
    if model is None:
        none = (0, 0, THRUSTER), (0, 0, FACET), (0, len(nodes)), (0, 0, len(nodes))
        return tuple(map(np.zeros, none)), np.full(len(nodes), -1), np.zeros(len(nodes), dtype=np.int64)
    angles = commands.path.orbit.mean_motion * nodes * model.rotates[:, None]
    sets = model.used(nodes)
    # an order ends with the next one, or where its thrusters are replaced
    stops = (commands.grid.feedback_impulses >= 0) | (np.diff(sets, prepend=sets[0]) != 0)
    stops = np.append(np.flatnonzero(stops), len(nodes) - 1)
    ends = stops[np.minimum(np.searchsorted(stops, np.arange(len(nodes)), "right"), len(stops) - 1)]
    return (model.thrusters, model.facets, angles, model.free(nodes)), sets, ends


def _stepwise(values: Floats) -> Floats:
    """Return values (N, 2 K + 1, 3) at half steps as start, middle and end of each step (N, K, 3, 3)."""
    return np.stack([values[:, :-2:2], values[:, 1::2], values[:, 2::2]], axis=2)


def _beyond_zonals(field: Field, frame: ChiefFrame, states: Floats) -> Floats:
    """Return the acceleration of a user function minus its zonals (N, T, 3) [m/s^2], inertial."""
    there = frame.inertial(states)
    zonal = replace(field, acceleration=None)
    return field.accelerations(frame.times, there) - zonal.accelerations(frame.times, there)
