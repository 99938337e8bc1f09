"""Requirements on states and thrust about any chief, against a cone program and integrated equations."""

import clarabel
import numpy as np
import pytest
from scipy.optimize import linprog, minimize_scalar
from scipy.sparse import csc_matrix

import closeform as cf
from chiefs import matrices_by_integration, orbit_of, with_impulses

START, END = np.array([0, -200.0, 0, 0, 0, 0]), np.array([0, -5.0, 0, 0, 0, 0])
BEGIN, TIME, UNIT = 500.0, 2400.0, 0.05  # s, s, m/s
ASTERN, SLOPE, CENTRE = [0, -1, 0], np.tan(np.radians(10)), np.array([6.0, -100.0, 0.0])
CORRIDOR = cf.requirements.ApproachCone(axis=ASTERN, half_angle=np.radians(10), radius=0.5)
GLIDE = cf.requirements.SpeedLimit(limit=0.05, rate=1e-3, axis=ASTERN)
WAYPOINT = cf.requirements.KeepIn(zone=cf.Sphere(2.0), centre=CENTRE, start=BEGIN + 900, end=BEGIN + 900)
QUIET = cf.requirements.NoThrust(start=BEGIN + 1000.0, end=BEGIN + 1500.0)


def sets(time):
    """Return matrices and offsets with which states x meet |(m x + c)[1:]| <= (m x + c)[0] at a time."""
    corridor, glide, waypoint = np.zeros((3, 6)), np.zeros((4, 6)), np.zeros((4, 6))
    corridor[0, 1], corridor[1, 0], corridor[2, 2] = -SLOPE, 1.0, 1.0
    glide[0, 1], glide[1:, 3:] = -1e-3, np.eye(3)
    waypoint[1:, :3] = np.eye(3)
    always = [(corridor, np.array([0.5, 0, 0])), (glide, np.array([0.05, 0, 0, 0]))]
    return [*always, (waypoint, np.append(2.0, -CENTRE))] if time == WAYPOINT.start else always


def least_by_cones(times, flows):
    """Return the minimum delta-v of impulses at `times` that keeps all requirements at them."""
    count = len(times)
    back, width = UNIT * np.linalg.inv(flows)[..., 3:], 4 * count  # impulses, and bounds on their sizes
    rows, rhs, cones = [], [], []

    def add(matrix, given, cone):
        rows.append(np.hstack([matrix, np.zeros((len(matrix), count))]))
        rhs.append(given)
        cones.append(cone)

    for k, time in enumerate(times):
        moved = [flows[k] @ back[j] if j <= k else np.zeros((6, 3)) for j in range(count)]
        moved, coasted = np.concatenate(moved, axis=1), flows[k] @ START
        if k + 1 == count:
            weights = np.repeat([1.0, 1000.0], 3) / 200.0
            add(weights[:, None] * moved, weights * (END - coasted), clarabel.ZeroConeT(6))
        for matrix, offset in sets(time):
            add(-matrix @ moved, matrix @ coasted + offset, clarabel.SecondOrderConeT(len(matrix)))
        size = np.zeros((4, width))
        size[0, 3 * count + k], size[1:, 3 * k : 3 * k + 3] = -1.0, -np.eye(3)
        rows.append(size)
        rhs.append(np.zeros(4))
        cones.append(clarabel.SecondOrderConeT(4))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cost = np.repeat([0.0, 1.0], [3 * count, count])
    given = csc_matrix((width, width)), cost, csc_matrix(np.vstack(rows)), np.concatenate(rhs)
    found = clarabel.DefaultSolver(*given, cones, settings).solve()
    assert str(found.status) == "Solved"
    return UNIT * found.obj_val


@pytest.mark.parametrize("kind", [0.3, "J2"])
def test_requirements_are_kept_at_hardly_more_than_the_least_cost(kind):
    """When integrated, the path keeps them; no bound is above the cone program on a grid of times."""
    orbit = orbit_of(kind)
    task = orbit, [START], [END], TIME, cf.Sphere(1.0)
    options = {"start": BEGIN, "cost": "delta-v", "if_blocked": ()}
    kept, free = CORRIDOR, cf.reconfigure(*task, **options)
    plan = cf.reconfigure(*task, requirements=(CORRIDOR, GLIDE, WAYPOINT), **options)
    assert plan.status == cf.Status.AVOIDED
    assert not kept.holds(free.path)
    times = np.union1d(np.linspace(BEGIN, BEGIN + TIME, 4001), [WAYPOINT.start, BEGIN + TIME])
    for time, state in zip(times, with_impulses(plan.path, times), strict=True):
        for matrix, offset in sets(time):
            first, *rest = matrix @ state + offset
            assert np.linalg.norm(rest) <= first + 1e-6
    assert np.abs(with_impulses(plan.path, times)[-1] - END).max() < 1e-6
    grid = np.linspace(BEGIN, BEGIN + TIME, 121)
    grid[np.abs(grid - WAYPOINT.start).argmin()] = WAYPOINT.start
    least = least_by_cones(grid, matrices_by_integration(orbit, grid))
    assert free.delta_v < plan.lower_bound <= least * (1 + 1e-4)
    assert plan.delta_v <= 1.06 * least


def test_requirements_combine_with_drift_and_quiet_times():
    """Past an obstacle at the side of a corridor, each drift of half an orbit is clear of it."""
    orbit = orbit_of(0.3)
    rock, until = orbit.coast([30.0, -60.0, 0.0, 0, 0, 0], 12_000.0), BEGIN + TIME + 0.2 * orbit.period
    wide = cf.requirements.ApproachCone(axis=ASTERN, half_angle=np.radians(35), radius=10.0)
    path = orbit.transfer(START, END, TIME, BEGIN)
    options = {"cost": "delta-v", "drift": until - BEGIN - TIME}
    plan = cf.avoid(path, rock, cf.Sphere(15.0), requirements=(wide, QUIET), **options)
    assert plan.ok, plan.reason
    assert cf.passively_safe(plan.path, rock, cf.Sphere(15.0), until)
    assert wide.margin(with_impulses(plan.path, np.linspace(BEGIN, BEGIN + TIME, 2001))).min() > -1e-6
    assert not any(QUIET.start < time < QUIET.end for time, _ in plan.path.impulses)


@pytest.mark.parametrize("kind", [0.6, "J2"])
def test_certificate_decides_to_a_hair(kind):
    """On a coast whose largest speed is found by minimisation, and with the exact bound of its curvature."""
    orbit = orbit_of(kind)
    path = orbit.coast([120.0, -300.0, 40.0, 0.05, -0.1, 0.2], 0.9 * orbit.period, 300.0)

    def speed(time):
        return np.linalg.norm(path.velocity(time), axis=-1)

    times = np.linspace(path.start, path.end, 20_001)
    k = int(speed(times).argmax())
    around = times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)]
    fastest = -minimize_scalar(lambda t: -speed(t), bounds=around, method="bounded").fun
    for factor in (1.0 + 1e-7, 1.0 - 1e-7):
        limit = cf.requirements.SpeedLimit(limit=factor * max(fastest, speed(times).max()))
        assert limit.holds(path) == (factor > 1.0)
    bend, jerk = orbit._bends(path.arcs)
    spacing = times[1] - times[0]
    rates = np.diff(path.velocity(times), axis=0) / spacing
    assert np.linalg.norm(rates, axis=1).max() <= bend[0]
    assert np.linalg.norm(np.diff(rates, axis=0), axis=1).max() / spacing <= jerk[0] * (1 + 1e-6)


def test_thrusters_in_fixed_directions_have_the_cost_of_a_linear_program():
    """Without a zone in the way, among impulses at 400 times; no bound is above it."""
    orbit, directions = (
        orbit_of(0.3),
        [[1, 0, 0.3], [-1, 0.2, 0], [0, 1, 0], [0, -1, 0.1], [0, 0, 1], [0, 0, -1]],
    )
    thrusters = cf.Thrusters([np.array(one) / np.linalg.norm(one) for one in directions])
    end = np.array([60.0, 150.0, 40.0, 0, 0, 0])
    rock = orbit.coast([0, -100.0, 0, 0, 0, 0], 6000.0)
    task = {"start": BEGIN, "cost": "delta-v", "thrusters": thrusters, "obstacles": rock}
    plan = cf.reconfigure(orbit, [START], [end], TIME, cf.Sphere(20.0), **task)
    assert plan.ok, plan.reason
    times = np.linspace(BEGIN, BEGIN + TIME, 400)
    flows = matrices_by_integration(orbit, times)
    pushes = (flows[-1] @ np.linalg.inv(flows))[..., 3:] @ thrusters.directions.T
    weights = np.repeat([1.0, 1000.0], 3)
    columns, gap = (
        weights[:, None] * pushes.swapaxes(0, 1).reshape(6, -1),
        weights * (end - flows[-1] @ START),
    )
    free = linprog(np.ones(columns.shape[1]), A_eq=columns, b_eq=gap).fun
    assert plan.lower_bound <= free * (1 + 1e-9)
    assert plan.lower_bound == pytest.approx(free, rel=1e-3)
    assert free * 0.999 < plan.delta_v < 1.3 * free
    for _, jump in plan.path.impulses:
        assert (thrusters.directions @ jump).max() > 0.5 * np.linalg.norm(jump)
    assert np.abs(with_impulses(plan.path, times)[-1] - end).max() < 1e-6
    assert not cf.find_conflicts(plan.path, rock, cf.Sphere(20.0))


def test_fixed_thrusters_of_one_craft_and_a_thrust_limit_of_another():
    """Two craft far apart: impulses along the axes by one, burns by the other."""
    orbit, axes = orbit_of(0.1), cf.Thrusters([*np.eye(3), *-np.eye(3)])
    starts = np.array([START, START + [0, 5e3, 0, 0, 0, 0]])
    given = {"start": BEGIN, "cost": "delta-v", "thrusters": [axes, None], "max_acceleration": [np.inf, 2e-3]}
    plan = cf.reconfigure(orbit, starts, starts + END - START, TIME, cf.Sphere(20.0), **given)
    assert plan.ok, plan.reason
    first, second = plan.paths[0], plan.paths[1]
    assert first.impulses
    assert not second.impulses
    assert second.peak_thrust <= 2e-3 * (1 + 1e-9)
    assert plan.lower_bound <= plan.delta_v <= 1.05 * plan.lower_bound
