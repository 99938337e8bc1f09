"""Guidance: the commands to spacecraft for a plan, in the force model that guidance knows.

Spacecraft with thrusters fire pulses, impulses are changed for the force model, and continuous thrust
compensates the model error. The same guidance is simulated, bounded by tracking margins, and exported as
compensated thrust.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial, reduce

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import Feedback
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.planned_paths import extended_paths, impulses_of
from closeform.dynamics.simulation.commands import (
    SAME,
    Commands,
    Engines,
    ThrusterModel,
    ThrusterStages,
    ThrustSpans,
    thrust_bends,
)
from closeform.dynamics.simulation.impulse_retargeting import Retargeted, retarget
from closeform.dynamics.simulation.propagate import Trajectories, propagate
from closeform.dynamics.simulation.random_errors import ErrorSampler, SampledErrors
from closeform.dynamics.simulation.thruster_pulses import fire_plan, pulsed_reference, shooters
from closeform.fuel.firing import ThrusterFiring
from closeform.fuel.pulses import Pulses
from closeform.motion.arc import END, START
from closeform.motion.joining import stack
from closeform.motion.path import Path

Span = tuple[float, float]
MOST_STEPS = 2_000_000  # steps of all spacecraft that are simulated together, of about 200 bytes each


@dataclass(frozen=True, eq=False)
class Guidance:
    """Commands for planned `paths` (N,) in the `believed` field, with or without a feedback `law`.

    `impulses` are those of the plan, changed for the field, and `retargeted` the paths by them. `firing` has
    the pulses of the spacecraft that have `thrusters`, whose times the `paths` then cover. With `cancel` the
    model error is compensated.
    """

    paths: Path
    believed: Field
    law: Feedback | None
    cancel: bool
    thrusters: Sequence[ThrusterStages | None]
    impulses: Retargeted
    retargeted: Path
    firing: ThrusterFiring | None

    @classmethod
    def of(
        cls,
        paths: Path,
        believed: Field,
        law: Feedback | None,
        thrusters: Sequence[ThrusterStages | None] = (),
        cancel: bool = True,
        mass: ArrayLike | None = None,
        specific_impulse: ArrayLike | None = None,
    ) -> Guidance:
        """Return the guidance of a plan. Raises Infeasible if it is not feasible in the field."""
        impulses, changed = retarget(paths, believed if cancel else None, law)
        firing = None
        if shooters(thrusters):
            firing = fire_plan(paths, impulses, believed, thrusters, mass, specific_impulse, law)
            span = np.array([firing.path.start.min(), firing.path.end.max()])
            paths, changed = extended_paths(paths, span), extended_paths(changed, span)
        return cls(paths, believed, law, cancel, thrusters, impulses, changed, firing)

    @property
    def span(self) -> Span:
        """Start and end time [s]."""
        return float(self.paths.start[0]), float(self.paths.end[0])

    @cached_property
    def _models(self) -> dict[int, tuple[Path, ThrusterModel]]:
        """Path (1,) by the pulses in Hill's equations, and thrusters, of each spacecraft that has some."""
        if self.firing is None:
            return {}
        firing, found = self.firing, {}
        for j, k in enumerate(shooters(self.thrusters)):
            if (own := self.thrusters[k]) is not None:
                model = ThrusterModel.of(own, firing.pulses[firing.pulses.craft == j])
                found[k] = firing.path[j : j + 1], model
        return found

    @cached_property
    def _pulsed(self) -> dict[int, tuple[Path, list[tuple[float, Floats]]]]:
        """Reference of each spacecraft that fires pulses, and state errors at the starts of its coasts."""
        return {
            k: pulsed_reference(self.paths[k : k + 1], path, model, self.believed._of([k]), self.law)
            for k, (path, model) in self._models.items()
            if len(model.pulses)
        }

    @cached_property
    def reference(self) -> Path:
        """Paths (N,) to which feedback returns: those by the commands without errors in the believed field.

        On held coasts they are the planned paths.
        """
        if not self._pulsed:
            return self.retargeted
        pulsed = {k: path[0] for k, (path, _) in self._pulsed.items()}
        return stack([pulsed.get(k, self.retargeted[k]) for k in range(len(self.paths))])

    def pulses(self, span: Span) -> list[Pulses]:
        """Return the planned pulses that begin in a span, in a list; none without thrusters."""
        if self.firing is None:
            return []
        fired = self.firing.pulses
        return [fired[(fired.start >= span[0]) & (fired.start < span[1])]]

    @property
    def missed(self) -> Iterator[tuple[int, float, Floats]]:
        """Spacecraft, time and state error (6,) at the end of each span of impulses or pulses."""
        for k, moves in enumerate(ThrustSpans.of(self.paths, self.law).impulsive):
            if k in self._pulsed:
                yield from ((k, *one) for one in self._pulsed[k][1])
            elif self.cancel:
                for end in moves[moves[:, 1] < self.paths.end[k] - SAME, 1]:
                    yield k, float(end), self.retargeted[k].state(end) - self.paths[k].state(end)

    @property
    def deviation(self) -> Floats:
        """Largest distance of the reference from the plan (N,) [m], at the nodes of the reference."""
        times = np.union1d(self.reference.arcs[:, START], self.reference.arcs[:, END])
        off = self.reference.position(times) - self.paths.position(times)
        return np.asarray(np.linalg.norm(off, axis=2).max(axis=1))

    def commands(
        self, law: Feedback | None, engines: Engines, span: Span | None = None
    ) -> Iterator[tuple[list[int], Commands]]:
        """Yield the spacecraft that share a time grid, by index, and their commands.

        Each spacecraft with thrusters has its own grid. All grids have the same output times.
        """
        rest = [k for k in range(len(self.paths)) if k not in self._models]
        outputs = np.zeros(0) if span is not None else self._output_times(rest, law, engines.lost)
        pulsed = self.firing is not None
        commands = partial(Commands.of, pulsed=pulsed, span=span, outputs=outputs)
        for k, (path, model) in self._models.items():
            target = self.reference[[k]] if law is not None else None
            own = path, law, None, engines.among([k])
            yield [k], commands(*own, reference=target, thrusters=model)
        if rest:
            known = self.believed._of(rest) if self.cancel else None
            changed = self.impulses.impulse[np.isin(self.impulses.craft, rest)]
            plan = self.paths[rest], law, known, engines.among(rest)
            every = commands(*plan, impulses=changed, reference=self.retargeted[rest])
            size = max(MOST_STEPS // len(every.grid.rows), 1)
            if size >= len(rest):
                yield rest, every
                return
            for k in range(0, len(rest), size):
                yield rest[k : k + size], every.among(range(len(rest))[k : k + size])

    def _output_times(self, rest: list[int], law: Feedback | None, lost: Floats) -> Floats:
        """Return the times at which all spacecraft have outputs, and those without thrusters changes."""
        times = [lost[np.isfinite(lost)]]
        if self.firing is not None:
            times.append(impulses_of(self.firing.path)[1])
        if rest:
            own = self.paths[rest]
            sharp = impulses_of(own)[1] if self.firing is not None else thrust_bends(own)
            times += [ThrustSpans.of(own, law).bounds, sharp]
        return reduce(np.union1d, times)

    def simulate(
        self,
        law: Feedback | None,
        field: Field,
        engines: Engines,
        sampler: ErrorSampler | None = None,
        measured: tuple[Floats, Floats] | None = None,
        span: Span | None = None,
        begin: Floats | None = None,
        leg: int = 0,
    ) -> Trajectories:
        """Simulate the commands in a field, with errors of a sampler of which some are `measured`.

        A leg covers a `span`, from states `begin` (N, 6), or from the start of the plan.
        """
        parts, craft = list[Trajectories](), list[int]()
        for which, commands in self.commands(law, engines, span):
            errors = SampledErrors.none(len(which), commands.grid.measurement_count)
            if sampler is not None and measured is not None:
                errors = sampler.sample(which, measured, commands, leg)
            own = None if begin is None else begin[which] + errors.start * (leg == 0)
            frame = commands.frame if field is self.believed else None
            parts.append(propagate(commands, field._of(which), errors, own, frame))
            craft += which
        return Trajectories.joined(parts, 1, np.argsort(craft))
