"""Pulsed flights: what thrusters fire to fly a plan in a field, and where that leads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.field.chief_frame import ChiefFrame
from closeform.field.course import Flights, Nozzles, commands_of, exactly, flown, together
from closeform.field.drag import ballistics_of
from closeform.field.feedback import Feedback
from closeform.field.field import Field
from closeform.field.residual import residuals
from closeform.field.timetable import BESIDE, Timetable, edges_of
from closeform.fuel.allocation import Allocation
from closeform.fuel.firing import Firing, fire
from closeform.fuel.pulses import linked
from closeform.fuel.thrusters import Thrusters
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, PUSH, START, WIDTH
from closeform.motion.joining import stack
from closeform.motion.path import Path, ends_of

PIECE = 30.0  # s: in so long what is commanded is one arc's thrust, met at four instants
INSIDE = np.array([BESIDE, 1.0 / 3.0, 2.0 / 3.0, 1.0 - BESIDE])


def fired_in(
    paths: Path,
    jumps: tuple[Any, Floats, Floats],
    field: Field,
    thrusters: Thrusters | Sequence[Thrusters],
    mass: ArrayLike | None = None,
    specific_impulse: ArrayLike | None = None,
) -> Firing:
    """What thrusters fire for planned paths (N,) in a field: their thrust less the residual, or `jumps`.

    These are the craft (M,), times (M,) and sizes (M, 3) of impulses as changed for the field.
    """
    craft, when, sizes = jumps
    steady = _commanded(paths, field)
    asked = []
    for k in range(len(paths)):
        one = paths[k]
        arcs = one.arcs.copy() if (craft == k).any() else steady[k]
        for time, size in zip(when[craft == k], sizes[craft == k], strict=True):
            kicked = arcs[:, IMPULSE : IMPULSE + 3].any(axis=1) & (arcs[:, START] == time)
            arcs[kicked, IMPULSE : IMPULSE + 3] = size
        asked.append(linked(one.orbit, arcs, ends_of(one)[0]))
    return fire(stack(asked), thrusters, mass, specific_impulse)


def _commanded(paths: Path, field: Field) -> Floats:
    """Arcs (N, M, 30) of the thrust less the residual, without states."""
    n, start, end = paths.orbit.mean_motion, float(paths.start[0]), float(paths.end[0])
    even = np.linspace(start, end, int(np.ceil((end - start) / PIECE)) + 1)
    edges = np.unique(np.concatenate([even, edges_of(paths)]))
    lengths = np.diff(edges)
    within = edges[:-1, None] + lengths[:, None] * INSIDE
    times = within.ravel()
    thrust = paths.thrust(times) - residuals(field, ChiefFrame.of(field, times), paths.state(times), n)
    angle = n * lengths[:, None] * INSIDE
    # of 1, t, P1, P2
    basis = np.stack([angle**0, angle, 1.0 - np.cos(angle), angle - np.sin(angle)], axis=-1)
    met = np.linalg.solve(basis, thrust.reshape(len(paths), -1, 4, 3)) * n ** np.arange(4.0)[:, None]
    arcs = np.zeros((len(paths), len(lengths), WIDTH))
    arcs[..., START], arcs[..., END], arcs[..., MEAN_MOTION] = edges[:-1], edges[1:], n
    arcs[..., PUSH:] = met.reshape(len(paths), -1, 12)
    return arcs


def nozzles_of(thrusters: Thrusters, law: Feedback | None) -> Nozzles:
    """One craft's thrusters, for what leads back: no burn is longer than from one impulse to the next."""
    allocation = Allocation.of(thrusters.directions)
    rows = np.zeros((allocation.count + 6, 5))
    rows[: allocation.count, :3] = thrusters.directions
    rows[:, 3] = np.inf  # of pushes where no thruster is
    rows[: allocation.count, 3] = thrusters.minimum_bit
    if law is not None:
        rows[: allocation.count, 4] = thrusters.acceleration * min(law.every, law.horizon / law.impulses)
    facets = np.hstack([allocation.corners.astype(float), allocation.inverses.reshape(-1, 9)])
    return Nozzles(rows, facets, thrusters.frame == "inertial")


def flown_pulses(
    firing: Firing,
    field: Field,
    believed: Field,
    law: Feedback | None,
    wrong: Callable[[Timetable], tuple[Floats, Floats]],
) -> tuple[Floats, Flights]:
    """Times (T,) and flights of craft that fire, each with steps of its own.

    They are led back to where the pulses lead in the field that is believed.

    `wrong` makes errors of measurements (S, N, M, 6) and of thrust (S, N, 4).
    """
    count, each = len(firing.path), []
    own, theirs = ballistics_of(field.drag, count), ballistics_of(believed.drag, count)
    for k, thrusters in enumerate(firing.thrusters):
        nozzles, path = nozzles_of(thrusters, law), firing.path[k : k + 1]
        commands = commands_of(path, law, None, theirs[k : k + 1], nozzles=nozzles)
        table = commands.table
        frame = ChiefFrame.of(field, table.times)
        if law is not None:
            known = frame if believed is field else ChiefFrame.of(believed, table.times)
            alone = flown(replace(commands, law=None), believed, known, *exactly(1, 1))
            commands = replace(commands, reference=alone.states[0])
        measured, thrust = (part[:, k : k + 1].copy() for part in wrong(table))
        each.append(flown(replace(commands, ballistics=own[k : k + 1]), field, frame, measured, thrust))
    return table.shown_times, replace(together(each, 1), asked=np.concatenate([one.asked for one in each]))
