"""Minimum delta-v within thrust limits, against convex programs and an integrator."""

import itertools
from contextlib import suppress
from math import inf, pi
from types import SimpleNamespace

import clarabel
import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import quad_vec, solve_ivp
from scipy.linalg import expm

import closeform as cf
import passages
from bridge import hill
from closeform.fuel.burns import burns_of
from closeform.mission.stage_burns import burns_in
from delta_v_plans import NEAR, passage
from formations import LOW_ORBIT

ORBIT = LOW_ORBIT
SLOTS = 160  # of constant thrust in the convex program
BY_BURNS = 2e-3  # relative gap to the convex program, whose planes are those of the path
FACTORS = (30.0, 2.0, 0.85)  # of the peak thrust of the plan of minimum energy
QUICK = ((4, 2.0), (11, 0.85))


def effect_of_thrust(n, h):
    """Return the effect (6, 3) of constant thrust over a time h, by Van Loan's exponential."""
    block = np.zeros((9, 9))
    block[:6, :6], block[3:6, 6:] = hill(n), np.eye(3)
    return expm(block * h)[:6, 6:]


def minimum_on_planes(path, obstacle, radius, a, b, duration, limit):
    """Return the minimum cost (SOCP) of limited thrust in slots within the supporting planes of a path."""
    n, h = ORBIT.mean_motion, duration / SLOTS
    one, step = effect_of_thrust(n, h), expm(hill(n) * h)
    powers = [np.eye(6)]
    for _ in range(SLOTS):
        powers.append(step @ powers[-1])
    equal = np.hstack([powers[SLOTS - 1 - j] @ one for j in range(SLOTS)])
    target = b - powers[SLOTS] @ a
    rows, floors = [], []
    for k in range(1, SLOTS):
        t = k * h
        apart = path.position(t) - obstacle.position(t)
        size = np.linalg.norm(apart)
        if size < NEAR * radius:
            normal = apart / size
            ways = [normal @ (powers[k - 1 - j] @ one)[:3] if j < k else np.zeros(3) for j in range(SLOTS)]
            rows.append(np.concatenate(ways))
            floors.append(min(radius, size) - normal @ ((powers[k] @ a)[:3] - obstacle.position(t)))
    scale = np.array([1.0 / duration] * 3 + [1.0] * 3)
    matrix = np.vstack([scale[:, None] * equal, -np.array(rows).reshape(-1, 3 * SLOTS) / duration])
    right = np.concatenate([scale * target, -np.array(floors) / duration])
    wide, cones = np.zeros((len(matrix) + SLOTS, 4 * SLOTS)), -np.eye(4 * SLOTS)
    for j in range(SLOTS):  # thrust relative to the limit, after its norm
        wide[: len(matrix), 4 * j + 1 : 4 * j + 4] = limit * matrix[:, 3 * j : 3 * j + 3]
        wide[len(matrix) + j, 4 * j] = 1.0
    cost = np.zeros(4 * SLOTS)
    cost[::4] = 1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    kinds = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(rows) + SLOTS)]
    kinds += [clarabel.SecondOrderConeT(4)] * SLOTS
    offsets = np.concatenate([right, np.ones(SLOTS), np.zeros(4 * SLOTS)])
    nothing = sparse.csc_matrix((4 * SLOTS, 4 * SLOTS))
    task = sparse.csc_matrix(np.vstack([wide, cones]))
    found = clarabel.DefaultSolver(nothing, cost, task, offsets, kinds, settings).solve()
    assert str(found.status) in ("Solved", "PrimalInfeasible")
    return found.obj_val * limit * h if str(found.status) == "Solved" else inf


def flown(path, times):
    """Return positions (T, 3) and the end state by an integrator of the thrust."""
    motion = hill(path.orbit.mean_motion)
    edges = np.unique(np.concatenate([path.arcs[:, 0], [path.end]]))
    state, places = path.state(path.start), np.empty((len(times), 3))
    for begin, end in zip(edges[:-1], edges[1:], strict=True):
        inner = begin + np.clip(1e-9 * (end - begin), 0.0, None)  # within this arc

        def rate(t, x, inner=inner, end=end):
            slope = motion @ x
            slope[3:] += path.thrust(min(max(t, inner), end - 1e-9 * (end - inner)))
            return slope

        way = solve_ivp(rate, (begin, end), state, method="DOP853", rtol=1e-9, atol=1e-10, dense_output=True)
        here = (times >= begin) & (times <= end)
        if here.any():
            places[here] = way.sol(times[here]).T[:, :3]
        state = way.y[:, -1]
    return places, state


@pytest.mark.parametrize(
    ("seed", "factor"),
    [
        pytest.param(seed, factor, marks=[] if (seed, factor) in QUICK else pytest.mark.slow)
        for seed in (4, 11, 14)
        for factor in FACTORS
    ],
)
def test_avoidance_of_a_sphere(seed, factor):
    """The plan keeps limit, zone and end, and costs little more than a convex program."""
    a, b, duration, obstacle, radius = passage(seed)
    path, zone = ORBIT.transfer(a, b, duration), cf.Sphere(radius)
    by_energy = cf.avoid(path, obstacle, zone)
    limit = factor * by_energy.path.peak_thrust
    found = cf.avoid(path, obstacle, zone, cost="delta-v", max_acceleration=limit, longer=False)
    assert found.status == cf.Status.AVOIDED
    assert found.cost == "delta-v"
    assert not found.path.impulses
    assert found.path.end == duration
    times = np.linspace(0.0, duration, 3001)
    strength = np.linalg.norm(found.path.thrust(times), axis=1)
    assert strength.max() <= found.path.peak_thrust <= limit
    places, end = flown(found.path, times)
    assert np.abs(end[:3] - b[:3]).max() < 1e-4  # m; accuracy of the integrator
    assert np.abs(end[3:] - b[3:]).max() < 1e-7
    assert np.linalg.norm(places - obstacle.position(times), axis=1).min() > radius * (1.0 - 1e-6)
    free = cf.least_delta_v(ORBIT, a, b, duration)
    within = free.lower
    with suppress(ValueError):  # the limit is neither proven sufficient nor insufficient
        within = max(within, cf.least_delta_v(ORBIT, a, b, duration, limit).lower)
    assert free.lower <= found.lower_bound == pytest.approx(within, rel=1e-7)
    assert found.lower_bound <= found.delta_v
    assert factor < 1.0 or found.delta_v < by_energy.delta_v
    least = minimum_on_planes(found.path, obstacle, radius, a, b, duration, limit)
    assert found.delta_v <= (1.0 + BY_BURNS) * least


def test_high_limits_approach_impulses():
    """Cost falls with the limit towards that of impulses."""
    a, b, duration, obstacle, radius = passage(7)
    path, zone = ORBIT.impulsive(a, b, duration), cf.Sphere(radius)
    impulses = cf.avoid(path, obstacle, zone, cost="delta-v")
    costs = []
    for limit in (1.0, 1e-2, 3e-4):
        found = cf.avoid(path, obstacle, zone, cost="delta-v", max_acceleration=limit, longer=False)
        assert found.ok
        assert found.path.peak_thrust <= limit * (1.0 + 1e-9)
        costs.append(found.delta_v)
    assert costs == sorted(costs)
    assert costs[0] == pytest.approx(impulses.delta_v, rel=1e-4)
    assert costs[-1] > 1.05 * impulses.delta_v


@pytest.mark.parametrize("factor", [pytest.param(3.0, marks=pytest.mark.slow), 0.8])
def test_swap_of_twelve(factor):
    """Twelve spacecraft cross a ring in a quarter of an orbit within a thrust limit."""
    angles = 2.0 * pi * np.arange(12) / 12
    ring = np.zeros((12, 6))
    ring[:, 1], ring[:, 2] = 120.0 * np.cos(angles), 120.0 * np.sin(angles)
    duration, zone = ORBIT.period / 4.0, cf.Sphere(15.0)
    by_energy = cf.reconfigure(ORBIT, ring, -ring, duration, zone)
    limit = factor * by_energy.paths.peak_thrust.max()
    plan = cf.reconfigure(ORBIT, ring, -ring, duration, zone, cost="delta-v", max_acceleration=limit)
    assert plan.ok
    assert plan.measures == ()
    assert plan.paths.peak_thrust.max() <= limit
    assert plan.delta_v == pytest.approx(plan.paths.delta_v.sum(), rel=1e-9)
    assert len(cf.screen(plan.paths, zone)) == 0
    assert np.abs(plan.paths.state(duration) + ring)[:, :3].max() < 1e-6
    alone = cf.least_delta_v(ORBIT, ring, -ring, duration, limit).lower.sum()
    assert plan.lower_bound == pytest.approx(alone, rel=1e-9)
    assert plan.lower_bound < plan.delta_v < by_energy.delta_v
    assert plan.gap < 0.08
    places, end = flown(plan.paths[3], np.linspace(0.0, duration, 50))
    assert np.abs(places - plan.paths[3].position(np.linspace(0.0, duration, 50))).max() < 1e-4
    assert np.abs(end + ring[3])[:3].max() < 1e-4


def test_insufficient_thrust():
    """Infeasibility is proven with a sufficient limit, and a longer plan keeps the given one."""
    a, b = np.array([0.0, -150.0, 0.0, 0.0, 0.0, 0.0]), np.array([0.0, 150.0, 0.0, 0.0, 0.0, 0.0])
    orbit, duration = cf.Orbit(0.0), 600.0
    least = 4.0 * 300.0 / duration**2  # rest to rest in deep space
    obstacle = orbit.coast([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 6000.0)
    task = orbit.transfer(a, b, duration), obstacle, cf.Sphere(40.0)
    weak = cf.avoid(*task, cost="delta-v", max_acceleration=0.9 * least, longer=False)
    assert weak.status == cf.Status.TOO_WEAK
    assert weak.path is None
    assert weak.weak.proven == pytest.approx(least, rel=1e-5)
    assert weak.weak.proven <= least * (1.0 + 1e-12)
    assert weak.weak.needed == pytest.approx(least, rel=1e-5)
    assert "proven necessary" in weak.reason
    longer = cf.avoid(*task, cost="delta-v", max_acceleration=0.9 * least)
    assert longer.ok
    assert longer.measures
    assert longer.path.peak_thrust <= 0.9 * least
    assert 1.0 < longer.path.end / duration < 1.3
    assert not cf.find_conflicts(longer.path, obstacle, cf.Sphere(40.0))
    both = cf.reconfigure(
        orbit,
        [a, b],
        [b, a],
        duration,
        cf.Sphere(40.0),
        cost="delta-v",
        max_acceleration=[1.0, 0.9 * least],
        if_blocked=["more sides"],
        names=["A", "B"],
    )
    assert both.status == cf.Status.TOO_WEAK
    assert both.weak.craft == 1
    assert both.reason.startswith("B needs")
    later = cf.reconfigure(
        orbit, [a, b], [b, a], duration, cf.Sphere(40.0), cost="delta-v", max_acceleration=0.9 * least
    )
    assert later.ok
    assert (later.durations > duration).all()
    assert later.paths.peak_thrust.max() <= 0.9 * least


def test_mixed_limits_and_thrusters():
    """Each spacecraft of a plan keeps its own limit or thrusters."""
    angles = 2.0 * pi * np.arange(6) / 6
    ring = np.zeros((6, 6))
    ring[:, 1], ring[:, 2] = 120.0 * np.cos(angles), 120.0 * np.sin(angles)
    limit = 8e-4
    limits, six = [limit, inf, inf] * 2, cf.Thrusters.rtn()
    plan = cf.reconfigure(
        ORBIT,
        ring,
        -ring,
        ORBIT.period / 4.0,
        cf.Sphere(15.0),
        cost="delta-v",
        max_acceleration=limits,
        thrusters=[None, six, None] * 2,
    )
    assert plan.ok
    assert len(cf.screen(plan.paths, cf.Sphere(15.0))) == 0
    for k, path in enumerate(plan.paths):
        assert bool(path.impulses) == (limits[k] == inf)
        if k % 3 == 0:
            assert path.peak_thrust <= limit
    assert np.abs(plan.paths.state(ORBIT.period / 4.0) + ring)[:, :3].max() < 1e-6


def test_clear_path_beyond_the_limit_is_replaced():
    """Impulses and energy-optimal thrust are replaced by burns within the limit, which are kept."""
    a, b = np.array([0.0, -300.0, 0.0, 0.0, 0.0, 0.0]), np.array([0.0, -100.0, 50.0, 0.0, 0.0, 0.0])
    far = ORBIT.coast([0.0, 5000.0, 0.0, 0.0, 0.0, 0.0], 3000.0)
    free = ORBIT.transfer(a, b, 3000.0)
    limit = 2.0 * free.peak_thrust
    task = far, cf.Sphere(50.0)
    burns = ORBIT.transfer(a, b, 3000.0, max_acceleration=limit, cost="delta-v")
    for path in (ORBIT.impulsive(a, b, 3000.0), free):
        found = cf.avoid(path, *task, cost="delta-v", max_acceleration=limit)
        assert found.status == cf.Status.CLEAR
        assert found.proven
        assert found.delta_v == pytest.approx(burns.delta_v, rel=1e-8)
    kept = cf.avoid(burns, *task, cost="delta-v", max_acceleration=limit)
    assert np.array_equal(kept.path.arcs, burns.arcs)


def test_delta_v_is_the_integral_of_thrust():
    """The reported delta-v is the integral of thrust."""
    a, b, duration, obstacle, radius = passage(4)
    limit = 2e-4
    path = ORBIT.transfer(a, b, duration)
    found = cf.avoid(path, obstacle, cf.Sphere(radius), cost="delta-v", max_acceleration=limit, longer=False)
    edges = np.unique(np.concatenate([found.path.arcs[:, 0], [duration]]))
    total = sum(
        quad_vec(lambda t: float(np.linalg.norm(found.path.thrust(t))), begin, end, points=[])[0]
        for begin, end in zip(edges[:-1] + 1e-7, edges[1:] - 1e-7, strict=True)
    )
    assert found.delta_v == pytest.approx(total, rel=1e-6)


def test_plans_have_no_negligible_burns():
    """A swap of four spacecraft has no negligible burns and is clear."""
    states = np.zeros((4, 6))
    states[[0, 1, 2, 3], [1, 2, 1, 2]] = 100.0, 100.0, -100.0, -100.0
    plan = cf.reconfigure(
        ORBIT, states, np.roll(states, 2, axis=0), ORBIT.period / 2, cf.Sphere(20.0),
        cost="delta-v", assign=False, max_acceleration=5e-3,
    )  # fmt: skip
    assert plan.ok
    places = np.array([plan.paths[k].position(np.linspace(0.0, ORBIT.period / 2, 4001)) for k in range(4)])
    gaps = [np.linalg.norm(places[i] - places[j], axis=1).min() for i in range(4) for j in range(i)]
    assert min(gaps) > 20.0 * (1.0 - 1e-6)
    sizes = np.concatenate([burns_of(plan.paths[k]).size for k in range(4)])
    assert sizes.min() > 1e-4 * plan.delta_v


@pytest.fixture(scope="module")
def touching():
    """Two spacecraft with a burn of nm/s between two of a decimetre per second, and every size [m/s]."""
    orbit, state, pieces = cf.Orbit.circular(500e3), np.zeros((2, 6)), []
    state[:, 1] = 80.0, -80.0
    for thrust, lasts in ((1e-3, 100.0), (0.0, 900.0), (1e-9, 5.0), (0.0, 900.0), (-1e-3, 100.0)):
        start = pieces[-1].end.max() if pieces else 0.0
        push = np.array([[thrust, 0.0, 0.0], [0.0, 0.0, thrust]])
        pieces.append(orbit.burn(state, push, lasts, start))
        state = pieces[-1].state(start + lasts)
    paths = cf.join(pieces)
    every = np.concatenate([burns_of(paths[k]).size for k in range(2)])
    assert every.min() < 1e-8  # m/s
    return SimpleNamespace(paths=paths, delta_v=paths.delta_v.sum()), every


def test_negligible_burns_are_not_listed(touching):
    """Listed burns add up without negligible ones."""
    (plan, every), count = touching, len(touching[0].paths)
    after = SimpleNamespace(names=[str(k) for k in range(count)], paths=plan.paths)
    listed = [
        row[6]
        for row in burns_in(
            SimpleNamespace(after=after, burning=after.paths, pulsed=None), lambda k, spent: np.nan
        )
    ]
    assert min(listed) >= 5e-7  # omitted if it prints as 0.000000
    assert sum(listed) == pytest.approx(plan.delta_v, abs=5e-7 * len(every))


def test_negligible_burns_are_not_exported(touching, tmp_path):
    """OPM and OCM have the listed burns."""
    plan, every = touching
    chief = cf.Chief.from_elements("2026-11-22T12:00:00", [cf.elements.EARTH_RADIUS + 500e3, 0, 0, 0, 1.7, 0])
    listed = int((every >= 5e-7).sum())
    assert listed < len(every)
    opm, ocm = (cf.export(plan.paths, tmp_path / to, to, chief=chief) for to in ("opm", "ocm"))
    texts = [file.read_text() for file in sorted(opm.glob("*.opm"))]
    assert sum(text.count("MAN_EPOCH_IGNITION") for text in texts) == listed
    spent = 0.0
    for file in sorted(ocm.glob("*.ocm")):
        block = file.read_text().split("MAN_START")[1].split("MAN_STOP")[0]
        rows = [line.split() for line in block.splitlines() if line.endswith((" ON", " OFF"))]
        for row, after in itertools.pairwise(rows):
            if row[-1] == "ON":  # mean thrust between nodes
                ends = np.array([row[2:5], after[2:5] if after[-1] == "ON" else row[2:5]], dtype=float)
                spent += float(row[1]) * np.linalg.norm(ends, axis=1).mean() * 1e3
        burns = burns_of(plan.paths[int(file.stem[1:]) - 1])
        large, times = burns.size >= 5e-7, np.array([float(row[0]) for row in rows])[:, None]
        assert (
            ((times > burns.start[large] - 1e-6) & (times < (burns.start + burns.duration)[large] + 1e-6))
            .any(axis=1)
            .all()
        )
    assert spent == pytest.approx(plan.delta_v, rel=1e-3)


def test_tiny_burns_are_listed_if_there_are_no_others():
    """A plan of tiny impulses only lists all of them."""
    orbit = cf.Orbit.circular(500e3)
    path = orbit.impulsive(np.zeros(6), [0.0, 1e-3, 0.0, 0.0, 0.0, 0.0], orbit.period)
    assert path.delta_v < 5e-7
    after = SimpleNamespace(names=["A"], paths=[path])
    listed = [
        row[6]
        for row in burns_in(
            SimpleNamespace(after=after, burning=after.paths, pulsed=None), lambda k, spent: np.nan
        )
    ]
    assert len(listed) == len(path.impulses)
    assert sum(listed) == pytest.approx(path.delta_v, rel=1e-12)


def test_rounded_components_of_burns_are_zero():
    """Components that are rounding of zero are listed as zero."""
    orbit = cf.Orbit.circular(500e3)
    ring = cf.targets.projected_circular(orbit, 4, 50.0)
    burns = burns_of(orbit.transfer(ring[0], ring[1], 0.75 * orbit.period))
    assert burns.size > 1.1 * np.linalg.norm(burns.push, axis=1)  # the direction turns
    assert burns.push[0, 1] == 0.0
    assert (np.abs(burns.push[0, ::2]) > 0.01).all()


@pytest.mark.parametrize(("group", "seed"), [("one box", 2), ("three ellipsoids", 0)])
def test_no_burn_is_too_small_to_be_fired(group, seed):
    """Burns of a tenth of a micrometre per second to 66 micrometres per second were planned here."""
    task, limit, least = passages.passage(group, seed), 1e-2, 1e-4
    given = task.path, task.obstacles, task.zones
    impulses = cf.avoid(*given, cost="delta-v")
    assert min(np.linalg.norm(push) for _, push in impulses.path.impulses) >= least
    burns = cf.avoid(*given, cost="delta-v", max_acceleration=limit, longer=False)
    for plan in (impulses, burns):
        assert plan.ok
        assert not task.conflicts(plan.path)
        assert plan.path.state(task.duration) == pytest.approx(task.final, abs=1e-6)
    times = np.linspace(0.0, task.duration, 200_001)
    thrust = np.linalg.norm(burns.path.thrust(times), axis=-1)
    level = np.digitize(thrust, [1e-12, 0.1 * limit])  # off, throttled, burning
    edges = np.flatnonzero(np.diff(level)) + 1
    pieces = zip(np.split(thrust, edges), np.split(level, edges), strict=True)
    given = np.array([one.sum() * times[1] for one, at in pieces if at[0]])
    assert given.min() >= 0.9 * least  # to a sample at either end
