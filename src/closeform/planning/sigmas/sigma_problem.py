"""Planning problem with errors: k sigmas of each pair are to stay out of its zone.

The keep-out region is the sum of the zone and the ellipsoid of k sigmas, which moves and grows.  Its norm
is a gauge with gradient a / (1 + k |l_a|).  These gradients are the normals of contacts, whose planes are

    a . (q + dr) >= 1 + k |l_a(t)|                                                   # theory (56)

and every method for planes a . q >= 1 applies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from closeform.arrays import Floats, size
from closeform.motion.arc import END, START
from closeform.motion.path import Path
from closeform.planning.problem.problem import PairRow, Problem, Trajectories
from closeform.planning.problem.scene import Contacts
from closeform.uncertainty.covariance_propagation import covariances, propagate_errors
from closeform.uncertainty.error_columns import columns_of
from closeform.uncertainty.errors import Uncertainty, one_for_each
from closeform.uncertainty.sigmas.ellipsoid_planes import faced, gauges
from closeform.zones.minkowski_sums import outer_sum
from closeform.zones.solids import Ellipsoid
from closeform.zones.zone import Zone, inner_ball

ROUNDING = 1e-16  # of a covariance: regularises zero uncertainty, where the planes are not unique


@dataclass(frozen=True, eq=False)
class Margin:
    """Number of sigmas of the errors of craft and, after them, obstacles (None: known exactly)."""

    errors: tuple[Uncertainty | None, ...]
    sigmas: float

    @classmethod
    def among(cls, count: int, obstacles: int, errors: Any, sigmas: Any) -> Margin | None:
        """Return the margin of craft and obstacles from the errors of craft, or of all; None without errors.

        Raises ValueError for errors of another type or number, or sigmas that are not a finite number.
        """
        bodies = count + obstacles
        craft_only = isinstance(errors, list | tuple) and len(errors) != bodies
        given = one_for_each("errors", errors, count if craft_only else bodies)
        many = size("sigmas", sigmas)
        return cls((*given, *[None] * (bodies - len(given))), many) if many and any(given) else None

    def fixed(self, count: int) -> tuple[Uncertainty | None, ...]:
        """Return the errors that no plan of the first `count` bodies changes: states and process noise."""
        own = [one and Uncertainty(noise=one.noise)._with_root(one._root) for one in self.errors[:count]]
        return (*own, *self.errors[count:])

    def problem(self, plain: Problem) -> Problem:
        """Return the problem of the same craft with this margin."""
        return SigmaProblem(**fields_of(plain), kept=self)


def fields_of(problem: Problem) -> dict[str, Any]:
    """Return the fields of a problem without errors, by name."""
    return {one.name: getattr(problem, one.name) for one in fields(Problem)}


@dataclass(frozen=True, eq=False, kw_only=True)
class SigmaProblem(Problem):
    """Planning problem with a margin of sigmas."""

    kept: Margin

    @property
    def sigmas(self) -> float:
        """Number of sigmas kept clear."""
        return self.kept.sigmas

    def depth(self, ratio: float) -> str:
        """Return a description of the clearance ratio at an end, and of the sigmas that all ends allow."""
        times = np.full((self.count + len(self.other_offsets) - 1, 2), -inf)
        times[: self.count] = self.base[:, [START, END]] * (-1.0, 1.0)
        pairs, present = self.pairs, self.windows[1]
        ends = np.maximum(times[pairs[:, 0]], times[pairs[:, 1]]) * (-1.0, 1.0)
        which, side = np.nonzero((present[:, :1] <= ends) & (ends <= present[:, 1:]))
        found = self.gauges(self.direct, Contacts.at(which, ends[which, side]), -1.0)[0]
        least = float(found.min())
        return f"{ratio:.2f} x the zone enlarged by {self.sigmas:g} sigmas (ends allow {least:.3g})"

    def conflicts(self, trajectories: Trajectories, factor: float = 1.0) -> list[PairRow]:
        """Return conflicts with zones and sigmas enlarged by `factor`; the ratio is the gauge.

        After the last arrival, they are conflicts with the zones alone.
        """
        zones = [Zone(zone.shape, zone.matrix / factor, zone.faces) for zone in self.zones]
        bodies = self.bodies(trajectories if self.drift is None else until(trajectories, self.arrival))
        search = Uncertainty._search_of(bodies, self.kept.errors, zones, factor * self.sigmas)
        found = []
        for zone, pairs in zip(zones, self.pairs_by_kind, strict=True):
            for (i, j), row in zip(*search(zone, *pairs), strict=True):
                found.append(((int(i), int(j)), row))
        if self.drift is None:
            return found
        return found + [one for one in super().conflicts(trajectories, factor) if one[1][2] > self.arrival]

    def with_errors(self, contacts: Contacts) -> Any:
        """Return the mask (K,) of contacts at which the sigmas count: before a loss of thrust and arrival."""
        return ~contacts.drifts.any(axis=1) & (contacts.times <= self.arrival)

    def spread(self, paths: Path, errors: Sequence[Uncertainty | None]) -> Any:
        """Return errors of all bodies along their paths: propagated, or as columns about any chief."""
        if self.beside is None:
            return propagate_errors(paths, errors)
        return [one and columns_of(paths[k], one) for k, one in enumerate(errors)]

    def covariances(self, trajectories: Trajectories, contacts: Contacts) -> Floats:
        """Return relative covariances (K, 3, 3) [m^2] of positions at contacts."""
        spread = self.spread(self.bodies(trajectories), self.kept.errors) if self.moves else self.fixed
        return self.relative(spread, contacts)

    def relative(self, spread: Any, contacts: Contacts) -> Floats:
        """Return relative covariances (K, 3, 3) [m^2] at contacts, 0 where errors do not count."""
        total, counts = np.zeros((contacts.number, 3, 3)), self.with_errors(contacts)
        pairs = np.where(counts[:, None], self.pairs[contacts.which], -1)
        for body in np.unique(pairs[counts]):
            if self.kept.errors[body] is None:
                continue
            those = np.flatnonzero((pairs == body).any(axis=1))
            times = np.ascontiguousarray(contacts.times[those])
            if self.beside is not None:
                columns = spread[body]._evaluate_rows(times[None])[:, :, :3]
                total[those] += np.einsum("cki,ckj->kij", columns, columns)
                continue
            arcs, offsets, rows, execution = spread
            own, out = slice(offsets[body], offsets[body + 1]), np.empty((len(those), 6, 6))
            given = arcs[own], self.orbit.mean_motion, rows[own], execution[body : body + 1]
            covariances(*given, times, out)
            total[those] += out[:, :3, :3]
        return total

    @cached_property
    def moves(self) -> bool:
        """True if errors depend on the plan."""
        own = self.kept.errors[: self.count]
        return any(one is not None and (one.magnitude or one.pointing or any(one.impulse)) for one in own)

    @cached_property
    def fixed(self) -> Any:
        """The part of the errors that is the same for all plans, as `spread`."""
        return self.spread(self.bodies(self.direct), self.kept.fixed(self.count))

    def gauges(self, trajectories: Trajectories, contacts: Contacts, sigmas: float) -> tuple[Floats, Floats]:
        """Return the gauges (K,) of pairs at contacts, and gradients; negative `sigmas`: the clear sigmas."""
        places = self.motions(trajectories, contacts)[:, 0]
        spread = self.covariances(trajectories, contacts)
        sizes, planes = np.empty(contacts.number), np.empty((contacts.number, 4))
        kinds = self.kinds[contacts.which]
        for kind in np.unique(kinds):
            shape, matrix, faces = faced(self.zones[kind])
            those = np.flatnonzero(kinds == kind)
            squares = matrix @ spread[those] @ matrix.T
            squares += ROUNDING * np.trace(squares, axis1=1, axis2=2)[:, None, None] * np.eye(3)
            size, plane = np.empty(len(those)), np.empty((len(those), 4))
            gauges(shape, faces, places[those], np.ascontiguousarray(squares), sigmas, size, plane)
            sizes[those], planes[those] = size, plane
        return sizes, planes[:, :3]

    def ratios(self, trajectories: Trajectories, which: Any, times: Floats) -> Floats:
        """Return the gauges (K,) of pairs, each at one time."""
        return self.gauges(trajectories, Contacts.at(which, times), self.sigmas)[0]

    def normals(self, trajectories: Trajectories, contacts: Contacts, least: float) -> Floats:
        """Return the normals of contacts at their pairs, divided by the extents of zone and sigmas."""
        counts, normals = self.with_errors(contacts), contacts.normals.copy()
        sizes, planes = self.gauges(trajectories, contacts.some(counts), self.sigmas)
        turned = (sizes > least) & planes.any(axis=1)
        normals[np.flatnonzero(counts)[turned]] = planes[turned]
        if not counts.all():
            normals[~counts] = super().normals(trajectories, contacts.some(~counts), least)
        return normals

    def sides(self, trajectories: Trajectories, contacts: Contacts, directions: Floats) -> Contacts:
        """Return contacts with planes perpendicular to directions (K, 3) in the rotating frame."""
        reach = self.deviations(trajectories, contacts, directions) * self.sigmas
        normals = np.empty((contacts.number, 3))
        for k, (kind, way) in enumerate(zip(self.kinds[contacts.which], directions, strict=True)):
            zone = self.zones[kind]
            normals[k] = np.linalg.solve(zone.matrix.T, way) / (zone.support(way) + reach[k])
        return contacts._replace(normals=normals)

    def deviations(self, trajectories: Trajectories, contacts: Contacts, directions: Floats) -> Floats:
        """Return standard deviations (K,) [m] of pairs along unit directions (K, 3)."""
        spread = self.covariances(trajectories, contacts)
        return np.asarray(np.sqrt(np.einsum("ki,kij,kj->k", directions, spread, directions)))

    @cached_property
    def relaxed(self) -> Problem:
        """The problem with only those errors that no plan changes: its keep-out regions are in this one's."""
        kept = Margin(self.kept.fixed(self.count), self.sigmas)
        return replace(self, kept=kept) if self.moves else self

    def insides(self, contacts: Contacts) -> Floats:
        """Return ellipsoids |W q| <= 1 in sums of zone and sigmas with the same extents along the normals.

        They are W (K, 3, 3), and include only errors that all plans have: others may be smaller in another.
        """
        spread, out = self.relative(self.fixed, contacts), np.empty((contacts.number, 3, 3))
        for k, (kind, normal) in enumerate(zip(self.kinds[contacts.which], contacts.normals, strict=True)):
            zone = self.zones[kind]
            values, vectors = np.linalg.eigh(zone.matrix @ spread[k] @ zone.matrix.T)
            axes = self.sigmas * vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
            turn = rotation_between(axes.T @ normal, normal)
            out[k] = np.linalg.inv(np.linalg.inv(inner_ball(zone)) + axes @ turn)
        return out

    def enlarged(self, contacts: Contacts) -> Problem:
        """Return an ordinary problem whose zones include the sigmas of each pair at its contact's time."""
        spread, zones = self.covariances(self.direct, contacts), []
        for k, kind in enumerate(self.kinds[contacts.which]):
            zone, size = self.zones[kind], np.trace(spread[k])
            if size > 0.0:
                ellipsoid = Ellipsoid.from_covariance(spread[k] + 1e-9 * size * np.eye(3), self.sigmas)
                zone = outer_sum(zone, ellipsoid)
            zones.append(zone)
        pairs = np.ascontiguousarray(self.pairs[contacts.which])
        other = {"pairs": pairs, "kinds": np.arange(len(zones)), "zones": tuple(zones)}
        return Problem(**{**fields_of(self), **other})


def until(trajectories: Trajectories, end: float) -> Trajectories:
    """Return the paths of bodies up to a time; one that begins later keeps its first arc."""
    arcs, offsets = trajectories
    kept = arcs[:, START] < end
    cut = arcs[kept | np.isin(np.arange(len(arcs)), offsets[:-1])]
    cut[:, END] = np.where(cut[:, START] < end, np.minimum(cut[:, END], end), cut[:, END])
    kept[offsets[:-1]] = True
    return cut, np.concatenate([[0], np.cumsum(kept)])[offsets]


def rotation_between(one: Floats, other: Floats) -> Floats:
    """Return the rotation U (3, 3) with U' one parallel to `other`."""
    sizes = np.linalg.norm(one), np.linalg.norm(other)
    if not min(sizes) > 0.0:
        return np.eye(3)
    u, v = one / sizes[0], other / sizes[1]
    # the product of two reflections, u to v
    across = u + v
    if not across @ across > 1e-12:
        return np.eye(3)
    first = np.eye(3) - 2.0 * np.outer(u, u)
    second = np.eye(3) - 2.0 * np.outer(across, across) / (across @ across)
    return np.asarray((second @ first).T)
