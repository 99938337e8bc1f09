"""Independent model of the gathering of lost spacecraft, after the papers.

Boresights come from scipy's rotations, locks from refined dense sampling of the angles at which two
spacecraft see each other (H03 eqs. 1 and 2); sets are Python sets.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.spatial.transform import Rotation

import bodies

SUNWARD = np.array([0.0, 0.0, -1.0])
START = {"A": np.array([1.0, 0.0, 0.0]), "B": np.array([-1.0, 0.0, 0.0])}  # boresights
STEP = 6.0  # s; 1.5 deg of rotation at 0.25 deg/s
# turns of one search: (about, angle), or a multiple of the tip angle
MODIFIED = 2 * [("sun", 3 * np.pi), 1, -2, ("sun", np.pi), 2, ("sun", np.pi), -2, 1]
BASIC = 2 * [("sun", 3 * np.pi), 1, -2, ("sun", np.pi), 2, -1]
# Five craft as in H03 section V: two pairs lock in the IPS, a fifth joins the second, they meet in the OPS.
POSITIONS = np.array(
    [
        [-27.8, -70.6, 90.9],
        [-3.9, -72.1, -70.0],
        [-37.0, -34.8, 95.9],
        [-75.2, -42.8, -50.7],
        [-64.5, 24.0, 97.5],
    ]
)
VELOCITIES = np.array(
    [
        [-0.0558, -0.0006, 0.0215],
        [-0.0257, 0.0298, -0.0438],
        [0.0008, -0.0097, 0.0053],
        [0.023, -0.0395, 0.028],
        [0.0001, 0.004, 0.0038],
    ]
)


class Sky:
    """Boresights of both groups over all rounds; a wait is a turn by zero."""

    def __init__(self, turns, tip, rate, rounds=1, wait=0.0):
        self.legs = []  # start, end, axis, angle, rotation at the start
        self.burns = []  # times of near-field burns
        time, turned, body_y = 0.0, Rotation.identity(), np.array([0.0, 1.0, 0.0])
        for _ in range(rounds):
            for turn in turns:
                about_sun = isinstance(turn, tuple)
                angle = turn[1] if about_sun else turn * tip
                axis = SUNWARD if about_sun else turned.apply(body_y)
                end = time + abs(angle) / rate
                self.legs.append((time, end, axis, angle, turned))
                turned = Rotation.from_rotvec(axis * angle) * turned
                time = end
            if wait:
                for k in range(2):
                    if k:
                        self.burns.append(time)
                    self.legs.append((time, time + wait, SUNWARD, 0.0, turned))
                    time += wait
        self.duration = time
        grid = [np.linspace(a, b, max(2, int((b - a) / STEP) + 2)) for a, b, *_ in self.legs]
        self.leg_of = np.repeat(range(len(grid)), [len(g) for g in grid])
        self.times = np.concatenate(grid)
        self.looks = np.concatenate([self.look(g, k) for k, g in enumerate(grid)])

    def look(self, times, leg):
        """Return group A's boresight at `times` within a leg."""
        a, b, axis, angle, turned = self.legs[leg]
        share = (np.atleast_1d(times) - a) / (b - a)
        return (Rotation.from_rotvec(np.outer(share * angle, axis)) * turned).apply(START["A"])

    def leg_at(self, time):
        return max(k for k, leg in enumerate(self.legs) if leg[0] <= time)


def depth(sensor, offset_apart, look):
    """Return the depth inside both cones, in cosines: A at 0, B at `offset_apart` (..., 3)."""
    sensor_a = sensor.offset * look
    sensor_b = offset_apart - sensor.offset * look
    apart = sensor_b - sensor_a
    size = np.linalg.norm(apart, axis=-1)
    line = apart / np.where(size > 0.0, size, 1.0)[..., None]
    seen_by_a = np.sum(look * line, axis=-1)
    seen_by_b = np.sum(-look * -line, axis=-1)
    cones = np.minimum(seen_by_a, seen_by_b) - np.cos(sensor.half_angle)
    return np.minimum(cones, 1.0 - size / sensor.range) if np.isfinite(sensor.range) else cones


def first_lock(sky, sensor, start, position, velocity):
    """Return the first lock time of a pair from `start` on, or inf; `position` is that of B from A."""
    later = sky.times > start
    here = sky.leg_at(start)
    times = np.concatenate([[start], sky.times[later]])
    legs = np.concatenate([[here], sky.leg_of[later]])
    looks = np.concatenate([sky.look(start, here), sky.looks[later]])

    def at(time, leg):
        return float(depth(sensor, position + (time - start) * velocity, sky.look(time, leg)[0]))

    value = depth(sensor, position + (times - start)[:, None] * velocity, looks)
    if value[0] >= 0.0:
        return start
    inside = value >= 0.0
    last = int(np.argmax(inside)) if inside.any() else len(value)
    # peaks of samples that may hide an earlier short lock
    k = np.arange(1, min(last, len(value) - 1))
    peaks = k[(value[k] >= value[k - 1]) & (value[k] >= value[k + 1]) & (value[k] > -0.05)]
    for p in peaks:
        for lo, hi in ((p - 1, p), (p, p + 1)):
            if legs[lo] != legs[hi] or times[lo] == times[hi]:
                continue
            best = minimize_scalar(
                lambda t, leg=legs[hi]: -at(t, leg),
                bounds=(times[lo], times[hi]),
                method="bounded",
                options={"xatol": 1e-9},
            )
            if best.fun <= 0.0:
                return brentq(at, times[lo], best.x, args=(legs[hi],), xtol=1e-10)
    if last == len(value):
        return np.inf
    if times[last] == times[last - 1] or legs[last] != legs[last - 1]:
        return times[last]
    return brentq(at, times[last - 1], times[last], args=(legs[last],), xtol=1e-10)


@dataclass
class Told:
    """Result of the model: `events` are (time, kind, first, second, case, impulse)."""

    events: list = field(default_factory=list)
    seen: set = field(default_factory=set)  # kinds of joins that occurred
    sets: list = field(default_factory=list)  # the formation set first
    lost: set = field(default_factory=set)
    duration: float = 0.0
    positions: np.ndarray = None
    velocities: np.ndarray = None
    delta_v: np.ndarray = None
    ok: bool = False
    adrift: set = field(default_factory=set)  # in the formation set without thrust


KINDS = ("lost", "knowledge", "formation")  # H03 figure 8 in its order


def gathered(sky, sensor, positions, velocities, groups, burns, push=0.0, errant=None, fails=None, off=None):
    """Return the result of a gathering; of simultaneous locks the lowest spacecraft of group A comes first.

    `errant` bodies, one for each spacecraft, replace the boresights of the sky.  Spacecraft k cannot burn
    from `fails[k]` on; `off(k, b, dv)` is the error of its burn number b.
    """
    r, v = np.array(positions, float), np.array(velocities, float)
    n = len(r)
    told = Told(delta_v=np.zeros(n), lost=set(range(n)))
    formation, knowledge = set(), []
    spent = told.delta_v
    order = sorted(range(n), key=lambda k: (groups[k], k))
    clock, due = 0.0, [(time, k) for time in sky.burns for k in order]
    if errant is not None:
        drifts = [j for j, turn in enumerate(errant[0].turns) if turn[1] == "wait"][1::2]
        due = sorted(((errant[k].begins[j], k) for j in drifts for k in order), key=lambda one: one[0])
    pairs = [(a, b) for a in range(n) for b in range(n) if groups[a] == "A" and groups[b] == "B"]
    known: dict[tuple, float] = {}  # lock times, valid until either burns

    burnt, pace = [0] * n, None  # number of burns of each; velocity of the formation set

    def powerless(k):
        return fails is not None and clock >= fails[k]

    def impulse(k, kind, dv):
        nonlocal known
        if np.linalg.norm(dv) < 1e-14:
            return  # rounding
        if powerless(k):
            told.adrift |= {k} if kind == "burn" else set()
            return
        if off is not None:
            dv = dv + off(k, burnt[k], dv)
        burnt[k] += 1
        v[k] += dv
        spent[k] += np.linalg.norm(dv)
        told.events.append((clock, kind, k, -1, 0, dv))
        known = {pair: time for pair, time in known.items() if k not in pair}

    def lock(a, b):
        apart, speed = r[b] - r[a], v[b] - v[a]
        if errant is None:
            return first_lock(sky, sensor, clock, apart, speed)
        found = bodies.first_lock(errant[a], errant[b], sensor, apart - clock * speed, speed, clock)
        return np.inf if np.isnan(found) else found

    def look(k):
        if errant is not None:
            return errant[k].boresights(np.array([clock]))[0]
        return sky.look(clock, sky.leg_at(clock))[0] * (1.0 if groups[k] == "A" else -1.0)

    def set_of(k):
        if k in formation:
            return formation
        return next((s for s in knowledge if k in s), None)

    def kind_of(k):
        return "formation" if k in formation else "lost" if k in told.lost else "knowledge"

    while len(formation) < n:
        found = (np.inf, n, n)
        for a, b in pairs:
            if set_of(a) is not None and set_of(a) is set_of(b):
                continue
            if (a, b) not in known:
                known[a, b] = lock(a, b)
            found = min(found, (known[a, b], a, b))
        if due and due[0][0] <= found[0]:
            time, k = due.pop(0)
            r += (time - clock) * v
            clock = time
            if k in told.lost:
                impulse(k, "near field", -push * look(k))
            continue
        if found[0] == np.inf:
            break
        r += (found[0] - clock) * v
        clock, i, j = found[0], *sorted(found[1:])
        ki, kj = kind_of(i), kind_of(j)
        told.events.append((clock, "lock", i, j, 3 * KINDS.index(ki) + KINDS.index(kj) + 1, None))
        told.seen.add("-".join(sorted((ki, kj))) + ("" if formation else " first"))
        if ki == kj == "lost":
            if formation:
                knowledge.append({i, j})
            else:
                formation |= {i, j}
                share = {"second": 0.0, "first": 1.0, "half": 0.5}[burns]
                share = 0.0 if powerless(i) else 1.0 if powerless(j) else share
                pace = v[i] + share * (v[j] - v[i])
                for k in (i, j):
                    impulse(k, "burn", pace - v[k])
        elif "formation" in (ki, kj):
            joining = j if ki == "formation" else i
            new = set_of(joining) or {joining}
            knowledge = [s for s in knowledge if s is not new]
            for k in sorted(new):
                impulse(k, "burn", pace - v[k])
            formation |= new
        elif ki == kj:
            one, other = set_of(i), set_of(j)
            knowledge = [s for s in knowledge if s is not one and s is not other] + [one | other]
        else:
            (set_of(i) or set_of(j)).update({i, j})
        told.lost -= {i, j}
    told.ok = len(formation) == n
    ends = [sky.duration, *(body.begins[-1] for body in errant or ())]
    told.duration = clock if told.ok else max(ends)
    told.positions, told.velocities = r + (told.duration - clock) * v, v
    told.sets = ([formation] if formation else []) + knowledge
    return told


def with_kernel(positions, velocities):
    """Add two distant spacecraft that lock at once, so that all others form knowledge sets."""
    far = [[1e6, 0.0, 0.0], [1e6 + 100.0, 0.0, 0.0]]
    return np.vstack([far, positions]), np.vstack([np.zeros((2, 3)), velocities])
