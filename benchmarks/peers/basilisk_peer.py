"""Basilisk, an independent spacecraft simulator, set up as in `examples/basilisk`: J2, steps of 10 s.

The times are CPU times of the run without the set-up; the call of closeform includes its set-up. Thrust and
feedback are a Python module that Basilisk calls at each step. `coasting` is the C++ physics alone. The
simulation has no attitude and records nothing.
"""

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np

import closeform as cf
from peers.motion import Array

EXAMPLE = Path(__file__).parents[2] / "examples" / "basilisk"
STEP = 10.0  # s
MISSING = "Basilisk is left out: `pip install -e '.[basilisk]'`."


def available() -> bool:
    """Return True if Basilisk is installed."""
    return importlib.util.find_spec("Basilisk") is not None


class Simulated:
    """Plan in a field with zonals, simulated by Basilisk."""

    def __init__(self, plan: cf.Plan, field: cf.Field) -> None:
        sys.path.append(str(EXAMPLE))
        import simulator

        self.simulator: Any = simulator
        self.plan, self.field = plan, field
        self.duration = STEP * int(plan.paths.end[0] / STEP)
        cosines, sines = np.zeros((2, len(field.zonals) + 2, len(field.zonals) + 2))
        cosines[0, 0] = 1.0
        for k, zonal in enumerate(field.zonals, 2):
            cosines[k, 0] = -zonal / np.sqrt(2.0 * k + 1.0)
        degree = 1 + max(k for k in range(len(cosines)) if cosines[k, 0] != 0.0)
        self.world = simulator.World(
            field.chief.mu, field.radius, cosines[:degree, :degree], sines[:degree, :degree]
        )
        chief = field.chief_states([0.0])[0]
        felt = field.accelerations(0.0, chief)
        self.start = np.vstack(
            [chief, cf.elements.inertial_from_relative(chief, plan.paths.state(0.0), acceleration=felt)]
        )
        self.commanded = cf.compensated_thrust(plan, field, every=0.5 * STEP).commanded[:, 1::2]

    def coasting(self) -> float:
        """Return the time [s] without thrust."""
        return float(self.simulator.fly(self.start, None, self.duration, self.world, STEP).seconds)

    def open_loop(self) -> float:
        """Return the time [s] with a thrust table."""
        law = lambda t, _: self.commanded[:, round(t / STEP)]  # noqa: E731
        return float(self.simulator.fly(self.start, law, self.duration, self.world, STEP).seconds)

    def tracked(self, feedback: cf.Feedback, sight: cf.Navigation) -> float:
        """Return the time [s] with navigation and feedback."""
        draws, paths = np.random.default_rng(1), self.plan.paths
        sizes, last = np.repeat([sight.position, sight.velocity], 3), {}

        def law(now: float, states: Array) -> Array:
            if round(now / STEP) % round(feedback.every / STEP) == 0:
                felt = self.field.accelerations(0.0, states[0])
                seen = cf.elements.relative_from_inertial(states[0], states[1:], acceleration=felt)
                off = seen + sizes * draws.normal(size=seen.shape) - paths.state(now)
                last.update(begun=now, back=paths.orbit.transfer(off, np.zeros(6), feedback.horizon))
            back: Array = last["back"].thrust(now + 0.5 * STEP - last["begun"])
            return self.commanded[:, round(now / STEP)] + back

        return float(self.simulator.fly(self.start, law, self.duration, self.world, STEP).seconds)
