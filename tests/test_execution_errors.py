"""Simulated errors of burns, impulses and starts: DOP853 with the same samples, spreads against margins."""

import numpy as np
import pytest

import closeform as cf
from simulated import (
    FIELD,
    ORBIT,
    SIGHT,
    chief,
    fired,
    flown,
    formation,
    kicked,
    pushed,
    swap,
    task,
)
from test_pulsed_flight import on_times

BURNS = cf.Uncertainty(magnitude=0.02, pointing=0.03)
PLANNED, BACKWARD, STRUCK = 1, 2, 3


def samples_of(seed: int, craft: int, which: int, count: int) -> np.ndarray:
    """Return normal numbers (count, 4) of a Philox generator keyed by simulation, spacecraft and kind."""
    bits = np.random.Philox(key=seed, counter=[0, 0, which, 1 + craft])
    return np.random.Generator(bits).normal(size=(count, 4))


def off(thrust: np.ndarray, normal: np.ndarray, errors: cf.Uncertainty = BURNS) -> np.ndarray:
    """Return thrust (3,) with errors of magnitude and pointing."""
    size, turn = errors.magnitude * normal[0], errors.pointing * normal[1:]
    return (1.0 + size) * (thrust + np.cross(turn, thrust))


def test_each_burn_has_its_own_error():
    """DOP853 reproduces a plan of several burns, each with its own error."""
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
        draws = samples_of(3, k, PLANNED, len(edges) + 1)

        def command(t, k=k, edges=edges, draws=draws):
            thrust = path.thrust(min(t, duration))
            own = off(thrust[k], draws[np.searchsorted(edges, t)])
            return np.where(np.arange(2)[:, None] == k, own, thrust)

        ends.append(flown(path, path.state(0.0), duration, command)[k])
    moved = np.linalg.norm((open_loop.states - exact.states)[0, :, -1, :3], axis=-1)
    assert (moved > 10.0).all()  # m
    assert open_loop.states[0, :, -1, :3] == pytest.approx(np.array(ends), abs=2e-3 * moved.max())


def test_impulse_errors_follow_gates_model():
    """Errors along and across each impulse have Gates' sizes; DOP853 reproduces the motion."""
    errors, field = cf.Uncertainty(impulse=(2e-3, 0.02, 5e-3, 0.03)), cf.Field(chief())
    start, final, duration = task(chief().orbit, 7, count=1)
    path = chief().orbit.impulsive(start, final, duration)
    flights = cf.simulate(path, field, "open", errors=errors, seeds=[5])
    wanted = cf.compensated_thrust(path, field).impulses
    shots = (flights.states - flights.arrivals)[0, 0, :, 3:]
    when = np.linalg.norm(shots, axis=1) > 0.0
    assert flights.times[when] == pytest.approx(wanted.time)
    normal = samples_of(5, 0, STRUCK, len(wanted))[:, :3]
    for shot, asked, own in zip(shots[when], wanted.impulse, normal, strict=True):
        size = np.linalg.norm(asked)
        way = asked / size
        along, across = np.hypot(2e-3, 0.02 * size), np.hypot(5e-3, 0.03 * size)
        assert (shot - asked) @ way == pytest.approx(along * (own @ way), rel=1e-6)
        aside = own - (own @ way) * way
        assert shot - asked - ((shot - asked) @ way) * way == pytest.approx(across * aside, rel=1e-6)
    end = fired(flights.arrivals[0, 0, 0], flights.times[when], shots[when], duration)
    assert flights.states[0, 0, -1] == pytest.approx(end, abs=1e-3)


def test_impulses_have_no_errors_of_continuous_thrust():
    """Errors of continuous thrust do not affect planned impulses."""
    exact, erring = (cf.simulate(kicked(), FIELD, feedback=LASTING, errors=one) for one in (None, BURNS))
    shots = [(one.states - one.arrivals)[..., 3:] for one in (exact, erring)]
    assert np.abs(shots[0]).max() > 0.1  # m/s
    assert shots[1] == pytest.approx(shots[0], abs=1e-12)


def test_pulses_and_corrections_have_their_own_errors():
    """DOP853 reproduces pulses of the plan and of each correction, with their own errors."""
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
    planned = samples_of(2, 1, PLANNED, len(edges) + 1)
    back = samples_of(2, 1, BACKWARD, len(flights.ordered))
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
    """Return the largest standard deviation of each spacecraft in 400 simulations and in its margins."""
    quiet = cf.simulate(path, FIELD, feedback=law)
    flights = cf.simulate(path, FIELD, feedback=law, navigation=sight, errors=errors, seeds=400)
    margins = cf.tracking_margins(path, FIELD, law, sight, errors=errors)
    away = (flights.states - quiet.states)[..., :3]
    found = np.linalg.eigvalsh(np.einsum("snti,sntj->ntij", away, away) / 400)[..., -1]
    predicted = margins.noise[:, None] ** 2 + np.linalg.eigvalsh(margins.spread)[..., -1]
    return np.sqrt(found.max(axis=1)), np.sqrt(predicted.max(axis=1)), margins


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
        pytest.param(formation(), LATE, BURNS, marks=pytest.mark.slow),
        pytest.param(burns(), LASTING, BURNS, marks=pytest.mark.slow),
        pytest.param(formation(), LASTING, START, marks=pytest.mark.slow),
        pytest.param(kicked(), SHOTS, START, marks=pytest.mark.slow),
        (kicked(), SHOTS, GATES),
        pytest.param(kicked(), SHOTS, cf.Uncertainty(impulse=(1e-3, 0.0, 1e-3, 0.0)), marks=pytest.mark.slow),
    ],
    ids=["plan", "late", "burns", "start", "start, impulses", "shares", "fixed"],
)
def test_margins_predict_the_spread_of_execution_errors(path, law, errors):
    """400 samples have a statistical error of 3.5 %, larger at the worst of many times."""
    found, predicted, _ = spreads(path, law, errors, cf.Navigation())
    assert (predicted > 0.5).all()  # m
    assert found == pytest.approx(predicted, rel=0.12)


SIZES = 0.2, 0.2


@pytest.mark.parametrize(
    ("law", "errors"),
    [
        pytest.param(LASTING, cf.Uncertainty(None, *SIZES), marks=pytest.mark.slow),
        pytest.param(LATE, cf.Uncertainty(None, *SIZES), marks=pytest.mark.slow),
        (SHOTS, cf.Uncertainty(impulse=(0.0, 0.2, 0.0, 0.2))),
    ],
    ids=["thrust", "late", "impulses"],
)
def test_margins_predict_errors_of_corrections(law, errors):
    """Errors of corrections add the predicted variance to that of navigation noise."""
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
    margins = cf.tracking_margins(coast, FIELD, law, sight, errors=errors)
    predicted = np.trace(margins.spread, axis1=-2, axis2=-1).mean()
    assert predicted > 0.15 * plain
    assert erring - plain == pytest.approx(predicted, rel=0.07)


@pytest.mark.parametrize(
    ("law", "errors"),
    [
        (LASTING, cf.Uncertainty(None, 0.05, 0.05)),
        pytest.param(LATE, cf.Uncertainty(None, 0.05, 0.05), marks=pytest.mark.slow),
        pytest.param(SHOTS, cf.Uncertainty(impulse=(0.0, 0.05, 0.0, 0.05)), marks=pytest.mark.slow),
    ],
    ids=["thrust", "late", "impulses"],
)
def test_margins_predict_errors_of_corrections_of_biases(law, errors):
    """Corrections of random biases spread by a third of the bound for any bias."""
    coast, sight = ORBIT.coast(np.zeros((4, 6)), ORBIT.period), cf.Navigation(position_bias=1.0)
    erring, plain = (
        cf.simulate(coast, FIELD, feedback=law, navigation=sight, errors=own, seeds=300).states[..., :3]
        for own in (errors, None)
    )
    margins = cf.tracking_margins(coast, FIELD, law, sight, errors=errors)
    away = (erring - plain).reshape(-1, *erring.shape[2:])
    found = np.linalg.eigvalsh(np.einsum("sti,stj->tij", away, away) / len(away))[:, -1].max()
    assert 3.0 * found == pytest.approx(np.linalg.eigvalsh(margins.spread)[..., -1].max(), rel=0.2)
    assert np.linalg.norm(erring, axis=-1).max() < margins.greatest.max()


def test_errors_of_fixed_size_count_in_all_directions():
    """Errors along impulses are bounded, and not loosely, by errors in all directions."""
    found, predicted, _ = spreads(
        kicked(), SHOTS, cf.Uncertainty(impulse=(2e-3, 0.0, 0.0, 0.0)), cf.Navigation()
    )
    assert (found < 1.1 * predicted).all()
    assert (found > 0.3 * predicted).all()


def test_samples_are_independent_of_other_spacecraft():
    """Samples depend neither on the number of simulations nor on other spacecraft."""
    path, both = formation(0.3), cf.Uncertainty(np.eye(6) * 1e-4, 0.02, 0.03)
    few, many = (cf.simulate(path, FIELD, errors=both, navigation=SIGHT, seeds=n) for n in (2, 5))
    assert (many.states[:2] == few.states).all()
    assert (many.states[1] != many.states[0]).any()
    plain = cf.simulate(path, FIELD, navigation=SIGHT, seeds=2)
    some = cf.simulate(path, FIELD, errors=[both, None, None, both], navigation=SIGHT, seeds=2)
    assert (some.states[:, 1:3] == plain.states[:, 1:3]).all()
    assert (some.states[:, [0, 3]] == few.states[:, [0, 3]]).all()


def test_start_states_are_sampled():
    covariance = np.diag([1.0, 4.0, 9.0, 1e-6, 1e-6, 1e-6])
    covariance[0, 4] = covariance[4, 0] = -8e-4
    flights = cf.simulate(formation(0.1), FIELD, errors=cf.Uncertainty(covariance), seeds=500)
    begun = (flights.states - flights.planned.state(flights.times))[:, :, 0].reshape(-1, 6)
    scale = np.sqrt(np.diag(covariance))
    found = begun.T @ begun / len(begun) / np.outer(scale, scale)
    assert found == pytest.approx(covariance / np.outer(scale, scale), abs=0.1)  # 2000 samples
    anew = cf.simulate(
        formation(0.4), FIELD, "replan", zones=cf.Sphere(5.0), errors=cf.Uncertainty(covariance), seeds=2
    )
    assert anew.states[:, :, 0] == pytest.approx(flights.states[:2, :, 0])


def test_errors_persist_in_long_simulations():
    """Simulated in parts: the spread stays the same until the end."""
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
def test_margin_covers_execution_errors(cost, errors):
    """The margin prevents violations, which a third of the simulations have without it."""
    start, zone = swap(), cf.Sphere(30.0)

    def planned(margin):
        to, time = start[[1, 0, 2]], 0.4 * ORBIT.period
        return cf.reconfigure(ORBIT, start, to, time, zone, cost=cost, margin=margin)

    plain = cf.fit_margin(planned, FIELD, zone, navigation=SIGHT)
    found = cf.fit_margin(planned, FIELD, zone, navigation=SIGHT, errors=errors)
    assert found.fits
    assert 1.1 * plain.greatest < found.greatest < 4.0 * plain.greatest
    ways = {"navigation": SIGHT, "zones": zone, "errors": errors, "seeds": 150}
    assert cf.simulate(found.plan, FIELD, **ways).violated == 0.0
    assert cf.simulate(planned(0.0), FIELD, **ways).violated > 0.3


@pytest.mark.parametrize(
    "way",
    [
        {"feedback": cf.Feedback(60.0, 600.0, delay=40.0)},
        pytest.param({"feedback": cf.Feedback(300.0, 1800.0, 6)}, marks=pytest.mark.slow),
        {"thrusters": cf.Thrusters.rtn(acceleration=0.02, minimum_bit=1e-6, period=60.0)},
        {"engine": False},
    ],
    ids=["delay", "impulses", "thrusters", "drift"],
)
def test_process_noise_spreads_as_in_simulations(way):
    """The covariance of the margins is that of simulations, within four standard errors."""
    lasts, errors, seeds = 0.4 * ORBIT.period, cf.Uncertainty(noise=1e-8), 300
    path = ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, 50, 100, 0, 0, 0], lasts)
    path = ORBIT.coast([0, 200, 0, 0, 0, 0], lasts) if "engine" in way else path
    margins = cf.tracking_margins(path, FIELD, errors=errors, **way)
    flights = cf.simulate(path, FIELD, errors=errors, seeds=seeds, **way)
    off = flights.states[:, 0, :, :3] - flights.states[:, 0, :, :3].mean(axis=0)
    for k in (len(flights.times) // 4, len(flights.times) - 2):
        sampled, now = np.std(off[:, k], axis=0), flights.times[k]
        predicted = [np.interp(now, margins.times, margins.spread[0, :, i, i]) ** 0.5 for i in range(3)]
        assert sampled == pytest.approx(predicted, rel=4.0 / np.sqrt(2.0 * seeds) + 0.03)


def test_invalid_errors_are_named():
    path = formation(0.1)
    with pytest.raises(ValueError, match=r"^errors: 2 for 4 craft; give one, or one for each$"):
        cf.simulate(path, FIELD, errors=[None, BURNS])
    with pytest.raises(ValueError, match=r"^errors: expected Uncertainty, got 0\.1$"):
        cf.simulate(path, cf.Field(FIELD.chief), errors=0.1)
