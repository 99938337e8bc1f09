"""Basilisk, a simulator of spacecraft by others, as `examples/basilisk` sets it up: J2, steps of 10 s.

What is timed is its run alone, on the processor, without what sets a simulation up (closeform's call has all
of it). Thrust and feedback are a Python module that is asked at each step; `coasting` is physics alone, in
C++. Attitude is left out, and nothing is recorded.
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
    """Whether it is installed."""
    return importlib.util.find_spec("Basilisk") is not None


class Simulated:
    """A plan in a field with zonals, as Basilisk flies it."""

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
        """Seconds, where nobody thrusts."""
        return float(self.simulator.fly(self.start, None, self.duration, self.world, STEP).seconds)

    def open_loop(self) -> float:
        """Seconds, with a table of thrust."""
        law = lambda t, _: self.commanded[:, round(t / STEP)]  # noqa: E731
        return float(self.simulator.fly(self.start, law, self.duration, self.world, STEP).seconds)

    def tracked(self, feedback: cf.Feedback, sight: cf.Navigation) -> float:
        """Seconds, measured and brought back."""
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
