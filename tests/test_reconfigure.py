"""`reconfigure` against brute force, an integrator, `avoid`, and the symmetries of Hill dynamics."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq, linear_sum_assignment, minimize_scalar

import closeform as cf
from bridge import Hindrance, bridge, hill, settle
from closeform.planning.plan import Plan, Status
from closeform.zones.shapes import CUBE
from resimulated import faults, fly

N = 1.1e-3
ORBIT, SPACE = cf.Orbit(N), cf.Orbit(0.0)
TILT = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
ELLIPSOID = cf.Ellipsoid([20.0, 40.0, 25.0], axes=TILT)
# Brute force keeps clear at samples only, which limits its accuracy.
GRAIN = 5e-3  # of the extra energy


def crossing_ends(orbit, count, seed, duration=3000.0, miss=4.0, when=0.45, spread=150.0):
    """Return initial and final states whose direct paths come within `miss` of one point."""
    rng = np.random.default_rng(seed)
    ends = rng.normal(size=(2, count, 6)) * np.repeat([spread, spread / duration], 3)
    at = orbit.transfer(*ends, duration).state(when * duration)
    at[:, :3] += rng.normal(size=(count, 3)) * miss
    at[:, 3:] = 0.0
    # subtract natural motion, which costs nothing
    back, ahead = orbit.transition([-when * duration, (1 - when) * duration])
    return ends[0] - at @ back.T, ends[1] - at @ ahead.T


def crossing_task(orbit, count, seed, zone, duration=3000.0, **how):
    initial, final = crossing_ends(orbit, count, seed, duration, **how)
    return {"orbit": orbit, "initial": initial, "final": final, "duration": duration, "zone": zone}


def planned(task, **more):
    """Return a plan that exists and passes the independent checks."""
    plan = cf.reconfigure(**task, **more)
    assert plan.ok, plan.reason
    assert faults(plan, **{**task, **more}) == []
    return plan


# ---------------------------------------------------------------------------------------------
# The checks find false plans.


@pytest.fixture(scope="module")
def by_hand():
    """Two spacecraft on direct paths, clear of each other and of a third: a plan without a planner."""
    initial = np.array([[0, -200.0, 0, 0, 0, 0], [0, 200.0, 60, 0, 0, 0]])
    final = np.array([[0, 150.0, 0, 0, 0, 0], [50.0, -200, 60, 0, 0, 0]])
    task = {"orbit": ORBIT, "initial": initial, "final": final, "duration": 2000.0, "zone": cf.Sphere(10.0)}
    return task, by_paths(task, ORBIT.transfer(initial, final, 2000.0))


def by_paths(task, paths):
    direct = task["orbit"].transfer(task["initial"], task["final"], task["duration"])
    return Plan(
        paths,
        direct,
        np.arange(2),
        np.zeros(2),
        np.full(2, task["duration"]),
        paths.energy.sum(),
        paths.energy.sum() - direct.energy.sum(),
        paths.delta_v.sum(),
        direct.energy.sum(),
        (),
        Status.CLEAR,
        "no conflict",
    )


def bent(task, **sizes):
    """Return a plan whose first spacecraft takes two legs through a displaced point."""
    own = task["orbit"].transfer(task["initial"][0], task["final"][0], 2000.0)
    via = own.state(800.0) + [0, 0, 0.5, 0, 0, 0]
    legs = [
        task["orbit"].transfer(task["initial"][0], via, 800.0),
        task["orbit"].transfer(via, task["final"][0], 1200.0, 800.0),
    ]
    other = task["orbit"].transfer(task["initial"][1], task["final"][1], 2000.0)
    return by_paths(task, cf.stack([cf.join(legs), other]))


FALSE_PLANS = {
    "nothing": (lambda task, plan: plan, None),
    "ends 2 mm away": (
        lambda task, plan: by_paths(
            task, ORBIT.transfer(task["initial"], task["final"] + [0, 0, 2e-3, 0, 0, 0], 2000.0)
        ),
        "craft 0 ends 0.002 m",
    ),
    "arrives 2 um/s faster": (
        lambda task, plan: by_paths(
            task, ORBIT.transfer(task["initial"], task["final"] + [0, 0, 0, 2e-6, 0, 0], 2000.0)
        ),
        "craft 0 ends",
    ),
    "energy": (lambda task, plan: replace(plan, energy=plan.energy * (1 + 1e-6)), "total energy"),
    "delta-v": (lambda task, plan: replace(plan, delta_v=plan.delta_v * 1.001), "total delta-v"),
    "lower bound": (lambda task, plan: replace(plan, lower_bound=0.999 * plan.lower_bound), "lower bound"),
    "slots": (lambda task, plan: replace(plan, slots=np.array([1, 1])), "slots"),
    "times": (lambda task, plan: replace(plan, durations=np.array([2000.0, 1999.0])), "other times"),
    "a bend without a touch": (lambda task, plan: bent(task), "the thrust's rate jumps"),
}


@pytest.mark.parametrize("name", FALSE_PLANS)
def test_plan_checks_find_errors(name, by_hand):
    task, plan = by_hand
    lie, words = FALSE_PLANS[name]
    said = faults(lie(task, plan), **task)
    assert any(words in one for one in said) if words else said == []


def test_checks_find_a_conflict(by_hand):
    task, plan = by_hand
    ratio = cf.closest_approach(plan.paths[0], plan.paths[1], cf.Sphere(1.0)).ratio
    assert faults(plan, **{**task, "zone": cf.Sphere(0.999 * ratio)}) == []
    said = faults(plan, **{**task, "zone": cf.Sphere(1.00001 * ratio)})
    assert said[0].startswith("craft 0 and 1 come to 0.99999")
    assert faults(plan, **{**task, "zone": [cf.Sphere(1.0), cf.Sphere(1.00001 * ratio)]}) == said
    assert faults(plan, **{**task, "zone": [cf.Sphere(1.0), None]}) == []
    late = ORBIT.coast(plan.paths[1].state(1500.0) + [0, 0, 5, 0, 0, 0], 100.0, start=1500.0)
    said = faults(plan, **{**task, "obstacles": [late]})
    assert said[0].startswith("craft 1 and 2 come to 0.")


def test_checks_find_excessive_thrust(by_hand):
    task, plan = by_hand
    peak = plan.paths.peak_thrust
    assert faults(plan, **task, max_acceleration=peak) == []
    assert len(faults(plan, **task, max_acceleration=peak * [0.999, 1.0])) == 1


def test_integrator_agrees_with_natural_motion():
    state = np.array([30.0, -40, 20, 0.02, -0.05, 0.01])
    path = ORBIT.coast(state, 6000.0)
    there = fly(ORBIT, path, state, 0.0).state(np.array([6000.0]))[0]
    np.testing.assert_allclose(there, expm(hill(N) * 6000.0) @ state, rtol=0, atol=1e-8)


# ---------------------------------------------------------------------------------------------
# Two spacecraft: the minimum cost of one contact.


def onto_surface(stiffness, gap, matrix):
    """Return the least 0.5 (q - gap)^T stiffness (q - gap) over |matrix q| = 1 for a gap inside."""
    back = np.linalg.inv(matrix)
    values, vectors = np.linalg.eigh(back.T @ stiffness @ back)
    inner = vectors.T @ (matrix @ gap)

    def size(shift):
        return np.linalg.norm(values / (values + shift) * inner)

    low = -values[0] * (1 - 1e-12)
    if size(low) < 1:  # along the softest axis, on either side
        place = np.where(values > values[0] * (1 + 1e-9), values / (values - values[0] + 1e-300) * inner, 0.0)
        place[0] = np.sqrt(1 - place @ place)
    else:
        shift = brentq(lambda s: size(s) - 1, low, 0.0, xtol=1e-15 * values[0], rtol=1e-14)
        place = values / (values + shift) * inner
    return 0.5 * (place - inner) @ (values * (place - inner))


def least_extra(task, starts=0.0):
    """Return a lower bound of the extra energy of two spacecraft.

    At each instant every clear plan is outside the zone; theory (11, 12) gives the cost of that.
    """
    orbit, zone = task["orbit"], task["zone"]
    starts, durations = (np.broadcast_to(one, 2).astype(float) for one in (starts, task["duration"]))
    direct = orbit.transfer(task["initial"], task["final"], durations, starts)

    def cost(time):
        gap = direct[0].position(time) - direct[1].position(time)
        if zone.norm(gap) >= 1:
            return 0.0
        soft = sum(
            bridge(orbit.mean_motion, span, [time - start], [time - start])[0, 0]
            for start, span in zip(starts, durations, strict=True)
        )
        return onto_surface(np.linalg.inv(soft), gap, zone.matrix)

    begin, end = starts.max(), (starts + durations).min()
    times = np.linspace(begin, end, 302)[1:-1]
    costs = [cost(time) for time in times]
    top, step = times[np.argmax(costs)], times[1] - times[0]
    best = minimize_scalar(
        lambda t: -cost(t),
        bounds=(max(top - step, begin + 1e-3 * step), min(top + step, end - 1e-3 * step)),
        method="bounded",
        options={"xatol": 1e-7 * step},
    )
    return max(-best.fun, *costs)


TWO = {
    "deep space": (SPACE, cf.Sphere(30.0), {}),
    "tilted ellipsoid": (SPACE, ELLIPSOID, {}),
    "orbit": (ORBIT, ELLIPSOID, {}),
    "orbit and a half": (ORBIT, ELLIPSOID, {"duration": 8600.0}),
    "short": (ORBIT, cf.Sphere(20.0), {"duration": 60.0}),
}


@pytest.mark.parametrize("name", TWO)
def test_two_spacecraft_reach_the_minimum_cost_of_a_contact(name):
    """A proven plan with one contact costs the lower bound."""
    orbit, zone, how = TWO[name]
    once = 0
    for seed in range(3):
        task = crossing_task(orbit, 2, seed, zone, **how)
        plan = cf.reconfigure(**task)
        if plan.status == Status.END_INSIDE:
            continue
        assert plan.ok, plan.reason
        assert faults(plan, **task) == []
        extra, least = plan.extra_energy, least_extra(task)
        # plans stay 1e-9 outside of the zone
        assert extra >= least * (1 - 1e-7) - 1e-12 * plan.energy
        if len(plan.contacts) == 1 and plan.proven:
            once += 1
            assert extra == pytest.approx(least, rel=1e-6, abs=1e-11 * plan.energy)
    assert once >= 1


@pytest.mark.parametrize("orbit", [SPACE, ORBIT])
def test_separate_start_and_arrival_times(orbit):
    """The second spacecraft starts later and arrives earlier, so it deviates less."""
    starts, durations = np.array([0.0, 400.0]), np.array([3000.0, 2200.0])
    task = crossing_task(orbit, 2, 3, cf.Sphere(30.0))
    back, ahead = orbit.transition([400.0, -400.0])
    task["initial"][1] = back @ task["initial"][1]
    task["final"][1] = ahead @ task["final"][1]
    task |= {"duration": durations}
    inner = orbit.transfer(task["initial"], task["final"], durations, starts)
    met = inner[0].state(1300.0) - inner[1].state(1300.0) + [0, 3, 4, 0, 0, 0]
    met[3:] = 0
    for end, time in (("initial", 400.0), ("final", 2600.0)):  # natural motion brings them together
        task[end][1] += orbit.transition(time - 1300.0) @ met
    plan = planned(task, start=starts)
    assert plan.contacts
    extra = plan.paths.energy - plan.direct.energy
    assert extra.sum() >= least_extra(task, starts) * (1 - 1e-7)
    if len(plan.contacts) == 1:
        assert extra.sum() == pytest.approx(least_extra(task, starts), rel=1e-6)


# ---------------------------------------------------------------------------------------------
# Against `avoid`, which moves one spacecraft.


@pytest.mark.parametrize("orbit", [SPACE, ORBIT])
def test_two_spacecraft_share_the_deviation_equally(orbit):
    """With equal times, each moves half as far as one alone would."""
    task = crossing_task(orbit, 2, 2, cf.Sphere(30.0))
    plan = planned(task)
    alone = cf.avoid(plan.direct[0], plan.direct[1], cf.Sphere(30.0))
    assert alone.extra_energy > 0
    assert plan.extra_energy == pytest.approx(alone.extra_energy / 2, rel=1e-6)
    times = np.linspace(0, 3000.0, 101)
    moved = plan.paths.position(times) - plan.direct.position(times)
    np.testing.assert_allclose(moved[0], -moved[1], atol=1e-6)
    aside = alone.path.position(times) - plan.direct[0].position(times)
    np.testing.assert_allclose(2 * moved[0], aside, atol=1e-5)


@pytest.mark.parametrize("orbit", [SPACE, ORBIT])
@pytest.mark.parametrize("seed", range(2))
def test_single_spacecraft_equals_avoid(orbit, seed):
    task = crossing_task(orbit, 4, seed, ELLIPSOID)
    initial, final = task["initial"], task["final"]
    rocks = [
        orbit.transfer(initial[1], final[1], 3000.0),
        orbit.coast(initial[2], 3000.0),
        orbit.coast(
            orbit.transition(-1350.0) @ orbit.transfer(initial[3], final[3], 3000.0).state(1350.0), 2000.0
        ),
    ]
    task |= {"initial": initial[:1], "final": final[:1], "obstacles": rocks}
    alone = cf.avoid(orbit.transfer(initial[0], final[0], 3000.0), rocks, ELLIPSOID)
    assert alone.ok
    plan = planned(task)
    assert plan.energy == pytest.approx(alone.energy, rel=1e-6)
    batch = cf.reconfigure(**{**task, "obstacles": cf.stack(rocks)})
    assert batch.energy == plan.energy
    assert all(touch.first == 0 and 1 <= touch.second <= 3 for touch in plan.contacts)


@pytest.mark.parametrize("order", [None, (2, 0, 3, 1)])
def test_sequential_method_equals_repeated_avoid(order):
    task = crossing_task(ORBIT, 4, 2, cf.Sphere(25.0))
    plan = planned(task, method="sequential", order=order)
    known = []
    for k in order or range(4):
        direct = ORBIT.transfer(task["initial"][k], task["final"][k], 3000.0)
        path = cf.avoid(direct, known, cf.Sphere(25.0)).path if known else direct
        assert plan.paths[k].energy == pytest.approx(path.energy, rel=1e-6)
        known.append(plan.paths[k])
    assert not plan.proven
    assert planned(task).energy <= plan.energy * (1 + 1e-6)


# ---------------------------------------------------------------------------------------------
# Many spacecraft: brute force and symmetry.


def brute_force(task, plan, sides, seed=0):
    """Return the least extra energies by SLSQP from the plan and from random sides of each pair.

    Deviations are spanned by the kernels at nodes and contact times; zones are kept at samples.
    """
    n, duration, zone = task["orbit"].mean_motion, task["duration"], task["zone"]
    count = len(task["initial"])
    touched = sorted({touch.time for touch in plan.contacts})
    spread = np.linspace(0, duration, 9)[1:-1]
    nodes = np.array([*touched, *(t for t in spread if min(abs(t - s) for s in touched) > 0.04 * duration)])
    near = [t + duration * 0.004 * np.linspace(-1, 1, 17) for t in touched]
    times = np.unique(np.concatenate([np.linspace(0, duration, 122)[1:-1], *near]))
    gram = bridge(n, duration, nodes, nodes).transpose(0, 2, 1, 3).reshape(3 * len(nodes), -1)
    reach = bridge(n, duration, times, nodes).transpose(0, 2, 1, 3).reshape(3 * len(times), -1)
    lower = np.linalg.cholesky(gram + 1e-14 * np.diag(np.diag(gram)))
    own = np.linalg.solve(lower, reach.T).T.reshape(len(times), 3, -1)
    places = plan.direct.position(times)
    hindrances, gaps, spans = [], [], []
    for i in range(count):
        for j in range(i):
            signs = np.zeros(count)
            signs[i], signs[j] = 1, -1
            hindrances.append(Hindrance(None, zone.matrix, zone.shape == CUBE))
            gaps.append(places[i] - places[j])
            spans.append(np.einsum("tam,k->takm", own, signs).reshape(len(times), 3, -1))
    moved = (plan.paths.position(times) - places).reshape(count, -1)
    starts = [np.linalg.lstsq(own.reshape(-1, own.shape[2]), moved.T, rcond=1e-10)[0].T.ravel()]
    rng = np.random.default_rng(seed)
    for _ in range(sides):
        rows, wanted = [], []
        for hindrance, gap, span in zip(hindrances, gaps, spans, strict=True):
            deepest = hindrance.norms(gap).argmin()
            if hindrance.norms(gap[deepest]) < 1:
                side = rng.normal(size=3)
                side = np.linalg.solve(zone.matrix, 1.2 * side / np.linalg.norm(side))
                rows.append(span[deepest])
                wanted.append(side - gap[deepest])
        starts.append(np.linalg.lstsq(np.concatenate(rows), np.concatenate(wanted), rcond=None)[0])
    found = [settle(hindrances, gaps, spans, weights) for weights in starts]
    return [one[0] if one else np.inf for one in found]


@pytest.mark.parametrize(
    ("orbit", "count", "seed"),
    [(SPACE, 3, 1), (ORBIT, 3, 2), pytest.param(ORBIT, 4, 5, marks=pytest.mark.slow)],
)
def test_brute_force_finds_no_lower_energy(orbit, count, seed):
    task = crossing_task(orbit, count, seed, cf.Sphere(20.0))
    plan = planned(task)
    assert 1 < len(plan.contacts) <= 12  # limits the effort of brute force
    extra = plan.extra_energy
    own, *others = brute_force(task, plan, sides=4)
    assert own == pytest.approx(extra, rel=1e-4)  # a local optimum
    assert extra <= min(others) * (1 + GRAIN)


BACKWARDS = np.array([1, -1, 1, -1, 1, -1])  # Hill's equations run back in time with y reversed


def changed(task, how):
    """Return an equivalent problem and the factor on its energy."""
    orbit, duration = task["orbit"], task["duration"]
    initial, final, zone = task["initial"], task["final"], task["zone"]
    factor = 1.0
    if how == "lengths x 1000":
        initial, final, zone, factor = 1e3 * initial, 1e3 * final, zone.enlarged(1e3), 1e6
    elif how == "times x 50":
        slow = np.repeat([1, 1 / 50], 3)
        orbit, duration = cf.Orbit(orbit.mean_motion / 50), 50 * duration
        initial, final, factor = initial * slow, final * slow, 50.0**-3
    elif how == "permuted":
        order = np.random.default_rng(0).permutation(len(initial))
        initial, final = initial[order], final[order]
    elif how == "with a common natural motion":
        natural = np.array([300.0, -2000, 100, 0.4, -0.9, 0.2])
        initial, final = initial + natural, final + orbit.transition(duration) @ natural
    elif how == "upside down":
        flip = np.array([1, 1, -1, 1, 1, -1])
        initial, final, zone = initial * flip, final * flip, cf.Zone(zone.shape, zone.matrix * flip[:3])
    elif how == "backwards":
        initial, final = final * BACKWARDS, initial * BACKWARDS
        zone = cf.Zone(zone.shape, zone.matrix * BACKWARDS[:3])
    changes = {"orbit": orbit, "initial": initial, "final": final, "duration": duration, "zone": zone}
    return changes, factor


@pytest.fixture(scope="module", params=[SPACE, ORBIT], ids=["deep space", "orbit"])
def base(request):
    task = crossing_task(request.param, 4, 1, ELLIPSOID)
    return task, planned(task)


@pytest.mark.parametrize(
    "how",
    [
        "lengths x 1000",
        "times x 50",
        "permuted",
        "with a common natural motion",
        "upside down",
        "backwards",
    ],
)
def test_symmetries(base, how):
    task, plan = base
    again, factor = changed(task, how)
    other = cf.reconfigure(**again)
    assert other.ok, other.reason
    if how == "permuted":  # the search depends on the order of the spacecraft
        assert other.energy == pytest.approx(plan.energy, rel=1e-3)
        return
    assert other.energy == pytest.approx(factor * plan.energy, rel=1e-6)
    np.testing.assert_allclose(other.paths.energy, factor * plan.paths.energy, rtol=1e-4)
    assert len(other.contacts) == len(plan.contacts)


def test_time_shift(base):
    task, plan = base
    other = cf.reconfigure(**task, start=5e4)
    assert other.energy == pytest.approx(plan.energy, rel=1e-6)
    np.testing.assert_allclose(
        [touch.time - 5e4 for touch in other.contacts], [touch.time for touch in plan.contacts], atol=0.01
    )


def test_distant_groups_are_independent():
    """Two distant groups cost as much together as alone."""
    near, far = crossing_task(ORBIT, 3, 3, cf.Sphere(20.0)), crossing_task(ORBIT, 2, 2, cf.Sphere(20.0))
    away = np.array([0, 1e5, 0, 0, 0, 0])  # along the track: at rest there
    both = {end: np.concatenate([near[end], far[end] + away]) for end in ("initial", "final")}
    together = planned(near | both)
    assert together.energy == pytest.approx(planned(near).energy + planned(far).energy, rel=1e-6)


def test_natural_motion_needs_no_thrust():
    initial = np.array([[0, 100.0 * k, 0, 0, 0, 0] for k in range(4)])
    plan = planned(
        {"orbit": ORBIT, "initial": initial, "final": initial, "duration": 3000.0, "zone": cf.Sphere(30.0)}
    )
    assert plan.status == Status.CLEAR
    assert plan.energy == pytest.approx(0, abs=1e-25)
    assert plan.contacts == ()
    assert plan.proven


def test_clear_direct_paths_are_kept():
    task = crossing_task(ORBIT, 5, 4, cf.Sphere(0.001))
    plan = planned(task)
    assert plan.status == Status.CLEAR
    assert plan.energy == plan.lower_bound
    assert plan.gap == 0
    assert plan.proven
    np.testing.assert_array_equal(plan.paths.state(1234.5), plan.direct.state(1234.5))


def test_larger_zone_of_a_pair_applies():
    task = crossing_task(SPACE, 3, 1, None)
    small, large = cf.Sphere(12.0), cf.Sphere(24.0)
    one = planned(task | {"zone": [large, small, small]})
    same = planned(task | {"zone": [large, None, small]})
    all_large = planned(task | {"zone": large})
    assert one.energy < all_large.energy
    assert same.energy <= one.energy
    assert planned(task | {"zone": [large, large, None]}).energy == pytest.approx(all_large.energy, rel=1e-6)
    assert planned(task | {"zone": [None, None, None]}).status == Status.CLEAR


# ---------------------------------------------------------------------------------------------
# Slots.


def costs(task):
    return task["orbit"].transfer(task["initial"][:, None], task["final"], task["duration"]).energy


@pytest.mark.parametrize(("craft", "slots"), [(1, 3), (4, 4), (5, 6)])
@pytest.mark.parametrize("orbit", [SPACE, ORBIT])
def test_assignment_is_optimal(orbit, craft, slots):
    rng = np.random.default_rng(10 * craft + slots)
    states = rng.normal(size=(2, 6, 6)) * np.repeat([200.0, 0.05], 3)
    task = {
        "orbit": orbit,
        "initial": states[0, :craft],
        "final": states[1, :slots],
        "duration": 2500.0,
        "zone": cf.Sphere(0.01),
    }
    plan = planned(task, assign=True)
    matrix = costs(task)
    best = min(permutations(range(slots), craft), key=lambda p: sum(matrix[k, s] for k, s in enumerate(p)))
    assert tuple(plan.slots) == best
    assert plan.energy == pytest.approx(sum(matrix[k, s] for k, s in enumerate(best)), rel=1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_assignment_with_conflicts_costs_no_more_than_the_plain_one(seed):
    task = crossing_task(ORBIT, 5, seed, cf.Sphere(30.0), spread=200.0)
    plan = planned(task, assign=True)
    plain = linear_sum_assignment(costs(task))[1]
    fixed = cf.reconfigure(**{**task, "final": task["final"][plain]})
    if fixed.ok and not fixed.measures and not plan.measures:
        assert plan.energy <= fixed.energy * (1 + 1e-9)
    assert plan.lower_bound == pytest.approx(costs(task)[range(5), plain].sum(), rel=1e-9)


# ---------------------------------------------------------------------------------------------
# Thrust limits and missing plans.


def line_abreast(distance=60.0):
    """Return three spacecraft side by side that move ahead by `distance` from rest in deep space."""
    initial = np.array([[0, 0, 100.0 * k, 0, 0, 0] for k in range(3)])
    return {
        "orbit": SPACE,
        "initial": initial,
        "final": initial + [distance, 0, 0, 0, 0, 0],
        "duration": 100.0,
        "zone": cf.Sphere(10.0),
    }


def test_thrust_limit_extends_the_duration():
    """From rest to rest over d in T the peak is 6 d / T^2."""
    limit = 6 * 60.0 / 400.0**2
    plan = planned(line_abreast(), max_acceleration=limit)
    assert plan.measures
    assert plan.durations.max() == pytest.approx(400.0, rel=1e-6)
    assert plan.late == pytest.approx(300.0, rel=1e-5)
    assert "late 300 s" in repr(plan).replace("\n ", "")
    assert plan.paths.peak_thrust.max() <= limit * (1 + 1e-9)
    assert any("longer" in line or "durat" in line for line in plan.measures)


def test_individual_thrust_limits():
    task = line_abreast()
    plan = planned(task, max_acceleration=[1.0, 6 * 60.0 / 150.0**2, 1.0])
    assert plan.durations[1] == pytest.approx(150.0, rel=1e-6)
    loose = planned(task, max_acceleration=[1.0, 1.0, 1.0])
    assert loose.measures == ()
    assert loose.late == 0.0
    assert loose.energy == planned(task).energy


@pytest.mark.parametrize("orbit", [SPACE, ORBIT])
def test_thrust_limit_with_contacts(orbit):
    task = crossing_task(orbit, 3, 2, cf.Sphere(20.0))
    free = planned(task)
    limits = 0.5 * free.paths.peak_thrust
    plan = planned(task, max_acceleration=limits)  # `faults` samples the thrust
    assert (plan.paths.peak_thrust <= limits * (1 + 1e-9)).all()
    assert plan.durations.max() > 3000.0
    assert plan.measures


def test_too_weak_without_extension():
    plan = cf.reconfigure(**line_abreast(), max_acceleration=[1.0, 1.0, 6 * 60.0 / 400.0**2], if_blocked=())
    assert_no_plan(plan, Status.TOO_WEAK)
    assert "2" in plan.reason
    only_stagger = cf.reconfigure(**line_abreast(), max_acceleration=1e-4, if_blocked=("stagger",))
    assert_no_plan(only_stagger, Status.TOO_WEAK)


def assert_no_plan(plan, status):
    assert plan.status == status
    assert not plan.ok
    assert plan.paths is None
    assert plan.reason
    assert np.isnan([plan.energy, plan.delta_v, plan.gap]).all()
    assert not plan.proven


TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)


def caged(until):
    """Return a task whose second spacecraft is inside four overlapping spheres until a time."""
    return {
        "orbit": SPACE,
        "initial": np.array([[1200.0, 1200, 0, 0, 0, 0], np.zeros(6)]),
        "final": np.array([[0, 1200.0, 0, 0, 0.05, 0], [1200, 0, 0, 0.2, 0, 0.1]]),
        "duration": 1000.0,
        "zone": cf.Sphere(285.0),
        "obstacles": [SPACE.coast([*wall, 0, 0, 0], until) for wall in 300 * TETRAHEDRON],
    }


@pytest.mark.slow
def test_missing_plan_names_the_pair_and_the_measures():
    none = cf.reconfigure(**caged(1e6), if_blocked=())
    assert_no_plan(none, Status.NOT_FOUND)
    assert none.measures == ()
    plan = cf.reconfigure(**caged(1e6), if_blocked=("more sides",))
    assert_no_plan(plan, Status.NOT_FOUND)
    assert len(plan.measures) == 1
    assert plan.measures[0].startswith("more sides")
    for one in (none, plan):
        assert one.blocked is not None
        assert one.blocked[0] == 1
        assert 2 <= one.blocked[1] < 6
        assert "craft 1" in one.reason
        assert f"obstacle {one.blocked[1] - 1} of 4" in one.reason


@pytest.mark.slow
@pytest.mark.parametrize("way", ["longer", "stagger"])
def test_measures_are_reported(way):
    """The cage is gone after the requested time."""
    plan = planned(caged(1000.0), if_blocked=(way,))
    assert plan.measures
    assert all(line.startswith(way) for line in plan.measures)
    assert plan.paths.end.min() == pytest.approx(1000.0 + plan.late)
    assert plan.late > 0.0
    if way == "longer":
        assert (plan.starts == 0).all()
    else:
        assert plan.starts.max() > 0


# ---------------------------------------------------------------------------------------------
# Invalid input.


@pytest.mark.parametrize("end", ["initial", "final"])
@pytest.mark.parametrize("orbit", [SPACE, ORBIT])
def test_ends_in_conflict(end, orbit):
    task = crossing_task(orbit, 4, 2, cf.Sphere(10.0))
    task[end][3] = task[end][1] + [0, 2.5, 0, 0, 0, 0]
    plan = cf.reconfigure(**task)
    assert_no_plan(plan, Status.END_INSIDE)
    assert plan.blocked == (1, 3)
    assert "0.25 x zone" in plan.reason
    assert "1" in plan.reason
    assert "3" in plan.reason


def test_rejected_plan_keeps_its_horizon():
    task = crossing_task(ORBIT, 4, 2, cf.Sphere(10.0))
    task["final"][3] = task["final"][1] + [0, 2.5, 0, 0, 0, 0]
    plan = cf.reconfigure(**task, drift=100.0)
    assert_no_plan(plan, Status.END_INSIDE)
    assert plan.drift == 100.0


def test_end_inside_the_zone_of_an_obstacle():
    task = crossing_task(SPACE, 2, 2, cf.Sphere(10.0))
    rock = SPACE.coast(task["final"][1] * [1, 1, 1, 0, 0, 0] + [0, 0, 5.0, 0, 0, 0], 3000.0)
    plan = cf.reconfigure(**task, obstacles=[rock])
    assert_no_plan(plan, Status.END_INSIDE)
    assert plan.blocked == (1, 2)
    assert "0.50 x zone" in plan.reason


def refusals():
    task = line_abreast()
    initial, final = task["initial"], task["final"]
    plate, rod = cf.Ellipsoid([30.0, 30, 5]), cf.Ellipsoid([5.0, 5, 30])
    elsewhere = cf.Orbit(1e-3).coast(np.zeros(6), 100.0)
    nan = initial.copy()
    nan[1, 2] = np.nan
    return {
        "fewer slots": ({"final": final[:2], "assign": True}, "final: .*3 craft.*2|final: .*2.*3 craft"),
        "slots unassigned": ({"final": np.concatenate([final, final + 1000])}, "final"),
        "nan": ({"initial": nan}, "initial"),
        "inf": ({"final": final * [np.inf, 1, 1, 1, 1, 1]}, "final"),
        "initial (3, 5)": ({"initial": initial[:, :5]}, "initial"),
        "initial (6,)": ({"initial": initial[0], "final": final[0]}, "initial"),
        "no craft": ({"initial": initial[:0], "final": final[:0]}, "initial"),
        "durations": ({"duration": [100.0, 100.0]}, "duration"),
        "negative duration": ({"duration": -1.0}, "duration"),
        "zero duration": ({"duration": [100.0, 0.0, 100.0]}, "duration"),
        "starts": ({"start": [0.0, 1.0]}, "start"),
        "nan start": ({"start": np.nan}, "start"),
        "zones": ({"zone": [cf.Sphere(1.0)] * 2}, "zone"),
        "zone number": ({"zone": 10.0}, "zone"),
        "zones that do not nest": ({"zone": [plate, rod, None]}, "0.*1.*neither zone contains"),
        "orbit of an obstacle": ({"obstacles": [elsewhere]}, "obstacles"),
        "no obstacle at all": ({"obstacles": [None]}, "obstacles"),
        "limits": ({"max_acceleration": [1.0, 1.0]}, "max_acceleration"),
        "no thrust": ({"max_acceleration": 0.0}, "max_acceleration"),
        "nan thrust": ({"max_acceleration": np.nan}, "max_acceleration"),
        "unknown way out": ({"if_blocked": ("pray",)}, "if_blocked.*pray"),
        "a word for a list": ({"if_blocked": "longer"}, "if_blocked"),
        "method": ({"method": "best"}, "method.*best"),
        "order": ({"method": "sequential", "order": [0, 1, 1]}, "order"),
        "short order": ({"method": "sequential", "order": [0, 1]}, "order"),
        "order of a joint plan": ({"order": [2, 1, 0]}, "order"),
    }


def test_invalid_input():
    for name in refusals():
        changes, words = refusals()[name]
        with pytest.raises(ValueError, match=words) as refusal:
            cf.reconfigure(**{**line_abreast(), **changes})
        assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("cost", ["energy", "delta-v"])
def test_ends_at_the_boundary_of_a_zone(cost):
    """An end 1e-10 outside is clear; one 1e-7 inside is not."""
    space = cf.Orbit(0.0)
    near, sphere = space.coast(np.zeros(6), 1000.0), (None, cf.Sphere(20.0))

    def planned(end):
        ends = [[0, 200.0, 0, 0, 0, 0]], [[0, end, 0, 0, 0, 0]]
        return cf.reconfigure(space, *ends, 1000.0, sphere, obstacles=near, cost=cost)

    kept = planned(20.0 * (1.0 + 1e-10))
    assert kept.status is Status.CLEAR
    assert kept.paths[0].position(1000.0)[1] > 20.0
    assert planned(20.0 * (1.0 - 1e-7)).status is Status.END_INSIDE
