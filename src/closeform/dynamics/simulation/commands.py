"""Commands of spacecraft in a simulation: planned thrust, feedback, engines and thrusters, on a time grid."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import Feedback
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.force_model.hill_frame import ChiefFrame
from closeform.dynamics.planned_paths import impulses_of
from closeform.dynamics.simulation.random_errors import ErrorEvents
from closeform.dynamics.simulation.station_keeping import ThrustSpans
from closeform.dynamics.simulation.thruster_model import ThrusterModel
from closeform.dynamics.simulation.time_grid import (
    CONTINUOUS,
    IMPULSIVE,
    PULSED,
    TimeGrid,
    thrust_bends,
    thrust_discontinuities,
)
from closeform.motion.path import Path


class Engines(NamedTuple):
    """Engines of N spacecraft: largest thrust, minimum impulse bit, and the time at which they fail.

    A spacecraft without an engine has limit 0 and bit inf, so that it ignores all commands. A spacecraft that
    loses its thrust has none from that time on.
    """

    limits: Floats  # (N,) [m/s^2]
    bits: Floats  # (N,) [m/s]
    lost: Floats  # (N,) [s], inf for an engine that does not fail

    @classmethod
    def of(cls, running: Any, limit: ArrayLike = np.inf, bit: ArrayLike = 0.0, lost: Any = np.inf) -> Engines:
        """Return the engines of spacecraft, some of which are `running` (N,)."""
        times = np.broadcast_to(lost, np.shape(running)).astype(float)
        return cls(np.where(running, limit, 0.0), np.where(running, bit, np.inf), times)

    @property
    def running(self) -> Any:
        """Spacecraft that have an engine (N,)."""
        return self.limits > 0.0

    def among(self, which: Any) -> Engines:
        """Return the engines of the selected spacecraft."""
        return Engines(*(part[which] for part in self))


@dataclass(frozen=True, eq=False)
class Commands:
    """Commands of spacecraft along `path` (N,) on a time grid.

    `known` is the force model whose model error is compensated, or None; `spans` determine when, and `frame`
    is its chief's frame at half steps. `jumps` (N, Q, 3) are planned impulses, one for each of the grid's.
    Feedback by a `law` returns to the `reference` (N,). `thrusters` fire the feedback of one spacecraft.
    """

    path: Path
    grid: TimeGrid
    known: Field | None
    frame: ChiefFrame | None
    spans: ThrustSpans
    jumps: Floats
    reference: Path
    law: Feedback | None
    engines: Engines
    ballistics: Floats
    thrusters: ThrusterModel | None

    @classmethod
    def of(
        cls,
        path: Path,
        law: Feedback | None,
        known: Field | None,
        ballistics: Floats,
        engines: Engines | None = None,
        *,
        impulses: Floats | None = None,
        reference: Path | None = None,
        thrusters: ThrusterModel | None = None,
        pulsed: bool = False,
        span: tuple[float, float] | None = None,
        outputs: Floats | None = None,
    ) -> Commands:
        """Return the commands of planned paths (N,), with the planned `impulses` (M, 3) or others.

        They cover the whole path, or a `span` without impulses. `pulsed`: some spacecraft have thrusters.
        Steps end at the times of `outputs`; by default where thrust bends, and where spans begin or end.
        """
        craft, when, planned = impulses_of(path)
        longest = PULSED if pulsed else CONTINUOUS
        if not pulsed and not path.peak_thrust.any() and (law is None or law.impulses):
            longest = IMPULSIVE
        spans = ThrustSpans.of(path, law)
        if outputs is None:
            outputs = np.union1d(thrust_bends(path), spans.bounds)
        whole = float(path.start[0]), float(path.end[0])
        grid = TimeGrid.of(span or whole, law, when, thrust_discontinuities(path), outputs, longest)
        jumps = np.zeros((len(path), int(grid.impulses.max()) + 1, 3))
        slots = np.searchsorted(grid.impulse_times, when)
        np.add.at(jumps, (craft, slots), planned if impulses is None else impulses)  # several at one instant
        frame = None if known is None else ChiefFrame.of(known, grid.times)
        engines = engines or Engines.of(np.ones(len(path), dtype=bool))
        target = path if reference is None else reference
        return cls(path, grid, known, frame, spans, jumps, target, law, engines, ballistics, thrusters)

    def among(self, which: Any) -> Commands:
        """Return the commands of the selected spacecraft (M,)."""
        each = {name: getattr(self, name)[which] for name in ("path", "jumps", "reference", "ballistics")}
        known = self.known and self.known._of(which)
        spans, engines = self.spans.among(which), self.engines.among(which)
        return replace(self, known=known, spans=spans, engines=engines, **each)

    def alone(self, first: int, last: int) -> tuple[Commands, Any, Any]:
        """Return the plan alone between two nodes, without feedback and compensation.

        With the rows of its impulses and of its output states among all.
        """
        nodes = slice(first, last + 1)
        fired, shown = (rows[nodes][rows[nodes] >= 0] for rows in (self.grid.impulses, self.grid.outputs))
        grid, jumps = self.grid.during(first, last), self.jumps[:, fired]
        return replace(self, grid=grid, jumps=jumps, known=None, frame=None, law=None), fired, shown

    @property
    def events(self) -> ErrorEvents:
        """Burns and impulses that have errors of their own."""
        continuous = self.law is not None and not self.law.impulses
        return ErrorEvents.of(self.path, self.grid, continuous, self.thrusters is not None)

    def frame_in(self, field: Field) -> ChiefFrame:
        """Return the chief's frame in a field at half steps."""
        if self.frame is not None and self.known is field:
            return self.frame
        return ChiefFrame.of(field, self.grid.times)
