"""Plans about any chief, beside integrated equations, a cone program, and the plans of Hill's equations."""

import clarabel
import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import minimize

import closeform as cf
from chiefs import matrices_by_integration, orbit_of, with_impulses

SEMI_AXES = np.array([60.0, 120.0, 60.0])
ZONE = cf.Ellipsoid(SEMI_AXES)
GAUSS = np.polynomial.legendre.leggauss(3)
BEHIND = np.array([20.0, -420.0, -15.0, 0.02, 0.0, -0.01])
AHEAD = np.array([-10.0, 430.0, 25.0, 0.0, 0.03, 0.02])


def case(kind, share=0.4, begin=0.15):
    """Return a path and a client that it meets half-way."""
    orbit = orbit_of(kind)
    duration, start = share * orbit.period, begin * orbit.period
    path, middle = orbit.transfer(BEHIND, AHEAD, duration, start), start + 0.5 * duration
    met = path.state(middle) * [1.0, 1.0, 1.0, 0.0, 0.0, 0.0] + [12.0, 5.0, -18.0, 0.0, 0.05, 0.0]
    return path, orbit.coast(orbit.transition(start - middle, middle) @ met, duration, start)


def integrated(orbit, path, pieces):
    """Return times and states under a path's thrust, by transition matrices and Gauss's quadrature."""
    edges = np.union1d(np.linspace(path.start, path.end, pieces), path.arcs[:, 0])
    pieces = len(edges) - 1
    half = 0.5 * np.diff(edges)
    inner = edges[:-1, None] + half[:, None] * (1.0 + GAUSS[0])
    times = np.concatenate([edges[:-1, None], inner], axis=1).ravel()
    flows = matrices_by_integration(orbit, np.append(times, edges[-1]))
    back = np.linalg.inv(flows[:-1].reshape(pieces, 4, 6, 6)[:, 1:])[..., 3:]
    gained = np.einsum("pqij,pqj,q,p->pi", back, path.thrust(inner), GAUSS[1], half)
    begun = path.state(path.start) + np.concatenate([np.zeros((1, 6)), np.cumsum(gained, axis=0)])
    ends = np.concatenate([flows[:-1:4], flows[-1:]])
    return edges, (ends @ begun[:, :, None])[..., 0]


def planes_facing(path, client, times, flows):
    """Return rows (K, T, 3) and bounds (K,) of planes between path and zone, for pushes at `times`.

    The zone is replaced at every instant near it by the half-space beyond the plane that faces the path.
    """
    relative = path.state(times) - client.state(times)
    back = np.linalg.inv(flows)[..., 3:]
    rows, bounds = [], []
    begun = path.state(path.start) - client.state(path.start)
    begun[3:] -= sum((jump for time, jump in path.impulses if time == path.start), np.zeros(3))
    for k, place in enumerate(relative[:, :3] / SEMI_AXES):
        size = np.linalg.norm(place)
        if 0 < k < len(times) - 1 and size < 2.0:
            reached = place / size / SEMI_AXES @ flows[k, :3]
            rows.append(np.where(np.arange(len(times))[:, None] < k, reached @ back, 0.0))
            bounds.append(1.0 - reached @ begun)
    return np.array(rows), np.array(bounds), begun


def solved(cost, quadratic, matrix, bounds, cones):
    """Return the cost of a cone program."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    matrices = sparse.csc_matrix(quadratic), cost, sparse.csc_matrix(matrix)
    found = clarabel.DefaultSolver(*matrices, bounds, cones, settings).solve()
    assert str(found.status) == "Solved"
    return found.obj_val


def planes_touched(contacts):
    """Return a function like `planes_facing`, for the planes of a plan's contacts after a loss of thrust."""

    def planes(path, client, times, flows):
        begun, back = path.state(path.start) - client.state(path.start), np.linalg.inv(flows)[..., 3:]
        met = np.unique([path.start, *(one.time for one in contacts)])
        until = dict(zip(met, matrices_by_integration(path.orbit, met), strict=True))
        rows, bounds = [], []
        for one in contacts:
            reached = one.normal @ until[one.time][:3]
            lost = one.time if np.isnan(one.failed_at) else one.failed_at
            rows.append(np.where(times[:, None] < lost, reached @ back, 0.0))
            bounds.append(one.reach - reached @ begun)
        return np.array(rows), np.array(bounds), begun

    return planes


def cone_energy(path, client, count=240, planes=planes_facing):
    """Return the minimum energy of thrust that is constant in intervals, on the path's side of the zone."""
    orbit, edges = path.orbit, np.linspace(path.start, path.end, 2 * count + 1)
    step = 2.0 * (edges[1] - edges[0])
    flows = matrices_by_integration(orbit, edges)
    rows, bounds, first = planes(path, client, edges, flows)
    rows = step * rows[:, 1::2]  # a push in an interval acts at its middle
    last = path.state(path.end) - client.state(path.end)
    unit = np.sqrt(2.0 * path.energy / (path.end - path.start))  # m/s^2
    arrived = step * (flows[-1] @ np.linalg.inv(flows[1::2])[..., 3:]).swapaxes(0, 1).reshape(6, -1)
    weights = np.repeat([1.0, step], 3) / np.abs(last).max()
    matrix = np.concatenate([weights[:, None] * arrived * unit, -unit * rows.reshape(len(rows), -1)])
    given = np.concatenate([weights * (last - flows[-1] @ first), -bounds])
    cones = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(rows))]
    return solved(np.zeros(3 * count), np.eye(3 * count), matrix, given, cones) * step * unit**2


def cone_delta_v(path, client, count=400):
    """Return the minimum delta-v of impulses at fixed times, on the path's side of the zone."""
    orbit, times = path.orbit, np.linspace(path.start, path.end, count + 1)
    flows = matrices_by_integration(orbit, times)
    rows, bounds, first = planes_facing(path, client, times, flows)
    last = AHEAD - client.state(path.end)
    arrived = (flows[-1] @ np.linalg.inv(flows)[..., 3:]).swapaxes(0, 1).reshape(6, -1)
    number, weights = count + 1, np.repeat([1.0, 1000.0], 3) / np.abs(last).max()
    sizes = np.zeros((len(rows) + 6, number))
    lines = np.concatenate([weights[:, None] * arrived, -rows.reshape(len(rows), -1)])
    cone = np.zeros((4 * number, 4 * number))  # (size, impulse) of each time
    for k in range(number):
        cone[4 * k, 3 * number + k] = -1.0
        cone[4 * k + 1 : 4 * k + 4, 3 * k : 3 * k + 3] = -np.eye(3)
    matrix = np.concatenate([np.hstack([lines, sizes]), cone])
    given = np.concatenate([weights * (last - flows[-1] @ first), -bounds, np.zeros(4 * number)])
    cones = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(rows))]
    cones += [clarabel.SecondOrderConeT(4)] * number
    cost = np.repeat([0.0, 1.0], [3 * number, number])
    return solved(cost, np.zeros((4 * number, 4 * number)), matrix, given, cones)


@pytest.mark.parametrize("kind", [0.1, 0.3, 0.6, "J2"])
def test_plans_are_clear_and_of_minimum_energy_in_integrated_equations(kind):
    orbit = orbit_of(kind)
    for share in (0.25, 0.8):
        direct, client = case(kind, share)
        plan = cf.avoid(direct, client, ZONE, prove=5.0)
        assert plan.status.name == "AVOIDED"
        times, states = integrated(orbit, plan.path, 600)
        scale = np.abs(states).max(axis=0)
        assert (np.abs(states - plan.path.state(times)) <= 2e-8 * scale).all()
        assert np.abs(states[-1] - AHEAD).max() <= 2e-8 * scale.max()
        ratios = np.linalg.norm((states - client.state(times))[:, :3] / SEMI_AXES, axis=1)
        assert 1.0 - 1e-7 < ratios.min() < 1.001
        least = cone_energy(plan.path, client)
        assert plan.energy == pytest.approx(least, rel=1e-3)
        assert direct.energy < plan.lower_bound <= plan.energy
        assert plan.gap <= 1e-3


def test_an_almost_circular_chief_has_the_plans_of_hill():
    hill = cf.Orbit.circular(500e3)
    round_one = cf.Orbit.eccentric(1e-9, perigee_altitude=500e3)
    for zone in (ZONE, cf.Box([50.0, 90.0, 40.0])):
        found = []
        for orbit in (hill, round_one):
            client = orbit.coast(np.zeros(6), 5000.0)
            found.append(cf.avoid(orbit.transfer(BEHIND, AHEAD, 3000.0, 1000.0), client, zone))
        mine, known = found
        assert mine.energy == pytest.approx(known.energy, rel=1e-6)
        assert mine.lower_bound == pytest.approx(known.lower_bound, rel=1e-6)
        assert [one.time for one in mine.contacts] == pytest.approx([one.time for one in known.contacts])
    passed = {"cost": "delta-v"}, {"cost": "delta-v", "max_acceleration": 1.5e-3, "longer": False}
    for options, rel in zip(passed, (1e-6, 1e-4), strict=True):
        found = []
        for orbit in (hill, round_one):
            client = orbit.coast([10.0, 20.0, -15.0, 0, 0, 0], 5000.0)
            path = orbit.transfer(BEHIND, AHEAD, 2500.0, 1000.0)
            found.append(cf.avoid(path, client, cf.Ellipsoid([150.0, 300.0, 150.0]), **options).delta_v)
        assert found[1] == pytest.approx(found[0], rel=rel)
    states = np.array([[0, 400 * k, 30 * k, 0, 0, 0] for k in (-1, 0, 1)])
    for cost in ("energy", "delta-v"):
        plans = [
            cf.reconfigure(
                orbit,
                states,
                states[::-1],
                [3000.0, 3500.0, 2500.0],
                cf.Sphere(90.0),
                start=[0, 200, 700],
                cost=cost,
            )
            for orbit in (hill, round_one)
        ]
        assert all(plan.ok for plan in plans)
        spent = [plan.energy if cost == "energy" else plan.delta_v for plan in plans]
        assert spent[1] == pytest.approx(spent[0], rel=1e-6)
    line = np.array(
        [[0, 200 * k, 30 * k, 0, 0, 0] for k in (-1, 0, 1)]
    )  # all meet at once, under strong thrust
    plans = [cf.reconfigure(orbit, line, line[::-1], 290.0, cf.Sphere(60.0)) for orbit in (hill, round_one)]
    assert plans[1].energy == pytest.approx(plans[0].energy, rel=1e-6)


@pytest.mark.parametrize("kind", [0.3, "J2"])
def test_formations_with_times_of_their_own_are_clear(kind):
    orbit, sphere = orbit_of(kind), cf.Sphere(90.0)
    states = np.array([[0, 300 * k, 40 * k, 0, 0, 0] for k in (-1, 0, 1)])
    starts, lengths = np.array([900.0, 1200.0, 1500.0]), np.array([2500.0, 2800.0, 2000.0])
    passing = orbit.coast([60.0, -150.0, 0, 0, 0.0, 0], 5000.0)
    plan = cf.reconfigure(orbit, states, -states, lengths, sphere, start=starts, obstacles=passing)
    assert plan.ok
    assert not len(cf.screen(plan.paths, sphere).pairs)
    for path, start, end, first, last in zip(
        plan.paths, starts, starts + lengths, states, -states, strict=True
    ):
        assert not cf.find_conflicts(path, passing, sphere)
        assert np.allclose(path.state(start), first, atol=1e-6)
        assert np.allclose(path.state(end), last, atol=1e-6)
        times, flown = integrated(orbit, path, 800)
        assert np.abs(flown - path.state(times)).max() <= 1e-6 * np.abs(flown).max()
    slots = np.array([*-states, [200.0, 0, 0, 0, 0, 0]])
    free = cf.reconfigure(orbit, states, slots, lengths, sphere, assign=True, start=starts, obstacles=passing)
    assert free.ok
    assert free.energy <= plan.energy * (1.0 + 1e-9)


def test_fallbacks_end_with_the_span_of_the_chief():
    """An arrival that drifts into the zone is never safe, so that longer plans are tried up to the end."""
    orbit = cf.Orbit.perturbed(0.01, 1.1, perigee_altitude=600e3, span=5000.0)
    slots = np.array([[0, 0, 200.0, 0, 0, -0.4], [0, 0, -200.0, 0, 0, 0.4]])
    options = {"obstacles": orbit.coast(np.zeros(6), 5000.0), "assign": True, "drift": 1200.0}
    plan = cf.reconfigure(orbit, BEHIND[None], slots, 2500.0, ZONE, if_blocked=("longer",), **options)
    assert not plan.ok
    assert sum("not known for so long" in line for line in plan.measures) >= 2
    for options in ({"start": 3000.0}, {"drift": 3000.0, "obstacles": orbit.coast(np.zeros(6), 5000.0)}):
        with pytest.raises(ValueError, match="5000"):
            cf.reconfigure(orbit, BEHIND[None], AHEAD[None], 2500.0, ZONE, **options)


def test_thrust_limits_lengthen_plans_within_the_span_of_the_chief():
    direct, client = case("J2", 0.3)
    orbit = direct.orbit
    client = client.extended(direct.start + 9000.0)
    plan = cf.avoid(direct, client, ZONE)
    limit = 0.7 * plan.paths.peak_thrust[0]
    longer = cf.avoid(direct, client, ZONE, max_acceleration=limit)
    assert longer.ok
    assert longer.paths.peak_thrust[0] <= limit * (1.0 + 1e-8)
    assert longer.path.end > direct.end
    beyond = cf.avoid(direct, client, ZONE, max_acceleration=1e-3 * limit)
    assert beyond.status.name == "TOO_WEAK"
    least = cf.reconfigure(
        orbit,
        BEHIND[None],
        AHEAD[None],
        2000.0,
        ZONE,
        obstacles=client,
        start=direct.start,
        max_acceleration=1e-9,
    )
    assert least.status.name == "TOO_WEAK"


def least_after_losses(own, client, until, losses):
    """Return the least norm of integrated drifts from states (K, 6) at times (K,), `losses` of thrust."""
    times, states = losses
    every = np.union1d(times, np.linspace(own.start, until, 1500))
    flows = matrices_by_integration(own.orbit, every)
    begun = np.linalg.solve(flows[np.searchsorted(every, times)], states[..., None])[..., 0]
    places = np.einsum("tij,kj->kti", flows[:, :3], begun) - client.position(every)  # (failure, time, axis)
    ratios = np.linalg.norm(places / SEMI_AXES, axis=2)
    return np.where(every >= times[:, None], ratios, np.inf).min()


@pytest.mark.parametrize(("kind", "across"), [("J2", 1.0), (0.3, 0.35)])
def test_energy_is_planned_passively_safe(kind, across):
    """Beside integrated drifts, and a cone program with the planes of its contacts after losses of thrust."""
    orbit = orbit_of(kind)
    client, aside = orbit.coast(np.zeros(6), 8000.0), np.array([0, 0, 150.0 * across, 0, 0, 0])
    path = orbit.transfer(BEHIND + aside, AHEAD + aside, 2400.0, 500.0)
    until = path.end + 5000.0
    plain = cf.avoid(path, client, ZONE)
    assert not cf.passively_safe(plain.path, client, ZONE, until)
    plan = cf.avoid(path, client, ZONE, drift=5000.0)
    own, times = plan.path, np.linspace(path.start, path.end, 150)
    assert plan.status.name == "AVOIDED"
    assert np.abs(own.state(own.end) - path.state(path.end)).max() < 1e-6
    assert 1.0 - 1e-6 < least_after_losses(own, client, until, (times, own.state(times))) < 1.1
    assert cf.passively_safe(own, client, ZONE, until)
    assert plan.energy == pytest.approx(
        cone_energy(own, client, planes=planes_touched(plan.contacts)), rel=2e-3
    )
    assert plain.energy < plan.energy
    assert plan.lower_bound <= plan.energy


@pytest.mark.slow
def test_a_pass_along_the_track_is_planned_out_of_its_plane_of_symmetry():
    """It costs hardly more than the least delta-v of the same pass one centimetre aside, without a zone."""
    orbit, aside = cf.Orbit.eccentric(0.2, perigee_altitude=700e3), np.array([0, 0, 0.01, 0, 0, 0])
    ends = np.array([[0, -300.0, 0, 0, 0, 0], [0, 300.0, 0, 0, 0, 0]])
    path, until = orbit.transfer(*ends, 0.5 * orbit.period), orbit.period
    client, zone = orbit.coast(np.zeros(6), until), cf.Sphere(50.0)
    plan = cf.avoid(path, client, zone, cost="delta-v", drift=0.5 * orbit.period)
    assert plan.ok
    assert cf.passively_safe(plan.path, client, zone, until)
    assert plan.delta_v < 1.25 * cf.least_delta_v(orbit, *(ends + aside), 0.5 * orbit.period).upper


@pytest.mark.parametrize("kind", [0.1, 0.3, 0.6, "J2"])
def test_impulses_are_clear_and_of_minimum_delta_v_in_integrated_equations(kind):
    orbit = orbit_of(kind)
    for share in (0.25, 0.8):
        direct, client = case(kind, share)
        plan = cf.avoid(direct, client, ZONE, cost="delta-v", prove=0.5)
        assert plan.ok
        path, times = plan.path, np.linspace(direct.start, direct.end, 2000)
        states = with_impulses(path, times)
        scale = np.abs(states).max(axis=0)
        assert (np.abs(states - path.state(times)) <= 1e-7 * scale).all()
        assert np.abs(path.state(path.end) - AHEAD).max() <= 1e-7 * scale.max()
        ratios = np.linalg.norm((states - client.state(times))[:, :3] / SEMI_AXES, axis=1)
        assert ratios.min() > 1.0 - 1e-6
        least = cone_delta_v(path, client)
        assert plan.delta_v <= 1.001 * least
        assert plan.lower_bound <= min(plan.delta_v, least) * (1.0 + 1e-6)
        free = cf.least_delta_v(orbit, BEHIND, AHEAD, direct.end - direct.start, start=direct.start)
        assert (1.0 - 1e-9) * free.lower <= plan.lower_bound


@pytest.mark.parametrize(("kind", "across"), [("J2", 1.0), (0.3, 0.35)])
def test_impulses_are_planned_passively_safe(kind, across):
    """Where the plan without a loss of thrust is not safe; beside drifts from between and amid impulses.

    With J2 the plan begins at the first instant at which the chief is known.
    """
    orbit = orbit_of(kind)
    client, aside = orbit.coast(np.zeros(6), 8000.0), np.array([0, 0, 150.0 * across, 0, 0, 0])
    path = orbit.transfer(BEHIND + aside, AHEAD + aside, 2400.0, 0.0 if kind == "J2" else 500.0)
    until = path.end + 5000.0
    plain = cf.avoid(path, client, ZONE, cost="delta-v")
    assert not cf.passively_safe(plain.path, client, ZONE, until)
    plan = cf.avoid(path, client, ZONE, cost="delta-v", drift=5000.0, budget=1)
    own = plan.path
    assert plan.status.name == "AVOIDED"
    assert np.abs(own.state(own.end) - path.state(path.end)).max() < 1e-6
    assert cf.passively_safe(own, client, ZONE, until)
    states, times = [own.state(time) for time in np.linspace(own.start, own.end, 60)], []
    for time, jump in own.impulses:
        for share in np.linspace(0.0, 1.0, 41):
            states.append(own.state(time) - np.concatenate([np.zeros(3), (1.0 - share) * jump]))
            times.append(time)
    times = np.array([*np.linspace(own.start, own.end, 60), *times])
    least = least_after_losses(own, client, until, (times, np.array(states)))
    assert least > 1.0 - 1e-6
    found = cf.drift_approach(own, client, ZONE, until)
    assert found.lower <= found.ratio
    assert found.ratio == pytest.approx(least, rel=0.02)
    assert plain.delta_v < plan.delta_v < 1.1 * plain.delta_v


def least_sigmas(place, covariance):
    """Return the number of sigmas between a relative position and the zone: the best of all planes."""

    def level(plane):
        gap = plane @ place - np.linalg.norm(SEMI_AXES * plane)
        return -gap / np.sqrt(plane @ covariance @ plane)

    return -minimize(level, place / SEMI_AXES**2 / np.linalg.norm(place / SEMI_AXES), tol=1e-12).fun


@pytest.mark.parametrize(("kind", "cost"), [(0.3, "energy"), (0.1, "delta-v"), ("J2", "delta-v")])
def test_plans_keep_three_sigmas(kind, cost):
    """Beside covariances by integrated transition matrices."""
    direct, client = case(kind)
    state, known = np.diag([4.0, 9.0, 4.0, 4e-6, 4e-6, 4e-6]), np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    execution = {} if cost == "energy" else {"impulse": (0.0, 0.01, 0.0, 0.005)}
    plan = cf.avoid(
        direct,
        client,
        ZONE,
        cost=cost,
        errors=cf.Uncertainty(state, **execution),
        other_errors=cf.Uncertainty(known),
    )
    assert plan.status.name == "AVOIDED"
    path, times = plan.path, np.linspace(direct.start, direct.end, 400)
    every = np.union1d(times, [time for time, _ in path.impulses])
    flows = matrices_by_integration(path.orbit, every)
    spread = flows @ (state + known) @ flows.swapaxes(1, 2)
    for time, jump in path.impulses:
        ahead = np.outer(jump, jump)
        kick = 0.01**2 * ahead + 0.005**2 * (jump @ jump * np.eye(3) - ahead)
        k = np.searchsorted(every, time)
        after = flows[k:] @ np.linalg.inv(flows[k])[:, 3:]
        spread[k:] += after @ kick @ after.swapaxes(1, 2)
    places = (path.state(every) - client.state(every))[:, :3]
    near = np.linalg.norm(places / SEMI_AXES, axis=1) < 1.6
    sigmas = [least_sigmas(*one) for one in zip(places[near], spread[near][:, :3, :3], strict=True)]
    assert 3.0 - 1e-4 < min(sigmas) < 3.05
    plain = cf.avoid(direct, client, ZONE, cost=cost)
    spent = [one.energy if cost == "energy" else one.delta_v for one in (plain, plan)]
    assert spent[0] < spent[1] < 1.3 * spent[0]


def test_what_is_not_planned_about_a_chief_is_refused_with_an_alternative():
    direct, client = case(0.1)
    inertial = cf.Thrusters(np.concatenate([np.eye(3), -np.eye(3)]), "inertial")
    for options, remedy in (
        ({"method": "sauter-palmer"}, "omit"),
        ({"requirements": cf.requirements.SpeedLimit(limit=1.0)}, "delta-v"),
        ({"cost": "delta-v", "thrusters": inertial}, "orbit's axes"),
    ):
        with pytest.raises(ValueError, match=remedy):
            cf.avoid(direct, client, ZONE, **options)
    with pytest.raises(ValueError, match="same orbit"):
        cf.avoid(direct, cf.Orbit.circular(500e3).coast(np.zeros(6), 9000.0), ZONE)
