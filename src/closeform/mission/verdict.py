"""Verdict and exit status of a run: whether searches, clearance, limits and requirements are met."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, degrees, floor, inf, isnan, log10, nan
from typing import TYPE_CHECKING, Any, Self

from closeform.arrays import Floats
from closeform.scenario import Craft

if TYPE_CHECKING:  # a verdict does not need these kernels
    from closeform.conflicts.flight import WatchedFlight

ROUNDING = 1e-9  # relative tolerance for limits that a plan keeps
SAMPLED = 1e-4  # bound on the sampling error of a predicted clearance ratio
MET, NOT_MET = 0, 1  # exit status: requirements met, or not
MOST_NAMES = 3  # listed spacecraft beyond a limit; the others are counted
KEYS = {"N": "max_thrust", "mm/s²": "max_acceleration"}  # scenario keys of thrust limits, by unit
WARNINGS = {  # words for the resource, and for its limit
    "delta-v": ("", "its delta_v_budget is"),
    "propellant": (" of propellant", "it has"),
}


@dataclass(frozen=True)
class Use:
    """Use and limit of a resource by a `craft`: `what` is "thrust", "delta-v" or "propellant", in `unit`."""

    what: str
    unit: str
    craft: str
    used: float
    limit: float

    @property
    def share(self) -> float:
        """Fraction of the limit that is used."""
        return self.used / self.limit

    @property
    def exceeded(self) -> bool:
        """True if the use exceeds the limit."""
        return self.share > 1.0 + ROUNDING

    def shown(self, grams: bool) -> tuple[float, float, str]:
        """Return the use, the limit and their unit as printed; `grams` selects grams for masses."""
        if grams and self.unit == "kg":
            return 1e3 * self.used, 1e3 * self.limit, "g"
        return self.used, self.limit, self.unit

    def warning(self, grams: bool) -> str:
        """Return the warning text for an exceeded limit."""
        of, has = WARNINGS.get(self.what) or ("", f"its {KEYS[self.unit]} is")
        used, limit, unit = self.shown(grams)
        return f"{self.craft} needs {used:.4g} {unit}{of}, {has} {limit:g} {unit}"

    @classmethod
    def of_spent(cls, craft: Sequence[Craft], delta_v: Floats, propellant: Floats) -> Iterator[Self]:
        """Yield the use of each craft (N,) with a limit: all delta-v [m/s], then all propellant [kg]."""
        limits = ("delta-v", "m/s", "delta_v_budget", delta_v), ("propellant", "kg", "propellant", propellant)
        for what, unit, key, spent in limits:
            for one, used in zip(craft, spent.tolist(), strict=True):
                if (has := getattr(one, key)) is not None:
                    yield cls(what, unit, one.name, used, has)


def thrust_use(craft: Craft, acceleration: float) -> Use:
    """Return the use of a thrust limit for an acceleration [m/s^2]: in N for a force limit, else in mm/s²."""
    if craft.max_thrust is not None and craft.mass is not None:
        return Use("thrust", "N", craft.name, acceleration * craft.mass, craft.max_thrust)
    return Use("thrust", "mm/s²", craft.name, 1e3 * acceleration, 1e3 * craft.max_acceleration)


@dataclass(frozen=True)
class Late:
    """Stage, by its `number` and `verb`, that `took` [s] instead of the requested `asked` [s].

    `punctual` lists, for each spacecraft that lacks thrust, the thrust that it needs to finish in time.  It
    is empty if the delay is not due to a lack of thrust.
    """

    number: int
    verb: str
    asked: float
    took: float
    punctual: tuple[Use, ...] = ()

    @property
    def late(self) -> float:
        """Delay [s]."""
        return self.took - self.asked

    @property
    def keeping(self) -> str:
        """Text with the thrust that would avoid the delay, rounded up."""
        names = [f"{raised(use.used)} {use.unit} ({use.craft})" for use in self.punctual[:MOST_NAMES]]
        more = len(self.punctual) - MOST_NAMES
        return ", ".join(names + [f"{more} more"] * (more > 0))

    @property
    def warning(self) -> str:
        """Text of the warning."""
        keeping = ""
        if self.punctual:
            keeping = f"; {KEYS[self.punctual[0].unit]} of {self.keeping} would avoid the delay"
        return (
            f"stage {self.number} ({self.verb}) takes {self.took:.1f} s, not {self.asked:.1f} s{keeping}; "
            'see "Tried"'
        )

    def __str__(self) -> str:
        keeping = f", avoidable with {self.keeping}" if self.punctual else ""
        return f"stage {self.number} ({self.verb}) by {self.late:.1f} s{keeping}"


@dataclass(frozen=True)
class Asked:
    """Requirement of a stage, with the texts `kept` and `broken` for a requirement that is `met` or not.

    A verdict reports only the met requirement of one `kind` with the least `slack`, in its own `unit`.
    `doubt` is the reason why a requirement that the plan meets in its model is in doubt, or empty.
    """

    kept: str
    broken: str
    met: bool
    slack: float
    kind: str
    doubt: str = ""
    unit: str = ""

    @property
    def shown(self) -> bool | None:
        """True if the requirement is met, None if that is in doubt."""
        return None if self.met and self.doubt else self.met

    def __str__(self) -> str:
        return (self.doubt or self.kept) if self.met else self.broken


@dataclass(frozen=True)
class ZoneDistance:
    """Minimum planned `distance` [m] of a `pair` from its keep-out zone, with the model error [m].

    Half of all missions have a model error of at most `expected`, and 95 % of at most `unlikely`; both are
    nan where it is unknown.  `enlarges` is True if a stage supports a keep-out margin, which enlarges its
    zones.  `remedy` is the way to a smaller error.
    """

    distance: float
    pair: tuple[str, str]
    expected: float = nan
    unlikely: float = nan
    enlarges: bool = True
    remedy: str = "add a field"

    @property
    def exceeded(self) -> bool:
        """True if the model error can exceed the distance."""
        return self.unlikely > self.distance

    @property
    def figures(self) -> dict[str, Any]:
        """Values for `summary.json`."""
        return {
            "distance_m": self.distance,
            "pair": list(self.pair),
            "expected_m": None if isnan(self.expected) else self.expected,
            "unlikely_m": None if isnan(self.unlikely) else self.unlikely,
            "exceeded": self.exceeded,
        }

    def __str__(self) -> str:
        words = f"closest distance to a zone {self.distance:.1f} m ({'-'.join(self.pair)})"
        if isnan(self.unlikely):
            return words
        error = f"model error (median {metres(self.expected)}, 95th percentile {metres(self.unlikely)})"
        if not self.exceeded:
            return f"{words}, {error}"
        exceeds = "exceeds it" if self.expected > self.distance else "can exceed it"
        least = f"{ceil(self.unlikely)}" if self.unlikely > 10.0 else raised(self.unlikely, 2)
        margin = f', or margin = "{least} m" where the ends allow it' if self.enlarges else ""
        return f"{words}; {error} {exceeds}: {self.remedy}{margin}"


@dataclass(frozen=True)
class LostThrust:
    """Loss of thrust of a `craft` at a `time` [s], and whether it still `needed` thrust.

    `ratio` is the minimum clearance ratio of the free drift, and `other` is the spacecraft of that closest
    approach.  For a spacecraft without a zone, `ratio` is nan and `other` is None.
    """

    craft: str
    time: float
    needed: bool
    ratio: float
    other: str | None

    @property
    def figures(self) -> dict[str, Any]:
        """Values for `summary.json`; the ratio is None without a zone."""
        ratio = None if isnan(self.ratio) else self.ratio
        return {
            "craft": self.craft,
            "time_s": self.time,
            "needed": self.needed,
            "ratio": ratio,
            "other": self.other,
        }

    @classmethod
    def of(cls, figures: Mapping[str, Any]) -> Self:
        """Return the loss of thrust with given `figures`."""
        ratio = nan if figures["ratio"] is None else figures["ratio"]
        return cls(figures["craft"], figures["time_s"], figures["needed"], ratio, figures["other"])

    @property
    def asked(self) -> Asked:
        """Requirement that the spacecraft needed no further thrust and that its drift is clear."""
        words = f"{self.craft} loses its thrust at {self.time:.1f} s"
        if not self.needed and not self.ratio < 1.0:
            return Asked(f"{words} and no longer needs it", "", True, inf, f"thrust of {self.craft}")
        if self.other is None:
            drifts = "drifts"
        elif self.ratio < 1.0:
            drifts = f"drifts into the zone of {self.other}, minimum {self.ratio:.4f} x zone"
        else:
            drifts = f"drifts without a conflict, minimum {self.ratio:.4f} x zone of {self.other}"
        return Asked("", f"{words} and {drifts}", False, 0.0, f"thrust of {self.craft}")


@dataclass(frozen=True)
class SunAngle:
    """Maximum `angle` [rad] between body x and the Sun in a search, of one `craft`, and its `limit` [rad]."""

    craft: str
    angle: float
    limit: float

    @property
    def within(self) -> bool:
        """True if the limit is kept."""
        return self.angle <= self.limit + ROUNDING

    @property
    def asked(self) -> Asked:
        """Requirement on the angle, and whether it is met."""
        found = f"body x up to {degrees(self.angle):.3f} deg off the Sun ({self.craft})"
        limit = f"limit {degrees(self.limit):g} deg"
        broken = f"sun limit exceeded: {found}, {limit}"
        return Asked(f"{found}, {limit}", broken, self.within, self.limit - self.angle, "sun")


@dataclass(frozen=True)
class Verdict:
    """Verdict of a run.

    - `stopped`: reason why stages of the file are missing; None if none are.
    - `conflicts`: number of conflicts, of so many `pairs`; None if the run did not look for conflicts.
    - `exceeded`: uses above their limits; None without any limit.
    - `searched`: whether the run searched for lost spacecraft.
    - `late`: stages that take longer than requested.
    - `sigmas`: number of standard deviations of the states with which conflicts were counted; None without.
    - `asked`: further requirements of the stages.
    - `drawn`: whether the paths include the sampled errors of a case.
    - `model`: dynamics of the plan; empty in deep space.
    - `zone_distance`: minimum distance from a zone, with the model error; None with a high-fidelity model.
    - `predicted`: minimum clearance ratio in the high-fidelity model `field` of the pairs that are clear as
      planned; None without a prediction.
    - `strict`: whether a model error above that distance is a failure.
    """

    stopped: str | None
    conflicts: int | None
    pairs: int
    exceeded: tuple[Use, ...] | None
    searched: bool
    late: tuple[Late, ...] = ()
    sigmas: float | None = None
    asked: tuple[Asked, ...] = ()
    drawn: bool = False
    model: str = ""
    zone_distance: ZoneDistance | None = None
    predicted: float | None = None
    field: str = ""
    strict: bool = False

    @property
    def enters(self) -> bool:
        """True if a zone that the plan keeps is entered in the high-fidelity model."""
        return self.predicted is not None and self.predicted < 1.0 - SAMPLED

    @property
    def clear(self) -> bool:
        """True if every stage succeeded, and no conflict remains in the plan or the high-fidelity model."""
        return self.stopped is None and not self.conflicts and not self.enters

    @property
    def doubts(self) -> list[str]:
        """Texts of the results in doubt, for example because the model error exceeds a distance."""
        found = [str(near)] if (near := self.zone_distance) is not None and near.exceeded else []
        return found + [one.doubt for one in self.asked if one.shown is None]

    @property
    def ok(self) -> bool:
        """True if the run is clear, has no late stage, and meets all limits and other requirements."""
        met = all(one.met for one in self.asked) and not (self.strict and self.doubts)
        return self.clear and met and not self.exceeded and not self.late

    @property
    def status(self) -> int:
        """Exit status of the command."""
        return MET if self.ok else NOT_MET

    @property
    def at(self) -> str:
        """Text that states the errors with which conflicts were counted; empty without errors."""
        if self.drawn:
            return " with the errors of this case"
        return "" if self.sigmas is None else f" at {self.sigmas:g} sigma{'s' * (self.sigmas != 1)}"

    @property
    def figures(self) -> dict[str, Any]:
        """Values for `summary.json`."""
        exceeded = [vars(use) for use in self.exceeded or ()]
        return {
            "status": self.status,
            "verdict": str(self),
            "clear": self.clear,
            "conflicts": self.conflicts,
            "pairs_in_conflict": self.pairs if self.conflicts is not None else None,
            "model": self.field or self.model or None,
            "model_error": None if self.zone_distance is None else self.zone_distance.figures,
            "not_shown": self.doubts,
            "predicted_ratio": self.predicted,
            "limits_kept": None if self.exceeded is None else not exceeded,
            "exceeded": exceeded,
            "late": [
                {
                    "stage": late.number,
                    "do": late.verb,
                    "asked_s": late.asked,
                    "took_s": late.took,
                    "keeping_N": {use.craft: use.used for use in late.punctual},
                }
                for late in self.late
            ],
        }

    def __str__(self) -> str:
        """Return one line: clear, with the model and its error, or the unmet requirements."""
        if self.ok:
            model = f" in {self.model}" * bool(self.model)
            if self.predicted is not None:
                model += f" and as predicted in {self.field}, minimum {self.predicted:.4f} x zone"
            return f"clear{model}: {('; ' if self.doubts else ', ').join(self.found)}"
        return "; ".join(self.unmet)

    @property
    def found(self) -> Iterator[str]:
        """Texts of the requirements that are met, with the distance from a zone last."""
        if self.searched:
            yield "no craft is lost"
        looked = self.conflicts is not None
        yield f"no conflict remains{self.at}" if looked else "no search for conflicts"
        order = sorted(self.asked, key=lambda one: (bool(one.doubt), -one.slack))
        yield from map(str, {one.kind: one for one in order}.values())
        if self.exceeded is not None:
            yield "limits are kept"
        if self.zone_distance is not None:
            yield str(self.zone_distance)

    @property
    def unmet(self) -> Iterator[str]:
        """Texts of the requirements that are not met."""
        if self.stopped is not None:
            yield f"stopped in {self.stopped}"
        if self.conflicts:
            remain = f"remain{'s' * (self.conflicts == 1)}{self.at}"
            yield f"{conflicts_of(self.conflicts, self.pairs)} {remain}"
        if self.enters:
            least = f"minimum {self.predicted:.4f} x zone in {self.field}"
            yield f"clear as planned, but not as predicted in the high-fidelity model: {least}"
        if self.exceeded:
            yield f"limits are not kept: {beyond(self.exceeded)}"
        if self.late:
            yield f"later than requested: {', '.join(map(str, self.late))}"
        yield from (one.broken for one in self.asked if not one.met)
        if self.strict:
            yield from self.doubts


def metres(number: float) -> str:
    """Return a length [m] as text with two digits, or in whole metres."""
    return f"{number:.2g} m" if number < 99.5 else f"{number:.0f} m"


def raised(number: float, digits: int = 4) -> str:
    """Return a number as text, rounded up to some digits."""
    unit = 10.0 ** (floor(log10(number)) + 1 - digits) if number > 0.0 else 1.0
    return f"{unit * ceil(number / unit * (1.0 - 1e-12)):.{digits}g}"


def conflicts_of(conflicts: int, pairs: int) -> str:
    """Return the number of conflicts as text, with the number of pairs if there is more than one conflict."""
    of = f" of {pairs} pair{'s' * (pairs != 1)}" if conflicts != 1 else ""
    return f"{conflicts} conflict{'s' * (conflicts != 1)}{of}"


def beyond(uses: Iterable[Use]) -> str:
    """Return text that lists the exceeded limits, each with the names of the spacecraft."""
    craft: dict[str, list[str]] = {}
    for use in uses:
        craft.setdefault(use.what, []).append(use.craft)
    parts = []
    for what, names in craft.items():
        more = [f"{len(names) - MOST_NAMES} more"] * (len(names) > MOST_NAMES)
        parts.append(f"{what} ({', '.join(names[:MOST_NAMES] + more)})")
    return ", ".join(parts)


def conflicts_in(flights: Iterable["WatchedFlight"]) -> tuple[int, int]:
    """Return the number of conflicts in consecutive flights, and the number of pairs.

    A conflict that continues from one flight into the next counts once.
    """
    count, pairs, ends = 0, set(), dict[tuple[str, str], float]()
    for flight in flights:
        for met in flight.conflicts:
            pair = met.first, met.second
            count += ends.get(pair) != met.start
            ends[pair] = met.end
            pairs.add(pair)
    return count, len(pairs)
