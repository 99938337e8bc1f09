"""Planning problem: unconstrained optima of the craft, obstacles, zones of all pairs, and times."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, pi, sqrt
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.pair_rows import conflicts_of, tracks_of_all
from closeform.fuel.pulses import extended
from closeform.motion.arc import END, IMPULSE, PUSH, START, WIDTH
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.effort import ENERGY
from closeform.motion.joining import stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path, ends_of, path_of
from closeform.planning.plan import Contact
from closeform.planning.problem.approaches import sample_bodies
from closeform.planning.problem.chief_paths import ChiefPaths
from closeform.planning.problem.contacts import turn_normals
from closeform.planning.problem.deflection import deflected_arcs, invert_responses, look_at, room_for
from closeform.planning.problem.natural_motion import windows_of
from closeform.planning.problem.pieces import BASE, PATHS, PLACES
from closeform.planning.problem.scene import Contacts, Scene
from closeform.planning.requirements.requirement import RequirementCheck
from closeform.zones.shapes import BALL
from closeform.zones.zone import Zone, inner_ball, scaled_norm

MARGIN = 1e-7  # of a craft's duration: contacts keep this far from its ends
SAMPLES = 64  # of a craft's time; a minimum that they miss is found by the certified march
A_TURN, A_DRIFT = 16, 32  # samples per revolution, where that is more; second: with `drift`
EFFORT = 90e6  # sampled positions of failed craft in a search: 5 to 10 s for each planned craft

Trajectories = tuple[Floats, Any]  # arcs of all bodies, and the offset of each body's first arc
PairRow = tuple[tuple[int, int], Floats]  # a pair, and its conflict: start, end, time, ratio


@dataclass(eq=False)
class Effort:
    """Counted work of the search for a passively safe plan, in sampled positions of failed craft.

    The count does not depend on the machine, unlike a time limit, so that neither do plans.  Shares of the
    limit are counted from the beginning of a part of the search.
    """

    limit: float = 0.0
    used: float = 0.0
    begun: float = 0.0  # of it, before the current part

    def allow(self, craft: int, budget: int | None, usual: int) -> None:
        """Set the limit for a number of craft; a budget above the usual one raises it in proportion."""
        self.limit = max(self.limit, EFFORT * craft * max(1.0, (budget or 0) / usual))

    def extend(self, share: float) -> None:
        """Allow a `share` of the limit beyond what has been used."""
        self.limit = max(self.limit, self.used - self.begun + share * self.limit)

    def begin(self) -> None:
        """Begin a part of the search that may use the whole limit, whatever was used before."""
        self.begun = self.used

    def beyond(self, share: float = 1.0) -> bool:
        """Return whether a part has used more than `share` of the limit, which ends it."""
        return self.used - self.begun > share * self.limit


@dataclass(eq=False)
class Closest:
    """Paths that are nearest to being clear of all that a search has checked.

    These are the ones least outside the requirements on single craft, and of these the ones with the largest
    minimum norm.  Planes of zones alone can lead far away, where no craft is near another.
    """

    outside: float = inf  # largest shortfall of requirements on single craft, in reserves
    norm: float = -inf
    trajectories: Trajectories | None = None

    def note(self, norm: float, trajectories: Trajectories, outside: float = 0.0) -> None:
        """Record paths if none before is as near to being clear."""
        outside = max(outside, 1.0)  # less than a reserve is rounding
        if (-self.outside, self.norm) < (-outside, norm):
            self.outside, self.norm, self.trajectories = outside, norm, trajectories


@dataclass(frozen=True, eq=False)
class Problem:
    """N base arcs (the unconstrained optima), M obstacles after them, and the zone of every pair.

    The bodies are numbered from the first craft to the last obstacle.  `pairs` (P, 2), i < j, contain at
    least one craft each, and `kinds` (P,) are the indices of their zones in `zones`.  Paths extend from
    `first` to `last`, with coasts before and after each craft's own arcs.  With a `drift` [s], paths must
    be passively safe for that long after the last arrival; `last` is the end of this horizon.  With
    `requirements`, each craft's path must keep its own.
    """

    orbit: Orbit
    base: Floats  # (N, 30)
    others: Floats
    other_offsets: Any  # (M + 1,)
    pairs: Any
    kinds: Any
    zones: tuple[Zone, ...]
    first: float
    last: float
    drift: float | None = None
    requirements: tuple[tuple[Any, ...], ...] = ()  # of each craft, beyond zones
    effort: Effort = field(default_factory=Effort)

    @classmethod
    def of(
        cls,
        direct: Path,
        obstacles: Path | None,
        groups: Iterable[tuple[Zone, Any]],
        drift: float | None = None,
    ) -> "Problem":
        """Return the problem of N unconstrained optima and a batch of obstacles.

        `groups` holds each zone with its pairs (M, 2).
        """
        base = direct.arcs
        arcs, offsets = np.empty((0, WIDTH)), np.zeros(1, dtype=np.int64)
        if obstacles is not None:
            arcs, offsets = obstacles.arcs, obstacles.offsets
        held = [(zone, pairs[pairs[:, 0] < len(base)]) for zone, pairs in groups]
        none = np.empty((0, 2), dtype=np.int64)
        return cls(
            direct.orbit,
            base,
            arcs,
            offsets,
            np.ascontiguousarray(np.concatenate([none, *(pairs for _, pairs in held)])),
            np.repeat(np.arange(len(held)), [len(pairs) for _, pairs in held]),
            tuple(zone for zone, _ in held),
            float(base[:, START].min()),
            float(base[:, END].max()) + (drift or 0.0),
            drift,
        )

    @property
    def arrival(self) -> float:
        """Time of the last arrival, which is the end of the plan."""
        return float(self.base[:, END].max())

    @property
    def without_drift(self) -> "Problem":
        """The problem without loss of thrust, up to the last arrival."""
        return self if self.drift is None else replace(self, last=self.arrival, drift=None)

    @property
    def count(self) -> int:
        """Number of planned craft."""
        return len(self.base)

    @cached_property
    def round(self) -> bool:
        """True if no zone has edges."""
        return all(zone.shape == BALL for zone in self.zones)

    @cached_property
    def windows(self) -> tuple[Floats, Floats]:
        """Times (P, 2) when a contact can act on each pair, and times when both bodies are present."""
        times = np.empty((self.count + len(self.other_offsets) - 1, 4))  # (start, -end): present, controlled
        own, others = times[: self.count], times[self.count :]
        own[:, 0], own[:, 1] = self.first, -self.last
        own[:, 2:] = self.base[:, [START, END]] * (1.0, -1.0)
        own[:, 2:] += MARGIN * (self.base[:, END] - self.base[:, START])[:, None]
        others[:, 0] = self.others[self.other_offsets[:-1], START]
        others[:, 1] = -self.others[self.other_offsets[1:] - 1, END]
        others[:, 2:] = np.inf
        one, other = times[self.pairs[:, 0]], times[self.pairs[:, 1]]
        present = np.maximum(one[:, :2], other[:, :2])
        inner = np.maximum(np.minimum(one[:, 2:], other[:, 2:]), present)
        return inner * (1.0, -1.0), present * (1.0, -1.0)

    @cached_property
    def beside(self) -> ChiefPaths | None:
        """The craft's paths about any chief as polynomials; None for Hill's equations and deep space."""
        if not isinstance(self.orbit, ChiefOrbit):
            return None
        return ChiefPaths(self.orbit, self.base, self.first, self.last)

    def rows(self, trajectories: Trajectories) -> Trajectories:
        """Return paths as the rows that kernels read: arcs, or pieces about any chief."""
        return trajectories if self.beside is None else self.beside.pieces(*trajectories)

    def _own_rows(self, trajectories: Trajectories) -> Trajectories:
        """Return `rows` of the craft alone, those of the unconstrained paths without work."""
        arcs, offsets = trajectories[0], trajectories[1][: self.count + 1]
        if self.beside is None:
            return arcs, offsets
        if trajectories is self.direct:
            return self.seen.direct, self.seen.direct_offsets
        return self.beside.pieces(arcs[: offsets[-1]], offsets)

    @cached_property
    def direct(self) -> Trajectories:
        """The unconstrained optima, with the coasts before and after them, and the obstacles."""
        if self.beside is not None:
            return self.with_obstacles(*self.beside.direct)
        return self.propagate(self.bare, Contacts.none())

    @property
    def obstacles(self) -> Path:
        """The obstacles' paths, of shape (M,)."""
        return self.bodies((self.others, self.other_offsets))

    def bodies(self, trajectories: Trajectories) -> Path:
        """Return the paths of all bodies, of shape (N + M,)."""
        return path_of(self.orbit, *trajectories, (len(trajectories[1]) - 1,))

    def with_obstacles(self, arcs: Floats, offsets: Any) -> Trajectories:
        """Return the craft's arcs followed by the obstacles'."""
        return np.concatenate([arcs, self.others]), np.concatenate(
            [offsets, offsets[-1] + self.other_offsets[1:]]
        )

    @cached_property
    def bare(self) -> Scene:
        """Kernel arguments of this problem, without the unconstrained paths."""
        inverses, beside = np.empty((self.count, 6, 6)), self.beside
        if beside is None:
            invert_responses(self.base, inverses)
        faces = [zone.faces for zone in self.zones]
        windows, presence = self.windows
        scene = Scene(
            np.ascontiguousarray(self.base),
            inverses,
            np.empty((0, WIDTH)),
            np.zeros(1, dtype=np.int64),
            *self.rows((np.ascontiguousarray(self.others), self.other_offsets)),
            self.pairs,
            self.kinds,
            windows,
            presence,
            np.array([zone.shape for zone in self.zones], dtype=np.int64),
            np.array([zone.matrix for zone in self.zones]).reshape(-1, 3, 3),
            np.concatenate([np.empty((0, 3)), *faces]),
            np.cumsum([0, *map(len, faces)]),
            np.array([zone.radius for zone in self.zones]),
            np.full(len(self.zones), np.inf),
            np.ones(len(self.zones)),
            np.empty(0),
            np.empty((0, 0, 6)),
            np.array([self.first, self.last]),
            np.empty(0),
            np.empty((0, PLACES)),
            np.empty((0, PATHS, 0)),
            np.zeros(1, dtype=np.int64),
            np.empty((0, BASE)),
            *windows_of(self.orbit, self.first, self.last),
        )
        if beside is None:
            return scene
        return scene._replace(
            clock=beside.clock, spans=beside.spans, units=beside.units, unit_offsets=beside.offsets
        )

    @cached_property
    def seen(self) -> Scene:
        """Kernel arguments of this problem with the zones at their own size."""
        rows, offsets = self.rows(self.direct)
        own = np.ascontiguousarray(offsets[: self.count + 1])
        direct = np.ascontiguousarray(rows[: own[-1]])
        return self.sampled(self.bare._replace(direct=direct, direct_offsets=own), self.samples())

    def sampled(self, scene: Scene, times: Floats) -> Scene:
        """Return a scene with the states of all bodies at `times`."""
        rows, offsets = self.rows(self.direct)
        states = np.empty((len(offsets) - 1, len(times), 6))
        bases = np.full((len(times) if self.beside is not None else 0, BASE), np.nan)
        sample_bodies(scene.clock, rows, offsets, times, bases, states)
        return scene._replace(times=times, states=states, bases=bases)

    def samples(self) -> Floats:
        """Return sample times that cover every craft's own time and every revolution of the orbit."""
        spans = sorted({*map(tuple, self.base[:, [START, END]].tolist()), (self.first, self.last)})
        a_turn = (A_TURN if self.drift is None else A_DRIFT) * self.orbit._rate / (2.0 * pi)
        grids = [
            np.linspace(start, end, int(max(SAMPLES / sqrt(len(spans)), a_turn * (end - start))) + 1)
            for start, end in spans
        ]
        return np.unique(np.concatenate(grids)) if len(grids) > 1 else grids[0]

    def trajectories(self, contacts: Contacts) -> Trajectories:
        """Return the paths of all bodies under the contacts' multipliers."""
        return self.propagate(self.bare, contacts) if contacts.number else self.direct

    def propagate(self, scene: Scene, contacts: Contacts) -> Trajectories:
        """Return the paths of all bodies in a scene."""
        return self.with_obstacles(*self.deflected(scene, contacts))

    def deflected(self, scene: Scene, contacts: Contacts) -> tuple[Floats, Any]:
        """Return the craft's arcs under the contacts' multipliers in a scene, and their offsets."""
        if self.beside is not None:
            return self.beside.propagate(scene, contacts)
        arcs, offsets = room_for(scene, contacts)
        return arcs[: deflected_arcs(scene, contacts, arcs, offsets)], offsets

    def planned(self, contacts: Contacts) -> Trajectories:
        """Return the paths under the contacts' multipliers, only up to the last arrival."""
        if self.drift is None:
            return self.trajectories(contacts)
        return self.with_obstacles(*self.arrived(*self.deflected(self.bare, contacts)))

    def arrived(self, arcs: Floats, offsets: Any) -> tuple[Floats, Any]:
        """Return the craft's arcs up to the last arrival, and their offsets."""
        early = arcs[:, START] < self.arrival
        left = arcs[early]
        left[:, END] = np.minimum(left[:, END], self.arrival)
        return left, np.concatenate([[0], np.cumsum(early)])[offsets]

    def motions(self, trajectories: Trajectories, contacts: Contacts) -> Floats:
        """Return relative position, velocity and acceleration (K, 3, 3) at contacts, in zone coordinates."""
        return self._look(trajectories, contacts, np.empty((0, 0)))

    def kernel(self, contacts: Contacts) -> Floats:
        """Return the response (3K, 3K) of positions to unit forces at contacts, in zone coordinates.

        Theory (12).
        """
        return self.unconstrained(contacts)[1]

    def unconstrained(self, contacts: Contacts) -> tuple[Floats, Floats]:
        """Return `motions` of the unconstrained optima at contacts, and the `kernel` there."""
        gram = np.empty((3 * contacts.number, 3 * contacts.number))
        return self._look(self.direct, contacts, gram), gram

    def _look(self, trajectories: Trajectories, contacts: Contacts, gram: Floats) -> Floats:
        motions = np.zeros((contacts.number, 3, 3))
        look_at(self.bare, *self._own_rows(trajectories), contacts, motions, gram)
        return motions

    def normals(self, trajectories: Trajectories, contacts: Contacts, least: float) -> Floats:
        """Return the normals (K, 3) at the pairs' positions; unchanged where the norm is at most `least`."""
        normals = contacts.normals.copy()
        turn_normals(self.bare, *self._own_rows(trajectories), contacts, least, normals)
        return normals

    @property
    def sigmas(self) -> float:
        """Number of standard deviations kept clear: 0, because all states are known exactly."""
        return 0.0

    def with_errors(self, contacts: Contacts) -> Any:
        """Return the mask (K,) of contacts at which standard deviations are kept clear: none."""
        return np.zeros(contacts.number, dtype=bool)

    def depth(self, ratio: float) -> str:
        """Return the clearance ratio at an end as text."""
        return f"{ratio:.2f} x zone"

    def deviations(self, trajectories: Trajectories, contacts: Contacts, directions: Floats) -> Floats:
        """Return standard deviations (K,) [m] of pairs at contacts, along unit directions (K, 3)."""
        return np.zeros(len(directions))

    @property
    def relaxed(self) -> "Problem":
        """The problem with only those errors that no plan changes: its keep-out regions are in this one's."""
        return self

    def insides(self, contacts: Contacts) -> Floats:
        """Return ellipsoids |W q| <= 1 inside the keep-out regions at contacts, as W (K, 3, 3)."""
        each = [inner_ball(self.zones[kind]) for kind in self.kinds[contacts.which]]
        return np.array(each).reshape(-1, 3, 3)

    def with_path(self, *paths: Path) -> Trajectories:
        """Return other paths of the craft, one for each, followed by the obstacles."""
        both = stack(paths)
        return self.with_obstacles(both.arcs, both.offsets)

    @cached_property
    def least_energy(self) -> float:
        """Control energy [m^2/s^3] of the unconstrained optima."""
        return self.energy(self.direct)

    def energy(self, trajectories: Trajectories) -> float:
        """Return the control energy [m^2/s^3] of all craft together."""
        return float(self.path(trajectories)._total(ENERGY).sum())

    def whole(self, trajectories: Trajectories) -> Trajectories:
        """Return paths of all bodies with those of the craft extended to the first and the last time."""
        planned = self.path(trajectories)
        return self.with_path(*(extended(planned[k], self.first, self.last) for k in range(self.count)))

    def requirements_among(self, trajectories: Trajectories) -> list[list[Any]]:
        """Return the requirements of each craft, among the paths of all bodies."""
        bodies = self.bodies(trajectories)
        return [[one._among(bodies, i) for one in own] for i, own in enumerate(self.requirements)]

    def requirement_checks(self, trajectories: Trajectories) -> list[RequirementCheck]:
        """Return the check of each requirement on a single craft; they are proven only if none is broken."""
        paths = self.path(trajectories)
        each = [(i, one) for i, own in enumerate(self.requirements_among(trajectories)) for one in own]
        found = [
            RequirementCheck(i, one, worst := one._worst(paths[i]), worst.margin >= 0.0) for i, one in each
        ]
        if all(one.kept for one in found):
            return [one._replace(kept=one.requirement.holds(paths[one.craft])) for one in found]
        return found

    def path(self, trajectories: Trajectories) -> Path:
        """Return the craft's paths, of shape (N,)."""
        arcs, offsets = trajectories
        own = offsets[: self.count + 1]
        return path_of(self.orbit, np.ascontiguousarray(arcs[: own[-1]]), own, (self.count,))

    @cached_property
    def index(self) -> dict[tuple[int, int], int]:
        """Index of each pair in `pairs`."""
        return {(i, j): k for k, (i, j) in enumerate(self.pairs.tolist())}

    def at(self, pair: tuple[int, int], time: float) -> Contacts:
        """Return one contact of a pair, without normal and multiplier."""
        return Contacts.at(np.array([self.index[pair]]), np.array([time]))

    def met(self, conflicts: Sequence[PairRow]) -> Contacts:
        """Return the closest approaches of conflicts as contacts, without normals and multipliers."""
        which = np.array([self.index[pair] for pair, _ in conflicts], dtype=np.int64)
        return Contacts.at(which, np.array([row[2] for _, row in conflicts], dtype=float))

    def touched(self, contacts: Sequence[Contact]) -> Contacts:
        """Return the contacts of a plan in the planner's form, without normals and multipliers."""
        pairs = [(min(one.first, one.second), max(one.first, one.second)) for one in contacts]
        which = np.array([self.index[pair] for pair in pairs], dtype=np.int64)
        drifts = np.zeros((len(contacts), 2))
        for k, one in enumerate(contacts):
            if one.failed_at == one.failed_at:
                drifts[k, int(one.first > one.second)] = one.time - one.failed_at
        return Contacts.at(which, np.array([one.time for one in contacts], dtype=float), drifts)

    def ratios(self, trajectories: Trajectories, which: Any, times: Floats) -> Floats:
        """Return the clearance ratios (K,) of pairs, each at one time."""
        places = self.motions(trajectories, Contacts.at(which, times))[:, 0]
        each = [scaled_norm(self.zones[kind], q) for kind, q in zip(self.kinds[which], places, strict=True)]
        return np.array(each)

    def ratio(self, trajectories: Trajectories, pair: tuple[int, int], time: float) -> float:
        """Return the clearance ratio of a pair at one time."""
        return float(self.ratios(trajectories, np.array([self.index[pair]]), np.array([time]))[0])

    @cached_property
    def pairs_by_kind(self) -> list[Any]:
        """The pairs (2, P) of each zone."""
        return [np.ascontiguousarray(self.pairs[self.kinds == kind].T) for kind in range(len(self.zones))]

    def direct_conflicts(self, factor: float) -> list[PairRow]:
        """Return the conflicts of the unconstrained optima with zones `factor` times as large (cached)."""
        if factor not in self._of_direct:
            self._of_direct[factor] = self.conflicts(self.direct, factor)
        return self._of_direct[factor]

    @cached_property
    def _of_direct(self) -> dict[float, list[PairRow]]:
        return {}

    def conflicts(self, trajectories: Trajectories, factor: float = 1.0) -> list[PairRow]:
        """Return every conflict with zones enlarged by `factor`: pair and (start, end, time, ratio).

        The result is certified, see `find_conflicts`.
        """
        found, bodies = [], self.bodies(trajectories)
        for zone, pairs in zip(self.zones, self.pairs_by_kind, strict=True):
            one = zone if factor == 1.0 else Zone(zone.shape, zone.matrix / factor, zone.faces)
            tracks = tracks_of_all(bodies, (one,), pairs.shape[1])[one]
            first, second = pairs
            table = conflicts_of(bodies, bodies, one, first, second, tracks)
            found += [((int(i), int(j)), row) for (i, j), row in zip(*table, strict=True)]
        return found


def deepest(conflicts: Iterable[PairRow]) -> PairRow:
    """Return the conflict with the smallest clearance ratio."""
    return min(conflicts, key=lambda one: one[1][3])


def is_optimum(path: Path) -> bool:
    """Return whether one craft's path is the unconstrained optimum: one arc of natural motion and thrust."""
    arc = path.arcs[0]
    other = arc[IMPULSE : IMPULSE + 3].any() or arc[PUSH:].any() or path.orbit._interpolates(path.arcs).any()
    return len(path.arcs) == 1 and not other


def transfer_of(path: Path, factor: float = 1.0) -> Path:
    """Return the unconstrained optimum between the end states of a path, over `factor` times its duration."""
    if factor == 1.0 and is_optimum(path):
        return path
    return path.orbit.transfer(*ends_of(path), factor * (path.end - path.start), path.start)
