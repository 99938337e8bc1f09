"""Replanning with thruster pulses: the firing from one measurement to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.drag import ballistics_of
from closeform.dynamics.drawn import Draws
from closeform.dynamics.engines import Engines
from closeform.dynamics.feedback import Feedback
from closeform.dynamics.field import Field
from closeform.dynamics.infeasible import Grounded
from closeform.dynamics.pulsed_flight import each_counts, fired_in, flown_exactly, given_until
from closeform.dynamics.reference_trajectory import Flights, commands_of, flown, in_order
from closeform.dynamics.retargeted import Retargeted
from closeform.dynamics.thruster_model import nozzles_of
from closeform.fuel.firing import ThrusterFiring
from closeform.fuel.thrusters import Thrusters
from closeform.motion.path import Path

ROUNDING = 1e-9  # of a leg
NOTHING = Retargeted(*(np.zeros(shape) for shape in (0, 0, (0, 3), (0, 3))))


def in_step(thrusters: Sequence[Thrusters | None], every: float) -> list[Thrusters | None]:
    """Return thrusters with periods, no shorter, of which a whole number fits between two plans [s].

    The pulses up to a new plan then equal the thrust of the old one. Raises Grounded if no period fits.
    """
    found: list[Thrusters | None] = []
    for own in thrusters:
        if own is None or own.period is None:
            found.append(own)
            continue
        if own.period > every * (1.0 + ROUNDING):
            raise Grounded(
                f"feedback: new plans {every:g} s apart, but thrusters fire once in {own.period:g} s; "
                "increase `every`"
            )
        found.append(replace(own, period=every / int(every / own.period + ROUNDING)))
    return found


class PulsedPlan(NamedTuple):
    """Plan (N,), its thruster firing, and the resulting paths (N,) in the believed field."""

    paths: Path
    thrusters: Sequence[Thrusters | None]
    firing: ThrusterFiring
    led: Path
    engines: Engines

    @classmethod
    def of(
        cls, paths: Path, thrusters: Sequence[Thrusters | None], believed: Field, engines: Engines
    ) -> Self:
        """Return the pulses of planned continuous thrust. Raises Grounded if the thrusters cannot fire it."""
        firing = fired_in(paths, NOTHING, believed, thrusters)
        led = paths.orbit._through(*flown_exactly(paths, firing, thrusters, believed))
        return cls(paths, thrusters, firing, led, engines)

    def again(self, paths: Path, believed: Field) -> Self:
        """Return the pulses of a new plan, whose end is met."""
        return self.of(paths, self.thrusters, believed, self.engines)

    def fired(self, asked: Floats) -> Floats:
        """Return the delta-v of craft (N,) [m/s]; for craft with thrusters, that of the pulses as fired."""
        sums = np.bincount(self.firing.pulses.craft, self.firing.pulses.impulse, len(self.firing.thrusters))
        found = asked.copy()
        found[[k for k, one in enumerate(self.thrusters) if one is not None]] = sums
        return found

    @property
    def aside(self) -> Floats:
        """Largest distance between the pulsed path and the plan (N,) [m]."""
        times = np.linspace(self.paths.start.min(), self.paths.end.max(), 1001)
        off = self.led.position(times) - self.paths.position(times)
        return np.asarray(np.linalg.norm(off, axis=-1).max(axis=1))

    def leg(
        self,
        span: tuple[float, float],
        now: Floats,
        fields: tuple[Field, Field],
        law: Feedback,
        draws: Draws,
        measured: tuple[Floats, Floats],
        number: int,
    ) -> tuple[Floats, Floats, Flights]:
        """Return times (T,), times of thruster orders (Q,), and one simulation from states `now` (N, 6).

        The simulation covers a `span`, in the first of two `fields`; guidance uses the second. Feedback
        returns the craft to the pulsed path, from the deviation measured at the start.
        """
        field, believed = fields
        felt, expected = (ballistics_of(one.drag, len(self.paths)) for one in fields)
        shooters = [k for k, one in enumerate(self.thrusters) if one is not None]
        rest = [k for k, one in enumerate(self.thrusters) if one is None]
        parts, none = [], np.zeros(0)
        for j, k in enumerate(shooters):
            pulses = self.firing.pulses[self.firing.pulses.craft == j]
            nozzles = nozzles_of(self.firing.thrusters[j], pulses)
            own = self.firing.path[j : j + 1]
            commands = commands_of(own, law, None, expected[[k]], nozzles=nozzles, span=span, beside=none)
            aim = self.led[[k]].state(commands.table.shown_times)
            own_commands = replace(commands, reference=aim, ballistics=felt[[k]])
            drawn, frame = draws.of(own_commands, [k], measured, number), commands.frame_in(field)
            done = flown(own_commands, field, frame, drawn, now[[k]] + drawn.start[0] * (number == 0))
            begun, over = (given_until(pulses, time) for time in span)
            parts.append(each_counts(done, over - begun))
        table = commands.table
        if rest:
            own = self.paths[rest]
            known = own, law, believed._of(rest), expected[rest], self.engines.among(rest)
            plain = commands_of(*known, span=span, beside=none)
            own_commands = replace(plain, ballistics=felt[rest])
            drawn, frame = draws.of(own_commands, rest, measured, number), plain.frame_in(field)
            done = flown(own_commands, field, frame, drawn, now[rest] + drawn.start[0] * (number == 0))
            parts.append(replace(done, fired=np.zeros((1, len(rest), *parts[0].fired.shape[2:]))))
        return table.shown_times, table.fired_times, in_order(parts, shooters + rest)
