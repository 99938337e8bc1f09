"""Errors of each burn, impulse and start in flight: DOP853 with the same draws, spreads against the room."""

import numpy as np
import pytest

import closeform as cf
from test_field import chief, fired, flown, pushed, task
from test_pulsed_flight import on_times
from test_room import CHIEF, FIELD, ORBIT, SIGHT, formation, kicked, swap

BURNS = cf.Uncertainty(magnitude=0.02, pointing=0.03)
PLANNED, BACKWARD, STRUCK = 1, 2, 3


def drawn(seed: int, craft: int, which: int, count: int) -> np.ndarray:
    """Normal numbers (count, 4): Philox, keyed by the flight, counted from craft and kind."""
    bits = np.random.Philox(key=seed, counter=[0, 0, which, 1 + craft])
    return np.random.Generator(bits).normal(size=(count, 4))


def off(thrust: np.ndarray, normal: np.ndarray, errors: cf.Uncertainty = BURNS) -> np.ndarray:
    """Thrust (3,) that is larger by a share and turned by a small angle."""
    size, turn = errors.magnitude * normal[0], errors.pointing * normal[1:]
    return (1.0 + size) * (thrust + np.cross(turn, thrust))


def test_each_burn_of_a_plan_has_an_error_of_its_own():
    """Within a thrust limit, of least delta-v: two burns and more, each with its draw, by DOP853."""
    orbit = chief().orbit
    start, final, duration = task(orbit, 7, count=2)
    path = orbit.transfer(start, final, duration, max_acceleration=3e-3, cost="delta-v")
    exact = cf.simulate(path, cf.Field(chief()), "open", cancel=False)
    open_loop = cf.simulate(path, cf.Field(chief()), "open", cancel=False, errors=BURNS, seeds=[3])
    burning = np.abs(path.thrust(np.linspace(0.0, duration, 20001)).T).sum(axis=0) > 0.0
    ends = []
    for k in range(2):
        edges = np.flatnonzero(np.diff(burning[:, k])) * duration / 20000.0
        assert len(edges) >= 2
        draws = drawn(3, k, PLANNED, len(edges) + 1)

        def command(t, k=k, edges=edges, draws=draws):
            thrust = path.thrust(min(t, duration))
            own = off(thrust[k], draws[np.searchsorted(edges, t)])
            return np.where(np.arange(2)[:, None] == k, own, thrust)

        ends.append(flown(path, path.state(0.0), duration, command)[k])
    moved = np.linalg.norm((open_loop.states - exact.states)[0, :, -1, :3], axis=-1)
    assert (moved > 10.0).all()  # m
    assert open_loop.states[0, :, -1, :3] == pytest.approx(np.array(ends), abs=2e-3 * moved.max())


def test_each_impulse_is_off_by_gates_model():
    """Along it and across it by sizes of their own, from normal numbers; flown on by DOP853."""
    errors, field = cf.Uncertainty(impulse=(2e-3, 0.02, 5e-3, 0.03)), cf.Field(chief())
    start, final, duration = task(chief().orbit, 7, count=1)
    path = chief().orbit.impulsive(start, final, duration)
    flights = cf.simulate(path, field, "open", errors=errors, seeds=[5])
    wanted = cf.compensated_thrust(path, field).impulses
    shots = (flights.states - flights.arrivals)[0, 0, :, 3:]
    when = np.linalg.norm(shots, axis=1) > 0.0
    assert flights.times[when] == pytest.approx(wanted.time)
    normal = drawn(5, 0, STRUCK, len(wanted))[:, :3]
    for shot, asked, own in zip(shots[when], wanted.impulse, normal, strict=True):
        size = np.linalg.norm(asked)
        way = asked / size
        along, across = np.hypot(2e-3, 0.02 * size), np.hypot(5e-3, 0.03 * size)
        assert (shot - asked) @ way == pytest.approx(along * (own @ way), rel=1e-6)
        aside = own - (own @ way) * way
        assert shot - asked - ((shot - asked) @ way) * way == pytest.approx(across * aside, rel=1e-6)
    end = fired(flights.arrivals[0, 0, 0], flights.times[when], shots[when], duration)
    assert flights.states[0, 0, -1] == pytest.approx(end, abs=1e-3)


def test_impulses_err_as_impulses_where_thrust_that_lasts_leads_back():
    """What each interval's thrust is off by is not theirs: without their own they are as planned."""
    exact, erring = (cf.simulate(kicked(), FIELD, feedback=LASTING, errors=one) for one in (None, BURNS))
    shots = [(one.states - one.arrivals)[..., 3:] for one in (exact, erring)]
    assert np.abs(shots[0]).max() > 0.1  # m/s
    assert shots[1] == pytest.approx(shots[0], abs=1e-12)


def test_thrusters_err_pulse_by_pulse_and_order_by_order():
    """Each pulse of the plan, and all that one order fires, with its own draw: by DOP853."""
    orbit, field = chief().orbit, cf.Field(chief())
    start, final, duration = task(orbit, 7, count=2, turns=0.15)
    path, strong = orbit.transfer(start, final, duration), 0.02
    thrusters = cf.Thrusters.rtn(acceleration=strong, minimum_bit=5e-4, period=60.0)
    sight = cf.Navigation(0.5, 2e-3)
    flights = cf.simulate(path, field, thrusters=thrusters, navigation=sight, errors=BURNS, seeds=[2])
    pulses = cf.compensated_thrust(path, field, thrusters=thrusters).firing.pulses
    own = pulses[pulses.craft == 1]
    pushes = on_times(flights, 0, 1, own)
    span = flights.times[0], flights.times[-1]
    begins, ends = own.start, own.start + own.duration
    edges = np.array([e for e in np.unique([*begins, *ends]) if not ((begins < e) & (e < ends)).any()])
    edges = edges[(edges > span[0]) & (edges < span[1])]
    planned = drawn(2, 1, PLANNED, len(edges) + 1)
    back = drawn(2, 1, BACKWARD, len(flights.ordered))
    erring = [
        (begin, over, off(push, planned[np.searchsorted(edges, 0.5 * (begin + over))]))
        for begin, over, push in pushes[: len(own)]
    ]
    erring += [
        (begin, over, off(push, back[np.searchsorted(flights.ordered, 0.5 * (begin + over)) - 1]))
        for begin, over, push in pushes[len(own) :]
    ]
    begin = field.chief_states(flights.times[:1])[0]
    end, without = (pushed(begin, flights.states[0, 1, 0], one, span) for one in (erring, pushes))
    assert np.linalg.norm(end - without) > 0.5  # m
    assert flights.states[0, 1, -1, :3] == pytest.approx(end, abs=0.02)  # m; burns end within steps of 5 s


def spreads(path: cf.Path, law: cf.Feedback, errors: cf.Uncertainty, sight: cf.Navigation):
    """The greatest standard deviation of each craft of 400 flights, and that of its room."""
    quiet = cf.simulate(path, FIELD, feedback=law)
    flights = cf.simulate(path, FIELD, feedback=law, navigation=sight, errors=errors, seeds=400)
    room = cf.tracking_margins(path, FIELD, law, sight, errors=errors)
    away = (flights.states - quiet.states)[..., :3]
    found = np.linalg.eigvalsh(np.einsum("snti,sntj->ntij", away, away) / 400)[..., -1]
    said = room.noise[:, None] ** 2 + np.linalg.eigvalsh(room.spread)[..., -1]
    return np.sqrt(found.max(axis=1)), np.sqrt(said.max(axis=1)), room


def burns(turns: float = 1.0) -> cf.Path:
    draws = np.random.default_rng(7)
    scale = 400.0 * np.repeat([1.0, ORBIT.mean_motion], 3)
    ends = draws.normal(size=(2, 2, 6)) * scale
    return ORBIT.transfer(*ends, turns * ORBIT.period, max_acceleration=3e-3, cost="delta-v")


LASTING, LATE, SHOTS = cf.Feedback(), cf.Feedback(60.0, 600.0, delay=20.0), cf.Feedback(300.0, 1800.0, 6)
START = cf.Uncertainty(np.diag([4.0, 4.0, 4.0, 1e-6, 1e-6, 1e-6]))
GATES = cf.Uncertainty(impulse=(0.0, 0.01, 0.0, 0.0175))


@pytest.mark.parametrize(
    ("path", "law", "errors"),
    [
        (formation(), LASTING, BURNS),
        (formation(), LATE, BURNS),
        (burns(), LASTING, BURNS),
        (formation(), LASTING, START),
        (kicked(), SHOTS, START),
        (kicked(), SHOTS, GATES),
        (kicked(), SHOTS, cf.Uncertainty(impulse=(1e-3, 0.0, 1e-3, 0.0))),
    ],
    ids=["plan", "late", "burns", "start", "start, impulses", "shares", "fixed"],
)
def test_the_room_says_how_far_errors_of_burns_spread(path, law, errors):
    """Without other errors, so that all is theirs; of 400 draws, 3.5 % off, the worst time of many."""
    found, said, _ = spreads(path, law, errors, cf.Navigation())
    assert (said > 0.5).all()  # m
    assert found == pytest.approx(said, rel=0.12)


SIZES = 0.2, 0.2


@pytest.mark.parametrize(
    ("law", "errors"),
    [
        (LASTING, cf.Uncertainty(None, *SIZES)),
        (LATE, cf.Uncertainty(None, *SIZES)),
        (SHOTS, cf.Uncertainty(impulse=(0.0, 0.2, 0.0, 0.2))),
    ],
    ids=["thrust", "late", "impulses"],
)
def test_what_leads_back_errs_too(law, errors):
    """Craft at the chief, whom noise alone moves: by how much more, of 400 flights with the same noise.

    Of a burn that is larger and turned, both errors multiply, which the room leaves out: 0.2^2 of the whole.
    """
    coast, sight = ORBIT.coast(np.zeros((4, 6)), 2.0 * ORBIT.period), cf.Navigation(0.1, 3e-3)
    erring, plain = (
        (
            cf.simulate(coast, FIELD, feedback=law, navigation=sight, errors=own, seeds=400).states[..., :3]
            ** 2
        )
        .sum(axis=-1)
        .mean()
        for own in (errors, None)
    )
    room = cf.tracking_margins(coast, FIELD, law, sight, errors=errors)
    said = np.trace(room.spread, axis1=-2, axis2=-1).mean()
    assert said > 0.15 * plain
    assert erring - plain == pytest.approx(said, rel=0.07)


@pytest.mark.parametrize(
    ("law", "errors"),
    [
        (LASTING, cf.Uncertainty(None, 0.05, 0.05)),
        (LATE, cf.Uncertainty(None, 0.05, 0.05)),
        (SHOTS, cf.Uncertainty(impulse=(0.0, 0.05, 0.0, 0.05))),
    ],
    ids=["thrust", "late", "impulses"],
)
def test_what_answers_to_constant_errors_of_measurements_errs_too(law, errors):
    """By 300 flights of four craft, of biases that point evenly to all sides: a third of what any may do."""
    coast, sight = ORBIT.coast(np.zeros((4, 6)), ORBIT.period), cf.Navigation(position_bias=1.0)
    erring, plain = (
        cf.simulate(coast, FIELD, feedback=law, navigation=sight, errors=own, seeds=300).states[..., :3]
        for own in (errors, None)
    )
    room = cf.tracking_margins(coast, FIELD, law, sight, errors=errors)
    away = (erring - plain).reshape(-1, *erring.shape[2:])
    found = np.linalg.eigvalsh(np.einsum("sti,stj->tij", away, away) / len(away))[:, -1].max()
    assert 3.0 * found == pytest.approx(np.linalg.eigvalsh(room.spread)[..., -1].max(), rel=0.2)
    assert np.linalg.norm(erring, axis=-1).max() < room.greatest.max()


def test_an_error_of_fixed_size_counts_to_all_sides():
    """What is along an impulse only is a bound where impulses point to all sides, and no wide one."""
    found, said, _ = spreads(kicked(), SHOTS, cf.Uncertainty(impulse=(2e-3, 0.0, 0.0, 0.0)), cf.Navigation())
    assert (found < 1.1 * said).all()
    assert (found > 0.3 * said).all()


def test_draws_are_each_craft_and_flights_own():
    """The same alone and among others; of one craft without errors nothing changes."""
    path, both = formation(0.3), cf.Uncertainty(np.eye(6) * 1e-4, 0.02, 0.03)
    few, many = (cf.simulate(path, FIELD, errors=both, navigation=SIGHT, seeds=n) for n in (2, 5))
    assert (many.states[:2] == few.states).all()
    assert (many.states[1] != many.states[0]).any()
    plain = cf.simulate(path, FIELD, navigation=SIGHT, seeds=2)
    some = cf.simulate(path, FIELD, errors=[both, None, None, both], navigation=SIGHT, seeds=2)
    assert (some.states[:, 1:3] == plain.states[:, 1:3]).all()
    assert (some.states[:, [0, 3]] == few.states[:, [0, 3]]).all()


def test_states_at_the_start_are_drawn():
    covariance = np.diag([1.0, 4.0, 9.0, 1e-6, 1e-6, 1e-6])
    covariance[0, 4] = covariance[4, 0] = -8e-4
    flights = cf.simulate(formation(0.1), FIELD, errors=cf.Uncertainty(covariance), seeds=500)
    begun = (flights.states - flights.planned.state(flights.times))[:, :, 0].reshape(-1, 6)
    scale = np.sqrt(np.diag(covariance))
    found = begun.T @ begun / len(begun) / np.outer(scale, scale)
    assert found == pytest.approx(covariance / np.outer(scale, scale), abs=0.1)  # of 2000 draws
    anew = cf.simulate(
        formation(0.4), FIELD, "replan", zones=cf.Sphere(5.0), errors=cf.Uncertainty(covariance), seeds=2
    )
    assert anew.states[:, :, 0] == pytest.approx(flights.states[:2, :, 0])


def test_a_long_flight_errs_in_each_of_its_stretches():
    """Flown in several: the spread is as large near its end as in its middle."""
    coast = ORBIT.coast(np.zeros((8, 6)), 40 * ORBIT.period)
    errors = cf.Uncertainty(impulse=(1e-3, 0.0, 1e-3, 0.0))
    flights = cf.simulate(coast, FIELD, feedback=SHOTS, errors=errors, navigation=cf.Navigation(0.01))
    away = (flights.states - coast.state(flights.times))[0, :, :, :3]
    parts = [away[:, some].std() for some in np.array_split(np.arange(len(flights.times)), 4)]
    assert min(parts) > 0.9 * max(parts)
    assert min(parts) > 0.3  # m


@pytest.mark.parametrize(
    ("cost", "errors"),
    [
        ("energy", cf.Uncertainty(magnitude=0.01, pointing=0.01)),
        ("delta-v", cf.Uncertainty(impulse=(0.0, 0.01, 0.0, 0.01))),
    ],
    ids=["thrust", "impulses"],
)
def test_a_margin_of_errors_of_burns_is_flown_clear(cost, errors):
    """Of 300 flights none enters; without a margin every third does."""
    start, zone = swap(), cf.Sphere(30.0)

    def planned(margin):
        to, time = start[[1, 0, 2]], 0.4 * ORBIT.period
        return cf.reconfigure(ORBIT, start, to, time, zone, cost=cost, margin=margin)

    plain = cf.fit_margin(planned, FIELD, zone, navigation=SIGHT)
    found = cf.fit_margin(planned, FIELD, zone, navigation=SIGHT, errors=errors)
    assert found.fits
    assert 1.1 * plain.greatest < found.greatest < 4.0 * plain.greatest
    ways = {"navigation": SIGHT, "zones": zone, "errors": errors, "seeds": 300}
    assert cf.simulate(found.plan, FIELD, **ways).violated == 0.0
    assert cf.simulate(planned(0.0), FIELD, **ways).violated > 0.3


def test_what_cannot_be_drawn_is_named():
    path = formation(0.1)
    with pytest.raises(ValueError, match=r"^errors: tracking margins do not cover process noise"):
        cf.tracking_margins(path, FIELD, errors=cf.Uncertainty(noise=1e-9))
    with pytest.raises(ValueError, match=r"^errors: 2 for 4 craft; give one, or one for each$"):
        cf.simulate(path, FIELD, errors=[None, BURNS])
    with pytest.raises(ValueError, match=r"^errors: expected Uncertainty, got 0\.1$"):
        cf.simulate(path, cf.Field(CHIEF), errors=0.1)
