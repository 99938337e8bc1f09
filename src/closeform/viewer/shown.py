"""Common input of scenes, from a mission, a screening, an encounter or a simulation."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight, watch
from closeform.exchange.epochs import Epoch
from closeform.mission.mission_result import Mission, StageResult
from closeform.mission.verdict import MET
from closeform.motion.joining import stack
from closeform.motion.orbit import Orbit
from closeform.report.run import RunReport
from closeform.scenario.stages import StageTable
from closeform.zones.made_table import MadeTable, set_of
from closeform.zones.pair_zones import PairZones
from closeform.zones.solids import Sphere
from closeform.zones.zone import Zone

if TYPE_CHECKING:  # runs do not need these file readers and probability kernels
    from closeform.mission.simulation import SimulatedRun
    from closeform.report.page import CommandReport
    from closeform.report.screening import Met, Screened
    from closeform.report.simulation import SimulationContent
    from closeform.uncertainty.errors import Uncertainty
    from closeform.uncertainty.uncertain_flight import UncertainFlight

COARSE = 33  # sampled instants of each stage that determine the size of the scene


class Screening(StageTable):
    """Single stage that represents a screening of ephemerides."""


class Encounter(StageTable):
    """Single stage that represents a conjunction message."""


class Flight(StageTable):
    """Stage that represents the worst simulation of a run in the high-fidelity model."""


@dataclass(frozen=True, eq=False)
class Shown:
    """Paths of N craft and the outcome of their stages.

    `bodies` holds the radii of hard bodies [m], `around` the zones to draw around the craft, `groups` their
    groups in a search. `results` holds at least one stage.
    """

    title: str
    opening: str
    verdict: str
    ok: bool
    warnings: tuple[str, ...]
    orbit: Orbit
    epoch: Epoch | None
    names: tuple[str, ...]
    bodies: tuple[float | None, ...]
    zones: PairZones
    around: tuple[Zone | None, ...]
    groups: tuple[str, ...]
    results: tuple[StageResult[Any, Any], ...]

    @classmethod
    def of_mission(cls, mission: Mission) -> Self:
        """Return all stages of a mission."""
        scenario = mission.scenario
        own = [
            one if one is None or isinstance(one, Zone) else largest(scenario.zones, k)
            for k, one in enumerate(scenario.keep_out)
        ]
        return cls(
            scenario.title,
            RunReport(mission).opening,
            str(mission.verdict),
            mission.verdict.ok,
            tuple(mission.warnings),
            mission.orbit,
            scenario.epoch,
            scenario.names,
            tuple(craft.body_radius for craft in scenario.craft),
            scenario.zones,
            tuple(own),
            scenario.groups,
            mission.results,
        )

    @classmethod
    def of_report(cls, report: "CommandReport") -> Self:
        """Return the scene input of a report on a screening, an encounter or a simulation."""
        # by command name: a test of the class would import the modules of the other two reports
        makers: dict[str, Callable[[Any], Self]] = {
            "screen": cls._of_screening,
            "encounter": cls._of_encounter,
            "simulate": cls.of_flight,
        }
        shown = makers[report.command.name](report.subject)
        return shown._worded(report.title, report.opening[0], report.verdict)

    @classmethod
    def _of_screening(cls, screened: "Screened") -> Self:
        frame, found = screened.frame, screened.uncertain
        epoch = Epoch(frame.epoch, frame.time_system)
        if found is None:
            return cls._of_one(epoch, screened.flight, screened.zones, staged(Screening))
        stage = staged(Screening, found.sigmas)
        return cls._of_one(epoch, screened.flight, screened.zones, stage, frame.errors, found)

    @classmethod
    def _of_encounter(cls, found: "Met") -> Self:
        met, zones = found.encounter, PairZones.of([Sphere(found.radius), None])
        flight = watch(stack([met.other, met.path]), found.names, zones)
        epoch, errors = Epoch(found.message.tca, "UTC"), (met.other_errors, met.errors)
        return replace(cls._of_one(epoch, flight, zones, staged(Encounter), errors), warnings=met.warnings)

    @classmethod
    def of_flight(cls, simulated: "SimulatedRun") -> Self:
        """Return the worst simulation of a run stage by stage; the title identifies it."""
        shown = cls._of_one(simulated.run.scenario.epoch, simulated.worst, simulated.zones, staged(Flight))
        stages = tuple(
            StageResult(one.number, one.stage, float(np.min(flight.paths.start)), flight, flight, None)
            for one, flight in zip(simulated.run.executed, simulated.worst_by_stage, strict=True)
        )
        which = f"{simulated.which[0].upper()}{simulated.which[1:]}: " if simulated.which else ""
        return replace(shown, title=which, results=stages)

    @classmethod
    def of_simulations(cls, content: "SimulationContent") -> Self:
        """Return the worst simulation of a run, with the words of its report."""
        shown = cls.of_flight(content.simulated)
        return shown._worded(content.title, content.title, content.simulated.entered)

    def _worded(self, title: str, opening: str, verdict: Any) -> Self:
        """Return the same with the words of a report; its title follows the own one."""
        ok = verdict.status == MET
        return replace(self, title=self.title + title, opening=opening, verdict=str(verdict), ok=ok)

    @classmethod
    def _of_one(
        cls,
        epoch: Epoch | None,
        flight: WatchedFlight,
        zones: PairZones,
        stage: StageTable,
        errors: "tuple[Uncertainty | None, ...]" = (),
        found: "UncertainFlight | None" = None,
    ) -> Self:
        """Return a single stage with the initial `errors` of its craft and the analysis `found` from them."""
        start, uncertain = float(np.min(flight.paths.start)), None
        if errors:
            from closeform.mission.uncertainty import UncertainStage  # only needed with errors

            uncertain = UncertainStage(1, stage, errors, found, None)
        count = len(flight.names)
        return cls(
            *("", "", "", True, (), flight.paths.orbit, epoch),
            flight.names,
            (None,) * count,
            zones,
            tuple(largest(zones, k) for k in range(count)),
            ("A",) * count,
            (StageResult(1, stage, start, flight, flight, None, uncertain=uncertain),),
        )

    @property
    def corners(self) -> Floats:
        """Smallest box (2, 3) [m] around all craft at sampled instants of all stages."""
        points = [
            result.after.paths.position(np.linspace(result.start, result.end, COARSE)).reshape(-1, 3)
            for result in self.results
        ]
        every = np.concatenate(points)
        return np.array([every.min(axis=0), every.max(axis=0)])


def staged(kind: type[StageTable], sigmas: float | None = None) -> StageTable:
    """Return a stage of a kind that no scenario file has, without validation."""
    return kind.model_construct(name=None, sigmas=sigmas, max_probability=None)


def largest(zones: PairZones, k: int) -> Zone | None:
    """Return the largest zone that a craft keeps, or its own if pairs have no table; None without any."""
    if isinstance(zones.table, MadeTable):
        own = zones.table.own[zones.kinds[k]]
        return None if own is None else set_of(own)
    firsts = {int(kind): other for other, kind in enumerate(zones.kinds) if other != k}
    kept = [zone for other in firsts.values() if (zone := zones.between(other, k)) is not None]
    return max(kept, key=lambda zone: zone.radius, default=None)
