"""Replanning during a simulation: new plans around the zones, from the measured states of the craft."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.chief_frame import ChiefFrame
from closeform.dynamics.drag import ballistics_of
from closeform.dynamics.drawn import Draws, exactly
from closeform.dynamics.engines import Engines
from closeform.dynamics.feedback import Feedback, Navigation
from closeform.dynamics.field import Field
from closeform.dynamics.infeasible import Grounded
from closeform.dynamics.reference_trajectory import Flights, commands_of, flown, together
from closeform.dynamics.residual import residuals
from closeform.dynamics.timetable import intervals_in
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.planning.reconfigure import reconfigure
from closeform.zones.made_table import NONE
from closeform.zones.pair_zones import PairZones, pairs_of
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.dynamics.pulsed_legs import PulsedPlan

SIGMAS = 4.0
SEEN = 201  # instants at which the model error along a plan is sampled
# factors on the margin, tried in this order: a craft measured inside a margin has no plan
PADDED = (2.0, 1.0, 0.5)


@dataclass(frozen=True, eq=False)
class Replanning:
    """Data shared by S simulations with replanning.

    Planned `paths` (N,), `zones`, and the margin `room` [m] around these. Thrust compensates the model error
    of the `believed` field, within the limits of `engines`. `law` keeps craft on the last plan. `first` holds
    the pulses of the plan, if thrusters fire it.
    """

    paths: Path
    zones: Zone | PairZones
    room: float
    field: Field
    believed: Field
    law: Feedback
    engines: Engines
    first: PulsedPlan | None

    @classmethod
    def of(
        cls,
        paths: Path,
        zones: Zone | PairZones,
        fields: tuple[Field, Field],
        law: Feedback,
        engines: Engines,
        draws: Draws,
        first: PulsedPlan | None,
    ) -> Self:
        """Return the data with the margin for the errors; guidance uses the second of two `fields`."""
        off = np.hypot(*draws.sizes.T)
        if draws.errors is not None:
            off += SIGMAS * np.array([np.hypot(one.magnitude, one.pointing) for one in draws.errors])
        pushes = np.where(engines.running, off * paths.peak_thrust, unopposed(paths, fields[1]))
        room = replanning_margin(draws.sight, law.every, pushes)
        if first is not None:
            room += float(np.sort(first.aside)[-2:].sum())
        return cls(paths, zones, room, *fields, law, engines, first)

    @property
    def instants(self) -> Floats:
        """Times of replanning, and the end (M + 1,) [s]."""
        start, end = float(self.paths.start[0]), float(self.paths.end[0])
        return np.linspace(start, end, intervals_in(end - start, self.law.every) + 1)

    def flights(
        self, draws: Draws
    ) -> tuple[tuple[Floats, Floats], Flights, list[int], list[list[tuple[float, str]]]]:
        """Return times shown and of orders, all simulations, numbers of plans, and refused plans."""
        own = ballistics_of(self.field.drag, len(self.paths))
        asked = commands_of(self.paths, self.law, self.believed, own, self.engines)
        measured = draws.measured(asked.table)
        each = [
            self.flight(replace(draws, seeds=[seed]), (seen[None], off[None]))
            for seed, seen, off in zip(draws.seeds, *measured, strict=True)
        ]
        frame = asked.frame_in(self.field)
        alone = flown(replace(asked, law=None), self.field, frame, exactly(len(self.paths), 1))
        asked_of = alone.asked if self.first is None else self.first.fired(alone.asked)
        done = replace(together([one[1] for one in each], 0), asked=asked_of)
        return each[0][0], done, [one[2] for one in each], [one[3] for one in each]

    def flight(
        self, draws: Draws, measured: tuple[Floats, Floats]
    ) -> tuple[tuple[Floats, Floats], Flights, int, list[tuple[float, str]]]:
        """Return one simulation, with errors of measurements (1, N, M, 6) and of thrust (1, N, 4).

        Each leg has its own burns. Also returned are the shown times, the times of thruster orders, the
        number of plans, and the times and reasons of refused plans.
        """
        instants, last, pulsed = self.instants, self.paths, self.first
        now, parts, times, made = last.state(instants[0]), [], [], 0
        refused: list[tuple[float, str]] = []
        ordered = [np.zeros(0)]
        wrong, errors = measured
        law = replace(self.law, every=float(instants[1] - instants[0]))
        ballistics = ballistics_of(self.field.drag, len(last))
        for k, (begin, over) in enumerate(zip(instants[:-1], instants[1:], strict=True)):
            if k > 0 and instants[-1] - begin >= law.horizon:
                path, anew, why = self.plan(now + wrong[0, :, k], float(begin))
                refused += [(float(begin), one) for one in why]
                if path is not None:
                    last, pulsed, made = path, anew, made + 1
            span, seen = (float(begin), float(over)), (wrong[:, :, k : k + 1], errors)
            if pulsed is not None:
                fields = self.field, self.believed
                shown, orders, done = pulsed.leg(span, now, fields, law, draws, seen, k)
                ordered.append(orders)
            else:
                commands = commands_of(last, law, self.believed, ballistics, self.engines, span=span)
                frame = commands.frame_in(self.field)
                drawn = draws.of(commands, range(len(now)), seen, k)
                now = now + drawn.start[0] if k == 0 else now
                shown, done = commands.table.shown_times, flown(commands, self.field, frame, drawn, now)
            now = done.states[0, :, -1].copy()
            rest = slice(None) if over == instants[-1] else slice(-1)
            parts.append(replace(done, states=done.states[:, :, rest]))
            times.append(shown[rest])
        states = np.concatenate([one.states for one in parts], axis=2)
        spent, limited = (
            np.sum([getattr(one, name) for one in parts], axis=0) for name in ("spent", "limited")
        )
        fired = np.concatenate([one.fired for one in parts], axis=2)
        done = Flights(states, states, fired, spent, parts[0].asked, limited)
        return (np.concatenate(times), np.concatenate(ordered)), done, made, refused

    def plan(self, states: Floats, begin: float) -> tuple[Path | None, PulsedPlan | None, list[str]]:
        """Return paths (N,) from measured states (N, 6), their pulses if any, and why plans were refused."""
        end, orbit, why = float(self.paths.end[0]), self.paths.orbit, list[str]()
        who, rest = (np.flatnonzero(some) for some in (self.engines.running, ~self.engines.running))
        limits = self.engines.limits[who]
        coasting = orbit.coast(states[rest], end - begin, begin)
        order = np.concatenate([who, rest])
        zones = self.zones
        if isinstance(zones, PairZones) and len(rest):
            zones = reordered(zones, order, len(who))
        for share in PADDED:
            plan = reconfigure(
                orbit,
                states[who],
                self.paths.state(end)[who],
                end - begin,
                zones,
                start=begin,
                obstacles=coasting,
                max_acceleration=limits if np.isfinite(limits).all() else None,
                if_blocked=("more sides",),
                margin=share * self.room,
            )
            try:
                if plan.ok and plan.paths is not None:
                    each = [part[k] for part in (plan.paths, coasting) for k in range(len(part))]
                    paths = stack([each[k] for k in np.argsort(order)])
                    return paths, self.first and self.first.again(paths, self.believed), why
                why.append(f"{share:g} of the margin: {plan.reason}")
            except Grounded as error:
                why.append(f"{share:g} of the margin: {error}")
        return None, None, why


def unopposed(paths: Path, field: Field) -> Floats:
    """Return the largest model error along paths (N,) [m/s^2], for craft that do not compensate it."""
    times = np.linspace(float(paths.start[0]), float(paths.end[0]), SEEN)
    left_out = residuals(field, ChiefFrame.of(field, times), paths.state(times), paths.orbit.mean_motion)
    return np.asarray(np.linalg.norm(left_out, axis=-1).max(axis=1))


def reordered(zones: PairZones, order: Any, moving: int) -> PairZones:
    """Return the zones of the same bodies in another order, the first `moving` of which move."""
    count, found = len(zones), list[Zone]()
    table = np.full((count + 1, count + 1), NONE)
    for one, other in zip(*(k.tolist() for k in next(pairs_of(count))), strict=True):
        if (zone := zones.between(order[one], order[other])) is not None:
            table[one, other] = len(found)
            found.append(zone)
    return PairZones(tuple(found), np.arange(count), table, np.arange(count) < moving)


def replanning_margin(sight: Navigation, every: float, pushes: Floats) -> float:
    """Return the margin [m] for two craft between measurements `every` [s] apart.

    It covers 4 sigmas of noise, all constant errors, and the unplanned accelerations `pushes` (N,) [m/s^2].
    """
    noise = SIGMAS * np.sqrt(2.0) * np.hypot(sight.position, every * sight.velocity)
    constant = 2.0 * (sight.position_bias + every * sight.velocity_bias)
    return float(noise + constant + np.sort(pushes)[-2:].sum() * every**2 / 2.0)
