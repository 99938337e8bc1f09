"""The high-fidelity model against a differentiated potential and an independent simulation.

That simulation integrates inertial motion by DOP853 in a textbook's J2; finite differences of the
integrated chief give the relative frame.
"""

import mpmath
import numpy as np
import pytest
from numpy.polynomial import Legendre
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

import closeform as cf
from closeform.dynamics.force_model.field import EARTH_ZONALS, GRAVITY_RADIUS
from closeform.dynamics.model_error_estimate import MOVES, model_error
from closeform.dynamics.simulation.impulse_retargeting import Retargeted
from simulated import (
    EPOCH,
    FIELD,
    MU,
    ORBIT,
    axes_of,
    chief,
    fired,
    flown,
    flown_apart,
    formation,
    pushed,
    task,
    textbook,
)

# --- forces -----------------------------------------------------------------------------------


def test_zonals_are_the_gradient_of_the_potential():
    """Difference mu/r (1 - sum J_k (R/r)^k P_k(s)) in forty digits."""
    place = [mpmath.mpf(v) for v in (3.1e6, -4.7e6, 4.2e6)]
    polynomials = [Legendre.basis(k).convert(kind=np.polynomial.Polynomial).coef for k in range(2, 7)]

    def potential(x, y, z):
        r = mpmath.sqrt(x * x + y * y + z * z)
        total = mpmath.mpf(1)
        for k, (zonal, powers) in enumerate(zip(EARTH_ZONALS, polynomials, strict=True), 2):
            legendre = sum(mpmath.mpf(c) * (z / r) ** p for p, c in enumerate(powers))
            total -= zonal * (GRAVITY_RADIUS / r) ** k * legendre
        return MU / r * total

    with mpmath.workdps(40):
        want = [
            float(mpmath.diff(potential, tuple(place), tuple(int(i == axis) for i in range(3))))
            for axis in range(3)
        ]
    felt = cf.Field(chief(), zonals=6).accelerations(0.0, [*map(float, place), 0.0, 0.0, 0.0])
    assert felt == pytest.approx(want, rel=1e-12)


def test_drag_by_hand():
    """rho B v^2 / 2 against the motion at the reference height, in an atmosphere at rest."""
    air = cf.Drag(4e-13, 500e3, 60e3, ballistic=0.02, chief=0.01, spin=0.0)
    at = [cf.elements.EARTH_RADIUS + 500e3, 0.0, 0.0, 0.0, 7600.0, 0.0]
    with_air = cf.Field(chief(), 0, air).accelerations(0.0, at, 0.02)
    without = cf.Field(chief(), 0).accelerations(0.0, at)
    assert with_air - without == pytest.approx([0.0, -0.5 * 4e-13 * 0.02 * 7600.0**2, 0.0], abs=1e-15)
    higher = np.array(at) + [60e3, 0, 0, 0, 0, 0]
    thinner = cf.Field(chief(), 0, air).accelerations(0.0, higher, 0.02)[1]
    assert thinner == pytest.approx(-0.5 * 4e-13 / np.e * 0.02 * 7600.0**2, rel=1e-10)


def test_atmosphere_rotates_with_the_earth():
    """A circular orbit at the rate of the atmosphere has no drag."""
    spin, at = 7600.0 / 6.9e6, [6.9e6, 0.0, 0.0, 0.0, 7600.0, 0.0]
    air = cf.Drag(4e-13, 500e3, 60e3, ballistic=0.02, chief=0.01, spin=spin)
    felt = cf.Field(chief(), 0, air).accelerations(0.0, at, 0.02)
    assert felt == pytest.approx(cf.Field(chief(), 0).accelerations(0.0, at), abs=1e-15)


# --- motion of the chief ------------------------------------------------------------------------


def test_chief_moves_in_the_field():
    field, times = cf.Field(chief()), np.array([4000.0, -1700.0, 0.0, 9000.0])
    states = field.chief_states(times)
    for time, state in zip(times, states, strict=True):
        if time == 0.0:
            assert state == pytest.approx(chief().state)
            continue
        rates = lambda t, s: np.concatenate([s[3:], textbook(s[:3])])  # noqa: E731
        end = solve_ivp(rates, (0.0, time), chief().state, "DOP853", rtol=1e-13, atol=1e-7).y[:, -1]
        assert state[:3] == pytest.approx(end[:3], abs=1e-4)  # m; one orbit has 40 000 km
        assert state[3:] == pytest.approx(end[3:], abs=1e-7)


def test_function_as_a_field():
    own = cf.Field(chief(), acceleration=lambda times, states: textbook(states[:, :3]))
    built, times = cf.Field(chief()), [0.0, 900.0, 5000.0]
    assert own.chief_states(times) == pytest.approx(built.chief_states(times), rel=1e-11, abs=1e-3)
    path = chief().orbit.transfer([0, 200, 0, 0, 0, 0], [0, 50, 30, 0, 0, 0], 3000.0)
    one, other = (cf.compensated_thrust(path, field).commanded for field in (own, built))
    assert one == pytest.approx(other, abs=1e-10)  # differences of accelerations of 8 m/s^2


def test_chief_keeps_keplers_orbit_without_zonals():
    times, high = np.linspace(-6000.0, 20000.0, 11), chief(e=0.1, a=8e6)
    assert cf.Field(high, 0).chief_states(times) == pytest.approx(high.states(times), rel=1e-8, abs=1e-3)


def test_chief_along_an_ephemeris():
    """The chief follows the ephemeris, not the motion that the field gives its first state."""
    times = np.arange(0.0, 3600.0, 30.0)
    states = chief().states(times)  # Kepler's, in a field with J2
    table = cf.Ephemeris("A", "2026-001A", "EARTH", "GCRF", "UTC", EPOCH, times, states)
    field = cf.Field(cf.Chief.from_ephemeris(table))
    assert field.chief_states([1000.0]) == pytest.approx(chief().states([1000.0]), rel=1e-9)


# --- relative motion ----------------------------------------------------------------------------


def test_cross_track_force_rotates_the_frame():
    """Relative velocity is the rate of relative position in the rotating axes of the chief."""
    field, dt = cf.Field(chief()), 0.02
    before, now, after = field.chief_states([-dt, 0.0, dt])
    deputy = now + np.array([300.0, -800.0, 900.0, 0.5, -0.2, 0.4])
    felt = textbook(deputy[:3])
    places = []
    for t, origin in ((-dt, before), (dt, after)):
        there = deputy[:3] + t * deputy[3:] + 0.5 * t * t * felt
        places.append(axes_of(origin) @ (there - origin[:3]))
    rate = (places[1] - places[0]) / (2.0 * dt)
    turning = cf.elements.relative_from_inertial(now, deputy, acceleration=textbook(now[:3]))
    plain = cf.elements.relative_from_inertial(now, deputy)
    assert turning[3:] == pytest.approx(rate, abs=2e-6)  # m/s: dt^2/6 of a jerk of 8e-3 m/s^3
    assert np.abs(plain[3:] - rate).max() > 1e-4
    back = cf.elements.inertial_from_relative(now, turning, acceleration=textbook(now[:3]))
    assert back == pytest.approx(deputy, rel=1e-12)
    arcs = cf.elements.relative_from_inertial(now, deputy, "arc", acceleration=textbook(now[:3]))
    assert cf.elements.inertial_from_relative(
        now, arcs, "arc", acceleration=textbook(now[:3])
    ) == pytest.approx(deputy)


def test_compensated_thrust_reaches_the_planned_end():
    """Planned thrust ends metres off; compensated thrust, interpolated by a spline, does not."""
    from scipy.interpolate import CubicSpline

    orbit = chief().orbit
    start, final, duration = task(orbit, 1)
    path = orbit.transfer(start, final, duration)
    table = cf.compensated_thrust(path, cf.Field(chief()))
    assert table.field == "J2"
    spline = CubicSpline(table.times, table.commanded, axis=1)
    kept = flown(path, start, duration, lambda t: spline(t))
    left = flown(path, start, duration, lambda t: path.thrust(min(t, duration)))
    assert np.linalg.norm(kept - final[:, :3], axis=1).max() < 1e-3  # m, promised; about 1e-6 is reached
    off = np.linalg.norm(left - final[:, :3], axis=1)
    assert off.min() > 0.5
    predicted = cf.validity(path, cf.Field(chief()))
    assert predicted.ends == pytest.approx(off, rel=2e-3)
    assert (np.abs(table.commanded - table.planned + table.residual) < 1e-18).all()


def test_model_error_of_a_circular_orbit_is_curvature():
    """It is of second order in the distance, at most 3 n^2 rho^2 / a."""
    still = chief(e=0.0)
    n, a = still.orbit.mean_motion, 6.878e6
    sizes = []
    for size in (2000.0, 1000.0, 500.0):
        path = still.orbit.coast([0.0, size, 0, 0, 0, 0], 3000.0)
        sizes.append(cf.validity(path, cf.Field(still, 0)).residual[0])
    assert sizes[0] <= 3.0 * n * n * 2000.0**2 / a
    assert np.diff(np.log2(sizes)) == pytest.approx([-2.0, -2.0], abs=0.01)


def test_deviation_is_proportional_to_eccentricity():
    """The deviation doubles with the eccentricity and stays below the 95 % estimate of the model error."""
    ends, stated = [], []
    for e in (5e-4, 1e-3, 2e-3):
        start, final, duration = task(chief(e).orbit, 4, size=300.0)
        path = chief(e).orbit.transfer(start, final, duration)
        found = cf.validity(path, cf.Field(chief(e), 0))
        ends.append(found.ends.max())
        reach = np.linalg.norm(path.position(np.linspace(0.0, duration, 200)), axis=-1).max()
        stated.append(model_error(reach, duration / path.orbit.period, 6.878e6, e, len(path), MOVES)[1])
    assert np.diff(np.log2(ends)) == pytest.approx([1.0, 1.0], abs=0.1)
    assert (np.array(ends) < stated).all()


@pytest.mark.parametrize("seed", range(2))
def test_prediction_at_an_eccentricity_of_one_percent(seed):
    """Predict deviations of tens of metres and closest approaches as DOP853 does."""
    wide, zone = chief(0.01), cf.Sphere(100.0)
    start, final, duration = task(wide.orbit, 40 + seed, count=3)
    path = wide.orbit.transfer(start, final, duration)
    found = cf.validity(path, cf.Field(wide), zone)
    real = flown_apart(path, cf.Field(wide), np.linspace(0.0, duration, 4001))
    assert found.ends.max() > 10.0
    assert found.ends == pytest.approx(np.linalg.norm(real[:, -1] - final[:, :3], axis=1), rel=1e-4)
    near = [np.linalg.norm(real[i] - real[j], axis=1).min() for i, j in found.pairs]
    assert 100.0 * found.simulated == pytest.approx(near, abs=0.05)  # m; samples 2 s apart


def test_predicted_closest_approach():
    """Compare with dense sampling of the plan plus the predicted deviations."""
    orbit, zone = chief().orbit, cf.Sphere(30.0)
    start = np.array([[0, 0, 120.0, 0, 0, 0], [0, 0, -120.0, 0, 0, 0]])
    plan = cf.reconfigure(orbit, start, start[::-1], 0.2 * orbit.period, zone)
    found = cf.validity(plan, cf.Field(chief()), zone)
    assert found.pairs.tolist() == [[0, 1]]
    assert found.planned == pytest.approx([1.0], abs=1e-4)
    times = np.linspace(0.0, 0.2 * orbit.period, 20001)
    off = [np.interp(times, found.times, (found.deviations[0] - found.deviations[1])[:, k]) for k in range(3)]
    places = plan.paths.position(times)
    dense = zone.norm(places[0] - places[1] + np.stack(off, axis=1)).min()
    assert found.simulated == pytest.approx([dense], abs=2e-4)
    assert len(found.lines) == 2
    zones = cf.PairZones.of([zone, None])
    assert cf.validity(plan, cf.Field(chief()), zones).simulated == pytest.approx(found.simulated)


@pytest.mark.parametrize(
    ("kind", "zone"),
    [
        ("impulses", cf.Sphere(15.0)),
        ("stages", cf.Box([10.0, 20.0, 15.0])),
        ("burns", cf.Cylinder(12.0, 30.0)),
    ],
    ids=["impulses", "stages", "burns"],
)
def test_predicted_closest_approach_with_jumps_of_thrust(zone, kind):
    """Compare with refined sampling of the plan plus the predicted deviations."""
    field, draws = cf.Field(chief()), np.random.default_rng(8)
    ends = draws.normal(size=(2, 4, 6)) * np.repeat([80.0, 0.05], 3)
    if kind == "impulses":
        plan = field.orbit.impulsive(*ends, 0.4 * field.orbit.period)
    elif kind == "stages":  # their impulses coincide at the closest approach
        stages = (ends[0], 0.5 * ends[1], 900.0), (0.5 * ends[1], ends[0], 900.0, 900.0)
        plan = cf.join([field.orbit.two_impulse(*stage) for stage in stages])
    else:
        most = 1.05 * field.orbit.transfer(*ends, 2000.0).peak_thrust.max()
        plan = field.orbit.transfer(*ends, 2000.0, max_acceleration=0.8 * most)
    found = cf.validity(plan, field, zone)
    spline = CubicHermiteSpline(found.times, found.deviations[..., :3], found.deviations[..., 3:], axis=1)

    def least(one: int, two: int, deviate: float) -> float:
        low, high = found.times[[0, -1]]
        for _ in range(4):
            times = np.linspace(low, high, 4001)
            places = plan.position(times) + deviate * spline(times)
            norms = zone.norm(places[one] - places[two])
            near = times[norms.argmin()]
            low, high = np.clip(near + (times[1] - times[0]) * np.array([-4, 4]), *found.times[[0, -1]])
        return norms.min()

    pairs = found.pairs.tolist()
    assert found.planned == pytest.approx([least(*pair, 0.0) for pair in pairs], abs=1e-5)
    assert found.simulated == pytest.approx([least(*pair, 1.0) for pair in pairs], abs=1e-5)


def test_limit_and_columns_of_compensated_thrust():
    path = chief().orbit.transfer([0, 200, 0, 0, 0, 0], [0, 50, 30, 0, 0, 0], 3000.0)
    field = cf.Field(chief())
    peak = float(cf.compensated_thrust(path, field).peak_thrust[0])
    assert cf.compensated_thrust(path, field, max_acceleration=0.99 * peak).exceeded.all()
    assert not cf.compensated_thrust(path, field, max_acceleration=1.01 * peak).exceeded.any()
    columns = cf.compensated_thrust(path, field, every=100.0).columns()
    assert {len(column) for column in columns.values()} == {31}
    assert columns["time_s"][-1] == 3000.0


# --- impulses -----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["impulsive", "two_impulse"])
def test_impulses_are_retargeted(kind):
    """Planned impulses end metres off; retargeted ones meet the final state for the same delta-v."""
    orbit = chief().orbit
    start, final, duration = task(orbit, 7, count=3)
    path = getattr(orbit, kind)(start, final, duration)
    table = cf.compensated_thrust(path, cf.Field(chief()))
    assert isinstance(table.impulses, Retargeted)
    assert not table.commanded.any()  # impulses only
    for k in range(3):
        own = table.impulses.craft == k
        assert own.sum() == len(path[k].impulses)
        times = table.impulses.time[own]
        kept = fired(start[k], times, table.impulses.impulse[own], duration)
        left = fired(start[k], times, table.impulses.planned[own], duration)
        assert np.abs(kept - final[k])[:3].max() < 1e-3  # m, and of velocity
        assert np.abs(kept - final[k])[3:].max() < 1e-6
        assert np.linalg.norm((left - final[k])[:3]) > 1.0
        jumps = dict(table.path[k].impulses)  # including those at the ends
        assert np.array([jumps[time] for time in times]) == pytest.approx(
            table.impulses.impulse[own], abs=1e-12
        )
    assert table.delta_v == pytest.approx(table.planned_delta_v, rel=0.01)
    sizes = np.linalg.norm(table.impulses.impulse, axis=1)
    assert np.bincount(table.impulses.craft, sizes) == pytest.approx(table.delta_v, rel=1e-9)
    assert len(table.impulses.columns()["vx_m_s"]) == len(table.impulses)


def test_deviation_between_impulses_is_reported():
    """Positions between impulses, and the reported deviation, agree with an independent integrator."""
    orbit = chief().orbit
    start, final, duration = task(orbit, 7, count=3)
    path = orbit.impulsive(start, final, duration)
    table = cf.compensated_thrust(path, cf.Field(chief()))
    plain = cf.simulate(path, cf.Field(chief()), "open", cancel=False)
    assert (table.deviation < 0.6 * plain.deviations.max(axis=(0, 2))).all()
    own = table.impulses.craft == 1
    instants = np.linspace(0.1, 0.95, 7) * duration
    places = []
    for end in instants:
        until = table.impulses.time[own] <= end
        flies = table.impulses.time[own][until], table.impulses.impulse[own][until]
        places.append(fired(start[1], *flies, end)[:3])
    assert table.path[1].position(instants) == pytest.approx(np.array(places), abs=1e-3)
    off = np.linalg.norm(np.array(places) - path[1].position(instants), axis=1)
    assert 0.5 * table.deviation[1] < off.max() <= 1.01 * table.deviation[1]


@pytest.mark.parametrize(
    ("e", "turns"), [(0.01, 2.3), (0.1, 5.3), pytest.param(0.1, 20.2, marks=pytest.mark.slow)]
)
def test_impulses_are_retargeted_for_eccentric_chiefs_and_long_plans(e, turns):
    """The ends are met even where Hill's equations are a poor model of an impulse's effect."""
    orbit, field = chief(e=e, a=7.5e6).orbit, cf.Field(chief(e=e, a=7.5e6))
    start, final, duration = task(orbit, 7, count=3, turns=turns)
    path = orbit.impulsive(start, final, duration)
    flights = cf.simulate(path, field, "open")
    assert flights.greatest_end < 1e-2  # m
    assert np.abs(flights.states[0, :, -1, 3:] - final[:, 3:]).max() < 1e-5  # m/s
    assert cf.compensated_thrust(path, field).deviation.max() < 0.1 * e * 2e5


def kicked(orbit, first: np.ndarray, times: tuple[float, ...], sizes: np.ndarray, end: float) -> cf.Path:
    """Return the path of one spacecraft from `first` (6,) with impulses `sizes` at `times`."""
    parts = [orbit.coast(first, times[0])]
    for time, until, size in zip(times, [*times[1:], end], sizes, strict=True):
        state = parts[-1].state(time) + np.concatenate([np.zeros(3), size])
        parts.append(orbit.coast(state, until - time, time))
    return cf.join(parts)


def test_impulse_times_that_differ_by_rounding():
    """They share an instant, and each spacecraft ends where it does alone."""
    orbit, field, sizes = chief().orbit, cf.Field(chief()), np.array([[0.01, 0.0, 0.02], [0.0, -0.01, 0.01]])
    start = np.array([[0.0, 100.0, 0.0, 0.0, 0.0, 0.05], [0.0, -100.0, 0.0, 0.0, 0.0, 0.0]])
    times = (1450.3, 1450.3 + 4.5e-13)
    assert 0.0 < times[1] - times[0] < 1e-12
    alone = [
        kicked(orbit, one, (50.0, time), np.stack([size, -size]), 2600.0)
        for one, time, size in zip(start, times, sizes, strict=True)
    ]
    flight = cf.simulate(cf.stack(alone), field, "open")
    assert (np.diff(flight.times) > 1e-6).all()
    told = cf.compensated_thrust(cf.stack(alone), field)
    for k, one in enumerate(alone):
        own = told.impulses.craft == k
        end = fired(start[k], told.impulses.time[own], told.impulses.impulse[own], 2600.0)
        assert flight.states[0, k, -1] == pytest.approx(end, abs=1e-3)
        assert flight.path(flight.worst)[k].position(2600.0) == pytest.approx(end[:3], abs=1e-3)
        assert told.delta_v[k] == pytest.approx(cf.compensated_thrust(one, field).delta_v[0], rel=1e-6)


def test_adjacent_impulses_are_retargeted_together():
    """Close impulses share the correction of one impulse and do not oppose each other."""
    orbit, field = chief().orbit, cf.Field(chief())
    first, sizes = (
        np.array([0.0, 100.0, 0.0, 0.0, 0.0, 0.05]),
        np.array([[0.04, 0, 0], [0, 0, 0.1], [0, 0.02, 0]]),
    )
    whole = kicked(orbit, first, (60.0, 1450.3, 2300.0), sizes, 2400.0)
    apart = np.array([sizes[0], 0.2 * sizes[1], 0.8 * sizes[1], sizes[2]])
    parted = kicked(orbit, first, (60.0, 1450.3, 1450.333, 2300.0), apart, 2400.0)
    one, two = (cf.compensated_thrust(path, field) for path in (whole, parted))
    assert np.linalg.norm(two.impulses.impulse[1:3].sum(axis=0) - one.impulses.impulse[1]) < 1e-4
    most = np.linalg.norm(one.impulses.impulse - one.impulses.planned, axis=1).max()
    assert np.linalg.norm(two.impulses.impulse - two.impulses.planned, axis=1).max() < 2.0 * most
    assert two.delta_v == pytest.approx(one.delta_v, abs=1e-4)  # m/s
    end = fired(first, two.impulses.time, two.impulses.impulse, 2400.0)
    assert end == pytest.approx(parted.state(2400.0), abs=1e-3)


@pytest.mark.parametrize("late", [4.6e-13, 5e-7], ids=["at once up to rounding", "within 1 us"])
def test_coincident_impulses_of_two_stages_are_both_applied(late):
    """The last impulse of a stage and the first of the next: as planned, retargeted, and as burns."""
    orbit, field = chief().orbit, cf.Field(chief())
    first, between = np.array([0.0, 400.0, 0, 0, 0, 0]), np.array([0.0, -300.0, 200.0, 0, 0, 0])
    stages = (first, between, 1500.0), (between, np.zeros(6), 1500.0, 1500.0 + late)
    path = cf.join([orbit.two_impulse(*stage) for stage in stages])
    end, (when, sizes) = float(path.end), map(np.array, zip(*path.impulses, strict=True))
    assert len(when) == 4
    assert 0.0 <= when[2] - when[1] < 1e-6
    as_planned = cf.simulate(path, field, "open", cancel=False)
    assert as_planned.states[0, 0, -1] == pytest.approx(fired(first, when, sizes, end), abs=1e-3)
    told = cf.compensated_thrust(path, field)
    met = fired(first, told.impulses.time, told.impulses.impulse, end)
    assert met == pytest.approx(path.state(end), abs=1e-3)
    assert told.delta_v == pytest.approx(told.planned_delta_v, rel=1e-3)
    burns = cf.compensated_thrust(path, field, thrusters=cf.Thrusters.rtn(acceleration=1.0))
    assert burns.deviation[0] < told.deviation[0] + 0.1  # m


def test_end_is_met_in_controllable_directions():
    """Impulses half an orbit before the end cannot correct its cross-track position; the rest is met."""
    orbit, field = chief().orbit, cf.Field(chief())
    times = (1.0, 1.0 + 0.5 * orbit.period)
    end, sizes = times[1] + 1.0, np.array([[0.027, 0, 0.16], [-0.027, 0, 0.05]])
    first = np.array([0.0, 50.0, 100.0, 0.0, 0.0, 0.0])
    path = kicked(orbit, first, times, sizes, end)
    told, final = cf.compensated_thrust(path, field), path.state(end)
    left = fired(first, times, sizes, end) - final
    kept = fired(first, times, told.impulses.impulse, end) - final
    assert abs(left[2]) > 0.05  # m
    assert kept[2] == pytest.approx(left[2], abs=0.1 * abs(left[2]))
    assert np.abs(np.delete(kept, 2)).max() < 1e-3
    assert np.linalg.norm(told.impulses.impulse - told.impulses.planned, axis=1).max() < 5e-3  # m/s
    assert told.deviation[0] < 3.0  # m


def test_impulses_beside_continuous_thrust():
    """A spacecraft with thrust keeps its plan beside one with impulses."""
    orbit = chief().orbit
    start, final, duration = task(orbit, 3, count=2)
    steered = orbit.transfer(start[0], final[0], duration)
    both = cf.stack([steered, orbit.impulsive(start[1], final[1], duration)])
    table = cf.compensated_thrust(both, cf.Field(chief()))
    assert table.deviation[0] == 0.0 < table.deviation[1]
    assert table.commanded[0].any()
    assert not table.commanded[1].any()
    flights = cf.simulate(both, cf.Field(chief()), "open")
    assert flights.greatest_end < 1e-3
    assert flights.delta_v[0] == pytest.approx(table.delta_v, rel=1e-4)


def test_impulses_under_feedback():
    """Impulses correct navigation and thrust errors; `path` contains them."""
    orbit, field = chief().orbit, cf.Field(chief())
    start, final, _ = task(orbit, 7, count=2)
    path = orbit.impulsive(start, final, 2.0 * orbit.period)
    seen = cf.Navigation(0.1, 3e-4)
    flights = cf.simulate(path, field, navigation=seen, thrust_error=(0.01, 0.01), seeds=20)
    blind = cf.simulate(path, field, "open", thrust_error=(0.01, 0.01), seeds=20)
    assert flights.greatest_end < 0.2 * blind.greatest_end
    assert (flights.feedback_delta_v > 0.0).all()
    went = flights.path(flights.worst).state(flights.times)
    assert went == pytest.approx(flights.states[flights.worst], abs=1e-9)  # after the last impulse
    coarse = cf.simulate(path, field, navigation=seen, minimum_bit=0.01, seeds=20)
    sizes = np.linalg.norm((coarse.states - coarse.arrivals)[..., 3:], axis=-1)
    assert sizes[sizes > 1e-9].min() >= 0.01 * (1.0 - 1e-9)
    fine = cf.simulate(path, field, navigation=seen, seeds=20)
    for craft, spent in zip(fine.path(3), fine.delta_v[3], strict=True):
        assert sum(np.linalg.norm(push) for _, push in craft.impulses) == pytest.approx(spent, rel=1e-6)
        assert (craft.impulses[0][0], craft.impulses[-1][0]) == (craft.start, craft.end)
    sizes = np.linalg.norm((fine.states - fine.arrivals)[..., 3:], axis=-1)
    assert sizes[sizes > 1e-9].min() < 0.01


# --- pulses -------------------------------------------------------------------------------------

BY_PULSES = cf.Thrusters.rtn(acceleration=0.02, minimum_bit=1e-4, period=60.0)


def test_pulses_reach_the_reported_end():
    """DOP853, pulse by pulse, ends at the reported position, as close to the plan as in Hill's equations."""
    orbit = chief().orbit
    start, final, duration = task(orbit, 7, count=2, turns=0.25)
    path = orbit.transfer(start, final, duration)
    table = cf.compensated_thrust(path, cf.Field(chief()), thrusters=BY_PULSES)
    fires = table.firing
    plain = cf.fire_thrusters(path, BY_PULSES)
    assert table.deviation == pytest.approx(fires.deviation, rel=0.05)  # same pulses in Hill's equations
    assert (table.deviation <= 1.02 * fires.deviation_bound).all()
    assert table.delta_v == pytest.approx(plain.delta_v, rel=0.01)
    for craft in (1,):
        own = fires.pulses[fires.pulses.craft == craft]
        pushes = own.direction * (own.impulse / own.duration)[:, None]
        burns = list(zip(own.start, own.start + own.duration, pushes, strict=True))
        end = pushed(chief().state, start[craft], burns, (0.0, duration))
        assert table.path[craft].position(duration) == pytest.approx(end, abs=5e-3)  # m
        assert np.linalg.norm(end - final[craft, :3]) <= table.deviation[craft] + 5e-3


def test_pulses_of_impulses():
    """Retargeted impulses become burns, which extend beyond the ends of the plan."""
    orbit = chief().orbit
    start, final, duration = task(orbit, 7, count=2)
    path = orbit.two_impulse(start, final, duration)
    strong = cf.Thrusters.rtn(acceleration=1.0)
    table = cf.compensated_thrust(path, cf.Field(chief()), thrusters=strong)
    assert table.path.start[0] < 0.0
    assert table.path.end[0] > duration
    assert (table.deviation < cf.compensated_thrust(path, cf.Field(chief())).deviation + 0.1).all()
    whole = [np.abs(table.impulses.impulse[table.impulses.craft == k]).sum() for k in range(2)]
    assert table.delta_v == pytest.approx(whole, rel=1e-6)  # one thruster per direction


def test_pulses_under_feedback():
    """Corrections act along thrusters only, with the minimum impulse bit or more."""
    orbit, field = chief().orbit, cf.Field(chief())
    start, final, duration = task(orbit, 7, count=2)
    path, seen = orbit.transfer(start, final, duration), cf.Navigation(0.1, 3e-4)
    thrusters = cf.Thrusters.rtn(acceleration=0.02, minimum_bit=1e-3, period=60.0)
    blind = cf.simulate(path, field, "open", thrusters=thrusters, thrust_error=(0.002, 0.002), seeds=10)
    led = cf.simulate(
        path, field, thrusters=thrusters, thrust_error=(0.002, 0.002), navigation=seen, seeds=10
    )
    table = cf.compensated_thrust(path, field, thrusters=thrusters)
    assert led.ends.mean() < 0.5 * blind.ends.mean()
    assert led.greatest_deviation < table.deviation.max() + 8.0
    assert np.array_equal(led.states, led.arrivals)  # burns, no impulses
    exact = cf.simulate(path, field, thrusters=thrusters, navigation=seen, seeds=3)
    sizes = np.abs(exact.orders)
    assert sizes[sizes > 1e-8].min(initial=1.0) >= thrusters.minimum_bit.min() * (1.0 - 1e-6)
    assert (exact.delta_v >= sizes.sum(axis=(2, 3))).all()
    assert led.orders.any()
    fixed = cf.Thrusters.rtn("inertial", 0.02, 1e-4, 60.0)
    assert cf.simulate(path, field, thrusters=fixed, navigation=seen).greatest_end < 3.0


# --- feedback ---------------------------------------------------------------------------------


def test_open_loop_agrees_with_an_independent_integrator():
    path = formation(1.2)
    other = flown(
        path, path.state(0.0), float(path.end[0]), lambda t: path.thrust(min(t, float(path.end[0])))
    )
    one = cf.simulate(path, cf.Field(chief()), "open", cancel=False)
    assert one.states[0, :, -1, :3] == pytest.approx(other, abs=1e-4)  # m; 20 m off the plan
    assert one.delta_v[0] == pytest.approx(path.delta_v, rel=1e-4)
    kept = cf.simulate(path, cf.Field(chief()), "open")
    assert kept.greatest_end < 1e-3


def test_deviations_agree_with_the_tube():
    """Compare the worst axis' standard deviation; no spacecraft is beyond 6 sigma."""
    path, seen = formation(), cf.Navigation(0.1, 3e-4)
    flights = cf.simulate(path, cf.Field(chief()), navigation=seen, seeds=100)
    off = (flights.states - path.state(flights.times))[..., 60:, :3]
    tube = cf.tube(path.orbit, cf.Feedback(), seen)
    assert off.std(axis=(0, 1, 2)).max() == pytest.approx(tube.noise, rel=0.1)
    assert np.linalg.norm(off, axis=-1).max() < 6.0 * tube.noise
    assert tube.noise == pytest.approx(np.sqrt(60.0 * (0.75 * 0.01 / 600.0 + 9e-8 * 600.0 / 3.0)), rel=0.25)


def test_model_error_stays_in_the_tube():
    """The uncompensated model error is a bounded acceleration."""
    path, field = formation(), cf.Field(chief())
    left = cf.simulate(path, field, cancel=False)
    tube = cf.tube(path.orbit, cf.Feedback(), cf.Navigation(), cf.validity(path, field).residual)
    off = np.linalg.norm((left.states - path.state(left.times))[..., :3], axis=-1).max(axis=(0, 2))
    assert (off <= tube.radius).all()
    assert (off > 0.3 * tube.radius).all()  # the tube is not much wider
    assert tube.model == pytest.approx(cf.validity(path, field).residual * 600.0**2 / 6.0, rel=0.2)


def test_biases_stay_in_the_tube():
    path, seen = formation(), cf.Navigation(position_bias=0.1, velocity_bias=1e-3)
    flights = cf.simulate(path, cf.Field(chief()), navigation=seen, seeds=60)
    off = np.linalg.norm((flights.states - path.state(flights.times))[..., :3], axis=-1).max()
    bias = cf.tube(path.orbit, cf.Feedback(), seen).bias
    assert 0.8 * bias < off <= 1.02 * bias  # starts at 0, not in the steady state


def test_feedback_rejects_an_unknown_field():
    """Feedback rejects zonals that the compensation does not know."""
    path, whole, known = formation(1.5), cf.Field(chief(), 6), cf.Field(chief(), 2)
    blind = cf.simulate(path, whole, "open", known=known)
    tracked = cf.simulate(path, whole, known=known)
    assert tracked.greatest_end < 0.1 * blind.greatest_end
    assert blind.greatest_end > 1e-3


def test_spacecraft_that_do_not_fit_into_memory_at_once(monkeypatch):
    """Simulated in parts, all move as together."""
    start, final, duration = task(chief().orbit, 5, count=3, turns=0.3)
    path, field = chief().orbit.two_impulse(start, final, duration), cf.Field(chief())
    options = {"navigation": cf.Navigation(0.1, 3e-4), "zones": cf.Sphere(5.0), "seeds": 2}
    together = cf.simulate(path, field, **options)
    monkeypatch.setattr("closeform.dynamics.simulation.guidance.MOST_STEPS", 1)
    parts = cf.simulate(path, field, **options)
    assert parts.states == pytest.approx(together.states, abs=1e-9)
    assert parts.delta_v == pytest.approx(together.delta_v, rel=1e-12)
    assert parts.ratios == pytest.approx(together.ratios, rel=1e-12)


def test_samples_do_not_depend_on_their_number():
    path, seen = formation(0.3), cf.Navigation(0.1, 3e-4)
    few, many = (
        cf.simulate(path, cf.Field(chief()), navigation=seen, seeds=n, thrust_error=(0.01, 0.01))
        for n in (2, 5)
    )
    assert (many.states[:2] == few.states).all()
    assert (many.states[1] != many.states[0]).any()


def test_thrust_limit_holds_in_simulation():
    path, field = formation(0.5), cf.Field(chief())
    limit = 0.7 * float(path.peak_thrust.max())
    short = cf.simulate(path, field, max_acceleration=limit)
    assert (short.delta_v <= limit * float(path.end[0])).all()
    free = cf.simulate(path, field)
    assert short.greatest_end > free.greatest_end
    assert not free.limited.any()
    blind = cf.simulate(path, field, "open", max_acceleration=limit)
    table = cf.compensated_thrust(path, field, every=1.0)
    over = (np.linalg.norm(table.commanded, axis=2) > limit).mean(axis=1)  # share of rows
    assert over.max() > 0.1
    assert blind.limited[0] == pytest.approx(over, abs=0.01)


def test_thrust_limits_of_stages_agree_with_an_independent_integrator():
    there, change = formation(0.3, 2), 0.3 * ORBIT.period
    back = ORBIT.transfer(there.state(change), there.state(0.0), change, change)
    path, end = cf.join([there, back]), 2.0 * change
    limits = {0.0: 0.8 * there.peak_thrust, change: [0.7 * back.peak_thrust[0], np.inf]}

    def share(time: float) -> np.ndarray:
        most = np.array(limits[0.0 if time < change else change])
        return most / np.linalg.norm(path.thrust(min(time, end)), axis=1)

    def command(time: float) -> np.ndarray:
        return path.thrust(min(time, end)) * np.minimum(1.0, share(time))[:, None]

    found = cf.simulate(path, FIELD, "open", cancel=False, max_acceleration=limits)
    other = flown(path, path.state(0.0), end, command)
    assert found.ends.min() > 50.0  # m
    assert found.states[0, :, -1, :3] == pytest.approx(other, abs=0.1)  # m; limits act within steps of 10 s
    beyond = [share(time) < 1.0 for time in np.linspace(0.0, end, 5001)]
    assert found.limited[0] == pytest.approx(np.mean(beyond, axis=0), abs=2e-3)
    kicked = cf.join([there, ORBIT.impulsive(there.state(change), there.state(0.0), change, start=change)])
    cf.simulate(kicked, FIELD, max_acceleration={0.0: 1.0, change: np.inf})
    with pytest.raises(ValueError, match=r"^max_acceleration: "):
        cf.simulate(kicked, FIELD, max_acceleration={0.0: np.inf, change: 1.0})


def test_simulated_ratios_agree_with_the_certified_search():
    orbit, zone = chief().orbit, cf.Sphere(30.0)
    start = np.array([[0, 0, 120.0, 0, 0, 0], [0, 0, -120.0, 0, 0, 0]])
    plan = cf.reconfigure(orbit, start, start[::-1], 0.4 * orbit.period, zone)
    flights = cf.simulate(plan, cf.Field(chief()), navigation=cf.Navigation(0.1, 3e-4), zones=zone, seeds=5)
    path = flights.path(flights.worst)
    nearest = cf.closest_approach(path[0], path[1], zone)
    assert nearest.ratio == pytest.approx(flights.least_ratio, abs=1e-4)
    assert flights.violated == (flights.ratios < 1.0).any(axis=1).mean()


def test_delta_v_splits_into_plan_field_and_feedback():
    """Delta-v beyond the plan is the field's without errors, and the feedback's with them."""
    orbit, field = chief().orbit, cf.Field(chief())
    start, final, duration = task(orbit, 7, count=3)
    path = orbit.transfer(start, final, duration, max_acceleration=3e-3, cost="delta-v")
    blind = cf.simulate(path, field, "open")
    assert blind.feedback_delta_v[0] == pytest.approx(np.zeros(3), abs=1e-9)
    table = cf.compensated_thrust(path, field, every=1.0)
    assert blind.field_delta_v == pytest.approx(table.delta_v - table.planned_delta_v, rel=1e-2)
    noisy = cf.simulate(path, field, navigation=cf.Navigation(1.0, 1e-3), seeds=4)
    assert noisy.field_delta_v == pytest.approx(blind.field_delta_v, rel=1e-2)  # different steps
    assert (noisy.feedback_delta_v > 0.0).all()
    plain = cf.simulate(path, field, cancel=False)
    assert not plain.field_delta_v.any()
    whole = noisy.planned_delta_v + noisy.field_delta_v + noisy.feedback_delta_v
    assert whole == pytest.approx(noisy.delta_v, rel=1e-12)


def test_deviations_under_impulses_agree_with_the_tube():
    """Compare over more than ten measurements, between which impulses act late."""
    orbit, seen = chief().orbit, cf.Navigation(0.1, 3e-4)
    law = cf.Feedback(300.0, 1800.0, 6)
    path = orbit.impulsive([0, 300, 0, 0, 0, 0], [0, -200, 50, 0, 0, 0], 1.5 * orbit.period)
    flights = cf.simulate(path, cf.Field(chief()), feedback=law, navigation=seen, seeds=60)
    steady = flights.times > 3000.0
    off = (flights.states - flights.states.mean(axis=0))[:, :, steady, :3]
    tube = cf.tube(orbit, law, seen)
    assert off.std(axis=(0, 1)).max() < 1.3 * tube.noise  # few samples
    assert off.std(axis=(0, 1, 2)).max() > 0.7 * tube.noise
    assert np.linalg.norm(off, axis=-1).max() < 6.0 * tube.noise


# --- fields of functions ------------------------------------------------------------------------


@pytest.mark.parametrize("control", ["open", "track"])
def test_simulation_in_the_field_of_a_function(control):
    """J2 to J6 as a function gives the motion of the built-in zonals."""
    whole, path = cf.Field(chief(), 6), formation(0.3)
    own = {
        zonals: cf.Field(
            chief(), zonals, acceleration=lambda times, states: whole.accelerations(times, states)
        )
        for zonals in (2, 0)
    }
    options = {"cancel": control == "open", "navigation": cf.Navigation(0.1, 3e-4), "seeds": 2}
    known = cf.simulate(path, whole, control, **options)
    two, none = (cf.simulate(path, field, control, **options) for field in own.values())
    assert two.states[..., :3] == pytest.approx(known.states[..., :3], abs=1e-4)  # m
    assert none.states[..., :3] == pytest.approx(known.states[..., :3], abs=2e-2)
    assert two.delta_v == pytest.approx(known.delta_v, rel=1e-6)
    if control == "open":
        impulses = chief().orbit.impulsive(*(path.state(t)[0] for t in (0.0, 1500.0)), 1500.0)
        assert cf.simulate(impulses, own[2], "open").greatest_end < 1e-2


# --- replanning ------------------------------------------------------------------------


def crossing(margin: float, turns: float = 0.6):
    """Return a plan in which two spacecraft change sides at 30 m plus `margin`, and their zone."""
    orbit, zone = chief().orbit, cf.Sphere(30.0)
    start = np.array([[0, 0, 120.0, 0, 0, 0], [0, 0, -120.0, 0, 0, 0]])
    return cf.reconfigure(orbit, start, start[::-1], turns * orbit.period, zone, margin=margin), zone


def test_replanning_keeps_zones_that_tracking_violates():
    """A plan without a margin: tracking violates the zone in some simulations, replanning in none."""
    plan, zone = crossing(0.0)
    field, seen = cf.Field(chief()), cf.Navigation(0.1, 3e-4)
    tracked = cf.simulate(plan, field, navigation=seen, zones=zone, seeds=8)
    flights = cf.simulate(plan, field, "replan", navigation=seen, zones=zone, seeds=3)
    assert tracked.violated > 0.0 == flights.violated
    assert (flights.replans == 8).all()  # the last of 12 intervals are tracked
    tube = 4.0 * np.sqrt(2.0) * np.hypot(0.1, 300.0 * 3e-4)
    assert flights.greatest_end < tube
    assert not len(cf.screen(flights.path(flights.worst), zone).pairs)


def test_replanning_costs_less_with_poor_navigation():
    """Tracking corrects each navigation error; a new plan starts from it."""
    plan, zone = crossing(12.0)
    field, seen = cf.Field(chief()), cf.Navigation(1.0, 1e-3)
    tracked, flights = (
        cf.simulate(plan, field, control, navigation=seen, zones=zone, seeds=2)
        for control in ("track", "replan")
    )
    assert flights.delta_v.sum() < 0.9 * tracked.delta_v.sum()
    assert flights.violated == 0.0


def test_failed_replanning_is_reported():
    """A spacecraft measured within the margin of a zone keeps its last plan."""
    orbit, zone = chief().orbit, cf.Sphere(30.0)
    start = np.array([[0, 20.0, 0, 0, 0, 0], [0, -11.0, 0, 0, 0, 0]])  # 1 m outside of the zone
    path, seen = orbit.coast(start, 2400.0), cf.Navigation(3.0, 1e-3)
    flights = cf.simulate(path, cf.Field(chief()), "replan", navigation=seen, zones=zone, seeds=2)
    assert (flights.replans < 4).any()
    seed, time, why = flights.refused[0]
    assert seed in (0, 1)
    assert time in (300.0, 600.0, 900.0, 1200.0, 1500.0)
    assert why.startswith("2 of the margin: craft 0 and craft 1")
    assert flights.greatest_deviation < 30.0  # m; the last plan is tracked


def test_plan_with_a_single_measurement():
    """The plan is shorter than the interval between measurements, with and without replanning."""
    plan, zone = crossing(2.0, 0.3)
    law = cf.Feedback(4000.0, 5000.0)
    one, other = (cf.simulate(plan, cf.Field(chief()), way, law, zones=zone) for way in ("track", "replan"))
    assert one.greatest_end < 1e-3
    assert (other.states == one.states).all()
    assert other.replans.tolist() == [0]


# --- long simulations -----------------------------------------------------------------------------


def test_correcting_impulses_are_the_pseudoinverse():
    """They null any deviation with the minimum sum of squares, as the pseudoinverse does."""
    from closeform.dynamics.control.feedback import impulse_gains

    orbit, law = chief().orbit, cf.Feedback(600.0, 4000.0, 5)
    times, gains = impulse_gains(orbit, law)
    assert times == pytest.approx([0.0, 800.0, 1600.0, 2400.0, 3200.0])
    moved = np.hstack([orbit.transition(4000.0 - t)[:, 3:] for t in times])
    want = -np.linalg.pinv(moved) @ orbit.transition(4000.0)
    scale = np.abs(want).max(axis=0)
    assert gains.reshape(-1, 6) / scale == pytest.approx(want / scale, abs=1e-6)


def test_station_keeping_by_impulses():
    """Impulses hold a coast for three orbits; an independent integrator reproduces it."""
    field = cf.Field(chief())
    orbit = field.orbit
    n, start = orbit.mean_motion, np.array([[100.0, 300.0, 200.0, 0.0, 0.0, 0.0]])
    start[:, 4] = -2.0 * n * start[:, 0]
    coast = orbit.coast(start, 3.0 * orbit.period)
    law = cf.Feedback(orbit.period, 2.0 * orbit.period, 8)
    held = cf.simulate(coast, field, feedback=law, navigation=cf.Navigation(0.1, 3e-4))
    jumps = (held.states - held.arrivals)[0, 0, :, 3:]
    own = jumps.any(axis=1)
    assert own.sum() == 12  # four of eight per measurement
    end = fired(start[0], held.times[own], jumps[own], float(coast.end[0]))
    assert held.states[0, 0, -1] == pytest.approx(end, abs=1e-3)
    assert held.delta_v[0] == pytest.approx(np.linalg.norm(jumps, axis=1).sum(), rel=1e-9)
    assert held.field_delta_v == pytest.approx([0.0], abs=1e-12)
    loose = cf.simulate(coast, field, "open", cancel=False)
    assert held.greatest_deviation < loose.greatest_deviation


def test_station_keeping_cost_per_day_is_steady():
    """Cost per day and deviation stay as in the first days."""
    field = cf.Field(chief(), drag=cf.Drag(5.2e-13, 500e3, 60e3, [0.02, 0.022], 0.02))
    orbit = field.orbit
    n, start = orbit.mean_motion, np.array([[100.0, 300.0, 200.0, 0, 0, 0], [-100.0, -300.0, 200.0, 0, 0, 0]])
    start[:, 4] = -2.0 * n * start[:, 0]
    law = cf.Feedback(orbit.period, 2.0 * orbit.period, 8)
    few, many = (
        cf.simulate(orbit.coast(start, days * 86400.0), field, feedback=law, zones=cf.Sphere(50.0))
        for days in (2, 10)
    )
    assert many.delta_v_per_day == pytest.approx(few.delta_v_per_day, rel=0.5)
    assert many.greatest_deviation < 2.0 * few.greatest_deviation < 200.0
    assert many.violated == 0.0


def test_mean_motion_of_a_field_is_that_of_its_chief():
    """Compare with the angle of the chief's motion over a day by an independent integrator."""
    field, times = cf.Field(chief()), np.linspace(0.0, 86400.0, 2881)
    rates = lambda t, s: np.concatenate([s[3:], textbook(s[:3])])  # noqa: E731
    path = solve_ivp(rates, (0.0, 86400.0), chief().state, "DOP853", times, rtol=1e-10, atol=1e-3).y[:3].T
    units = path / np.linalg.norm(path, axis=1, keepdims=True)
    turned = 2.0 * np.arcsin(0.5 * np.linalg.norm(np.diff(units, axis=0), axis=1)).sum()
    assert field.orbit.mean_motion * 86400.0 == pytest.approx(turned, abs=1e-3)  # of 96 rad in all
    assert abs(field.chief.orbit.mean_motion * 86400.0 - turned) > 0.03  # Kepler's rate is off


def test_thrust_that_varies_within_a_step():
    """The last second has a thousand times the usual thrust."""
    orbit, zone = chief().orbit, cf.Sphere(100.0)
    client = orbit.coast(np.zeros(6), 2000.0)
    planned = orbit.transfer([0, 300, 50, 0, 0, 0], [0, 100.25, 0, 0, 0.35, 0], 2000.0)
    path = cf.avoid(planned, client, zone).path
    late = path.thrust(np.array([1000.0, 2000.0]))
    assert np.linalg.norm(late[1]) > 100.0 * np.linalg.norm(late[0])
    both = cf.stack([path, client])
    flight = cf.simulate(both, cf.Field(chief()), "open", zones=zone)
    nearest = cf.closest_approach(path, client, zone)
    assert 100.0 * flight.least_ratio == pytest.approx(100.0 * nearest.ratio, abs=0.01)
    end = flight.states[0, 0, -1]
    assert end == pytest.approx(path.state(2000.0), abs=1e-3)  # position and velocity
