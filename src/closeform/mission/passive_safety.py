"""What a stage leads to when something fails: every pair, judged for all instants and all of the drift."""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import inf, isnan, nan
from typing import Any

import numpy as np

from closeform.conflicts.flight import WatchedFlight
from closeform.dynamics.field import described
from closeform.dynamics.least_ratios import least_of_pairs
from closeform.dynamics.lost_thrust import Loss, sampled_losses
from closeform.mission.mission_result import AvoidResult, ReconfigureResult, StageResult
from closeform.mission.simulation_verdict import Neglected
from closeform.mission.verdict import Asked, metres
from closeform.motion.arc import IMPULSE, THRUST
from closeform.motion.path import Path
from closeform.safety.drift_approach import drift_approach
from closeform.safety.drift_screen import drift_screen
from closeform.safety.failures import Failure, ThrustLost
from closeform.safety.sides import carried
from closeform.scenario import Scenario
from closeform.scenario.stage_table import Drifting
from closeform.zones.pair_zones import PairZones, by_zone, portions
from closeform.zones.zone import Zone

MOST = 2000  # pairs, each both ways, of which every least ratio is looked for; of more those that are unsafe
ROUNDING = 1e-8  # of a ratio: a bound nearer to it is the same
HILL = "Hill's equations"
CHUNK = 64  # of them that one thread takes at a time


@dataclass(frozen=True, eq=False)
class PairDrift:
    """How near `fails` comes to `meets`, in terms of the `zone` that holds for them, at the worst.

    It fails at `failed_at` [s], nan where it does not thrust; the least norm is `ratio` at `time` [s], inf in
    a drift so slow that nobody knows when; `distance` [m] then.  It is proven that no failure leads below
    `lower`, which is farther below `ratio` where the search of failures with many unknowns had to end.
    `model`: in which dynamics that is.
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
        """Whether it certainly stays out of the zone."""
        return self.ratio > 1.0 and self.proven > 1.0 - ROUNDING

    @property
    def proven(self) -> float:
        """The ratio below which no failure leads: `ratio` itself where that is the least."""
        return self.ratio if self.lower > self.ratio - ROUNDING * max(1.0, abs(self.ratio)) else self.lower

    @property
    def beside(self) -> str:
        """What is proven, in words, where less may exist than was found."""
        return "" if self.proven == self.ratio else f", at least {self.proven:.4f} by proof"


@dataclass(frozen=True, eq=False)
class PassiveSafety:
    """A stage `where` ("stage 1 (avoid)") judged `until` [s] the end of a drift `lasting` ("for 24 h").

    `pairs`: the nearest first, of each two craft both ways where both thrust; where they are more than
    `MOST` those that are unsafe alone, of `count` in all.  `planned`: whether the paths were planned to be
    safe, and not only judged; then `direct` is the nearest pair of the direct paths, if others are flown.
    `field`: the high-fidelity model in which it is judged as well, empty without any; of each pair the worse
    counts.  `doubt`: why safety in Hill's equations shows nothing of real motion, empty where it does.
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
        """The dynamics in which it is judged."""
        return f"in {HILL}" + f" and in {self.field}" * bool(self.field)

    @property
    def unsafe(self) -> tuple[PairDrift, ...]:
        """The pairs that are not safe."""
        return tuple(pair for pair in self.pairs if not pair.safe)

    @property
    def safe(self) -> bool:
        """Whether no failure leads into a zone."""
        return not self.unsafe

    @property
    def asked(self) -> Iterator[Asked]:
        """For the verdict."""
        worst, safe = self.worst, f"passively safe {self.lasting}"
        if worst is None:
            yield Asked(f"{safe} ({self.models})", "", True, inf, "drift")
            return
        more = f" and {len(self.unsafe) - 1} more" * (len(self.unsafe) > 1)
        least = f"{worst.ratio:.4f} x zone{worst.beside}"
        met = f"{worst.fails} with {worst.meets}, {least}{more}, in {worst.model}"
        kept = f"{safe} (least {least}, {self.models})"
        doubt = f"not shown: {safe}, {self.doubt}" if self.doubt else ""
        yield Asked(kept, f"not {safe} in {self.where}: {met}", self.safe, worst.ratio, "drift", doubt)

    @property
    def worst(self) -> PairDrift | None:
        """The nearest pair; None where none was looked for."""
        return self.pairs[0] if self.pairs else None


def judged(scenario: Scenario, result: StageResult[Any, Any]) -> PassiveSafety | None:
    """Whether a stage as flown is passively safe; None where it does not ask, or is not flown."""
    stage = result.stage
    if not isinstance(stage, Drifting) or stage.drift is None or not result.flown:
        return None
    drift, failure = stage.drift.on(result.after.paths.orbit.mean_motion), stage.what_fails
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
    """Judge passive safety in the scenario's field as well, or by the model error where it has none."""
    field, until, paths = scenario.field, found.until, result.after.paths
    neglected = Neglected.on(paths.orbit, scenario)
    if field is None and neglected is None:
        return found  # in deep space, or where the model error is not known
    limits = {
        "its drift has no end": until == inf,
        f"it has more than {MOST} pairs": found.count > MOST,
        "only a loss of thrust is simulated there": field is not None and found.failure != ThrustLost(),
    }
    if any(limits.values()):
        why = " and ".join(reason for reason, applies in limits.items() if applies)
        model = "with the model error" if field is None else f"in {described(field)}"
        return replace(found, doubt=f"not judged {model}, as {why}")
    also = {pair.failed_at for pair in found.pairs if not isnan(pair.failed_at)}
    held = np.array([does_thrust(paths[k]) or scenario.flights is not None for k in range(len(paths))])
    held &= np.array([craft.engine for craft in scenario.craft])
    losses = sampled_losses(paths, held, until, field, sorted(also))
    zones = scenario.zones
    if field is None:
        assert neglected is not None
        return replace(found, doubt=hidden(losses, held, zones, neglected, found, result))
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
    """Yield how near each two craft come after any loss of thrust, at all instants between states, too."""
    found = dict[tuple[int, int], PairDrift]()
    for loss in losses:
        for zone, first, second in meeting(loss, held, zones):
            ratios = np.empty(len(first))
            least_of_pairs(loss.states, loss.arrivals, loss.times, first, second, zone.form, ratios)
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
    """Return where the model error exceeds a clearance in Hill's equations, by the largest factor, if so.

    The model error counts from the start of the stage, as nobody corrects.  Of failures other than a loss of
    thrust the least clearance is taken to last.
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
    """Yield zones, and the pairs (P,) of which the craft that lost its thrust is one.

    Without such a craft: those of which no craft has thrust.
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
    """The nearest pair of a stage's direct paths, where it asks to be safe; None without."""
    if not isinstance(result.stage, Drifting) or result.stage.drift is None:
        return None
    until = result.before.end + result.stage.drift.on(result.before.paths.orbit.mean_motion)
    pairs, _ = nearest(result.before, scenario.zones, until, result.stage.what_fails)
    return pairs[0] if pairs else None


def nearest(
    flight: WatchedFlight, zones: PairZones, until: float, failure: Failure
) -> tuple[tuple[PairDrift, ...], int]:
    """How near each two craft come when one of them fails, the nearest first, and how many were asked for."""
    paths = flight.paths
    thrusts = np.array([does_thrust(paths[k]) for k in range(len(paths))])
    flying = paths if until == inf else carried(paths, until)
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
        at = np.where(thrusts[first], close.failed_at, nan)
        columns = first, second, at, close.time, close.ratio, close.distance, close.lower
        return [
            PairDrift(flight.names[one], flight.names[other], zone, *figures)
            for one, other, *figures in zip(*(part.tolist() for part in columns), strict=True)
        ]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        pairs = [pair for some in pool.map(search, looked) for pair in some]
    return tuple(sorted(pairs, key=lambda pair: (round(pair.ratio, 9), pair.time))), asked


def is_planned(result: StageResult[Any, Any]) -> bool:
    """Whether a stage's paths were planned to be passively safe."""
    if isinstance(result.result, AvoidResult):
        return result.result.avoidance.drift is not None
    return isinstance(result.result, ReconfigureResult) and result.result.plan.drift is not None


def does_thrust(path: Path) -> bool:
    """Whether one craft has any thrust."""
    return bool(path.arcs[:, THRUST:].any() or path.arcs[:, IMPULSE : IMPULSE + 3].any())


def directed(zones: PairZones, thrusts: Any, chunk: int) -> Iterator[tuple[Zone, Any, Any]]:
    """Zones, who fails, and who flies on: both ways where both thrust, else who does."""
    for zone, first, second in portions(zones, chunk):
        forth = thrusts[first] | ~thrusts[second]
        back = thrusts[second]
        for one, mask, who, whom in ((zone, forth, first, second), (zone.mirrored, back, second, first)):
            if mask.any():
                yield one, who[mask], whom[mask]


def ways(zones: PairZones, first: Any, second: Any) -> Iterator[tuple[Zone, Any, Any]]:
    """The zones of some directed pairs, by zone and direction."""
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
