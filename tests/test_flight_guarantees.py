"""Guarantees of the flight core, against integrated equations of motion, in slices, and for bad input."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from closeform.flight.library import compiler, core
from closeform.flight.motion import path_of
from closeform.flight.pairs import loss_of_thrust, zone_of
from closeform.flight.table import chief_of

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")

MU = 3.986004418e14
CIRCLE = cf.Orbit.circular(500e3)
ELLIPSE = cf.Orbit.eccentric(0.4, perigee_altitude=500e3)
ZONE = cf.Ellipsoid([20.0, 40.0, 30.0])


def flown(path, since, until):
    """Return the state of a path at times: integrated linear equations of motion about a Kepler orbit."""
    if path.orbit is CIRCLE:
        axis, e = (MU / CIRCLE.mean_motion**2) ** (1 / 3), 0.0
    else:
        axis, e = 6878137.0 / 0.6, 0.4
    momentum = np.sqrt(MU * axis * (1 - e * e))

    def rates(t, s):
        r, fall, (x, y, z, vx, vy, vz) = s[0], s[1], s[2:]
        w, bend = momentum / r**2, -2.0 * momentum * fall / r**3
        ux, uy, uz = path.thrust(min(t, path.end)) if t <= path.end else np.zeros(3)
        ax = 2 * w * vy + bend * y + (w * w + 2 * MU / r**3) * x + ux
        ay = -2 * w * vx - bend * x + (w * w - MU / r**3) * y + uy
        return [fall, momentum**2 / r**3 - MU / r**2, vx, vy, vz, ax, ay, -MU / r**3 * z + uz]

    def at(t):  # of the chief, which is at perigee at time 0
        if t == 0.0:
            return np.array([axis * (1 - e), 0.0])
        chief = solve_ivp(
            lambda _, s: [s[1], momentum**2 / s[0] ** 3 - MU / s[0] ** 2],
            (0.0, t),
            [axis * (1 - e), 0.0],
            rtol=1e-10,
            atol=1e-9,
        )
        return chief.y[:, -1]

    whole = solve_ivp(
        rates,
        (since, until),
        [*at(since), *path.state(since)],
        method="DOP853",
        rtol=1e-10,
        atol=1e-10,
        dense_output=True,
    )
    return lambda t: whole.sol(t)[2:]


def passing(rng, path):
    """Return a coast that comes within some 15 m of a path half-way."""
    half = 0.5 * (path.end - path.start)
    there = path.state(path.start + half) + rng.normal(size=6) * ([15.0] * 3 + [0.05] * 3)
    begin = np.linalg.solve(path.orbit.transition(half, path.start), there)
    return path.orbit.coast(begin, 2.0 * half, start=path.start)


@pytest.mark.parametrize("orbit", [CIRCLE, ELLIPSE], ids=["circle", "ellipse"])
def test_conflicts_are_those_of_integrated_motion(orbit):
    rng = np.random.default_rng(5)
    met = 0
    for k in range(6):
        start, duration = 400.0 * k, 1500.0
        begin, end = rng.normal(size=(2, 6)) * ([30.0] * 3 + [0.05] * 3)
        aside = rng.normal(size=3) * 60.0
        begin[:3], end[:3] = begin[:3] + aside, end[:3] - aside
        path = cf.flight.transfer(orbit, begin, end, duration, start)
        other = passing(rng, path)
        one, two = flown(path, start, start + duration), flown(other, start, start + duration)
        times = np.linspace(start, start + duration, 3000)
        norms = ZONE.norm((one(times) - two(times))[:3].T)
        inside = np.zeros(len(times), dtype=bool)
        for conflict in cf.flight.find_conflicts(path, other, ZONE):
            inside |= (times >= conflict.start - 1e-3) & (times <= conflict.end + 1e-3)
            for t in (conflict.start, conflict.end):
                if start < t < start + duration:
                    assert float(ZONE.norm((one(t) - two(t))[:3])) == pytest.approx(1.0, abs=1e-7)
                    met += 1
        assert (norms[~inside] > 1.0).all()
        assert (norms[inside] < 1.0 + 1e-3).all()
    assert met >= 4


def test_closest_approaches_of_paths_from_rest_to_rest_are_those_of_samples():
    rng, zones = np.random.default_rng(4), (cf.Sphere(10.0), cf.Box([10.0] * 3), cf.Cylinder(10.0, 10.0))
    for k in range(30):
        orbit = (cf.Orbit(0.0), CIRCLE, ELLIPSE)[k % 3]
        ends = rng.normal(size=(4, 6)) * ([40.0] * 3 + [0.0] * 3)
        path, other = (orbit.transfer(*pair, 1000.0) for pair in (ends[:2], ends[2:]))
        apart = [path.state(t)[:3] - other.state(t)[:3] for t in np.linspace(0.0, 1000.0, 401)]
        for zone in zones:
            least = zone.norm(np.array(apart)).min()
            ratio = cf.flight.closest_approach(path, other, zone).ratio
            assert least - 0.05 < ratio < least + 1e-9  # 0.5 m in half a step


def test_slices_of_the_least_budget_find_the_same_conflicts_and_certify_ever_longer():
    rng = np.random.default_rng(6)
    types, functions = core()
    found = 0
    for orbit in (CIRCLE, ELLIPSE):
        chief = chief_of(orbit)
        own = orbit.transfer([0, 150, 20, 0, 0, 0], [10, -150, -20, 0, 0, 0], 3000.0)
        others = [passing(rng, own) for _ in range(5)]
        kept = [path_of(one, chief) for one in (own, *others)]
        zone, searches = zone_of(ZONE), types.new("cff_conflict_search_t[5]")
        for k in range(5):
            assert functions.cff_conflicts_begin(searches + k, kept[0], kept[k + 1], zone) == functions.CFF_OK
        rows, count, until = (
            types.new("cff_fleet_conflict_t[40]"),
            types.new("uint32_t *"),
            types.new("double *", -1.0),
        )
        status, before = functions.CFF_MORE, -1.0
        while status == functions.CFF_MORE:
            used = sum(one.evaluations_used for one in searches)
            status = functions.cff_fleet_continue(searches, 5, 64, rows, 40, count, until)
            assert sum(one.evaluations_used for one in searches) - used <= 64 + 60  # the step that it is in
            assert until[0] >= before
            before = until[0]
        assert status == functions.CFF_OK
        assert until[0] == 3000.0
        for k, other in enumerate(others):
            mine = sorted(
                (row.conflict.start_s, row.conflict.end_s) for row in rows[0 : count[0]] if row.other == k
            )
            whole = [(one.start, one.end) for one in cf.flight.find_conflicts(own, other, ZONE)]
            assert mine == [pytest.approx(span, abs=1e-7) for span in whole]
            found += len(mine)
    assert found >= 3


def test_a_path_around_a_lingering_obstacle_is_clear_when_integrated():
    rng = np.random.default_rng(21)
    bent = 0
    for _ in range(8):
        way = rng.normal(size=3)
        way *= 200.0 / np.linalg.norm(way)
        direct = CIRCLE.transfer([*way, 0, 0, 0], [*-way, 0, 0, 0], 1800.0)
        there = direct.state(900.0) * ([1.0] * 3 + [0.9] * 3) + rng.normal(size=6) * ([10.0] * 3 + [0.02] * 3)
        obstacle = CIRCLE.coast(CIRCLE.transition(-900.0) @ there, 1800.0)
        path, status = cf.flight.avoid(direct, obstacle, ZONE)
        assert status == "OK"
        one, two = flown(path, 0.0, 1800.0), flown(obstacle, 0.0, 1800.0)
        times = np.linspace(0.0, 1800.0, 2000)
        assert ZONE.norm((one(times) - two(times))[:3].T).min() > 1.0 - 1e-6
        assert np.abs(one(1800.0) - direct.state(1800.0)).max() < 1e-4
        bent += len(path.arcs) > 1
    assert bent >= 6


@pytest.mark.parametrize("orbit", [CIRCLE, ELLIPSE], ids=["circle", "ellipse"])
def test_verdicts_on_loss_of_thrust_hold_for_integrated_drifts(orbit):
    rng = np.random.default_rng(9)
    functions, verdicts = core().functions, []
    for k in (0, 2, 4):
        until = 1.2 * orbit.period
        begin = [rng.normal() * 60.0, 250.0 + 80.0 * k, 60.0, 0, 0, 0]
        path = orbit.transfer(begin, [20.0, 70.0 + 80.0 * k, 30.0, 0, 0, 0.05], 1200.0)
        target = orbit.coast(np.zeros(6), until)
        found = loss_of_thrust(path, target, ZONE, until)
        verdicts.append(found.verdict)
        failures = np.linspace(0.0, 1200.0, 5) if found.verdict == functions.CFF_SAFE else [found.failure_s]
        for fails in failures:
            motion = flown(orbit.coast(path.state(fails), until - fails, start=fails), fails, until)
            if found.verdict == functions.CFF_SAFE:
                assert ZONE.norm(motion(np.linspace(fails, until, 800))[:3].T).min() > 1.0
            else:
                assert found.verdict == functions.CFF_UNSAFE
                assert float(ZONE.norm(motion(found.time_s)[:3])) < 1.0 + 1e-6
    assert len(set(verdicts)) == 2


def test_an_impulse_that_is_fired_in_part_leads_inside_between_two_clear_drifts():
    functions = core().functions
    first = CIRCLE.coast([-400.0, 44.0, 50.0, 4.0, 0.0, 0.0], 20.0)
    target = CIRCLE.coast(np.zeros(6), 300.0)
    verdicts = []
    for push in (0.1, -0.6, -1.25):
        after = first.state(20.0) + [0.0, 0.0, 0.0, 0.0, 0.0, push]
        path = cf.join([first, CIRCLE.coast(after, 20.0, start=20.0)])
        found = loss_of_thrust(path, target, ZONE, 300.0)
        drifts = [
            CIRCLE.coast(first.state(20.0) + [0, 0, 0, 0, 0, share * push], 280.0, start=20.0)
            for share in np.linspace(0.0, 1.0, 41)
        ]
        inside = [len(cf.find_conflicts(drift, target, ZONE)) > 0 for drift in drifts]
        assert (found.verdict == functions.CFF_SAFE) == (not any(inside))
        verdicts.append((inside[0], any(inside), inside[-1]))
        assert found.verdict == functions.CFF_SAFE or found.failure_s == 20.0
    assert (False, True, False) in verdicts


def test_thrust_is_that_of_the_package():
    types, functions = core()
    out = types.new("double[3]")
    for path in (
        CIRCLE.burn(np.zeros(6), [1e-3, -2e-3, 5e-4], 900.0, frame="inertial"),
        CIRCLE.transfer(np.zeros(6), [50.0, 20.0, 10.0, 0, 0, 0], 900.0),
    ):
        one = path_of(path, chief_of(CIRCLE))
        for t in (0.0, 333.0, 900.0):
            assert functions.cff_thrust_at(one, t, out) == functions.CFF_OK
            assert list(out) == pytest.approx(path.thrust(t), rel=1e-9, abs=1e-15)


def test_bad_numbers_are_refused_and_leave_the_answer_unchanged():
    types, functions = core()
    chief = chief_of(CIRCLE)
    coast = CIRCLE.coast([0, 100.0, 0, 0, 0, 0], 1000.0)
    for bad in (np.nan, np.inf, -np.inf):
        for place in (0, 1, 2, 6, 9, 12, 15, 18, 29):
            rows = coast.arcs.copy()
            rows[0, place] = bad
            broken = path_of(cf.Path(CIRCLE, rows, np.array([0, 1]), ()), chief)
            good, zone = path_of(coast, chief), zone_of(ZONE)
            search, near, found = (
                types.new(f"cff_{name}_t *") for name in ("conflict_search", "approach", "avoidance")
            )
            work, energy = types.new("cff_avoid_work_t *"), types.new("double *", 0.5)
            answers = search, near, found
            before = [bytes(types.buffer(one)) for one in answers]
            calls = [
                functions.cff_conflicts_begin(search, broken, good, zone),
                functions.cff_closest_approach(good, broken, zone, 0.0, 1000.0, 1000, near),
                functions.cff_avoid(broken.arcs, good, zone, 1, 1000, work, found),
                functions.cff_energy(broken, energy),
            ]
            assert calls == [functions.CFF_BAD_INPUT] * 4, (bad, place)
            assert [bytes(types.buffer(one)) for one in answers] == before
            assert energy[0] == 0.5
