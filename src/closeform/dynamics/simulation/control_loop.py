"""Control loop of a simulation: open loop, tracking and replanning are one loop over legs.

A plan is followed open loop or tracked in one leg. Replanning has a leg from each measurement to the next,
and a new plan between legs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import Feedback
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.simulation.commands import Engines
from closeform.dynamics.simulation.guidance import Guidance
from closeform.dynamics.simulation.propagate import Trajectories
from closeform.dynamics.simulation.random_errors import ErrorSampler
from closeform.dynamics.simulation.replanning import Replanner
from closeform.dynamics.simulation.time_grid import intervals_in
from closeform.fuel.pulses import Pulses, one_table


class Run(NamedTuple):
    """Simulations, their planned pulses, the number of new plans, and times and reasons of refused plans."""

    done: Trajectories
    pulses: Pulses | None
    replans: int
    refused: list[tuple[float, str]]


class ControlLoop(NamedTuple):
    """Loop in a field with a feedback `law`, or None for open-loop control, and a planner, if any."""

    law: Feedback | None
    field: Field
    engines: Engines
    planner: Replanner | None

    def runs(self, first: Guidance, sampler: ErrorSampler) -> list[Run]:
        """Return the simulations of all seeds in one run, or with a planner in a run of each seed."""
        start, end = first.span if self.planner is None else self.planner.instants[[0, -1]]
        looks = 0 if self.law is None else intervals_in(end - start, self.law.every)
        seen, thrust = sampler.measured(looks + 1, (end - start) / max(looks, 1))
        if self.planner is None:
            return [self.run(first, sampler, seen, thrust)]
        return [
            self.run(first, replace(sampler, seeds=[seed]), one[None], off[None])
            for seed, one, off in zip(sampler.seeds, seen, thrust, strict=True)
        ]

    def run(self, guidance: Guidance, sampler: ErrorSampler, seen: Floats, thrust: Floats) -> Run:
        """Return simulations leg by leg, with errors of measurements (S, N, M, 6) and of thrust (S, N, 4).

        Without a planner there is one leg. Each leg has its own burns.
        """
        planner = self.planner
        if planner is None:
            firing = guidance.firing
            done = guidance.simulate(self.law, self.field, self.engines, sampler, (seen, thrust))
            return Run(done, None if firing is None else firing.pulses, 0, [])
        instants, refused = planner.instants, list[tuple[float, str]]()
        now, parts, pulses, replans = guidance.paths.state(instants[0]), [], list[Pulses](), 0
        for leg, span in enumerate(pairwise(instants.tolist())):
            if leg > 0 and instants[-1] - span[0] >= planner.law.horizon:
                anew, why = planner.replan(now + seen[0, :, leg], span[0])
                refused += [(span[0], one) for one in why]
                if anew is not None:
                    guidance, replans = anew, replans + 1
            measured = seen[:, :, leg : leg + 1], thrust
            errors = sampler, measured, span, now, leg
            parts.append(guidance.simulate(self.law, self.field, self.engines, *errors))
            pulses += guidance.pulses(span)
            now = parts[-1].states[0, :, -1].copy()
        fired = one_table(pulses) if pulses else None
        if fired is not None:
            fired = fired[np.lexsort((fired.start, fired.craft))]
        return Run(_of_all_legs(parts), fired, replans, refused)


def _of_all_legs(parts: Sequence[Trajectories]) -> Trajectories:
    """Return the trajectories of successive legs as one; each leg begins where the previous one ends."""
    kept = [slice(-1)] * (len(parts) - 1) + [slice(None)]
    times = np.concatenate([one.times[some] for one, some in zip(parts, kept, strict=True)])
    states = np.concatenate([one.states[:, :, some] for one, some in zip(parts, kept, strict=True)], axis=2)
    return replace(
        parts[0],
        times=times,
        states=states,
        arrivals=states,
        fired_times=np.concatenate([one.fired_times for one in parts]),
        fired=np.concatenate([one.fired for one in parts], axis=2),
        spent=np.sum([one.spent for one in parts], axis=0),
        limited=np.sum([one.limited for one in parts], axis=0),
    )


def joined(runs: Sequence[Trajectories]) -> Trajectories:
    """Return the trajectories of runs of different seeds as one."""
    if len(runs) == 1:
        return runs[0]
    names = "states", "arrivals", "fired", "spent", "limited"
    return replace(runs[0], **{name: np.concatenate([getattr(run, name) for run in runs]) for name in names})
