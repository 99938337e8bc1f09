"""Minimum-delta-v impulses by thrusters that push in fixed directions.

Delta-v is summed over the thrusters, and the primer's program becomes linear:

    maximise g . c   subject to   d_i . p(t) <= 1 at all times, for every direction d_i          # theory (36)

The program is solved on a grid of times; the highest d_i . p between them are added until none is above 1.
The result is certified: between times h apart d_i . p differs from the cubic of its values and slopes by at
most h^4/384 of its fourth derivative, which is bounded.  Directions fixed in inertial axes turn in the
orbit's axes.  Here time runs from 0 to 1, lengths are divided by the duration, and n is the angle in a
duration.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import linprog

from closeform.arrays import Floats, shown
from closeform.motion.arc import END, START, STATE
from closeform.motion.minimum_delta_v.impulses import longest_turn
from closeform.motion.minimum_delta_v.reduced import ANSWER, COUNT, FIRST, LOWER, PRIMER, UNIQUE, UPPER
from closeform.motion.steering import transition_matrices

GRID, GRID_PER_TURN = 25, 24.0  # times of the first program
FINE_PER_TURN = 128.0  # intervals of the certificate, at least
BETWEEN = 1e-10  # allowed difference between d . p and the cubics between those times
HIGHEST = 8  # maxima of each d . p that are added at once
ENOUGH = 5e-10  # gap at which an answer is final
ROUNDS = 40
NEAR = 0.9  # d . p from which a time stays in the program
INDEPENDENT = 1e-13  # share of the largest eigenvalue of the reachable changes: less counts as zero
EXACT = 1e-15  # share of the states: a smaller change is rounding, for each radian
TOLERANCES = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
ONE_SIDED = "no thruster acts along the required change"
REACHED = 1e-9  # share of the required change that must be reached


def turned(directions: Floats, inertial: bool, angles: Floats) -> Floats:
    """Return directions (T, m, 3) in the orbit's axes at angles n t of the orbit."""
    if not inertial:
        return np.broadcast_to(directions, (len(angles), *directions.shape))
    x, y, z = directions.T
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    return np.stack([x * c + y * s, y * c - x * s, np.broadcast_to(z, (len(angles), len(z)))], axis=-1)


class Program:
    """Changes that thrusters can make in one transfer: columns of six numbers for times and directions."""

    def __init__(self, n: float, directions: Floats, inertial: bool, phase: float) -> None:
        self.n, self.directions, self.inertial, self.phase = n, directions, inertial, phase

    def rows(self, times: Floats) -> tuple[Floats, Floats]:
        """Return the rows that map c to d_i . p, and their rates: (T, m, 6) each."""
        moves = transition_matrices(self.n, times)
        toward = turned(self.directions, self.inertial, self.phase + self.n * times)
        values, rates = toward @ moves[:, :3], toward @ moves[:, 3:]
        if self.inertial:  # the rate of d is n times that of a quarter of a turn
            x, y, _ = np.moveaxis(toward, -1, 0)
            rates = rates + self.n * (y[..., None] * moves[:, None, 0] - x[..., None] * moves[:, None, 1])
        return values, rates

    def highest(self, c: Floats) -> tuple[float, Floats]:
        """Return a certified bound on max d_i . p, and the times of its maxima between grid times."""
        fourth = self.fourth(c)
        count = int(FINE_PER_TURN * self.n / (2 * np.pi) + (fourth / (384.0 * BETWEEN)) ** 0.25) + 3
        times, h = np.linspace(0.0, 1.0, count, retstep=True)
        values, rates = (part @ c for part in self.rows(times))
        low, high, a, b = values[:-1], values[1:], h * rates[:-1], h * rates[1:]
        # the cubic low + a s + q s^2 + r s^3 and the root of its slope where it bends down
        q, r = 3.0 * (high - low) - 2.0 * a - b, 2.0 * (low - high) + a + b
        with np.errstate(invalid="ignore", divide="ignore"):
            root = -a / (q - np.sqrt(np.maximum(q * q - 3.0 * r * a, 0.0)))
        root = np.where((root > 0.0) & (root < 1.0), root, 1.0 * (high > low))
        tops = np.maximum(low + root * (a + root * (q + root * r)), np.maximum(low, high))
        walled = np.pad(tops, ((1, 1), (0, 0)), constant_values=-np.inf)
        heights = np.where(tops >= np.maximum(walled[2:], walled[:-2]), tops, -np.inf)
        steps = np.argsort(-heights, axis=0)[:HIGHEST]
        which = np.broadcast_to(np.arange(tops.shape[1]), steps.shape)
        added = (times[steps] + h * root[steps, which])[heights[steps, which] > NEAR]
        return float(tops.max() + fourth * h**4 / 384.0), added

    def fourth(self, c: Floats) -> float:
        """Return a bound on the fourth derivative of d . p along the transfer."""
        n, (x, _, z, vx, vy, vz) = self.n, c
        second = np.array([3 * n * n * x + 2 * n * vy, -2 * n * vx, -n * n * z])
        third = np.array([3 * n * n * vx + 2 * n * second[1], -2 * n * second[0], -n * n * vz])
        a, b = np.linalg.norm(second), np.linalg.norm(third)
        bend, jerk = a + b * min(1.0, 1.0 / max(n, 1e-300)), b + a * n * min(1.0, n)
        if not self.inertial:
            return float(n * n * bend)
        speed = np.linalg.norm(c[3:]) + bend
        place = np.linalg.norm(c[:3]) + speed
        return float(7.0 * n * n * bend + 4.0 * n * jerk + 4.0 * n**3 * speed + n**4 * place)

    def solve(self, g: Floats) -> tuple[float, Floats, Floats, Any, Floats]:
        """Return the lower bound, the start of the primer, and times, thrusters and sizes of the impulses.

        Raises `OutOfReach` if no firing achieves the required change g (6,).
        """
        times = np.linspace(0.0, 1.0, int(GRID + GRID_PER_TURN * self.n / (2 * np.pi)))
        columns = self.rows(times)[0].reshape(-1, 6)
        values, axes = np.linalg.eigh(columns.T @ columns / len(columns))
        kept = values > INDEPENDENT * values[-1]
        metric = axes[:, kept] / np.sqrt(values[kept])
        beside = g - axes[:, kept] @ (axes[:, kept].T @ g)
        if np.linalg.norm(beside) > REACHED * np.linalg.norm(g):
            across = np.linalg.norm(beside[[2, 5]]) > 0.5 * np.linalg.norm(beside)
            raise OutOfReach(
                "no thruster acts cross-track" if across else "no thruster changes the along-track drift"
            )
        lower, best, primer = 0.0, None, np.zeros(6)
        for _ in range(ROUNDS):
            columns = self.rows(times)[0]
            count = columns.shape[1]
            columns = columns.reshape(-1, 6)
            found = linprog(
                np.ones(len(columns)), A_eq=(columns @ metric).T, b_eq=g @ metric, options=TOLERANCES
            )
            if found.x is None:
                raise OutOfReach(ONE_SIDED)
            c = metric @ found.eqlin.marginals
            peak, added = self.highest(c)
            worth = float(g @ c) / max(peak, 1e-300)
            if worth > lower:
                lower, primer = worth, c / peak
            best = found.x, times
            if found.fun <= lower * (1.0 + ENOUGH):
                break
            near = (columns @ c).reshape(len(times), count).max(axis=1) > NEAR
            times = np.unique(np.concatenate([times[near], added]))
        assert best is not None
        sizes, times = best
        fired = np.flatnonzero(sizes > 0.0)
        at, thruster = times[fired // count], fired % count
        rows = self.rows(at)[0][np.arange(len(at)), thruster]
        exact = np.linalg.lstsq((rows @ metric).T, g @ metric, rcond=None)[0]
        return lower, primer, at, thruster, np.where(exact > 0.0, exact, 0.0)


class OutOfReach(Exception):
    """Transfer that no firing achieves; the argument states the reason."""


def answers_of(
    thrusters: Any, mean_motion: float, arcs: Floats, finals: Floats, called: Sequence[str] = ()
) -> Floats:
    """Return answers (P, 34) as `impulses.answers` does, with impulses of one spacecraft's thrusters.

    Raises ValueError for a transfer that no firing achieves; the message names it by its entry in `called`.
    """
    if not hasattr(thrusters, "directions"):
        raise ValueError(f"thrusters: expected Thrusters, got {shown(thrusters)}")
    longest_turn(mean_motion, arcs)
    directions, inertial = thrusters.directions, thrusters.frame == "inertial"
    out = np.zeros((len(arcs), ANSWER))
    for k, (arc, final) in enumerate(zip(arcs, finals, strict=True)):
        duration = arc[END] - arc[START]
        back = transition_matrices(mean_motion, -duration)
        x, y, z, vx, vy, vz = back @ final - arc[STATE : STATE + 6]
        twice = 2.0 * mean_motion
        g = np.array([vx - twice * y, vy + twice * x, vz, -x / duration, -y / duration, -z / duration])
        size = np.linalg.norm(g)
        states = np.abs(np.stack([arc[STATE : STATE + 6], final])).sum(axis=0)
        scale = states[:3].sum() / duration + states[3:].sum()
        if size <= EXACT * (1.0 + 6.0 * mean_motion * duration) * scale:
            out[k, UNIQUE] = 1.0
            continue
        program = Program(mean_motion * duration, directions, inertial, mean_motion * arc[START])
        try:
            lower, primer, times, thruster, sizes = program.solve(g / size)
        except OutOfReach as reason:
            named = called[k] if called else f"transfer {k} of {len(arcs)}" if len(arcs) > 1 else ""
            craft = f"{named}: " if named else ""
            where = thrusters.unreachable if reason.args[0] == ONE_SIDED else None
            lack = ""
            if where is not None:
                lack = f"; add a thruster along {' '.join(f'{x:.3g}' for x in where)} of the thrusters' frame"
            raise ValueError(
                f"thrusters: {craft}no firing in {duration:g} s achieves the transfer: {reason}{lack}"
            ) from None
        pushes = (
            sizes[:, None]
            * turned(directions, inertial, program.phase + program.n * times)[np.arange(len(times)), thruster]
        )
        order = np.argsort(times, kind="stable")
        out[k, LOWER], out[k, UPPER] = min(lower, sizes.sum()) * size, sizes.sum() * size
        out[k, COUNT] = len(times)
        out[k, PRIMER : PRIMER + 6] = primer / np.array([1, 1, 1, duration, duration, duration])
        for place, j in enumerate(order):
            first = FIRST + 4 * place
            out[k, first], out[k, first + 1 : first + 4] = times[j] * duration, pushes[j] * size
    return out
