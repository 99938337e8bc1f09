"""Verdict: what a run has come to, and its exit status: all found, clear, limits kept; or what is not so."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, degrees, floor, inf, isnan, log10, nan
from typing import TYPE_CHECKING, Any, Self

from closeform.arrays import Floats
from closeform.scenario import Craft

if TYPE_CHECKING:  # whose kernels a verdict can spare
    from closeform.conflicts.flight import WatchedFlight

ROUNDING = 1e-9  # of a limit that a plan was to keep to
SAMPLED = 1e-4  # of a zone: what is predicted at some instants is off by less
MET, NOT_MET = 0, 1  # exit status: of what was asked for
MOST_NAMES = 3  # of craft beyond a limit; more are counted
KEYS = {"N": "max_thrust", "mm/s²": "max_acceleration"}  # of limits of thrust, by unit
WARNINGS = {  # of a limit: of what, and what there is
    "delta-v": ("", "its delta_v_budget is"),
    "propellant": (" of propellant", "it has"),
}


@dataclass(frozen=True)
class Use:
    """How much of what it has a `craft` uses: `what` ("thrust", "delta-v", "propellant"), in one `unit`."""

    what: str
    unit: str
    craft: str
    used: float
    limit: float

    @property
    def share(self) -> float:
        """The share of the limit that is used."""
        return self.used / self.limit

    @property
    def exceeded(self) -> bool:
        """Whether that is more than there is."""
        return self.share > 1.0 + ROUNDING

    def shown(self, grams: bool) -> tuple[float, float, str]:
        """What is used, the limit, and the unit of both as they are printed: of masses perhaps grams."""
        if grams and self.unit == "kg":
            return 1e3 * self.used, 1e3 * self.limit, "g"
        return self.used, self.limit, self.unit

    def warning(self, grams: bool) -> str:
        """The same in words, for a limit that is exceeded."""
        of, has = WARNINGS.get(self.what) or ("", f"its {KEYS[self.unit]} is")
        used, limit, unit = self.shown(grams)
        return f"{self.craft} needs {used:.4g} {unit}{of}, {has} {limit:g} {unit}"

    @classmethod
    def of_spent(cls, craft: Sequence[Craft], delta_v: Floats, propellant: Floats) -> Iterator[Self]:
        """What craft (N,) that have a limit spend: all delta-v [m/s], then all propellant [kg]."""
        limits = ("delta-v", "m/s", "delta_v_budget", delta_v), ("propellant", "kg", "propellant", propellant)
        for what, unit, key, spent in limits:
            for one, used in zip(craft, spent.tolist(), strict=True):
                if (has := getattr(one, key)) is not None:
                    yield cls(what, unit, one.name, used, has)


def thrust_use(craft: Craft, acceleration: float) -> Use:
    """How much a craft uses of its limit: in newtons, or in mm/s² where that is no force."""
    if craft.max_thrust is not None and craft.mass is not None:
        return Use("thrust", "N", craft.name, acceleration * craft.mass, craft.max_thrust)
    return Use("thrust", "mm/s²", craft.name, 1e3 * acceleration, 1e3 * craft.max_acceleration)


@dataclass(frozen=True)
class Late:
    """A stage, by its `number` and `verb`, that `took` [s] longer than `asked` [s].

    `punctual`: the thrust with which each craft that has less would have kept the time; none where it is
    not want of thrust.
    """

    number: int
    verb: str
    asked: float
    took: float
    punctual: tuple[Use, ...] = ()

    @property
    def late(self) -> float:
        """By how much [s]."""
        return self.took - self.asked

    @property
    def keeping(self) -> str:
        """The thrust that would keep the time, rounded up."""
        names = [f"{raised(use.used)} {use.unit} ({use.craft})" for use in self.punctual[:MOST_NAMES]]
        more = len(self.punctual) - MOST_NAMES
        return ", ".join(names + [f"{more} more"] * (more > 0))

    @property
    def warning(self) -> str:
        """The same in words."""
        keeping = ""
        if self.punctual:
            keeping = f"; {KEYS[self.punctual[0].unit]} of {self.keeping} would keep it"
        return (
            f"stage {self.number} ({self.verb}) takes {self.took:.1f} s, not {self.asked:.1f} s{keeping}; "
            'see "Tried"'
        )

    def __str__(self) -> str:
        keeping = f", for want of {self.keeping}" if self.punctual else ""
        return f"stage {self.number} ({self.verb}) by {self.late:.1f} s{keeping}"


@dataclass(frozen=True)
class Asked:
    """Something that a stage asks for: in words if it is `met`, and if not.

    Of those of one `kind` that are met the one with the least `margin` is told.  `doubt`: why it is not shown
    although it is met in the model of the plan; empty where it is shown.
    """

    kept: str
    broken: str
    met: bool
    margin: float
    kind: str
    doubt: str = ""

    @property
    def shown(self) -> bool | None:
        """Whether it is met; None where that is not shown."""
        return None if self.met and self.doubt else self.met

    def __str__(self) -> str:
        return (self.doubt or self.kept) if self.met else self.broken


@dataclass(frozen=True)
class Margin:
    """Least distance [m] of a `pair` to its zone as planned, and the model error [m] beside it.

    Half of all missions have a model error of at most `expected`, 95 % of at most `unlikely`.  `planned`:
    whether a stage can keep a margin.
    """

    distance: float
    pair: tuple[str, str]
    expected: float
    unlikely: float
    planned: bool = True

    @property
    def exceeded(self) -> bool:
        """Whether the model error may take craft into a zone."""
        return self.unlikely > self.distance

    @property
    def figures(self) -> dict[str, Any]:
        """The same for `summary.json`."""
        return {
            "margin_m": self.distance,
            "pair": list(self.pair),
            "expected_m": self.expected,
            "unlikely_m": self.unlikely,
            "exceeded": self.exceeded,
        }

    def __str__(self) -> str:
        words = f"margin {self.distance:.1f} m ({'-'.join(self.pair)})"
        error = f"model error {metres(self.expected)} (95 %: {metres(self.unlikely)})"
        if not self.exceeded:
            return f"{words}, {error}"
        exceeds = "exceeds it" if self.expected > self.distance else "can exceed it"
        least = f"{ceil(self.unlikely)}" if self.unlikely > 10.0 else raised(self.unlikely, 2)
        margin = f'set margin = "{least} m", or ' if self.planned else ""
        return f"{words}; {error} {exceeds}: {margin}add a field"


@dataclass(frozen=True)
class LostThrust:
    """A `craft` that loses its thrust at a `time` [s] and drifts, whether it `needed` more or not.

    From then on it comes within `ratio` times the zone of the `other` that it comes nearest to; nan, None
    where it keeps none.
    """

    craft: str
    time: float
    needed: bool
    ratio: float
    other: str | None

    @property
    def figures(self) -> dict[str, Any]:
        """The same for `summary.json`; of no zone the ratio is None."""
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
        """From its `figures`."""
        ratio = nan if figures["ratio"] is None else figures["ratio"]
        return cls(figures["craft"], figures["time_s"], figures["needed"], ratio, figures["other"])

    @property
    def asked(self) -> Asked:
        """What it comes to: a craft that needed its thrust does not get to where it was asked to be."""
        words = f"{self.craft} loses its thrust at {self.time:.1f} s"
        if not self.needed and not self.ratio < 1.0:
            return Asked(f"{words} and needed it no more", "", True, inf, f"thrust of {self.craft}")
        if self.other is None:
            drifts = "drifts"
        elif self.ratio < 1.0:
            drifts = f"drifts into the zone of {self.other}, to {self.ratio:.4f} of it"
        else:
            drifts = f"drifts clear of all, least {self.ratio:.4f} x zone of {self.other}"
        return Asked("", f"{words} and {drifts}", False, 0.0, f"thrust of {self.craft}")


@dataclass(frozen=True)
class SunAngle:
    """The greatest `angle` [rad] of body x from the Sun in a search, that of one `craft`, and its `limit`."""

    craft: str
    angle: float
    limit: float

    @property
    def within(self) -> bool:
        """Whether the limit is kept."""
        return self.angle <= self.limit + ROUNDING

    @property
    def asked(self) -> Asked:
        """The requirement and whether it is met."""
        found = f"body x up to {degrees(self.angle):.3f} deg off the Sun ({self.craft})"
        limit = f"limit {degrees(self.limit):g} deg"
        broken = f"sun limit exceeded: {found}, {limit}"
        return Asked(f"{found}, {limit}", broken, self.within, self.limit - self.angle, "sun")


@dataclass(frozen=True)
class Verdict:
    """Whether what was asked for is met.

    `stopped`: why there are fewer stages than in the file, else None; `conflicts`, each from an entry
    into a zone to the exit, of so many `pairs`; None where nobody looked for them.  `exceeded`: who
    uses more than there is, None without any limit.  `searched`: whether craft were lost.  `late`: stages
    that take longer than asked.  `sigmas`: of the errors of states by which conflicts were counted.
    `asked`: what stages ask for beyond that.  `drawn`: whether craft fly with errors that a case has drawn.
    `model`: the dynamics of the plan, empty in deep space; `margin`: the least one, with the model error;
    None where that is not known, or a field is given.  `predicted`: the least ratio in the scenario's `field`
    of pairs that are clear as planned; None without.  `strict`: whether a model error above the margin is a
    failure.
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
    margin: Margin | None = None
    predicted: float | None = None
    field: str = ""
    strict: bool = False

    @property
    def enters(self) -> bool:
        """Whether a zone is entered in the field although the plan keeps it."""
        return self.predicted is not None and self.predicted < 1.0 - SAMPLED

    @property
    def clear(self) -> bool:
        """Whether every stage was flown, nobody is lost and no conflict remains, planned or in a field."""
        return self.stopped is None and not self.conflicts and not self.enters

    @property
    def doubts(self) -> list[str]:
        """What is not shown, as the model error exceeds a margin."""
        found = [str(self.margin)] if self.margin is not None and self.margin.exceeded else []
        return found + [one.doubt for one in self.asked if one.shown is None]

    @property
    def ok(self) -> bool:
        """Whether it is clear, every limit is kept, no stage is late, and what else is asked for is met."""
        met = all(one.met for one in self.asked) and not (self.strict and self.doubts)
        return self.clear and met and not self.exceeded and not self.late

    @property
    def status(self) -> int:
        """The exit status of the command."""
        return MET if self.ok else NOT_MET

    @property
    def at(self) -> str:
        """With which errors conflicts were counted, in words."""
        if self.drawn:
            return " with the errors of this case"
        return "" if self.sigmas is None else f" at {self.sigmas:g} sigma{'s' * (self.sigmas != 1)}"

    @property
    def figures(self) -> dict[str, Any]:
        """What it has come to, for `summary.json`."""
        exceeded = [vars(use) for use in self.exceeded or ()]
        return {
            "status": self.status,
            "verdict": str(self),
            "clear": self.clear,
            "conflicts": self.conflicts,
            "pairs_in_conflict": self.pairs if self.conflicts is not None else None,
            "model": self.field or self.model or None,
            "model_error": None if self.margin is None else self.margin.figures,
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
        """One line: clear, in which model and by how much, or what is not met."""
        if self.ok:
            model = f" in {self.model}" * bool(self.model)
            if self.predicted is not None:
                model += f" and as predicted in {self.field}, least {self.predicted:.4f} x zone"
            return f"clear{model}: {('; ' if self.doubts else ', ').join(self.found)}"
        return "; ".join(self.unmet)

    @property
    def found(self) -> Iterator[str]:
        """What is met, the margin last."""
        if self.searched:
            yield "nobody is lost"
        looked = self.conflicts is not None
        yield f"no conflict remains{self.at}" if looked else "conflicts were not looked for"
        order = sorted(self.asked, key=lambda one: (bool(one.doubt), -one.margin))
        yield from map(str, {one.kind: one for one in order}.values())
        if self.exceeded is not None:
            yield "limits are kept"
        if self.margin is not None:
            yield str(self.margin)

    @property
    def unmet(self) -> Iterator[str]:
        """What is not met."""
        if self.stopped is not None:
            yield f"stopped in {self.stopped}"
        if self.conflicts:
            remain = f"remain{'s' * (self.conflicts == 1)}{self.at}"
            yield f"{conflicts_of(self.conflicts, self.pairs)} {remain}"
        if self.enters:
            least = f"least {self.predicted:.4f} x zone in {self.field}"
            yield f"clear as planned, not as predicted in the field: {least}"
        if self.exceeded:
            yield f"limits are not kept: {beyond(self.exceeded)}"
        if self.late:
            yield f"later than asked: {', '.join(map(str, self.late))}"
        yield from (one.broken for one in self.asked if not one.met)
        if self.strict:
            yield from self.doubts


def metres(number: float) -> str:
    """A length [m] with two digits, or whole metres."""
    return f"{number:.2g} m" if number < 99.5 else f"{number:.0f} m"


def raised(number: float, digits: int = 4) -> str:
    """A number with some digits that is not below it."""
    unit = 10.0 ** (floor(log10(number)) + 1 - digits) if number > 0.0 else 1.0
    return f"{unit * ceil(number / unit * (1.0 - 1e-12)):.{digits}g}"


def conflicts_of(conflicts: int, pairs: int) -> str:
    """A number of conflicts, and of the pairs that are in them, perhaps again and again."""
    of = f" of {pairs} pair{'s' * (pairs != 1)}" if conflicts != 1 else ""
    return f"{conflicts} conflict{'s' * (conflicts != 1)}{of}"


def beyond(uses: Iterable[Use]) -> str:
    """Which limits are not kept, and by whom."""
    craft: dict[str, list[str]] = {}
    for use in uses:
        craft.setdefault(use.what, []).append(use.craft)
    parts = []
    for what, names in craft.items():
        more = [f"{len(names) - MOST_NAMES} more"] * (len(names) > MOST_NAMES)
        parts.append(f"{what} ({', '.join(names[:MOST_NAMES] + more)})")
    return ", ".join(parts)


def conflicts_in(flights: Iterable["WatchedFlight"]) -> tuple[int, int]:
    """How many conflicts there are in flights that follow one another, and of how many pairs.

    One that lasts from one flight into the next is one.
    """
    count, pairs, ends = 0, set(), dict[tuple[str, str], float]()
    for flight in flights:
        for met in flight.conflicts:
            pair = met.first, met.second
            count += ends.get(pair) != met.start
            ends[pair] = met.end
            pairs.add(pair)
    return count, len(pairs)
