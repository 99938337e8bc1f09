"""`reconfigure` against brute force, an integrator, `avoid`, and the symmetries of Hill's equations."""

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
from reflown import faults, fly

N = 1.1e-3
ORBIT, SPACE = cf.Orbit(N), cf.Orbit(0.0)
TILT = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
ELLIPSOID = cf.Ellipsoid([20.0, 40.0, 25.0], axes=TILT)
# Brute force keeps zones at samples only and cannot follow the optimum better than this.
GRAIN = 5e-3  # of the extra energy


def meeting(orbit, count, seed, duration=3000.0, miss=4.0, when=0.45, spread=150.0):
    """Initial and final states of craft whose direct paths come within some `miss` of one point."""
    rng = np.random.default_rng(seed)
    ends = rng.normal(size=(2, count, 6)) * np.repeat([spread, spread / duration], 3)
    at = orbit.transfer(*ends, duration).state(when * duration)
    at[:, :3] += rng.normal(size=(count, 3)) * miss
    at[:, 3:] = 0.0
    # natural motion may be taken off: it costs nothing
    back, ahead = orbit.transition([-when * duration, (1 - when) * duration])
    return ends[0] - at @ back.T, ends[1] - at @ ahead.T


def asked(orbit, count, seed, zone, duration=3000.0, **how):
    initial, final = meeting(orbit, count, seed, duration, **how)
    return {"orbit": orbit, "initial": initial, "final": final, "duration": duration, "zone": zone}


def planned(task, **more):
    """The plan, which must be there and stand being flown again."""
    plan = cf.reconfigure(**task, **more)
    assert plan.ok, plan.reason
    assert faults(plan, **{**task, **more}) == []
    return plan


# ---------------------------------------------------------------------------------------------
# The checks themselves see what is wrong.


@pytest.fixture(scope="module")
def by_hand():
    """Two craft on direct paths, clear of each other and of a third that coasts: a plan without a planner."""
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
        paths.delta_v.sum(),
        direct.energy.sum(),
        (),
        Status.CLEAR,
        "no conflict",
    )


def bent(task, **sizes):
    """The first craft's path in two legs through a place a little aside."""
    own = task["orbit"].transfer(task["initial"][0], task["final"][0], 2000.0)
    via = own.state(800.0) + [0, 0, 0.5, 0, 0, 0]
    legs = [
        task["orbit"].transfer(task["initial"][0], via, 800.0),
        task["orbit"].transfer(via, task["final"][0], 1200.0, 800.0),
    ]
    other = task["orbit"].transfer(task["initial"][1], task["final"][1], 2000.0)
    return by_paths(task, cf.stack([cf.join(legs), other]))


LIES = {
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


@pytest.mark.parametrize("name", LIES)
def test_a_false_plan_is_seen_through(name, by_hand):
    task, plan = by_hand
    lie, words = LIES[name]
    said = faults(lie(task, plan), **task)
    assert any(words in one for one in said) if words else said == []


def test_a_conflict_is_seen(by_hand):
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


def test_a_weak_thruster_is_seen(by_hand):
    task, plan = by_hand
    peak = plan.paths.peak_thrust
    assert faults(plan, **task, max_acceleration=peak) == []
    assert len(faults(plan, **task, max_acceleration=peak * [0.999, 1.0])) == 1


def test_the_integrator_knows_natural_motion():
    state = np.array([30.0, -40, 20, 0.02, -0.05, 0.01])
    path = ORBIT.coast(state, 6000.0)
    there = fly(ORBIT, path, state, 0.0).state(np.array([6000.0]))[0]
    np.testing.assert_allclose(there, expm(hill(N) * 6000.0) @ state, rtol=0, atol=1e-8)


# ---------------------------------------------------------------------------------------------
# Two craft: what a touch must cost at least.


def onto_surface(stiffness, gap, matrix):
    """Least ½ (q - gap)' stiffness (q - gap) over q on the surface |matrix q| = 1, from a gap within."""
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
    """A lower bound of two craft's extra energy: the dearest instant at which they must be apart.

    At each instant every clear plan is outside the zone; theory (11, 12) is what that costs.
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
def test_two_craft_cost_what_a_touch_must_cost(name):
    """Where they touch once, the plan costs the lower bound: nothing is cheaper, on any side."""
    orbit, zone, how = TWO[name]
    once = 0
    for seed in range(6):
        task = asked(orbit, 2, seed, zone, **how)
        plan = cf.reconfigure(**task)
        if plan.status == Status.END_INSIDE:
            continue
        assert plan.ok, plan.reason
        assert faults(plan, **task) == []
        extra, least = plan.extra_energy, least_extra(task)
        # planned 1e-9 outside of the zone
        assert extra >= least * (1 - 1e-7) - 1e-12 * plan.energy
        if len(plan.contacts) == 1 and plan.proven:
            once += 1
            assert extra == pytest.approx(least, rel=1e-6, abs=1e-11 * plan.energy)
    assert once >= 2


@pytest.mark.parametrize("orbit", [SPACE, ORBIT])
def test_windows_of_their_own(orbit):
    """The second craft starts later and arrives earlier: it does less of the moving."""
    starts, durations = np.array([0.0, 400.0]), np.array([3000.0, 2200.0])
    task = asked(orbit, 2, 3, cf.Sphere(30.0))
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
# Against `avoid`, which moves one craft.


@pytest.mark.parametrize("orbit", [SPACE, ORBIT])
def test_two_share_the_deviation_and_halve_its_energy(orbit):
    """With one time for both the kernels are equal: each moves half of what one alone would."""
    task = asked(orbit, 2, 2, cf.Sphere(30.0))
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
@pytest.mark.parametrize("seed", range(3))
def test_one_craft_among_obstacles_is_avoided_as_avoid_does(orbit, seed):
    task = asked(orbit, 4, seed, ELLIPSOID)
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
def test_sequential_is_a_chain_of_avoid(order):
    task = asked(ORBIT, 4, 2, cf.Sphere(25.0))
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
# Many craft: brute force, and what symmetry asks.


def brute_force(task, plan, sides, seed=0):
    """Least total extra energy by SLSQP from the plan itself and from random sides of every pair.

    Deviations are spanned by each craft's kernel at some nodes and at the plan's touches, zones
    kept at many times, most of them near the touches: nothing else of the plan is used.
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


@pytest.mark.parametrize(("orbit", "count", "seed"), [(SPACE, 3, 1), (ORBIT, 3, 2), (ORBIT, 4, 5)])
def test_brute_force_finds_nothing_cheaper(orbit, count, seed):
    task = asked(orbit, count, seed, cf.Sphere(20.0))
    plan = planned(task)
    assert 1 < len(plan.contacts) <= 12  # or brute force takes for ever
    extra = plan.extra_energy
    own, *others = brute_force(task, plan, sides=4)
    assert own == pytest.approx(extra, rel=1e-4)  # a local optimum
    assert extra <= min(others) * (1 + GRAIN)


BACKWARDS = np.array([1, -1, 1, -1, 1, -1])  # Hill's equations run back in time with y reversed


def changed(task, how):
    """The same problem in another guise, and the factor on its energy."""
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
    task = asked(request.param, 4, 1, ELLIPSOID)
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
def test_the_same_problem_in_another_guise_costs_the_same(base, how):
    task, plan = base
    again, factor = changed(task, how)
    other = cf.reconfigure(**again)
    assert other.ok, other.reason
    if how == "permuted":  # ways are tried in the order of the craft, and not all
        assert other.energy == pytest.approx(plan.energy, rel=1e-3)
        return
    assert other.energy == pytest.approx(factor * plan.energy, rel=1e-6)
    np.testing.assert_allclose(other.paths.energy, factor * plan.paths.energy, rtol=1e-4)
    assert len(other.contacts) == len(plan.contacts)


def test_later_is_the_same(base):
    task, plan = base
    other = cf.reconfigure(**task, start=5e4)
    assert other.energy == pytest.approx(plan.energy, rel=1e-6)
    np.testing.assert_allclose(
        [touch.time - 5e4 for touch in other.contacts], [touch.time for touch in plan.contacts], atol=0.01
    )


def test_strangers_do_not_matter():
    """Two groups, far from each other, are planned together as each alone."""
    near, far = asked(ORBIT, 3, 3, cf.Sphere(20.0)), asked(ORBIT, 2, 2, cf.Sphere(20.0))
    away = np.array([0, 1e5, 0, 0, 0, 0])  # along the track: at rest there
    both = {end: np.concatenate([near[end], far[end] + away]) for end in ("initial", "final")}
    together = planned(near | both)
    assert together.energy == pytest.approx(planned(near).energy + planned(far).energy, rel=1e-6)


def test_who_need_not_move_does_not():
    """Craft on natural motions clear of each other: nothing to do, at no cost, and no gap."""
    initial = np.array([[0, 100.0 * k, 0, 0, 0, 0] for k in range(4)])
    plan = planned(
        {"orbit": ORBIT, "initial": initial, "final": initial, "duration": 3000.0, "zone": cf.Sphere(30.0)}
    )
    assert plan.status == Status.CLEAR
    assert plan.energy == pytest.approx(0, abs=1e-25)
    assert plan.contacts == ()
    assert plan.proven


def test_clear_formations_fly_direct():
    task = asked(ORBIT, 5, 4, cf.Sphere(0.001))
    plan = planned(task)
    assert plan.status == Status.CLEAR
    assert plan.energy == plan.lower_bound
    assert plan.gap == 0
    assert plan.proven
    np.testing.assert_array_equal(plan.paths.state(1234.5), plan.direct.state(1234.5))


def test_of_two_zones_the_larger_holds():
    task = asked(SPACE, 3, 1, None)
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


@pytest.mark.parametrize(("craft", "slots"), [(1, 3), (4, 4), (5, 6), (6, 6)])
@pytest.mark.parametrize("orbit", [SPACE, ORBIT])
def test_slots_are_those_of_all_permutations(orbit, craft, slots):
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


@pytest.mark.parametrize("seed", range(4))
def test_assignment_in_conflict_is_never_dearer_than_the_plain_one(seed):
    task = asked(ORBIT, 5, seed, cf.Sphere(30.0), spread=200.0)
    plan = planned(task, assign=True)
    plain = linear_sum_assignment(costs(task))[1]
    fixed = cf.reconfigure(**{**task, "final": task["final"][plain]})
    if fixed.ok and not fixed.measures and not plan.measures:
        assert plan.energy <= fixed.energy * (1 + 1e-9)
    assert plan.lower_bound == pytest.approx(costs(task)[range(5), plain].sum(), rel=1e-9)


# ---------------------------------------------------------------------------------------------
# Limits, and what happens where there is no plan.


def line_abreast(distance=60.0):
    """Three craft side by side, far from each other, each `distance` ahead; deep space, at rest."""
    initial = np.array([[0, 0, 100.0 * k, 0, 0, 0] for k in range(3)])
    return {
        "orbit": SPACE,
        "initial": initial,
        "final": initial + [distance, 0, 0, 0, 0, 0],
        "duration": 100.0,
        "zone": cf.Sphere(10.0),
    }


def test_a_thrust_limit_makes_it_as_long_as_it_must_be():
    """From rest to rest over d in T the peak is 6 d / T^2."""
    limit = 6 * 60.0 / 400.0**2
    plan = planned(line_abreast(), max_acceleration=limit)
    assert plan.measures
    assert plan.durations.max() == pytest.approx(400.0, rel=1e-6)
    assert plan.paths.peak_thrust.max() <= limit * (1 + 1e-9)
    assert any("longer" in line or "durat" in line for line in plan.measures)


def test_each_craft_has_its_own_limit():
    task = line_abreast()
    plan = planned(task, max_acceleration=[1.0, 6 * 60.0 / 150.0**2, 1.0])
    assert plan.durations[1] == pytest.approx(150.0, rel=1e-6)
    loose = planned(task, max_acceleration=[1.0, 1.0, 1.0])
    assert loose.measures == ()
    assert loose.energy == planned(task).energy


@pytest.mark.parametrize("orbit", [SPACE, ORBIT])
def test_a_limit_holds_where_craft_meet(orbit):
    task = asked(orbit, 3, 2, cf.Sphere(20.0))
    free = planned(task)
    limits = 0.5 * free.paths.peak_thrust
    plan = planned(task, max_acceleration=limits)  # `faults` samples the thrust
    assert (plan.paths.peak_thrust <= limits * (1 + 1e-9)).all()
    assert plan.durations.max() > 3000.0
    assert plan.measures


def test_too_weak_where_nothing_may_be_longer():
    plan = cf.reconfigure(**line_abreast(), max_acceleration=[1.0, 1.0, 6 * 60.0 / 400.0**2], if_blocked=())
    refused(plan, Status.TOO_WEAK)
    assert "2" in plan.reason
    only_stagger = cf.reconfigure(**line_abreast(), max_acceleration=1e-4, if_blocked=("stagger",))
    refused(only_stagger, Status.TOO_WEAK)


def refused(plan, status):
    assert plan.status == status
    assert not plan.ok
    assert plan.paths is None
    assert plan.reason
    assert np.isnan([plan.energy, plan.delta_v, plan.gap]).all()
    assert not plan.proven


TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)


def caged(until):
    """The second craft is in a cage of four overlapping spheres, gone after `until`; the first is outside."""
    return {
        "orbit": SPACE,
        "initial": np.array([[1200.0, 1200, 0, 0, 0, 0], np.zeros(6)]),
        "final": np.array([[0, 1200.0, 0, 0, 0.05, 0], [1200, 0, 0, 0.2, 0, 0.1]]),
        "duration": 1000.0,
        "zone": cf.Sphere(285.0),
        "obstacles": [SPACE.coast([*wall, 0, 0, 0], until) for wall in 300 * TETRAHEDRON],
    }


@pytest.mark.slow
def test_no_plan_names_the_pair_and_what_was_tried():
    none = cf.reconfigure(**caged(1e6), if_blocked=())
    refused(none, Status.NOT_FOUND)
    assert none.measures == ()
    plan = cf.reconfigure(**caged(1e6), if_blocked=("more sides",))
    refused(plan, Status.NOT_FOUND)
    assert len(plan.measures) == 1
    assert plan.measures[0].startswith("more sides")
    for one in (none, plan):
        assert one.blocked is not None
        assert one.blocked[0] == 1
        assert 2 <= one.blocked[1] < 6
        assert f"craft 1 and obstacle {one.blocked[1] - 2}" in one.reason


@pytest.mark.parametrize("way", [pytest.param("longer", marks=pytest.mark.slow), "stagger"])
def test_a_way_out_is_taken_openly(way):
    """The cage is there for the time asked for; later it is gone."""
    plan = planned(caged(1000.0), if_blocked=(way,))
    assert plan.measures
    assert all(line.startswith(way) for line in plan.measures)
    assert plan.paths.end.min() > 1000.0
    if way == "longer":
        assert (plan.starts == 0).all()
    else:
        assert plan.starts.max() > 0


# ---------------------------------------------------------------------------------------------
# What is refused.


@pytest.mark.parametrize("end", ["initial", "final"])
@pytest.mark.parametrize("orbit", [SPACE, ORBIT])
def test_ends_in_conflict_are_named(end, orbit):
    task = asked(orbit, 4, 2, cf.Sphere(10.0))
    task[end][3] = task[end][1] + [0, 2.5, 0, 0, 0, 0]
    plan = cf.reconfigure(**task)
    refused(plan, Status.END_INSIDE)
    assert plan.blocked == (1, 3)
    assert "0.25 x zone" in plan.reason
    assert "1" in plan.reason
    assert "3" in plan.reason


def test_a_plan_refused_for_its_ends_says_its_drift():
    task = asked(ORBIT, 4, 2, cf.Sphere(10.0))
    task["final"][3] = task["final"][1] + [0, 2.5, 0, 0, 0, 0]
    plan = cf.reconfigure(**task, drift=100.0)
    refused(plan, Status.END_INSIDE)
    assert plan.drift == 100.0


def test_an_end_inside_an_obstacles_zone_is_named():
    task = asked(SPACE, 2, 2, cf.Sphere(10.0))
    rock = SPACE.coast(task["final"][1] * [1, 1, 1, 0, 0, 0] + [0, 0, 5.0, 0, 0, 0], 3000.0)
    plan = cf.reconfigure(**task, obstacles=[rock])
    refused(plan, Status.END_INSIDE)
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
        "zones that do not nest": ({"zone": [plate, rod, None]}, "0.*1.*neither zone holds"),
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


def test_bad_input_is_refused():
    for name in refusals():
        changes, words = refusals()[name]
        with pytest.raises(ValueError, match=words) as refusal:
            cf.reconfigure(**{**line_abreast(), **changes})
        assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("cost", ["energy", "delta-v"])
def test_clear_paths_that_end_beside_a_zone_are_kept(cost):
    """A tenth of a nanometre per metre outside is clear; as much inside is not."""
    space = cf.Orbit(0.0)
    near, sphere = space.coast(np.zeros(6), 1000.0), (None, cf.Sphere(20.0))

    def planned(end):
        ends = [[0, 200.0, 0, 0, 0, 0]], [[0, end, 0, 0, 0, 0]]
        return cf.reconfigure(space, *ends, 1000.0, sphere, obstacles=near, cost=cost)

    kept = planned(20.0 * (1.0 + 1e-10))
    assert kept.status is Status.CLEAR
    assert kept.paths[0].position(1000.0)[1] > 20.0
    assert planned(20.0 * (1.0 - 1e-7)).status is Status.END_INSIDE
