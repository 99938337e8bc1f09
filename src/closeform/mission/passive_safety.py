"""Passive safety of a stage: the clearance of every pair after a failure at any instant of the stage."""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import inf, isnan, nan
from typing import Any

import numpy as np

from closeform.conflicts.flight import WatchedFlight
from closeform.dynamics.clearance import minimum_ratios
from closeform.dynamics.force_model.field import described
from closeform.dynamics.simulation.loss_of_thrust import INSTANTS, Loss, sampled_losses
from closeform.mission.mission_result import AvoidResult, ReconfigureResult, StageResult
from closeform.mission.simulation_verdict import Neglected
from closeform.mission.verdict import Asked, metres
from closeform.motion.arc import IMPULSE, THRUST
from closeform.motion.path import Path
from closeform.safety.drift_approach import drift_approach
from closeform.safety.drift_screen import drift_screen
from closeform.safety.failures import Failure, ThrustLost
from closeform.scenario import Scenario
from closeform.scenario.stages import Drifting
from closeform.zones.pair_zones import PairZones, by_zone, portions
from closeform.zones.zone import Zone

MOST = 2000  # maximum number of directed pairs with an exact minimum; of more, only unsafe ones get one
ROUNDING = 1e-8  # relative tolerance within which a bound equals a clearance ratio
HILL = "Hill's equations"
# Instants of a loss of thrust that are compared with the model error before safety counts as shown: the
# error of a narrow range of failures, which INSTANTS miss, can be twice as large.
MOST_INSTANTS, DENSE = 401, 20_000  # at most, and times the square of the number of spacecraft
CHUNK = 64  # directed pairs that one thread evaluates at a time


@dataclass(frozen=True, eq=False)
class PairDrift:
    """Closest approach of the spacecraft `fails` to the spacecraft `meets` after the worst failure.

    - `failed_at`: time of the failure [s]; nan for a spacecraft that does not thrust.
    - `ratio`: minimum clearance ratio of the `zone` of the pair.
    - `time`: time of the minimum [s]; inf if the drift is too slow to determine it.
    - `distance`: distance [m] at that time.
    - `lower`: proven lower bound on the ratio over all failures.  It is farther below `ratio` if the search
      over failures with many unknowns was stopped early.
    - `model`: dynamics of the drift.
    """

    fails: str
    meets: str
    zone: Zone
    failed_at: float
    time: float
    ratio: float
    distance: float
    lower: float
    model: str = HILL

    @property
    def safe(self) -> bool:
        """True if the spacecraft provably stays out of the zone."""
        return self.ratio > 1.0 and self.proven > 1.0 - ROUNDING

    @property
    def proven(self) -> float:
        """Proven minimum clearance ratio over all failures: `ratio` if it is the minimum, else `lower`."""
        return self.ratio if self.lower > self.ratio - ROUNDING * max(1.0, abs(self.ratio)) else self.lower

    @property
    def beside(self) -> str:
        """Text that states the proven bound; empty if `ratio` is the proven minimum."""
        return "" if self.proven == self.ratio else f", at least {self.proven:.4f} by proof"


@dataclass(frozen=True, eq=False)
class PassiveSafety:
    """Passive safety of a stage `where` ("stage 1 (avoid)") over a horizon `lasting` ("for 24 h").

    - `until`: end of the drift [s].
    - `pairs`: directed pairs, lowest clearance ratio first.  Two spacecraft that both thrust form two of
      them.  Above `MOST`, only the unsafe ones are listed.
    - `count`: number of evaluated directed pairs.
    - `planned`: whether the paths were planned to be passively safe, and not only evaluated.
    - `direct`: closest pair of the direct paths, if `planned` and the planned paths differ from them.
    - `field`: high-fidelity model in which the stage is evaluated as well; empty without any.  The lower
      clearance ratio of each pair counts.
    - `doubt`: reason why safety in Hill's equations does not imply safety in real motion; empty if none.
    """

    where: str
    lasting: str
    until: float
    failure: Failure
    pairs: tuple[PairDrift, ...]
    count: int
    planned: bool
    direct: PairDrift | None = None
    field: str = ""
    doubt: str = ""

    @property
    def models(self) -> str:
        """Text that names the dynamics of the evaluation."""
        linear = next((pair.model for pair in self.pairs if pair.model != self.field), HILL)
        return f"in {linear}" + f" and in {self.field}" * bool(self.field)

    @property
    def unsafe(self) -> tuple[PairDrift, ...]:
        """Pairs that are not safe."""
        return tuple(pair for pair in self.pairs if not pair.safe)

    @property
    def safe(self) -> bool:
        """True if no failure causes a conflict."""
        return not self.unsafe

    @property
    def asked(self) -> Iterator[Asked]:
        """Requirement of passive safety for the verdict."""
        worst, safe = self.worst, f"passively safe {self.lasting}"
        also = f", {self.models}" * bool(self.field)  # the verdict names the model of the plan
        if worst is None:
            yield Asked(safe + also, "", True, inf, "drift")
            return
        more = f" and {len(self.unsafe) - 1} more" * (len(self.unsafe) > 1)
        least = f"{worst.ratio:.4f} x zone{worst.beside}"
        met = f"{worst.fails} with {worst.meets}, {least}{more}, in {worst.model}"
        kept = f"{safe} (minimum {least}{also})"
        doubt = f"not shown: {safe}, {self.doubt}" if self.doubt else ""
        yield Asked(kept, f"not {safe} in {self.where}: {met}", self.safe, worst.ratio, "drift", doubt)

    @property
    def worst(self) -> PairDrift | None:
        """Pair with the lowest clearance ratio; None if no pair was evaluated."""
        return self.pairs[0] if self.pairs else None


def judged(scenario: Scenario, result: StageResult[Any, Any]) -> PassiveSafety | None:
    """Return the passive safety of a stage; None if the stage does not require it or has no valid plan."""
    stage = result.stage
    if not isinstance(stage, Drifting) or stage.drift is None or not result.executed:
        return None
    drift, failure = stage.drift.on(result.after.paths.orbit.period), stage.what_fails
    until, planned, zones = result.end + drift, is_planned(result), scenario.zones
    pairs, count = nearest(result.after, zones, until, failure)
    direct: tuple[PairDrift, ...] = ()
    if planned and result.planned is not result.before:
        direct, _ = nearest(result.before, zones, result.before.end + drift, failure)
    where = f"stage {result.number} ({stage.verb})"
    worst = direct[0] if direct else None
    found = PassiveSafety(where, stage.lasting, until, failure, pairs, count, planned, worst)
    return beyond_hill(scenario, result, found) if pairs else found


def beyond_hill(scenario: Scenario, result: StageResult[Any, Any], found: PassiveSafety) -> PassiveSafety:
    """Evaluate passive safety in the scenario's high-fidelity model as well, or compare with the model error.

    Return `found` with the lower clearance ratio of each pair, or with a doubt.
    """
    field, until, paths = scenario.field, found.until, result.after.paths
    neglected = Neglected.on(paths.orbit, scenario)
    if field is None and (neglected is None or scenario.orbit.model != "hill"):
        return found  # in deep space, or where the model error of a drift is not known
    limits = {
        "its drift has no end": until == inf,
        f"it has more than {MOST} pairs": found.count > MOST,
        "only a loss of thrust is simulated there": field is not None and found.failure != ThrustLost(),
    }
    if any(limits.values()):
        why = " and ".join(reason for reason, applies in limits.items() if applies)
        model = "with the model error" if field is None else f"in {described(field)}"
        return replace(found, doubt=f"not assessed {model}, because {why}")
    also = {pair.failed_at for pair in found.pairs if not isnan(pair.failed_at)}
    held = np.array([does_thrust(paths[k]) or scenario.flights is not None for k in range(len(paths))])
    held &= np.array([craft.engine for craft in scenario.craft])
    zones, common = scenario.zones, (paths, held, until, field, sorted(also))
    losses = sampled_losses(*common)
    if field is None:
        assert neglected is not None
        compared = held, zones, neglected, found, result
        dense = int(np.clip(DENSE / len(paths) ** 2, INSTANTS, MOST_INSTANTS))
        doubt = hidden(losses, *compared) or hidden(sampled_losses(*common, dense), *compared)
        return replace(found, doubt=doubt)
    pairs = {(pair.fails, pair.meets): pair for pair in found.pairs}
    for pair in in_field(losses, held, zones, described(field), result.after.names):
        known = pairs.get((pair.fails, pair.meets))
        if known is None or pair.ratio < known.ratio:
            pairs[pair.fails, pair.meets] = pair
    worst = tuple(sorted(pairs.values(), key=lambda pair: (round(pair.ratio, 9), pair.time)))
    return replace(found, pairs=worst, count=len(worst), field=described(field))


def in_field(
    losses: Iterator[Loss], held: Any, zones: PairZones, field: str, names: tuple[str, ...]
) -> Iterator[PairDrift]:
    """Yield the closest approach of each directed pair after any sampled loss of thrust.

    The motion between the states of a loss is interpolated, so that the minimum covers all instants.
    """
    found = dict[tuple[int, int], PairDrift]()
    for loss in losses:
        for zone, first, second in meeting(loss, held, zones):
            ratios = np.empty(len(first))
            minimum_ratios(loss.states, loss.arrivals, loss.times, first, second, zone.form, ratios)
            for one, two, ratio in zip(first.tolist(), second.tolist(), ratios.tolist(), strict=True):
                key = (two, one) if two == loss.craft else (one, two)
                if key not in found or ratio < found[key].ratio:
                    time, distance = loss.nearest(one, two, zone)
                    fails, meets = (names[k] for k in key)
                    found[key] = PairDrift(fails, meets, zone, loss.time, time, ratio, distance, ratio, field)
    yield from found.values()


def hidden(
    losses: Iterator[Loss],
    held: Any,
    zones: PairZones,
    neglected: Neglected,
    found: PassiveSafety,
    result: StageResult[Any, Any],
) -> str:
    """Return text for the largest excess of the model error over a clearance in Hill's equations.

    The text is empty if there is no excess.  The model error grows from the start of the stage, because no
    correction is assumed.  For failures other than a loss of thrust, the minimum clearance applies to all
    times.
    """
    worst = found.pairs[0]
    least = inf if found.failure == ThrustLost() else (worst.ratio - 1.0) * worst.zone.inner_radius
    most, words = 1.0, ""
    for loss in losses:
        far = np.maximum.accumulate(np.linalg.norm(loss.states[..., :3], axis=-1), axis=1)
        for zone, first, second in meeting(loss, held, zones):
            apart = loss.states[first, :, :3] - loss.states[second, :, :3]
            spare = np.minimum((zone.norm(apart) - 1.0) * zone.inner_radius, least)
            half, unlikely = neglected.error(
                np.maximum(far[first], far[second]), loss.times - result.start, 2
            )
            share = unlikely / np.maximum(spare, 1e-9)
            at = np.unravel_index(int(np.argmax(share)), share.shape)
            if share[at] > most:
                most = float(share[at])
                words = (
                    f"clearance {metres(max(spare[at], 0.0))} at {loss.times[at[1]]:.0f} s, "
                    f"model error {metres(half[at])} (95 %: {metres(unlikely[at])})"
                )
    return words


def meeting(loss: Loss, held: Any, zones: PairZones) -> Iterator[tuple[Zone, Any, Any]]:
    """Yield each zone with the indices (P,), (P,) of its pairs that include the craft that lost its thrust.

    For a `loss` without such a craft, yield the pairs in which no craft has thrust.
    """
    first, second = np.triu_indices(len(held), 1)
    some = (
        (first == loss.craft) | (second == loss.craft) if loss.craft >= 0 else ~(held[first] | held[second])
    )
    first, second = first[some], second[some]
    which = zones.which(first, second)
    for k, those in by_zone(which):
        yield zones.zones[k], first[those], second[those]


def unplanned(scenario: Scenario, result: StageResult[Any, Any]) -> PairDrift | None:
    """Return the closest pair of the direct paths after a failure; None if the stage requires no safety."""
    if not isinstance(result.stage, Drifting) or result.stage.drift is None:
        return None
    until = result.before.end + result.stage.drift.on(result.before.paths.orbit.period)
    pairs, _ = nearest(result.before, scenario.zones, until, result.stage.what_fails)
    return pairs[0] if pairs else None


def nearest(
    flight: WatchedFlight, zones: PairZones, until: float, failure: Failure
) -> tuple[tuple[PairDrift, ...], int]:
    """Return the closest approach of each directed pair after a failure, lowest first, and the pair count.

    The count includes safe pairs that are not listed because there are more than `MOST` pairs.
    """
    paths = flight.paths
    thrusts = np.array([does_thrust(paths[k]) for k in range(len(paths))])
    flying = paths if until == inf else paths.extended(until)
    model = paths.orbit._model or HILL
    asked = sum(len(first) for _, first, _ in directed(zones, thrusts, MOST))
    looked = directed(zones, thrusts, CHUNK)
    if asked > MOST:
        found = drift_screen(paths, zones, until, failure)
        first, second = found.pairs[np.argsort(found.ratio, kind="stable")].T
        mine = thrusts[first] | (~thrusts[second] & (first < second))
        looked = ways(zones, first[mine][:MOST], second[mine][:MOST])

    def search(job: tuple[Zone, Any, Any]) -> list[PairDrift]:
        zone, first, second = job
        close = drift_approach(paths[first], flying[second], zone, until, failure)
        failed = np.where(thrusts[first], close.failed_at, nan)
        columns = first, second, failed, close.time, close.ratio, close.distance, close.lower
        return [
            PairDrift(flight.names[one], flight.names[two], zone, at, time, ratio, distance, lower, model)
            for one, two, at, time, ratio, distance, lower in zip(
                *(part.tolist() for part in columns), strict=True
            )
        ]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        pairs = [pair for some in pool.map(search, looked) for pair in some]
    return tuple(sorted(pairs, key=lambda pair: (round(pair.ratio, 9), pair.time))), asked


def is_planned(result: StageResult[Any, Any]) -> bool:
    """Return True if the paths of a stage were planned to be passively safe."""
    if isinstance(result.result, AvoidResult):
        return result.result.plan.drift is not None
    return isinstance(result.result, ReconfigureResult) and result.result.plan.drift is not None


def does_thrust(path: Path) -> bool:
    """Return True if the path of one craft has any thrust."""
    return bool(path.arcs[:, THRUST:].any() or path.arcs[:, IMPULSE : IMPULSE + 3].any())


def directed(zones: PairZones, thrusts: Any, chunk: int) -> Iterator[tuple[Zone, Any, Any]]:
    """Yield each zone with the indices (P,) of the craft that fail and (P,) of the craft that they approach.

    A pair in which both craft thrust appears in both directions; otherwise the thrusting craft fails.
    """
    for zone, first, second in portions(zones, chunk):
        forth = thrusts[first] | ~thrusts[second]
        back = thrusts[second]
        for one, mask, failed, other in ((zone, forth, first, second), (zone.mirrored, back, second, first)):
            if mask.any():
                yield one, failed[mask], other[mask]


def ways(zones: PairZones, first: Any, second: Any) -> Iterator[tuple[Zone, Any, Any]]:
    """Yield each zone with its directed pairs, as indices (P,), (P,), in chunks."""
    which = zones.which(np.minimum(first, second), np.maximum(first, second))
    for k, some in by_zone(which):
        zone = zones.zones[k]
        for one, those in (
            (zone, some[first[some] < second[some]]),
            (zone.mirrored, some[first[some] > second[some]]),
        ):
            for start in range(0, len(those), CHUNK):
                part = those[start : start + CHUNK]
                yield one, first[part], second[part]
