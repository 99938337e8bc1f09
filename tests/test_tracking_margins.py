"""Tracking-error margins along a path against simulations with errors, and plans with fitted margins."""

import numpy as np
import pytest

import closeform as cf
from simulated import FIELD, ORBIT, SIGHT, at, deviations, formation, kicked, swap

OFF = 0.01, np.radians(1.0)


def test_margins_bound_thrust_errors_tightly():
    """Without noise, each simulation stays within the margins and uses half of them."""
    path = formation()
    room = cf.tracking_margins(path, FIELD, thrust_error=OFF)
    flights = cf.simulate(path, FIELD, thrust_error=OFF, seeds=80)
    off = np.linalg.norm(deviations(path, flights), axis=-1)
    limit = at(room, room.radius, flights.times)
    assert (off <= limit + 1e-4).all()  # m
    assert (off.max(axis=(0, 2)) > 0.5 * room.greatest).all()
    flat = cf.tube(ORBIT, cf.Feedback(), cf.Navigation(), 0.0, np.hypot(*OFF) * path.peak_thrust)
    assert (room.greatest < flat.radius).all()


def test_intervals_do_not_depend_on_the_start():
    """Rounding may make end minus start longer than the duration."""
    begin = 4079.2677706076606
    assert begin + 3000.0 - begin > 3000.0
    ends = [[0, 400, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0]], [[0, -300, 200, 0, 0, 0], [0, 50, 0, 0, 0, 0]]
    early, late = (ORBIT.transfer(*ends, 3000.0, start) for start in (0.0, begin))
    rooms = [cf.tracking_margins(path, FIELD, navigation=SIGHT).times for path in (early, late)]
    assert rooms[1] == pytest.approx(rooms[0] + begin)
    seldom = cf.Feedback(600.0, 900.0)
    for path in (early, late):  # anew three times, not less than 900 s before the end
        anew = cf.simulate(path, FIELD, "replan", zones=cf.Sphere(5.0), feedback=seldom, navigation=SIGHT)
        assert anew.replans.tolist() == [3]


def test_uncompensated_model_error_is_predicted():
    """Without compensation, the deviation is predicted to a hundredth."""
    path = formation()
    room = cf.tracking_margins(path, FIELD, cancel=False)
    flight = cf.simulate(path, FIELD, cancel=False)
    off, expected = deviations(path, flight)[0], at(room, room.shift, flight.times)
    assert np.abs(off).max() > 0.1
    assert np.abs(expected - off).max() < 0.02 * np.abs(off).max()


def test_thrust_errors_increase_the_noise():
    """Thrust of wrong size or direction adds noise, as simulations show."""
    path, wrong = formation(), (0.2, 0.2)
    room = cf.tracking_margins(path, FIELD, navigation=SIGHT, thrust_error=wrong)
    plain = cf.tracking_margins(path, FIELD, navigation=SIGHT)
    assert plain.noise == pytest.approx(cf.tube(ORBIT, cf.Feedback(), SIGHT).noise, rel=5e-3)
    assert 1.01 < room.noise.max() / plain.noise.max() < 1.3
    quiet = cf.simulate(path, FIELD, thrust_error=wrong, seeds=200)
    noisy = cf.simulate(path, FIELD, thrust_error=wrong, navigation=SIGHT, seeds=200)
    spread = (noisy.states - quiet.states)[..., 60:, :3].std(axis=(0, 2)).max()
    assert 0.8 * room.noise.max() < spread < 1.03 * room.noise.max()


def test_thrust_errors_of_each_spacecraft():
    path, sizes = formation(), np.array([[0.0, 0.0], OFF, [0.02, 0.0], [0.0, 0.02]])
    room, alike = (
        cf.tracking_margins(path, FIELD, thrust_error=sizes),
        cf.tracking_margins(path, FIELD, thrust_error=OFF),
    )
    assert room.greatest[0] == 0.0
    assert room.greatest[1] == pytest.approx(alike.greatest[1])
    off = np.linalg.norm(deviations(path, cf.simulate(path, FIELD, thrust_error=sizes, seeds=40)), axis=-1)
    assert (off.max(axis=(0, 2)) <= room.greatest + 1e-4).all()
    assert (off.max(axis=(0, 2))[2:] > 0.5 * room.greatest[2:]).all()


def test_correlated_navigation_errors():
    """Errors correlated over five intervals have more effect; limits are bias and white noise."""
    path, filtered = formation(), cf.Navigation(0.1, 3e-4, correlation=300.0)
    wide, white = (cf.tube(ORBIT, cf.Feedback(), sight).noise for sight in (filtered, SIGHT))
    assert wide > 2.0 * white
    off = deviations(path, cf.simulate(path, FIELD, navigation=filtered, seeds=300))
    assert off[..., 120:, :].std(axis=(0, 1, 2)).max() == pytest.approx(wide, rel=0.06)  # drawn: 3 %
    for long, alike in ((1e9, cf.Navigation(position_bias=0.1)), (1e-3, cf.Navigation(position=0.1))):
        limit = cf.tube(ORBIT, cf.Feedback(), cf.Navigation(position=0.1, correlation=long))
        other = cf.tube(ORBIT, cf.Feedback(), alike)
        assert limit.noise == pytest.approx(other.noise + other.bias, rel=0.05)


@pytest.mark.parametrize("delay", [20.0, *(pytest.param(d, marks=pytest.mark.slow) for d in (7.0, 60.0))])
def test_delayed_thrust(delay):
    """Noise and model error agree with the tube and exceed those without a delay."""
    path, late = formation(), cf.Feedback(60.0, 600.0, delay=delay)
    tubes = [cf.tube(ORBIT, law, SIGHT, 1e-5) for law in (cf.Feedback(), late)]
    assert tubes[1].noise > tubes[0].noise
    assert tubes[1].model > tubes[0].model
    flights = cf.simulate(path, FIELD, feedback=late, navigation=SIGHT, seeds=200)
    spread = deviations(path, flights)[..., 120:, :].std(axis=(0, 1, 2)).max()
    assert spread == pytest.approx(tubes[1].noise, rel=0.05)  # drawn: 2 %
    pushed = cf.simulate(path, FIELD, feedback=late, cancel=False)
    expected = cf.tracking_margins(path, FIELD, late, cancel=False)
    found = at(expected, expected.shift, pushed.times) - deviations(path, pushed)[0]
    plain = deviations(path, cf.simulate(path, FIELD, cancel=False))[0]
    assert np.abs(found).max() < 0.02 * np.abs(deviations(path, pushed)).max()
    assert np.abs(at(expected, expected.shift, pushed.times) - plain).max() > 3.0 * np.abs(found).max()
    most = cf.tube(ORBIT, late, cf.Navigation(), cf.validity(path, FIELD).residual)
    assert (np.abs(deviations(path, pushed)[0]).max(axis=(1, 2)) < most.radius).all()


def test_delay_is_compensated():
    """Without errors nothing deviates; with them the deviation is that without a delay."""
    path = formation(0.5)
    kept = cf.simulate(path, FIELD, feedback=cf.Feedback(60.0, 600.0, delay=45.0))
    assert kept.greatest_deviation < 1e-3
    long = ORBIT.coast(np.zeros(6), 40 * ORBIT.period)  # simulated in several parts
    short = cf.simulate(long, FIELD, feedback=cf.Feedback(60.0, 600.0, delay=25.0), navigation=SIGHT)
    assert short.greatest_deviation < 6.0 * cf.tube(ORBIT, cf.Feedback(60.0, 600.0, delay=25.0), SIGHT).noise


def test_required_thrust_with_feedback():
    """Simulations never exceed the required thrust; a slightly lower limit is reached by all."""
    path = formation()
    room = cf.tracking_margins(path, FIELD, navigation=SIGHT, thrust_error=OFF)
    ways = {"navigation": SIGHT, "thrust_error": OFF, "seeds": 60}
    assert not cf.simulate(path, FIELD, max_acceleration=room.thrust, **ways).limited.any()
    assert cf.simulate(path, FIELD, max_acceleration=0.93 * room.thrust, **ways).limited.any(axis=0).all()


def differential_drag() -> tuple[cf.Path, cf.Field]:
    """Return three coasting spacecraft, two of which have another drag than the chief."""
    lag = cf.Field(FIELD.chief, 0, cf.Drag(5.2e-13, 500e3, 60e3, [0.02, 0.03, 0.01], 0.02, spin=0.0))
    states = np.zeros((3, 6))
    states[:, 1] = [0.0, 50.0, -50.0]
    return ORBIT.coast(states, 3.0 * ORBIT.period), lag


def test_tube_includes_the_minimum_bit():
    """Deviations by differential drag, without noise, are within the tube."""
    law, bit = cf.Feedback(600.0, 2400.0, impulses=4), 1e-3
    path, lag = differential_drag()
    flights = cf.simulate(path, lag, feedback=law, minimum_bit=bit, cancel=False)
    unknown = cf.validity(path, lag).residual
    room = cf.tube(ORBIT, law, cf.Navigation(), unknown, minimum_bit=bit)
    fine = cf.tube(ORBIT, law, cf.Navigation(), unknown)
    off = flights.deviations.max(axis=(0, 2))
    assert (off <= room.radius).all()
    assert (off > fine.radius).any()
    assert (off > 0.1 * room.radius).any()


@pytest.mark.parametrize(
    "law",
    [cf.Feedback(300.0, 1800.0, 6), pytest.param(cf.Feedback(600.0, 2400.0, 4), marks=pytest.mark.slow)],
)
def test_margins_bound_impulse_errors_tightly(law):
    """Impulses of wrong size and direction, corrected by impulses."""
    path = kicked()
    room = cf.tracking_margins(path, FIELD, law, thrust_error=OFF)
    flights = cf.simulate(path, FIELD, feedback=law, thrust_error=OFF, seeds=80)
    off = np.linalg.norm(deviations(path, flights), axis=-1)
    limit = at(room, room.radius, flights.times)
    assert (off <= limit).all()
    assert (off.max(axis=(0, 2)) > 0.6 * room.greatest).all()
    exact = cf.simulate(path, FIELD, feedback=law)
    aside = at(room, room.shift, flights.times) - deviations(path, exact)[0]
    assert np.abs(deviations(path, exact)).max() > 1.0  # m, by impulses changed for the field
    assert np.abs(aside).max() < 0.25  # m, known every 50 or 100 s


@pytest.mark.parametrize("path", [formation(), kicked()], ids=["thrust", "impulses"])
def test_margins_scale_with_sigmas(path):
    wide, narrow = (
        cf.tracking_margins(path, FIELD, navigation=SIGHT, thrust_error=OFF, sigmas=k) for k in (4.0, 1.5)
    )
    assert (wide.sigmas, narrow.sigmas) == (4.0, 1.5)
    assert (wide.radius - narrow.radius) / wide.noise[:, None] == pytest.approx(2.5)


@pytest.mark.parametrize(
    "law",
    [pytest.param(cf.Feedback(300.0, 1800.0, 6), marks=pytest.mark.slow), cf.Feedback(600.0, 2400.0, 4)],
)
def test_noise_of_feedback_by_impulses(law):
    """The covariance of 400 simulations agrees with the steady state to a few percent."""
    path = kicked()
    quiet = cf.simulate(path, FIELD, feedback=law)
    noisy = cf.simulate(path, FIELD, feedback=law, navigation=SIGHT, seeds=400)
    room = cf.tracking_margins(path, FIELD, law, SIGHT)
    off = (noisy.states - quiet.states)[..., :3].reshape(-1, len(noisy.times), 3)
    spread = np.linalg.eigvalsh(np.einsum("sti,stj->tij", off, off) / len(off))[:, -1] ** 0.5
    assert spread.max() == pytest.approx(room.noise.max(), rel=0.06)  # of all times; drawn: 2 % each
    shaky = cf.tracking_margins(path, FIELD, law, SIGHT, thrust_error=(0.2, 0.2))
    assert 1.05 < shaky.noise.max() / room.noise.max() < 1.4
    wild = cf.simulate(path, FIELD, feedback=law, thrust_error=(0.2, 0.2), seeds=200)
    both = cf.simulate(path, FIELD, feedback=law, thrust_error=(0.2, 0.2), navigation=SIGHT, seeds=200)
    assert (both.states - wild.states)[..., :3].std(axis=(0, 1)).max() < 1.03 * shaky.noise.max()


def test_correction_at_the_next_measurement_replaces_a_due_impulse():
    """A maximum interval of 310 s in 3000 s gives one of 300 s."""
    path = ORBIT.impulsive([0, 400, 0, 0, 0, 0], [0, -300, 200, 0, 0, 0], 3000.0)
    law = cf.Feedback(310.0, 1800.0, 6)
    quiet = cf.simulate(path, FIELD, feedback=law)
    noisy = cf.simulate(path, FIELD, feedback=law, navigation=SIGHT, seeds=400)
    room = cf.tracking_margins(path, FIELD, law, SIGHT)
    assert room.noise == pytest.approx(cf.tube(ORBIT, cf.Feedback(300.0, 1800.0, 6), SIGHT).noise, rel=1e-9)
    off = (noisy.states - quiet.states)[:, 0, :, :3]
    spread = np.linalg.eigvalsh(np.einsum("sti,stj->tij", off, off) / len(off))[:, -1] ** 0.5
    assert spread.max() == pytest.approx(room.noise.max(), rel=0.06)


# --- thrusters and minimum impulse bits -------------------------------------------------

NOZZLES = cf.Thrusters.rtn(acceleration=0.02, minimum_bit=1e-5, period=60.0)


@pytest.mark.parametrize(
    ("kind", "bit"),
    [
        ("energy", 5e-4),
        ("impulses", 1e-5),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in (("energy", 1e-5), ("impulses", 5e-4))),
    ],
)
def test_margins_bound_pulsed_thrust(kind, bit):
    """The deviation of pulses is predicted; thrust errors and unfired bits stay within the margins."""
    draws = np.random.default_rng(7)
    ends = draws.normal(size=(2, 2, 6)) * 400.0 * np.repeat([1.0, ORBIT.mean_motion], 3)
    path = (ORBIT.two_impulse if kind == "impulses" else ORBIT.transfer)(*ends, 0.45 * ORBIT.period)
    nozzles = cf.Thrusters.rtn(acceleration=0.02, minimum_bit=bit, period=60.0)
    for sets in (nozzles, [nozzles, None]):
        for errors in ({"thrust_error": OFF}, {"errors": cf.Uncertainty(magnitude=0.01, pointing=0.01)}):
            options = {"thrusters": sets, "navigation": SIGHT, **errors}
            room, flights = (
                cf.tracking_margins(path, FIELD, **options),
                cf.simulate(path, FIELD, **options, seeds=40),
            )
            within = (flights.times > room.times[0]) & (flights.times < room.times[-1])
            off = flights.states - flights.planned.state(flights.times)
            off = np.linalg.norm(off[:, :, within, :3], axis=-1).max(axis=0)
            limit = at(room, room.radius, flights.times[within])
            assert (off <= limit).all()
            assert (off.max(axis=1) > (0.4 if bit < 1e-4 else 0.15) * room.greatest).all()


def test_deviation_of_pulses_is_predicted():
    """Without errors it is the only deviation; continuous thrust has none."""
    path = ORBIT.transfer(*formation(count=2).state([0.0, 3000.0]).swapaxes(0, 1), 3000.0)
    room, flight = (
        cf.tracking_margins(path, FIELD, thrusters=NOZZLES),
        cf.simulate(path, FIELD, thrusters=NOZZLES),
    )
    assert not cf.tracking_margins(path, FIELD).shift.any()
    within = (flight.times > room.times[0]) & (flight.times < room.times[-1])
    off = (flight.states - flight.planned.state(flight.times))[0, :, within, :3].swapaxes(0, 1)
    said = at(room, room.shift, flight.times[within])
    assert np.abs(off).max() > 0.3  # m
    assert np.linalg.norm(said - off, axis=-1).max(axis=1) == pytest.approx(np.zeros(2), abs=room.rest.max())


def test_margins_include_the_minimum_bit():
    """The same as for the tube, with differential drag."""
    law, bit = cf.Feedback(600.0, 2400.0, impulses=4), 1e-3
    path, lag = differential_drag()
    flights = cf.simulate(path, lag, feedback=law, minimum_bit=bit, cancel=False)
    fine, room = (cf.tracking_margins(path, lag, law, cancel=False, minimum_bit=size) for size in (0.0, bit))
    off = flights.deviations.max(axis=(0, 2))
    assert (off <= room.greatest).all()
    assert (off > fine.greatest).any()


def test_minimum_bit_requires_impulses():
    path = formation(0.3, 2)
    with pytest.raises(
        ValueError, match=r"^minimum_bit: requires feedback by impulses; give such a Feedback, or remove it$"
    ):
        cf.tracking_margins(path, FIELD, minimum_bit=1e-3)
    with pytest.raises(ValueError, match=r"^thrusters: cannot be combined with minimum_bit"):
        cf.tracking_margins(path, FIELD, minimum_bit=1e-3, thrusters=NOZZLES)
    with pytest.raises(ValueError, match=r"^thrusters: 3 sets for 2 spacecraft; give one, or one for each$"):
        cf.tracking_margins(path, FIELD, thrusters=[NOZZLES] * 3)


def test_no_thrusters_at_all():
    path = formation(0.3, 2)
    none, room = (
        cf.tracking_margins(path, FIELD, navigation=SIGHT, thrusters=sets) for sets in ([None] * 2, None)
    )
    assert (none.radius == room.radius).all()


@pytest.mark.parametrize("seconds", [100.0, 400.0])
def test_margins_of_paths_shorter_than_a_pulse_interval(seconds):
    """Burns are centred in the available time."""
    options = {
        "navigation": SIGHT,
        "thrusters": cf.Thrusters.rtn(acceleration=0.02, minimum_bit=1e-7, period=20.0),
    }
    path = ORBIT.coast(np.zeros((1, 6)), seconds)
    room, flights = (
        cf.tracking_margins(path, FIELD, **options),
        cf.simulate(path, FIELD, **options, seeds=300),
    )
    assert 0.01 < deviations(path, flights).std(axis=(0, 1)).max() < room.noise.max()
    assert (flights.deviations.max(axis=(0, 2)) < room.greatest).all()


def test_delay_longer_than_the_path():
    """No correction acts, in the simulation or in the margins."""
    path, law = formation(0.008), cf.Feedback(60.0, 600.0, delay=60.0)
    assert path.end[0] - path.start[0] < 60.0
    errors = cf.Uncertainty(1e-2 * np.eye(6))
    options = {"feedback": law, "navigation": SIGHT, "errors": errors}
    flights, free = cf.simulate(path, FIELD, **options), cf.simulate(path, FIELD, "open", errors=errors)
    assert flights.states == pytest.approx(free.states)
    room = cf.tracking_margins(path, FIELD, **options)
    free = ORBIT.transition(path.end[0])[:3] * 0.1
    assert room.spread[0, -1] == pytest.approx(free @ free.T)


def two_transfers(begin: float) -> cf.Path:
    """Return two consecutive two-impulse transfers with all impulses at measurement times."""
    ends = [0, 400, 0, 0, 0, 0], [0, -300, 200, 0, 0, 0], np.zeros(6)
    parts = [ORBIT.two_impulse(*ends[k : k + 2], 1500.0, begin + 1500.0 * k) for k in range(2)]
    return cf.join(parts)


@pytest.mark.parametrize("begin", [6066.357757671799, 6547.846749285817])
def test_impulses_at_measurement_times(begin):
    """A measurement at the time of an impulse precedes it, wherever the path starts."""
    gates = cf.Uncertainty(impulse=(0.0, 0.01, 0.0, 0.0175))
    field = cf.Field(FIELD.chief, 0)
    early, late = (
        cf.tracking_margins(two_transfers(one), field, errors=gates, cancel=False) for one in (0.0, begin)
    )
    assert late.spread == pytest.approx(early.spread, abs=1e-4)  # m^2, of 19
    assert late.times == pytest.approx(early.times + begin)
    assert cf.simulate(two_transfers(begin), field, seeds=2).greatest_deviation < 1.0  # m


# --- fitted margins ---------------------------------------------------------------------------


def crossing(count: int = 4) -> np.ndarray:
    angle = 2.0 * np.pi / count * np.arange(count) + 0.3
    states = np.zeros((count, 6))
    states[:, 1], states[:, 2] = 150 * np.cos(angle), 150 * np.sin(angle)
    return states


@pytest.mark.parametrize("zone", [cf.Sphere(30.0), cf.Box([20.0, 30.0, 25.0])])
def test_fitted_margin_keeps_simulations_clear(zone):
    """Of 60 simulations with noise and thrust errors none enters; without a margin, a third."""
    start = swap()

    def planned(margin):
        return cf.reconfigure(ORBIT, start, start[[1, 0, 2]], 0.4 * ORBIT.period, zone, margin=margin)

    found = cf.fit_margin(planned, FIELD, zone, navigation=SIGHT, thrust_error=OFF)
    assert found.fits
    assert found.rounds <= 4
    assert 0.28 < found.greatest < 0.6
    flown = {"navigation": SIGHT, "zones": zone, "thrust_error": OFF, "seeds": 60}
    assert cf.simulate(found.plan, FIELD, **flown).violated == 0.0
    assert cf.simulate(planned(0.0), FIELD, **flown).violated > 0.3


def test_fitted_margin_of_impulses_assumes_default_feedback():
    """Of 60 simulations with default feedback none enters."""
    start, zone = swap(), cf.Sphere(30.0)

    def planned(margin):
        to, time = start[[1, 0, 2]], 0.4 * ORBIT.period
        return cf.reconfigure(ORBIT, start, to, time, zone, cost="delta-v", margin=margin)

    found = cf.fit_margin(planned, FIELD, zone, navigation=SIGHT, thrust_error=OFF)
    assert found.fits
    assert 1.0 < found.greatest < 2.5  # m; thrust that lasts needs 0.32
    flown = {"navigation": SIGHT, "zones": zone, "thrust_error": OFF, "seeds": 60}
    assert cf.simulate(found.plan, FIELD, **flown).violated == 0.0
    assert cf.simulate(planned(0.0), FIELD, **flown).violated > 0.3


def test_margin_against_a_known_obstacle():
    """The margin is that of one spacecraft, not of two."""
    zone, client = cf.Sphere(30.0), ORBIT.coast(np.zeros(6), 1500.0)
    path = ORBIT.transfer([0, 0, 120, 0, 0, 0], [0, 0, -120, 0, 0, 0], 1500.0)
    found = cf.fit_margin(
        lambda margin: cf.avoid(path, client, zone, margin=margin),
        FIELD,
        zone,
        navigation=SIGHT,
        obstacles=client,
    )
    assert found.fits
    assert found.greatest == pytest.approx(cf.tube(ORBIT, cf.Feedback(), SIGHT).radius, rel=0.02)


@pytest.mark.parametrize("cost", ["energy", pytest.param("delta-v", marks=pytest.mark.slow)])
def test_margin_against_a_station_keeping_spacecraft(cost):
    """The obstacle deviates as well: none of 100 simulations enters."""
    zone, client = cf.Sphere(30.0), ORBIT.coast(np.zeros(6), 9000.0)
    start, final = np.array([[0, 0, 120, 0, 0, 0], [0, 3, -120, 0, 0, 0]])
    path = (ORBIT.transfer if cost == "energy" else ORBIT.two_impulse)(start, final, 1500.0)
    options = {"navigation": SIGHT, "thrust_error": OFF}

    def planned(margin):
        return cf.avoid(path, client, zone, cost=cost, margin=margin)

    found = cf.fit_margin(planned, FIELD, zone, obstacles=client, held=True, **options)
    known = cf.fit_margin(planned, FIELD, zone, obstacles=client, **options)
    assert found.fits
    assert 1.1 * known.greatest < found.greatest < 2.0 * known.greatest
    still = ORBIT.coast(np.zeros((1, 6)), 1500.0)
    entered = [
        cf.simulate(cf.stack([plan.path, still[0]]), FIELD, zones=zone, seeds=100, **options).violated
        for plan in (found.plan, planned(0.0))
    ]
    assert entered[0] == 0.0
    assert entered[1] > 0.3


@pytest.mark.parametrize("cost", ["energy", pytest.param("delta-v", marks=pytest.mark.slow)])
def test_margin_of_a_fast_pass(cost):
    """At 5 m/s, margins are sampled each 10 or 14 s: none of 100 simulations enters."""
    zone, client = cf.Sphere(30.0), ORBIT.coast(np.zeros(6), 9000.0)
    ends = [0, 0, 2000, 0, 0, 0], [0, 15, -3500, 0, 0, 0]
    path = (ORBIT.transfer if cost == "energy" else ORBIT.two_impulse)(*ends, 1000.0)
    options = {"navigation": SIGHT, "thrust_error": (0.002, 0.002)}

    def planned(margin):
        return cf.avoid(path, client, zone, cost=cost, margin=margin)

    found = cf.fit_margin(planned, FIELD, zone, obstacles=client, held=True, **options)
    noise = cf.tube(ORBIT, cf.Feedback(), SIGHT).of_a_pair
    assert found.fits
    assert found.greatest > 5.0 * noise
    still = ORBIT.coast(np.zeros((1, 6)), 1000.0)
    entered = [
        cf.simulate(cf.stack([plan.path, still[0]]), FIELD, zones=zone, seeds=100, **options).violated
        for plan in (found.plan, planned(noise))
    ]
    assert entered[0] == 0.0
    assert entered[1] > 0.1


def test_fit_fails_without_thrust_for_feedback():
    start, zone = swap(), cf.Sphere(30.0)

    def planned(margin):
        return cf.reconfigure(ORBIT, start, start[[1, 0, 2]], 0.4 * ORBIT.period, zone, margin=margin)

    free = cf.fit_margin(planned, FIELD, zone, navigation=SIGHT)
    limit = 0.99 * free.room.thrust.max()
    found = cf.fit_margin(planned, FIELD, zone, navigation=SIGHT, max_acceleration=limit)
    assert not found.fits
    assert "with feedback, its limit is" in found.reason
    assert "plan with at most" in found.reason
    hasty = ORBIT.transfer(start + [0, 20.0, 0, 0, 0, 0], start, 300.0, start=-300.0)
    assert hasty.peak_thrust.min() > 2.0 * limit
    for before in (None, hasty):  # whose thrust was given
        ways = {"navigation": SIGHT, "max_acceleration": 1.01 * limit / 0.99, "before": before}
        assert cf.fit_margin(planned, FIELD, zone, **ways).fits


def test_fit_fails_if_the_ends_are_too_close():
    start, zone = crossing(), cf.Sphere(211.9)  # neighbours are 212.13 m apart
    found = cf.fit_margin(
        lambda margin: cf.reconfigure(ORBIT, start, -start, 2000.0, zone, margin=margin),
        FIELD,
        zone,
        navigation=SIGHT,
    )
    assert not found.fits
    assert found.room is None
    assert "less than the margin of 0.279 m" in found.reason
