"""Realization of plans by thrusters: bounds, an independent integrator, zones and refusals."""

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import linprog

import closeform as cf
from closeform.fuel.allocation import Allocation
from firings import CUBE, clustered, deviation, modulated, reflown

ORBIT = cf.Orbit.circular(500e3)
N = ORBIT.mean_motion
A = np.array([0.0, 200, 0, 0, 0, 0])
B = np.array([40.0, -150, 60, 0, -2 * N * 40, 0.02])
MOVE = ORBIT.transfer(A, B, 3000.0)
BURNS = ORBIT.impulsive(A, B, 3000.0)
SIX = cf.Thrusters.rtn(acceleration=2e-3, period=30.0)


def test_bound_holds_for_random_plans():
    """Random plans of optimal and constant thrust, impulses, and all of them."""
    ratios = []
    for seed in range(30):
        firing = cf.fire_thrusters(*modulated(np.random.default_rng(seed)))
        off = deviation(firing, looks=12)
        assert off <= firing.deviation_bound, seed
        assert off >= firing.deviation * (1 - 1e-9) or off >= 0.98 * firing.deviation
        ratios.append(firing.deviation_bound / off)
    assert np.median(ratios) < 2.0


def test_bound_holds_with_decreasing_mass():
    """An independent integrator with decreasing mass stays within the bound."""
    burned = []
    for seed in range(5000, 5014):
        rng = np.random.default_rng(seed)
        path, thrusters = modulated(rng)
        impulse = 2 * path.delta_v / 9.80665 / rng.uniform(0.01, 0.5)
        firing = cf.fire_thrusters(path, thrusters, 10.0, impulse)
        if len(firing.pulses) > 100:
            continue
        edges, states = reflown(firing, 10.0, impulse)
        planned = firing.planned.position(edges.clip(firing.planned.start, firing.planned.end))
        assert np.linalg.norm(states[:, :3] - planned, axis=1).max() <= firing.deviation_bound, seed
        assert states[-1, 6] == pytest.approx(10.0 - firing.propellant, rel=1e-12)
        burned.append(firing.propellant / 10.0)
    assert len(burned) > 4
    assert max(burned) > 0.1


@pytest.mark.parametrize(
    ("kind", "frame"), [("transfer", "orbit"), ("impulses", "inertial"), ("burn", "inertial")]
)
def test_pulses_agree_with_an_independent_integrator(kind, frame):
    """With decreasing mass, plan and path are within the bound."""
    path = {
        "transfer": ORBIT.transfer(A, B, 1500.0),
        "impulses": ORBIT.two_impulse(A, B, 1500.0),
        "burn": ORBIT.burn(A, [1e-3, 2e-4, -3e-4], 600.0, frame=frame),
    }[kind]
    thrusters = cf.Thrusters.rtn(frame, acceleration=0.01, period=40.0)
    mass, impulse = 12.0, 20.0
    firing = cf.fire_thrusters(path, thrusters, mass, impulse)
    edges, states = reflown(firing, mass, impulse)
    off = np.linalg.norm(states[:, :3] - firing.planned.position(edges), axis=1).max()
    assert off <= firing.deviation_bound
    constant = cf.fire_thrusters(path, thrusters)
    beside = np.linalg.norm(states[:, :3] - firing.path.position(edges), axis=1).max()
    assert beside <= firing.deviation_bound - 0.9 * constant.deviation_bound
    assert states[-1, 6] == pytest.approx(mass - firing.propellant, rel=1e-12)


def test_propellant_by_the_rocket_equation():
    """Compare with the rocket equation in 40 digits."""
    firing = cf.fire_thrusters(MOVE, SIX, mass=12.0, specific_impulse=60.0)
    mpmath.mp.dps = 40
    spent = mpmath.fsum(map(float, firing.pulses.impulse))
    burned = 12 * (1 - mpmath.exp(-spent / (mpmath.mpf(60) * mpmath.mpf("9.80665"))))
    assert firing.propellant == pytest.approx(float(burned), rel=1e-12)
    assert firing.delta_v == pytest.approx(float(spent), rel=1e-14)
    flow = 12.0 * 2e-3 / (60.0 * 9.80665)
    assert np.allclose(firing.pulses.propellant, flow * firing.pulses.duration, rtol=1e-14)
    assert np.isnan(cf.fire_thrusters(MOVE, SIX).propellant)


def test_pulses_have_the_planned_delta_v_and_centroid():
    """Compare each pulse with quadrature of the planned thrust over its period."""
    firing = cf.fire_thrusters(MOVE, SIX)
    pulses = firing.pulses
    for k in range(0, len(pulses), 17):
        axis, sign = int(pulses.thruster[k]) // 2, 1.0 - 2.0 * (pulses.thruster[k] % 2)
        middle = pulses.start[k] + 0.5 * pulses.duration[k]
        low = 30.0 * np.floor(middle / 30.0)

        def push(t, axis=axis, sign=sign):
            return max(sign * MOVE.thrust(t)[axis], 0.0)

        whole = quad(push, low, low + 30.0, epsabs=1e-14, limit=200)[0]
        moment = quad(lambda t, push=push: t * push(t), low, low + 30.0, epsabs=1e-11, limit=200)[0]
        assert pulses.impulse[k] == pytest.approx(whole, rel=1e-9, abs=1e-12)
        assert middle == pytest.approx(moment / whole, abs=1e-4)
        assert pulses.duration[k] * 2e-3 == pytest.approx(pulses.impulse[k], rel=1e-12)


@pytest.mark.parametrize("directions", [cf.Thrusters.rtn().directions, CUBE, CUBE[[0, 3, 5, 6]], CUBE[:4]])
def test_allocation_has_the_minimum_sum(directions):
    """Compare with a linear program; infeasible thrust needs an artificial direction."""
    allocation, rng = Allocation.of(directions), np.random.default_rng(8)
    for wanted in np.concatenate([rng.normal(size=(60, 3)), np.eye(3), -np.eye(3)]):
        facet = allocation.facets(wanted[None], 1e-9)
        sizes, corners = allocation.amounts(facet, wanted[None])[0], allocation.corners[facet[0]]
        done = linprog(np.ones(len(directions)), A_eq=directions.T, b_eq=wanted, bounds=(0, None))
        made = sizes[corners < len(directions)]
        if done.status == 0:
            assert sizes.min() > -1e-8
            assert made.sum() == pytest.approx(done.fun, rel=1e-5)  # tie-breaking of 1e-6
            assert sizes[corners >= len(directions)].sum() < 1e-8
        else:
            assert sizes[corners >= len(directions)].max() > 1e-3


def test_impulse_becomes_a_centred_burn():
    """A burn deviates by q w / 8 from its impulse, also at both ends of the plan."""
    path = ORBIT.two_impulse(A, B, 1500.0)
    firing = cf.fire_thrusters(path, cf.Thrusters.rtn(acceleration=5e-3))
    assert firing.path.start < path.start
    assert firing.path.end > path.end
    for time, jump in path.impulses:
        own = np.abs(firing.pulses.start + firing.pulses.duration / 2 - time) < 1e-9
        given = firing.pulses.direction[own] * firing.pulses.impulse[own, None]
        assert np.allclose(given.sum(axis=0), jump, atol=1e-12)
    width, impulse = firing.pulses.duration, firing.pulses.impulse
    axes = [max((width * impulse / 8)[firing.pulses.thruster // 2 == axis]) for axis in range(3)]
    assert 0.9 * max(axes) < firing.deviation <= firing.deviation_bound < 1.2 * np.linalg.norm(axes)


def test_full_thrust_is_one_burn():
    push = ORBIT.burn(A, [0.0, 1e-3, 0.0], 600.0)
    firing = cf.fire_thrusters(push, cf.Thrusters.rtn(acceleration=1e-3, period=30.0))
    assert len(firing.pulses) == 1
    assert (firing.pulses.start[0], firing.pulses.duration[0]) == pytest.approx((0.0, 600.0))
    assert firing.deviation < 1e-9
    assert firing.deviation_bound < 1e-3


def test_final_impulse_below_the_minimum_bit():
    """A final impulse below the minimum bit is dropped, and the position is still met."""
    orbit = cf.Orbit.circular(500e3)
    begin, late = np.array([0.0, -100, 0, 0, 0, 0]), np.array([0, 0, 0, 0, 2e-4, 1e-4])
    end = orbit.coast(begin + [0, 0, 0, 0, 0.02, 0], 3000.0).state(3000.0) + late
    plan = orbit.two_impulse(begin, end, 3000.0)
    fired = cf.fire_thrusters(plan, cf.Thrusters.rtn(acceleration=1e-2, minimum_bit=1e-3))
    assert fired.dropped.start == pytest.approx([3000.0, 3000.0])
    assert fired.dropped.impulse == pytest.approx([2e-4, 1e-4])
    assert fired.path.state(3000.0) == pytest.approx(end - late, abs=0.01)
    assert 0 < fired.deviation <= fired.deviation_bound < 0.01


def test_pulses_respect_the_minimum_bit():
    """No pulse is below the minimum bit; dropped impulses are reported and part of the bound."""
    fine, coarse = (
        cf.fire_thrusters(MOVE, SIX),
        cf.fire_thrusters(MOVE, cf.Thrusters.rtn(acceleration=2e-3, period=30.0, minimum_bit=0.02)),
    )
    assert len(coarse.pulses) < len(fine.pulses)
    assert coarse.pulses.impulse.min() >= 0.02
    assert len(coarse.dropped) > 0
    assert coarse.dropped.impulse.max() < 0.02
    assert coarse.delta_v + coarse.dropped.impulse.sum() == pytest.approx(fine.delta_v, rel=1e-9)
    assert 0 < coarse.dropped_deviation <= coarse.deviation_bound
    assert coarse.deviation <= coarse.deviation_bound
    assert len(fine.dropped) == 0 == fine.dropped_deviation


def test_minimum_bit_grows_as_mass_falls():
    """The final mass determines the minimum impulse."""
    thrusters = cf.Thrusters.rtn(acceleration=2e-3, period=30.0, minimum_bit=4e-3)
    light = cf.fire_thrusters(MOVE, thrusters, mass=10.0, specific_impulse=1.0)
    left = 10.0 - light.propellant
    assert left < 0.97 * 10.0
    assert light.pulses.impulse.min() >= 4e-3 * 10.0 / left * (1 - 1e-12)


def test_deviation_in_a_typical_cluster():
    """Reconfigurations within 100 m with bits of 1 mm/s deviate by less than 1 m."""
    rng, found = np.random.default_rng(4), []
    for _ in range(8):
        sizes = rng.normal(size=(2, 4)) * 50
        ends = [[x, y, z, v * N / 2, -2 * N * x, -z * N] for x, y, z, v in sizes]
        path = ORBIT.transfer(*ends, ORBIT.period * rng.uniform(0.3, 1.0))
        firing = cf.fire_thrusters(path, cf.Thrusters.rtn(acceleration=1e-3, minimum_bit=1e-3, period=10.0))
        assert deviation(firing, 12) <= firing.deviation_bound
        found.append((firing.deviation, firing.deviation_bound))
    assert np.median(found, axis=0)[0] < 1.0
    assert np.median(found, axis=0)[1] < 2.0


def ring():
    """Return six spacecraft on a ring that change places through its middle."""
    angle = np.arange(6) * np.pi / 3 + 0.1
    initial = np.zeros((6, 6))
    initial[:, 1], initial[:, 2] = 100 * np.cos(angle), 100 * np.sin(angle)
    return initial, np.roll(initial, 3, axis=0)


def test_fired_formation_is_certified():
    """A plan whose zone is enlarged by two bounds is clear when fired, by dense sampling."""
    thrusters = cf.Thrusters.rtn(acceleration=5e-3, period=120.0)
    touching = cf.reconfigure(ORBIT, *ring(), 1400.0, cf.Sphere(20.0))
    assert touching.contacts
    near = cf.fire_thrusters(touching, thrusters, zone=cf.Sphere(20.5))
    assert near.path.shape == near.deviation.shape == near.propellant.shape == (6,)
    assert (near.deviation <= near.deviation_bound).all()
    assert set(near.pulses.craft) == set(range(6))
    assert not near.clear
    assert {(one.first, one.second) for one in near.conflicts} <= {(i, j) for j in range(6) for i in range(j)}

    plan = cf.reconfigure(ORBIT, *ring(), 1400.0, cf.Sphere(20.0 + 2.2 * near.deviation_bound.max()))
    fired = cf.fire_thrusters(plan, thrusters, zone=cf.Sphere(20.0))
    assert fired.clear
    places = fired.path.position(np.linspace(fired.path.start.max(), fired.path.end.min(), 8001))
    for one in range(6):
        for other in range(one):
            assert np.linalg.norm(places[one] - places[other], axis=1).min() > 20.0
    alone = [cf.fire_thrusters(plan.paths[k], thrusters) for k in range(6)]
    assert np.allclose([one.delta_v for one in alone], fired.delta_v, rtol=1e-12)


def test_fired_avoidance_is_clear():
    path = ORBIT.transfer([0, -200, 10, 0, 0, 0], [40, 200, 60, 0, -0.09, 0], 3000.0)
    other = ORBIT.coast(ORBIT.transition(-1350.0) @ (path.state(1350.0) + [3, 4, -5, 0.02, 0, 0.01]), 3000.0)
    found = cf.avoid(path, other, cf.Sphere(25.0))
    fired = cf.fire_thrusters(found, SIX, zone=[cf.Sphere(24.0)], obstacles=other)
    assert fired.clear
    assert cf.find_conflicts(fired.path, other, cf.Sphere(24.0)) == ()
    (near,) = cf.fire_thrusters(found, SIX, zone=cf.Sphere(25.0 + 0.5), obstacles=[other]).conflicts
    assert (near.first, near.second) == (0, 1)
    assert fired.conflicts == ()
    assert cf.fire_thrusters(found, SIX).conflicts is None


def test_table_of_burns():
    firing = cf.fire_thrusters(MOVE, SIX, 12.0, 60.0)
    burns = firing.burns
    assert list(burns)[:4] == ["craft", "thruster", "start_s", "duration_s"]
    assert {len(column) for column in burns.values()} == {len(firing.pulses)}
    vectors = np.stack([burns[f"{axis}_m_s"] for axis in ("radial", "along_track", "cross_track")], axis=1)
    assert np.allclose(np.linalg.norm(vectors, axis=1), firing.pulses.impulse)
    assert np.allclose(burns["propellant_kg"].sum(), firing.propellant)


def test_coast_has_no_pulses():
    firing = cf.fire_thrusters(ORBIT.coast(A, 900.0), SIX, 12.0, 60.0)
    assert len(firing.pulses) == 0
    assert (firing.delta_v, firing.propellant, firing.deviation, firing.deviation_bound) == (0, 0, 0, 0)


BLOCKED = cf.avoid(MOVE, ORBIT.coast(A, 3000.0), cf.Sphere(1000.0))
REFUSED = {
    "no acceleration": (
        {"thrusters": cf.Thrusters.rtn(period=30.0)},
        "thrusters: acceleration is missing; give it, or use with_force",
    ),
    "period above the duration": (
        {"thrusters": cf.Thrusters.rtn(acceleration=1.0, period=4000.0)},
        "period: 4000 s is longer than the plan, which takes 3000 s; give a shorter one",
    ),
    "too short a period": (
        {"thrusters": cf.Thrusters.rtn(acceleration=1.0, period=1e-4)},
        "period: 3000 s of thrust are more than 1000000 cycles or pieces of an orbit; give a longer one, or "
        "fire the plan piece by piece",
    ),
    "too weak": (
        {"thrusters": cf.Thrusters.rtn(acceleration=1e-5, period=30.0)},
        "acceleration: at about 2985.08 s thruster 0 must provide 0.000175 m/s², above its 1e-05 m/s²; plan "
        "with a max_acceleration or more time",
    ),
    "bit above the whole": (
        {"thrusters": cf.Thrusters.rtn(acceleration=1.0, period=30.0, minimum_bit=5.0)},
        "minimum_bit: 5 m/s is above 0.192 m/s, the largest pulse of the plan, so no thruster "
        "would fire; plan with impulses, or take finer thrusters",
    ),
    "bit above each impulse": (
        {"plan": BURNS, "thrusters": cf.Thrusters.rtn(acceleration=1.0, minimum_bit=5.0)},
        "minimum_bit: 5 m/s is above 0.064 m/s, the largest pulse of the plan, so no thruster "
        "would fire; take finer thrusters",
    ),
    "stronger than times can tell": (
        {"thrusters": cf.Thrusters.rtn(acceleration=1e9, period=30.0)},
        "acceleration: 1e+09 m/s² fires the whole plan in pulses shorter than 6e-09 s, below "
        "the resolution of time; reduce it",
    ),
    "out of reach": (
        {"thrusters": cf.Thrusters(SIX.directions[:5], acceleration=1.0, period=30.0)},
        "thrusters: at 7.45443 s the plan requires thrust that they lack, along -z of their frame; "
        "plan with these thrusters, or add one",
    ),
    "impulses too close": (
        {"plan": ORBIT.two_impulse(A, A + [0, 9, 0, 0, 2, 0], 20.0), "thrusters": SIX},
        "acceleration: thruster 2 fires",
    ),
    "sets for others": (
        {"thrusters": [SIX, SIX]},
        "thrusters: 2 sets for 1 spacecraft; give one, or one for each",
    ),
    "no mass": ({"specific_impulse": 60.0}, "mass: required with specific_impulse; give both or neither"),
    "no specific impulse": ({"mass": 60.0}, "specific_impulse: required with mass; give both or neither"),
    "blocked": ({"plan": BLOCKED}, f"plan: has no path: {BLOCKED.reason}"),
    "batch of batches": (
        {"plan": ORBIT.coast(np.zeros((2, 3, 6)), 9.0)},
        "plan: expected one spacecraft or a batch of shape (N,), got shape (2, 3)",
    ),
    "obstacles without a zone": (
        {"obstacles": MOVE},
        "zone: required with obstacles; give the zone to keep clear",
    ),
}


def test_invalid_input_is_refused():
    for what in REFUSED:
        arguments, message = REFUSED[what]
        with pytest.raises(ValueError, match=r": ") as error:
            cf.fire_thrusters(**{"plan": MOVE, "thrusters": SIX} | arguments)
        assert str(error.value).startswith(message)


def test_refusal_names_the_spacecraft():
    both = cf.stack([ORBIT.coast(A, 3000.0), MOVE])
    weak = cf.Thrusters.rtn(acceleration=1e-5, period=30.0)
    with pytest.raises(ValueError, match=r"^acceleration: craft 1: at about "):
        cf.fire_thrusters(both, weak)


def test_almost_simultaneous_impulses_are_one_burn():
    """Two almost simultaneous impulses become one burn with their sum and centroid."""
    middle = ORBIT.coast(A, 1000.0)
    state = middle.state(1000.0)
    state[3:] += [0.0, 0.02, 0.0]
    between = ORBIT.coast(state, 0.05, 1000.0)
    later = between.state(1000.05)
    later[3:] += [0.0, 0.06, 0.0]
    plan = cf.join([middle, between, ORBIT.coast(later, 2000.0, 1000.05)])
    fired = cf.fire_thrusters(plan, SIX)
    assert len(plan.impulses) == 2
    assert len(fired.pulses) == 1
    assert fired.pulses.impulse.sum() == pytest.approx(0.08, rel=1e-9)
    centroid = fired.pulses.start[0] + 0.5 * fired.pulses.duration[0]
    assert centroid == pytest.approx((0.02 * 1000.0 + 0.06 * 1000.05) / 0.08, abs=1e-6)
    assert fired.deviation <= fired.deviation_bound


def test_bound_holds_for_merged_burns():
    """Clusters of up to five impulses whose burns would overlap are within the bound."""
    together, ratios = 0, []
    for seed in range(30):
        plan, thrusters = clustered(np.random.default_rng(seed))
        firing = cf.fire_thrusters(plan, thrusters)
        off = deviation(firing, looks=12)
        assert off <= firing.deviation_bound, seed
        together += len(firing.pulses) < 3 * len(plan.impulses)
        ratios.append(firing.deviation_bound / off)
    assert together > 20
    assert np.median(ratios) < 1.5


def test_impulse_after_continuous_thrust_is_refused():
    """An impulse directly after continuous thrust is refused."""
    thrust = ORBIT.burn(A, [0.0, 4e-4, 0.0], 60.0)
    after = thrust.state(60.0) + [0.0, 0, 0, 0, 0.1, 0]
    with pytest.raises(ValueError, match="must begin again at"):
        cf.fire_thrusters(cf.join([thrust, ORBIT.coast(after, 2000.0, 60.0)]), SIX)
