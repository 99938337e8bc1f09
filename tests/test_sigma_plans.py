"""Plans with sigma clearance against sampled errors, matrix exponentials and convex programs."""

import clarabel
import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import expm
from scipy.optimize import brentq

import closeform as cf
from closeform.mission.mission import plan_mission
from closeform.motion.joining import stack
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts
from closeform.planning.sigmas.sigma_problem import Margin
from closeform.scenario import parse

ORBIT = cf.Orbit.circular(500e3)
N = ORBIT.mean_motion
PATH = ORBIT.transfer(
    [3.2, 40.9, -39.3, -0.022, 0.004, -0.009], [-3.6, -45.0, 43.2, 0.005, 0.024, -0.006], 0.4 * ORBIT.period
)
CLIENT = ORBIT.coast(np.zeros(6), PATH.end)
ZONE = cf.Sphere(28.0)
KNOWN = np.diag([1.0, 2.0, 1.0, 2e-3, 2e-3, 2e-3]) ** 2
ERRORS = cf.Uncertainty(KNOWN)
NODES = 400  # of the convex program
TOUCH = 1e-6  # tolerance of the plan at an active margin, in zone sizes


def hill():
    matrix = np.zeros((6, 6))
    matrix[:3, 3:] = np.eye(3)
    matrix[3, 0], matrix[3, 4], matrix[4, 3], matrix[5, 2] = 3 * N * N, 2 * N, -2 * N, -N * N
    return matrix


def moved(times):
    """Return transitions (T, 6, 6) from time 0, by matrix exponentials."""
    return np.array([expm(hill() * t) for t in times])


def sampled_errors(count, size, k, seed):
    """Return errors (count, size) of length k."""
    draws = np.random.default_rng(seed).normal(size=(count, size))
    return k * draws / np.linalg.norm(draws, axis=1, keepdims=True)


def flown(path, times, errors, root, magnitude=0.0):
    """Return positions (T, K, 3) of a spacecraft with errors of its state and burn magnitude."""
    flow, nominal = moved(times - path.start), path.state(times)
    columns = flow @ root
    if magnitude:
        forced = nominal - flow @ path.state(path.start)
        columns = np.concatenate([columns, magnitude * forced[:, :, None]], axis=2)
    return nominal[:, None, :3] + np.einsum("tic,kc->tki", columns[:, :3], errors)


def nearest(place, spread, k):
    """Return the least distance from the origin to an ellipsoid of k sigmas, by its secular equation."""
    values, axes = np.linalg.eigh(spread)
    along = axes.T @ place
    if ((along**2 / values).sum()) <= k * k:
        return 0.0
    # the nearest point is r - S w / rho, with w = (S / rho + I)^-1 r, where its sigmas are k
    share = brentq(lambda s: (values * (along / (1.0 + s * values)) ** 2).sum() * s * s - k * k, 0.0, 1e9)
    return float(np.linalg.norm(along / (1.0 + share * values)))


@pytest.mark.parametrize("k", [2.0, *(pytest.param(k, marks=pytest.mark.slow) for k in (0.5, 3.0))])
def test_errors_of_k_sigmas_touch_and_never_enter(k):
    plan = cf.avoid(PATH, CLIENT, ZONE, errors=ERRORS, sigmas=k)
    assert (plan.status, plan.sigmas) == (cf.Status.AVOIDED, k)
    times = np.linspace(PATH.start, PATH.end, 1500)
    places = flown(plan.path, times, sampled_errors(500, 6, k, 1), np.sqrt(KNOWN))
    assert np.linalg.norm(places, axis=2).min() > 28.0
    flow = moved(times)[:, :3]
    near = [nearest(r, a @ KNOWN @ a.T, k) for r, a in zip(plan.path.position(times), flow, strict=True)]
    # a second between samples, at some 0.1 m/s of each other, bends the distance by 1e-4 m
    assert 28.0 * (1.0 - TOUCH) < min(near) < 28.0 + 1e-3


def test_contacts_report_the_active_margin():
    plan = cf.avoid(PATH, CLIENT, ZONE, errors=ERRORS, sigmas=2.0)
    for contact in plan.contacts:
        flow = expm(hill() * contact.time)[:3]
        spread = flow @ KNOWN @ flow.T
        assert contact.sigma == pytest.approx(np.sqrt(contact.normal @ spread @ contact.normal), rel=1e-9)
        assert contact.reach == pytest.approx(28.0, rel=1e-8)
        out = contact.normal @ plan.path.position(contact.time)
        assert out == pytest.approx(28.0 + 2.0 * contact.sigma, rel=TOUCH)
        assert nearest(plan.path.position(contact.time), spread, 2.0) == pytest.approx(28.0, rel=TOUCH)


def least_energy(path, planes):
    """Return the least energy that keeps planes (time, normal, least), with thrust constant between nodes."""
    edges = np.unique(np.concatenate([np.linspace(path.start, path.end, NODES + 1), [p[0] for p in planes]]))
    count = len(edges) - 1
    matrix = hill()
    states, effects = np.eye(6), np.zeros((6, 3 * count))
    rows = []
    for m in range(count):
        both = np.zeros((9, 9))
        both[:6, :6], both[3:6, 6:] = matrix, np.eye(3)
        step = expm(both * (edges[m + 1] - edges[m]))
        states, effects = step[:6, :6] @ states, step[:6, :6] @ effects
        effects[:, 3 * m : 3 * m + 3] += step[:6, 6:]
        here = [p for p in planes if p[0] == edges[m + 1]]
        rows += [(p, (states @ path.state(path.start))[:3], effects[:3].copy()) for p in here]
    scale = 1e-4  # m/s^2
    steps = np.repeat(np.diff(edges), 3)
    weight = sparse.diags(steps / steps.mean()).tocsc()
    reached = path.state(path.end) - states @ path.state(path.start)
    units = np.array([1.0, 1.0, 1.0, N, N, N])[:, None]
    ends = scale * effects / units
    kept = np.array([scale * normal @ effect for (_, normal, _), _, effect in rows])
    least = np.array([low - normal @ place for (_, normal, low), place, _ in rows])
    given = sparse.csc_matrix(np.vstack([ends, -kept]))
    limits = np.concatenate([reached / units[:, 0], -least])
    cones = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(rows))]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_rel = settings.tol_feas = 1e-10
    solved = clarabel.DefaultSolver(weight, np.zeros(3 * count), given, limits, cones, settings).solve()
    u = scale * np.array(solved.x)
    return 0.5 * float((steps * u * u).sum())


@pytest.mark.parametrize("k", [3.0])
def test_energy_equals_that_of_a_convex_program_with_the_same_planes(k):
    plan = cf.avoid(PATH, CLIENT, ZONE, errors=ERRORS, sigmas=k)
    planes = [(c.time, c.normal, c.reach + k * c.sigma) for c in plan.contacts]
    # thrust that is held between 400 nodes costs more by the square of their distance
    assert plan.energy == pytest.approx(least_energy(PATH, planes), rel=2e-4)
    assert plan.lower_bound <= plan.energy * (1.0 + 1e-12)


def test_zero_sigmas_give_the_plain_plan():
    plain = cf.avoid(PATH, CLIENT, ZONE)
    none = cf.avoid(PATH, CLIENT, ZONE, errors=ERRORS, sigmas=0.0)
    assert (none.energy, none.sigmas) == (plain.energy, 0.0)
    nowhere = cf.avoid(PATH, CLIENT, ZONE, errors=cf.Uncertainty(), sigmas=3.0)
    assert nowhere.energy == pytest.approx(plain.energy, rel=1e-6)
    few = cf.avoid(PATH, CLIENT, ZONE, errors=ERRORS, sigmas=1e-6)
    assert few.energy == pytest.approx(plain.energy, rel=1e-6)


def test_cost_grows_with_sigmas_by_the_shadow_price():
    by_sigmas = [cf.avoid(PATH, CLIENT, ZONE, errors=ERRORS, sigmas=k) for k in (1.0, 1.999, 2.0, 2.001, 3.0)]
    spent = [plan.energy for plan in by_sigmas]
    assert spent == sorted(spent)
    assert spent[0] < spent[-1]
    (price,) = by_sigmas[2].prices
    assert price.per_sigma == pytest.approx((spent[3] - spent[1]) / 0.002, rel=1e-3)
    known = [cf.Uncertainty(s * s * KNOWN) for s in (0.5, 1.0, 1.5)]
    by_errors = [cf.avoid(PATH, CLIENT, ZONE, errors=one, sigmas=2.0).energy for one in known]
    assert by_errors == sorted(by_errors)
    assert by_errors[2] == pytest.approx(spent[4], rel=1e-6)  # 3 sigmas are 2 of errors half as large again


def test_errors_of_the_obstacle_add():
    both = cf.avoid(PATH, CLIENT, ZONE, errors=ERRORS, other_errors=ERRORS, sigmas=1.5)
    one = cf.avoid(PATH, CLIENT, ZONE, errors=cf.Uncertainty(2.0 * KNOWN), sigmas=1.5)
    other = cf.avoid(PATH, CLIENT, ZONE, other_errors=cf.Uncertainty(2.0 * KNOWN), sigmas=1.5)
    assert both.energy == pytest.approx(one.energy, rel=1e-6)
    assert other.energy == pytest.approx(one.energy, rel=1e-6)


@pytest.mark.parametrize(
    "zone",
    [
        cf.Box([25.0, 30.0, 20.0]),
        pytest.param(cf.Ellipsoid([25.0, 35.0, 20.0]), marks=pytest.mark.slow),
        pytest.param(cf.Cylinder(28.0, 20.0, [0, 0, 1]), marks=pytest.mark.slow),
        cf.HalfSpaces([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]], [18.0] * 4),
    ],
)
def test_zone_shapes(zone):
    plan = cf.avoid(PATH, CLIENT, zone, errors=ERRORS, sigmas=2.0)
    assert plan.status == cf.Status.AVOIDED
    times = np.linspace(PATH.start, PATH.end, 200)
    places = flown(plan.path, times, sampled_errors(3000, 6, 2.0, 3), np.sqrt(KNOWN))
    least = float(zone.norm(places.reshape(-1, 3)).min())
    assert 1.0 < least < 1.1  # 3000 samples do not include the active one
    assert plan.lower_bound <= plan.energy


def test_burn_magnitude_errors():
    errors = cf.Uncertainty(KNOWN, magnitude=0.03)
    plan = cf.avoid(PATH, CLIENT, ZONE, errors=errors, sigmas=2.0)
    times = np.linspace(PATH.start, PATH.end, 400)
    places = flown(plan.path, times, sampled_errors(1500, 7, 2.0, 4), np.sqrt(KNOWN), magnitude=0.03)
    assert np.linalg.norm(places, axis=2).min() > 28.0
    assert cf.clearance_in_sigmas(plan.path, CLIENT, ZONE, errors).sigmas == pytest.approx(2.0, rel=1e-5)
    known = cf.avoid(PATH, CLIENT, ZONE, errors=ERRORS, sigmas=2.0)
    assert plan.energy > known.energy
    # the bound without these errors is nearly the cost without them
    assert cf.avoid(PATH, CLIENT, ZONE).lower_bound < plan.lower_bound <= known.energy * (1.0 + 1e-9)


def test_impulses_keep_the_margin():
    spent = []
    for k in (1.0, 2.0):
        plan = cf.avoid(PATH, CLIENT, ZONE, errors=ERRORS, sigmas=k, cost="delta-v")
        assert (plan.status, plan.sigmas) == (cf.Status.AVOIDED, k)
        times = np.linspace(PATH.start, PATH.end, 400)
        places = flown(plan.path, times, sampled_errors(1000, 6, k, 5), np.sqrt(KNOWN))
        assert np.linalg.norm(places, axis=2).min() > 28.0
        spent.append(plan.delta_v)
    assert cf.avoid(PATH, CLIENT, ZONE, cost="delta-v").delta_v < spent[0] < spent[1]
    gates = cf.Uncertainty(KNOWN, impulse=[1e-4, 0.01, 1e-4, 0.01])
    wider = cf.avoid(PATH, CLIENT, ZONE, errors=gates, sigmas=2.0, cost="delta-v")
    assert cf.clearance_in_sigmas(wider.path, CLIENT, ZONE, gates).sigmas >= 2.0
    assert wider.delta_v > spent[1]


def ring(size, phase, order):
    angle = 2.0 * np.pi * np.arange(4) / 4 + phase
    x, y = size * np.cos(angle), -2.0 * size * np.sin(angle)
    states = np.stack([x, y, 0 * x, 0.5 * N * y, -2.0 * N * x, 0 * x], axis=1)
    return states[order]


@pytest.mark.parametrize("cost", [pytest.param("energy", marks=pytest.mark.slow), "delta-v"])
def test_four_spacecraft_keep_the_margin_of_both_errors(cost):
    initial, final = ring(60.0, 0.0, [0, 1, 2, 3]), ring(60.0, 0.3, [2, 0, 1, 3])
    known = [cf.Uncertainty(s * s * KNOWN) for s in (0.5, 1.0, 1.0, 1.5)]
    spent = []
    for k in (0.0, 1.0, 2.0):
        plan = cf.reconfigure(
            ORBIT, initial, final, 0.25 * ORBIT.period, cf.Sphere(20.0), errors=known, sigmas=k, cost=cost
        )
        assert plan.ok
        assert plan.sigmas == k
        spent.append(plan.spent)
    assert plan.contacts
    assert spent[0] < spent[1] < spent[2]
    times = np.linspace(0.0, 0.25 * ORBIT.period, 150)
    draws = sampled_errors(800, 24, 2.0, 6).reshape(800, 4, 6)  # joint errors of all four
    sizes = (0.5, 1.0, 1.0, 1.5)
    places = [flown(plan.paths[i], times, draws[:, i], sizes[i] * np.sqrt(KNOWN)) for i in range(4)]
    for i in range(4):
        for j in range(i):
            assert np.linalg.norm(places[i] - places[j], axis=2).min() > 20.0
            met = cf.clearance_in_sigmas(plan.paths[i], plan.paths[j], cf.Sphere(20.0), known[i], known[j])
            assert met.sigmas >= 2.0


def test_rejected_ends_report_their_sigmas():
    plan = cf.avoid(PATH, CLIENT, ZONE, errors=ERRORS, sigmas=30.0)
    assert (plan.status, plan.path) == (cf.Status.END_INSIDE, None)
    allowed = float(plan.reason.split("ends allow ")[1].split(")")[0])
    ends = np.array([PATH.start, PATH.end])
    places, spreads = PATH.position(ends), [m @ KNOWN @ m.T for m in moved(ends)[:, :3]]
    least = [
        min(nearest(r, spread, share * allowed) for r, spread in zip(places, spreads, strict=True))
        for share in (0.99, 1.01)
    ]
    assert least[0] > 28.0 > least[1]
    states = PATH.state(0.0)[None], PATH.state(PATH.end)[None]
    many = cf.reconfigure(
        ORBIT, *states, PATH.end, [None, ZONE], obstacles=CLIENT, errors=[ERRORS], sigmas=30.0
    )
    assert many.status == cf.Status.END_INSIDE
    assert f"ends allow {allowed:g}" in many.reason


def test_inner_ellipsoid_of_the_lower_bound():
    plain = Problem.of(stack([PATH]), stack([CLIENT]), [(ZONE, np.array([[0, 1]]))])
    problem = Margin((ERRORS, None), 2.0).problem(plain)
    plan = cf.avoid(PATH, CLIENT, ZONE, errors=ERRORS, sigmas=2.0)
    contact = plan.contacts[0]
    at = Contacts.at(np.array([0]), np.array([contact.time]))
    normal = np.linalg.solve(ZONE.matrix.T, contact.normal)
    inside = problem.insides(at._replace(normals=normal[None]))[0]
    draws = np.random.default_rng(2).normal(size=(2, 4000, 3))
    surface, ways = draws / np.linalg.norm(draws, axis=2, keepdims=True)
    places = np.linalg.solve(inside, surface.T).T * 28.0  # m, on the ellipsoid
    flow = expm(hill() * contact.time)[:3]
    reach = 28.0 + 2.0 * np.sqrt(np.einsum("ki,ij,kj->k", ways, flow @ KNOWN @ flow.T, ways))
    assert (places @ ways.T <= reach + 1e-9).all()
    along = np.linalg.norm(np.linalg.solve(inside.T, contact.normal)) * 28.0
    assert along == pytest.approx(28.0 + 2.0 * contact.sigma, rel=1e-9)
    # so that it bounds the zone from inside
    assert plan.lower_bound > cf.avoid(PATH, CLIENT, ZONE).lower_bound


SCENARIO = """\
closeform = 1
title = "Known to some metres"

[orbit]
altitude = "500 km"

[craft]
name = ["A", "B", "C"]
position = ["0 0 0 m", "3 41 -39 m", "0 400 0 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "24 m" }
covariance = { position = "1 2 1 m", velocity = "1 1 1 mm/s" }
execution = { magnitude = "1 %" }

[[stage]]
do = "coast"
for = "100 s"
"""
TOGETHER = """
[[stage]]
do = "reconfigure"
to = [
  { position = "4 60 -30 m", velocity = "0 0 0 m/s" },
  { position = "-4 -60 30 m", velocity = "0 0 0 m/s" },
  { position = "0 400 0 m", velocity = "0 0 0 m/s" },
]
within = "0.15 orbits"
"""


def test_reconfigure_stage_keeps_the_requested_sigmas():
    text = SCENARIO.replace('"0 0 0 m", "3', '"0 -60 30 m", "3') + TOGETHER
    without, kept = plan_mission(parse(text)), plan_mission(parse(text + "sigmas = 3.0\n"))
    assert kept.results[-1].result.plan.sigmas == 3.0
    assert without.results[-1].uncertain.nearest.sigmas < 3.0 <= kept.results[-1].uncertain.nearest.sigmas
    assert kept.verdict.ok


def test_zone_of_each_pair():
    """Each pair keeps its own zone at the requested sigmas."""
    known = cf.Uncertainty(np.diag([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2)
    path = ORBIT.transfer([3, 41, -39, 0, 0, 0], [-4, -60, 43, 0, 0, 0], 0.4 * ORBIT.period)
    others = [ORBIT.coast([0, ahead, 0, 0, 0, 0], path.end) for ahead in (0.0, -100.0)]
    zones = cf.PairZones.of([cf.Sphere(10.0), cf.Box([15.0, 25.0, 15.0]), cf.Sphere(5.0)])
    plan = cf.avoid(path, others, zones, errors=known, other_errors=[None, known], sigmas=2.0)
    assert plan.ok
    assert plan.contacts
    for k, (other, theirs) in enumerate(zip(others, (None, known), strict=True)):
        zone = zones.between(0, k + 1)
        assert cf.clearance_in_sigmas(plan.path, other, zone, known, theirs).sigmas >= 2.0
    assert cf.clearance_in_sigmas(path, others[0], zones.between(0, 1), known).sigmas < 2.0
