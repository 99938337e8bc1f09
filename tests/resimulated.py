"""Independent check of formation plans: an integrator of Hill's equations with only the plan's thrust.

`faults` lists what is wrong with a plan.  Motion is integrated from the requested states, energies are
quadratures, minimum ratios come from dense samples whose local minima are refined, and unconstrained optima
from exponentials of Hill's matrix.  From the plan only its thrust and the numbers that it states are used.
"""

from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import linear_sum_assignment

import closeform as cf
from bridge import hill
from closeform.zones.shapes import CUBE

MILLIMETRE = 1e-3  # at the end; a velocity may be off by as much over the craft's duration
RATIO = 1e-6  # of the zone, and of a least ratio; planned is 1e-9 outside, so this is the integrator's
ENERGY, DELTA_V = 1e-8, 1e-5  # relative; the integrand of delta-v has a kink where thrust vanishes
SAMPLES = 1500  # at least, over the whole plan
PLANNED = 1.0, 1.001, 1.02  # zones; the larger ones where no plan was found any closer
TOUCHING = 1e-4  # of an ellipsoid; weak touches settle last
ROUNDED = 0.03  # of a box, whose edges are rounded first and then sharpened
STRIDE = 0.2  # of the smallest zone, at most travelled between two samples
LOWS = 30  # of a pair, at most; where two keep their distance every sample is one
NODES = np.polynomial.legendre.leggauss(24)
PANELS = 12  # of quadrature between two jumps of the thrust's rate


@dataclass
class Flight:
    """One simulated craft: dense solutions between the times at which the rate of its thrust jumps."""

    joints: np.ndarray  # (K + 1,)
    legs: list  # K functions of times

    def state(self, times):
        """States (..., 6) at `times` (...)."""
        flat = np.ravel(times)
        leg = np.clip(np.searchsorted(self.joints, flat, side="right") - 1, 0, len(self.legs) - 1)
        out = np.empty((len(flat), 6))
        for k in np.unique(leg):
            out[leg == k] = self.legs[k](flat[leg == k]).T
        return out.reshape(*np.shape(times), 6)


def thrust_of(path, first, last):
    """The path's thrust between two joints, also at the joints themselves, as (..., 3) of times."""
    if last <= path.start or first >= path.end:
        return lambda t: np.zeros((*np.shape(t), 3))
    final = np.nextafter(last, first)  # at a joint a path has the thrust after it
    return lambda t: path.thrust(np.clip(t, first, final))


def fly(orbit, path, state, time):
    """Forward and back in time from `state` (6,) at `time`, over all of `path`."""
    system = hill(orbit.mean_motion)
    joints = np.unique(np.concatenate([path.arcs[:, 0], path.arcs[:, 1], [time]]))
    size = np.abs(path.state(np.linspace(path.start, path.end, 50))).max(axis=0)
    length = max(size[:3].max(), 1e-3)
    tolerance = 1e-13 * np.repeat([length, max(size[3:].max(), length / (path.end - path.start))], 3)
    legs = {}
    for side in (joints[joints >= time], joints[joints <= time][::-1]):
        here = state
        for first, last in pairwise(side):
            thrust = thrust_of(path, min(first, last), max(first, last))

            def rate(t, s, thrust=thrust):
                out = system @ s
                out[3:] += thrust(t)
                return out

            leg = solve_ivp(
                rate, (first, last), here, method="DOP853", rtol=1e-12, atol=tolerance, dense_output=True
            )
            legs[min(first, last)], here = leg.sol, leg.y[:, -1]
    return Flight(joints, [legs[joint] for joint in joints[:-1]])


def efforts(path):
    """Energy, delta-v and peak thrust of one craft's thrust, by Gauss-Legendre panels between joints."""
    energy = delta_v = peak = 0.0
    for first, last in path.arcs[:, :2]:
        thrust = thrust_of(path, first, last)
        edges = np.linspace(first, last, PANELS + 1)
        half = 0.5 * np.diff(edges)[:, None]
        size = np.linalg.norm(thrust(edges[:-1, None] + half * (1 + NODES[0])), axis=-1)
        energy += 0.5 * (half * NODES[1] * size**2).sum()
        delta_v += (half * NODES[1] * size).sum()
        peak = max(peak, size.max(), *np.linalg.norm(thrust(edges), axis=-1))
    return energy, delta_v, peak


def optimum(n, initial, final, duration):
    """Energy of the unconstrained optimum between two states (6,).                # theory (7)"""
    unit = np.repeat([1.0, duration], 3)  # in units of the duration, good for any n T
    system = hill(n * duration)
    push = np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    grown = expm(np.block([[system, push], [np.zeros((6, 6)), -system.T]]))
    gap = unit * final - grown[:6, :6] @ (unit * initial)
    return 0.5 * gap @ np.linalg.solve(grown[:6, 6:] @ grown[:6, :6].T, gap) / duration**3


DIRECTIONS = np.random.default_rng(0).normal(size=(500, 3))


def larger(one, other):
    """Of two zones the one that holds the other, by its norm along many directions."""
    if one is None or other is None or one is other:
        return one or other
    if (one.norm(DIRECTIONS) <= other.norm(DIRECTIONS) * (1 + 1e-12)).all():
        return one
    assert (other.norm(DIRECTIONS) <= one.norm(DIRECTIONS) * (1 + 1e-12)).all(), (
        "neither zone contains the other"
    )
    return other


class Pairs:
    """All pairs of craft, and of craft and obstacles, over the time of a plan; `zones` (P,) are theirs."""

    def __init__(self, flights, obstacles, zones, start, end):
        self.flights, self.obstacles = flights, obstacles
        self.start, self.end = start, end
        pairs = combinations(range(len(zones)), 2)
        between = {(i, j): larger(zones[i], zones[j]) for i, j in pairs if i < len(flights)}
        self.pairs = np.array([pair for pair, zone in between.items() if zone], dtype=int).reshape(-1, 2)
        self.zones = [between[tuple(pair)] for pair in self.pairs]
        self.matrices = np.array([zone.matrix for zone in self.zones]).reshape(-1, 3, 3)
        self.boxes = np.array([zone.shape == CUBE for zone in self.zones], dtype=bool)

    def places(self, body, times):
        """Positions (..., 3), far away where an obstacle's path has not begun or is over."""
        if body < len(self.flights):
            return self.flights[body].state(times)[..., :3]
        path = self.obstacles[body - len(self.flights)]
        there = (times >= path.start) & (times <= path.end)
        return np.where(there[..., None], path.position(np.clip(times, path.start, path.end)), 1e9)

    def norms(self, which, gaps):
        """Of the gaps (P, T, 3) of pairs `which` (P,)."""
        scaled = np.abs(gaps @ np.swapaxes(self.matrices[which], 1, 2))
        return np.where(
            self.boxes[which, None], scaled.max(axis=-1), np.sqrt(np.einsum("pti,pti->pt", scaled, scaled))
        )

    def zone_of(self, first, second):
        return self.zones[np.flatnonzero((self.pairs == sorted((first, second))).all(axis=1))[0]]

    def stride(self):
        """Times between which no two craft move far in terms of the smallest zone."""
        coarse = np.linspace(self.start, self.end, 60)
        speed = max(
            np.linalg.norm(flight.state(coarse)[:, 3:], axis=1).max() for flight in self.flights
        ) + max(
            [
                np.linalg.norm(path.velocity(np.linspace(path.start, path.end, 60)), axis=1).max()
                for path in self.obstacles
            ],
            default=0.0,
        )
        smallest = min(1 / np.linalg.norm(matrix, 2) for matrix in self.matrices)
        count = int((self.end - self.start) * 2 * speed / (STRIDE * smallest))
        return np.linspace(self.start, self.end, max(SAMPLES, min(count, 20 * SAMPLES)))

    def least(self):
        """The least ratio (P,) of every pair."""
        times = self.stride()
        edges = [t for path in self.obstacles for t in (path.start, path.end) if self.start < t < self.end]
        times = np.union1d(times, edges)
        places = [self.places(body, times) for body in range(len(self.flights) + len(self.obstacles))]
        lowest = np.full(len(self.pairs), np.inf)
        which, when = [], []
        for first in range(len(self.flights)):
            rows = np.flatnonzero(self.pairs[:, 0] == first)
            if not len(rows):
                continue
            gaps = places[first] - np.stack([places[other] for other in self.pairs[rows, 1]])
            norms = self.norms(rows, gaps)
            lowest[rows] = norms.min(axis=1)
            jump = np.abs(np.diff(norms, axis=1))
            reach = lowest[rows] + np.where(jump < 1e3, jump, 0).max(axis=1)
            padded = np.pad(norms, ((0, 0), (1, 1)), constant_values=np.inf)
            low = (norms <= padded[:, :-2]) & (norms <= padded[:, 2:])
            norms[~low | (norms > reach[:, None])] = np.inf
            lows = np.argsort(norms, axis=1)[:, :LOWS]
            row, k = np.nonzero(np.isfinite(np.take_along_axis(norms, lows, axis=1)))
            which.append(rows[row])
            when.append(times[lows[row, k]])
        return self.refined(lowest, np.concatenate(which), np.concatenate(when), np.diff(times).max())

    def refined(self, lowest, which, when, width):
        pairs = self.pairs[which]
        for _ in range(7):
            times = np.clip(when[:, None] + width * np.linspace(-1, 1, 21), self.start, self.end)
            sides = np.empty((2, *times.shape, 3))
            for side in (0, 1):
                for body in np.unique(pairs[:, side]):
                    own = pairs[:, side] == body
                    sides[side, own] = self.places(body, times[own])
            norms = self.norms(which, sides[0] - sides[1])
            best = norms.argmin(axis=1)
            when = np.take_along_axis(times, best[:, None], axis=1)[:, 0]
            np.minimum.at(lowest, which, norms.min(axis=1))
            width /= 9
        return lowest


def zones_of(zone, craft, obstacles):
    """One zone or None for each craft and obstacle."""
    if isinstance(zone, cf.Zone):
        return [zone] * (craft + obstacles)
    return [*zone, *[None] * (craft + obstacles - len(zone))]


def obstacles_of(obstacles):
    if not isinstance(obstacles, cf.Path):
        return list(obstacles)
    return [obstacles[k] for k in range(len(obstacles))] if obstacles.shape else [obstacles]


def claimed(plan, pairs):
    """The least ratios (P,) by the package's own search."""
    bodies = cf.stack([*(plan.paths[k] for k in range(len(plan.paths))), *pairs.obstacles])
    ratios = np.empty(len(pairs.pairs))
    for zone in {id(zone): zone for zone in pairs.zones}.values():
        own = np.array([zone is one for one in pairs.zones])
        first, second = pairs.pairs[own].T
        ratios[own] = cf.closest_approach(bodies[first], bodies[second], zone).ratio
    return ratios


def faults(
    plan,
    orbit,
    initial,
    final,
    duration,
    zone,
    *,
    assign=False,
    start=0.0,
    obstacles=(),
    max_acceleration=None,
    method="joint",
    order=None,
    if_blocked=(),
):
    """Return the faults of a plan against its requirements; an empty list if there are none."""
    del if_blocked  # the measures of the plan list what was done
    if not plan.ok:
        return [f"{plan.status}: {plan.reason}"]
    initial, final = np.asarray(initial, dtype=float), np.asarray(final, dtype=float)
    craft = len(initial)
    said = _frame_faults(plan, craft, len(final), assign, start, duration)
    if said:
        return said
    asked = np.broadcast_to(np.asarray(start, dtype=float), craft)
    ends = plan.starts + plan.durations
    if (plan.starts > asked).any():  # staggered: final states hold at the common end
        ends = plan.paths.end
    flights = [fly(orbit, plan.paths[k], initial[k], asked[k]) for k in range(craft)]
    wanted = final[plan.slots]
    for k, flight in enumerate(flights):
        off = np.abs(flight.state(ends[k]) - wanted[k])
        if off[:3].max() > MILLIMETRE or off[3:].max() * plan.durations[k] > MILLIMETRE:
            said.append(f"craft {k} ends {off[:3].max():.3g} m and {off[3:].max():.3g} m/s from its slot")
    said += _effort_faults(plan, craft, max_acceleration)
    said += _bound_faults(plan, orbit, initial, final, asked, ends, assign)
    others = obstacles_of(obstacles)
    window = min(asked.min(), plan.paths.start.min()), plan.paths.end.max()
    pairs = Pairs(flights, others, zones_of(zone, craft, len(others)), *window)
    if len(pairs.pairs):
        least, own = pairs.least(), claimed(plan, pairs)
        for (i, j), ratio, claim in zip(pairs.pairs, least.tolist(), own.tolist(), strict=True):
            if not ratio >= 1 - RATIO:
                said.append(f"craft {i} and {j} come to {ratio!r} x zone")
            if not (abs(ratio - claim) <= RATIO * ratio or ratio == claim):
                said.append(f"craft {i} and {j}: least ratio {ratio!r}, claimed {claim!r}")
    said += touch_faults(plan, pairs)
    if method == "joint":
        said += force_faults(plan)
    elif not plan.measures:  # or they may have planned in another order
        said += force_faults(plan, list(range(craft) if order is None else order))
    return said


def _frame_faults(plan, craft, slots, assign, start, duration):
    said = []
    if plan.paths.shape != (craft,) or plan.direct.shape != (craft,):
        said.append(f"paths {plan.paths.shape} and direct {plan.direct.shape} of {craft} craft")
        return said
    if np.shape(plan.slots) != (craft,) or len(set(plan.slots)) != craft or max(plan.slots) >= slots:
        said.append(f"slots {plan.slots}")
    if not assign and list(plan.slots) != list(range(craft)):
        said.append(f"slots {plan.slots} without assignment")
    if not plan.measures and not (
        np.array_equal(plan.starts, np.broadcast_to(start, craft))
        and np.array_equal(plan.durations, np.broadcast_to(duration, craft))
    ):
        said.append("other times than asked, without a word")
    first = min(plan.starts.min(), np.min(start))
    last = (plan.starts + plan.durations).max()
    slack = 1e-9 * (last - first)
    for k in range(craft):
        path = plan.paths[k]
        if not (
            abs(path.start - first) <= 1e-9 * (last - first) and abs(path.end - last) <= 1e-9 * abs(last)
        ):
            said.append(f"craft {k} flies from {path.start} to {path.end} s, the plan from {first} to {last}")
        if path.impulses:
            said.append(f"craft {k} has impulses")
        for when, bounds in (
            ("before", (path.start, plan.starts[k])),
            ("after", (plan.starts[k] + plan.durations[k], path.end)),
        ):
            if bounds[1] - bounds[0] > 4 * slack:
                idle = np.linspace(bounds[0] + slack, bounds[1] - slack, 100)
                if np.abs(path.thrust(idle)).max() > 0:
                    said.append(f"craft {k} thrusts {when} its time")
    return said


def _effort_faults(plan, craft, max_acceleration):
    said = []
    energies, delta_vs, peaks = np.transpose([efforts(plan.paths[k]) for k in range(craft)])
    for name, found, claim, tolerance in (
        ("energy", energies, plan.paths.energy, ENERGY),
        ("delta-v", delta_vs, plan.paths.delta_v, DELTA_V),
        ("total energy", energies.sum(), plan.energy, ENERGY),
        ("total delta-v", delta_vs.sum(), plan.delta_v, DELTA_V),
    ):
        if not np.allclose(found, claim, rtol=tolerance, atol=tolerance * np.max(found)):
            said.append(f"{name} {found}, claimed {claim}")
    if max_acceleration is not None:
        limits = np.broadcast_to(max_acceleration, craft)
        for k in np.flatnonzero(peaks > limits * (1 + 1e-9)):
            said.append(f"craft {k} thrusts {peaks[k]:.6g} m/s^2, its limit is {limits[k]:.6g}")
    return said


def _bound_faults(plan, orbit, initial, final, asked, ends, assign):
    """The unconstrained optima over the planned times: before and after them craft coast."""
    said, system = [], hill(orbit.mean_motion)
    begun = [
        expm(system * (t - t0)) @ state for t, t0, state in zip(plan.starts, asked, initial, strict=True)
    ]
    early = [expm(system * (t - t1)) for t, t1 in zip(plan.starts + plan.durations, ends, strict=True)]

    def cost(craft, slot):
        return optimum(orbit.mean_motion, begun[craft], early[craft] @ final[slot], plan.durations[craft])

    own = np.array([cost(k, slot) for k, slot in enumerate(plan.slots)])
    scale = own.max()
    if not np.allclose(plan.direct.energy, own, rtol=1e-8, atol=1e-10 * scale):
        said.append(f"direct energies {plan.direct.energy}, by the Gramian {own}")
    bound = own.sum()
    if assign:
        costs = np.array([[cost(k, slot) for slot in range(len(final))] for k in range(len(initial))])
        bound = costs[linear_sum_assignment(costs)].sum()
    # contacts add to the bound, not where it is that of all assignments
    added = plan.lower_bound - bound
    if added < -1e-8 * bound or (added > 1e-8 * bound and (assign or not plan.contacts)):
        said.append(f"lower bound {plan.lower_bound}, by the Gramian {bound}")
    if plan.energy < plan.lower_bound * (1 - 1e-9):
        said.append(f"energy {plan.energy} below the lower bound {plan.lower_bound}")
    gap = plan.energy / plan.lower_bound - 1 if plan.lower_bound > 0 else 0.0
    if plan.lower_bound > 0 and not np.isclose(plan.gap, gap, rtol=0, atol=1e-9):
        said.append(f"gap {plan.gap}, not {gap}")
    if plan.proven and not assign and gap > 1e-6 * (1 + 1e-6):
        said.append(f"proven with a gap of {gap}")
    return said


def touch_faults(plan, pairs):
    """At touches, in order of time, the pair is at its zone and pushed apart."""
    said = []
    for touch in plan.contacts:
        i, j = touch.first, touch.second
        time = np.array([touch.time])
        gap = (pairs.places(i, time) - pairs.places(j, time))[0]
        zone = pairs.zone_of(i, j)
        ratio = zone.norm(gap)
        if not abs(np.linalg.norm(touch.normal) - 1) < 1e-9 or not touch.multiplier > 0:
            said.append(f"touch of {i} and {j}: normal {touch.normal}, force {touch.multiplier}")
        if not touch.normal @ gap > 0:
            said.append(f"touch of {i} and {j} pulls")
        if not min(abs(ratio - size) for size in PLANNED) < (ROUNDED if zone.shape == CUBE else TOUCHING):
            said.append(f"touch of {i} and {j} at {ratio!r} x zone")
    if [touch.time for touch in plan.contacts] != sorted(touch.time for touch in plan.contacts):
        said.append("touches out of order")
    return said


def force_faults(plan, rank=None):
    """The rates of thrusts jump by the forces of touches and nowhere else, and thrusts do not.

    So each path is the optimum for its touches.  With a `rank` of the craft (a sequential plan)
    the later one of two alone gives way.
    """
    said = []
    length = plan.paths.end.max() - plan.paths.start.min()
    for k in range(len(plan.paths)):
        path = plan.paths[k]
        inner = (path.arcs[1:, 0] > plan.starts[k] + 1e-9 * length) & (
            path.arcs[1:, 0] < plan.starts[k] + plan.durations[k] - 1e-9 * length
        )
        joints = np.unique(path.arcs[1:, 0][inner])
        forces = np.zeros((len(joints), 3))
        for touch in plan.contacts:
            if k not in (touch.first, touch.second) or not _gives_way(plan, k, touch, rank):
                continue
            near = np.abs(joints - touch.time).argmin() if len(joints) else None
            if near is None or abs(joints[near] - touch.time) > 1e-9 * length:
                said.append(f"no joint of craft {k} at its touch at {touch.time!r} s")
                continue
            forces[near] += (1 if k == touch.first else -1) * touch.multiplier * touch.normal
        size = np.abs(path.thrust(np.linspace(path.start, path.end, 50))).max() / length
        for joint, force in zip(joints, forces, strict=True):
            jump, steps = _rate_jump(path, joint, length)
            if np.abs(steps).max() > 1e-9 * size * length:
                said.append(f"craft {k}: thrust itself jumps at {joint!r} s")
            if np.abs(jump - force).max() > 1e-4 * max(np.abs(force).max(), np.abs(jump).max(), size):
                said.append(f"craft {k}: the thrust's rate jumps by {jump} at {joint!r} s, not {force}")
    return said


def _gives_way(plan, craft, touch, rank):
    """Who coasts before its start or after its end does not, nor who has planned before the other."""
    if not plan.starts[craft] < touch.time < plan.starts[craft] + plan.durations[craft]:
        return False
    other = touch.second if craft == touch.first else touch.first
    return rank is None or other not in rank or rank.index(other) < rank.index(craft)


def _rate_jump(path, joint, length):
    """Jumps of the thrust's rate and of the thrust at a joint, by one-sided differences."""
    before, after = path.arcs[:, 1] == joint, path.arcs[:, 0] == joint
    room = min(np.ptp(path.arcs[before, :2][-1]), np.ptp(path.arcs[after, :2][0]))
    h = min(1e-4 * length, room / 4)
    ahead = path.thrust(joint + h * np.arange(4))
    left = np.nextafter(joint, path.start)
    behind = path.thrust(np.append(left, joint - h * np.arange(1, 4)))
    weights = np.array([-11, 18, -9, 2]) / (6 * h)
    return weights @ ahead + weights @ behind, ahead[0] - behind[0]
