"""Process noise in studies and simulations against matrix exponentials, independent of the time steps."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.special import ndtri
from scipy.stats import chi2

import closeform as cf
from bridge import hill
from closeform.campaign import case_of, evaluated
from closeform.dynamics.simulation.random_errors import NOISE_STEP, process_noise
from closeform.dynamics.simulation.simulate import replanning_margin
from closeform.mission.executed_mission import ProcessNoise
from closeform.mission.mission import plan_mission
from closeform.scenario import parse
from closeform.uncertainty.white_noise import BLOCK, increments, velocity_changes, with_velocity_changes
from passing import noise_of
from philox import block
from studies import NEAR

ORBIT = cf.Orbit.circular(500e3)
N = ORBIT.mean_motion
CHIEF = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, 0.9, 0.0])

COASTS = """\
closeform = 1
title = "Two that coast"

[orbit]
altitude = "500 km"

[craft]
name = ["A", "B"]
position = ["0 -60 0 m", "0 0 0 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "25 m" }
execution = [{ noise = "1e-7 m^2/s^3" }, { noise = "2e-8 m^2/s^3" }]

[[stage]]
do = "coast"
for = "3000 s"

[study]
cases = 1000
seed = 3
draws = "errors"
"""
ANEW = COASTS.replace('"errors"', '"replanned"')


def in_stages(text, *lengths):
    """Return the same coast in several stages."""
    stage = '[[stage]]\ndo = "coast"\nfor = "3000 s"\n'
    return text.replace(stage, "".join(stage.replace("3000", f"{length:g}") for length in lengths))


def scenario_of(text):
    return parse(text, "coasts.toml")


def has_covariance(deviations, covariance):
    """Return True if (C, 6) samples fit a covariance: moments within 5 sigma, chi-squared overall."""
    count = len(deviations)
    white = np.linalg.solve(np.linalg.cholesky(covariance), deviations.T)
    moments = white @ white.T / count
    sizes = np.sqrt((1.0 + np.eye(6)) / count)
    low, high = chi2.ppf([1e-5, 1.0 - 1e-5], 6 * count)
    return (np.abs(moments - np.eye(6)) < 5.0 * sizes).all() and low < (white**2).sum() < high


@pytest.mark.parametrize(("level", "count"), [(0, 2), (3, 13), (6, 70)])
def test_subdivided_steps_have_the_exact_covariance(level, count):
    """The response to each normal number squares to the covariance of all steps."""
    asked = []
    increments(N, level, count, lambda level, rows: np.zeros((1, asked.append(rows) or rows, 6)))
    ends = 6 * np.cumsum([0, *asked])

    def units(level, rows):
        out = np.zeros((ends[-1], rows, 6))
        out.reshape(ends[-1], -1)[ends[level] : ends[level + 1]] = np.eye(6 * rows)
        return out

    step = BLOCK / 2**level
    sizes = np.repeat([step**1.5, step**0.5], 3)
    found = (increments(N, level, count, units) / sizes).reshape(ends[-1], -1)
    expected = np.kron(np.eye(count), noise_of(1.0, N, step) / np.outer(sizes, sizes))
    assert np.abs(found.T @ found - expected).max() < 1e-10


def test_two_half_steps_add_to_a_step():
    """Steps of the next level add to those of this one, for any number of steps."""
    random = [np.random.default_rng(k).standard_normal((4, 200, 6)) for k in range(8)]
    coarse, fine = (increments(N, k, n, lambda k, rows: random[k][:, :rows]) for k, n in ((6, 70), (7, 190)))
    flow = expm(hill(N) * BLOCK / 2**7)
    assert fine[:, 0:140:2] @ flow.T + fine[:, 1:140:2] == pytest.approx(coarse, rel=1e-9, abs=1e-6)


def test_numbers_depend_on_seed_spacecraft_case_and_interval():
    """Compare with NumPy's generator, and with conditioning for half steps."""
    craft = scenario_of(COASTS).craft[0]
    for level in (0, 1):
        found = ProcessNoise(3, N, level).pushes(craft, 3, 5, 7)
        for case in (5, 6):

            def numbers(event, case=case):
                return ndtri(np.concatenate([block(3, "noise of A", 2 * case + k, event) for k in (0, 1)]))[
                    :6
                ]

            for step in range(3):
                whole = np.linalg.cholesky(noise_of(1e-7, N, BLOCK)) @ numbers((step >> level) << 20)
                if level == 1:
                    half, flow = noise_of(1e-7, N, BLOCK / 2), expm(hill(N) * BLOCK / 2)
                    gain = np.linalg.solve(noise_of(1e-7, N, BLOCK), flow @ half).T
                    rest = np.linalg.cholesky(half - gain @ flow @ half)
                    first = gain @ whole + rest @ numbers(((step >> 1) << 20) + 1)
                    whole = first if step % 2 == 0 else whole - flow @ first
                assert found[case - 5, step] == pytest.approx(whole, rel=1e-6)


def test_velocity_disturbances_propagate_by_natural_motion():
    """Thrust is unchanged on a transfer, an inertially fixed burn and impulses."""
    plan = ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, 60, 0, 0, 0.01, 0], 2000.0)
    burn = ORBIT.burn(plan.state(2000.0), [1e-4, 2e-4, 0], 1500.0, start=2000.0, frame="inertial")
    last = ORBIT.impulsive(burn.state(3500.0), [0, 0, 0, 0, 0, 0], 1800.0, start=3500.0)
    path = cf.join([plan, burn, last])
    times = np.concatenate([[-300.0, 0.0], 41.0 * np.arange(1, 129), [path.end]])
    kicks = 1e-3 * np.random.default_rng(1).standard_normal((len(times), 3))
    moved = with_velocity_changes(path, times, kicks)
    seen = np.random.default_rng(2).uniform(0.0, path.end, 100)
    seen = np.append(seen, path.end)
    assert moved.thrust(seen) == pytest.approx(path.thrust(seen), rel=1e-9, abs=1e-15)
    assert moved.delta_v == pytest.approx(path.delta_v, rel=1e-9)
    assert len(moved.impulses) == len(path.impulses)
    expected = np.zeros((len(seen), 6))
    for time, kick in zip(times, kicks, strict=True):
        later = seen >= time
        expected[later] += np.array([expm(hill(N) * (t - time))[:, 3:] @ kick for t in seen[later]])
    off = moved.state(seen) - path.state(seen)
    assert off[:, :3] == pytest.approx(expected[:, :3], abs=1e-8)  # m
    assert off[:, 3:] == pytest.approx(expected[:, 3:], abs=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("text", [COASTS, ANEW], ids=["errors", "replanned"])
def test_cases_have_the_covariance_of_the_noise(text):
    """States after half an orbit, in two stages, of two spacecraft with different noise."""
    scenario = scenario_of(in_stages(text, 1304.0, 1696.0))  # s; the first ends where velocities change
    ends = np.array([plan_mission(case_of(scenario, case)).paths.state(2992.0) for case in range(150)])
    away = ends - ORBIT.coast([[0, -60, 0, 0, 0, 0], np.zeros(6)], 3000.0).state(2992.0)
    for k, density in ((0, 1e-7), (1, 2e-8)):
        assert has_covariance(away[:, k], noise_of(density, N, 2992.0))
        assert not has_covariance(away[:, k], noise_of(1.6 * density, N, 2992.0))
    both = away[:, 0].T @ away[:, 1] / len(away)
    sizes = np.sqrt(np.outer(*(np.diag(noise_of(q, N, 2992.0)) for q in (1e-7, 2e-8))))
    assert np.abs(both / sizes).max() < 5.0 / np.sqrt(len(away))


@pytest.mark.parametrize("text", [COASTS, ANEW], ids=["errors", "replanned"])
def test_noise_does_not_depend_on_the_stages(text):
    """Compare one stage with several, a longer one, and more spacecraft."""
    whole = plan_mission(case_of(scenario_of(text), 7))
    times = np.linspace(1.0, 2999.0, 500)
    texts = [in_stages(text, 800.0, 401.3, 1798.7, 0.001)]
    if text == ANEW:
        texts.append(in_stages(text, 4500.0))
    third = text.replace('["A", "B"]', '["C", "A", "B"]').replace(
        '["0 -60 0 m",', '["0 900 0 m", "0 -60 0 m",'
    )
    texts.append(third.replace('[{ noise = "1e-7', '[{ noise = "1e-9 m^2/s^3" }, { noise = "1e-7'))
    for other in texts:
        mission = plan_mission(case_of(scenario_of(other), 7))
        names = mission.scenario.names
        some = [names.index("A"), names.index("B")]
        found, expected = mission.paths[some], whole.paths
        assert found.position(times) == pytest.approx(expected.position(times), abs=1e-7)
        assert found.velocity(times) == pytest.approx(expected.velocity(times), abs=1e-10)
        assert (found.delta_v == 0.0).all()
        assert all(found[k].impulses == () for k in range(2))


def test_runs_reproduce_the_cases_of_a_study():
    """A transfer past a station with initial, burn and process errors."""
    noisy = NEAR.replace(
        'pointing = "0.5 deg" }, "exact"]',
        'pointing = "0.5 deg", noise = "1e-7 m^2/s^3" }, { noise = "2e-8 m^2/s^3" }]',
    )
    scenario = parse(noisy, "near.toml")
    campaign = evaluated(scenario, 80)
    entered = campaign.zones[0]
    assert 4 < campaign.counts["zone"].any < 76
    for case in [*np.flatnonzero(entered.inside)[:3].tolist(), *range(3)]:
        mission = plan_mission(case_of(scenario, case))
        assert mission.verdict.conflicts == entered.entries[case] + entered.began[case]
        assert mission.delta_v.sum() == pytest.approx(mission.paths.delta_v.sum())
    np.testing.assert_array_equal(evaluated(scenario, 20).zones[0].entries, entered.entries[:20])


@pytest.mark.slow
def test_share_of_entries_is_the_collision_probability():
    """Compare 4000 cases with the Monte Carlo of `collision_probability`."""
    text = COASTS.replace("execution = [{", 'covariance = { position = "2 5 2 m" }\nexecution = [{')
    found = evaluated(scenario_of(text), 4000).counts["zone"]
    path, other = ORBIT.coast([[0, -60, 0, 0, 0, 0], np.zeros(6)], 3000.0)
    known = np.diag([4.0, 25.0, 4.0, 0, 0, 0])
    figure = cf.collision_probability(
        path,
        other,
        cf.Sphere(25.0),
        cf.Uncertainty(known, noise=1e-7),
        cf.Uncertainty(known, noise=2e-8),
        method="monte-carlo",
        samples=40_000,
    )
    error = np.sqrt(figure.value * (1.0 - figure.value) / 4000)
    assert 0.05 < figure.value < 0.95
    assert abs(found.any / 4000 - figure.value) < 4.0 * np.hypot(error, 0.25 * (figure.high - figure.low))


def test_noise_continues_after_loss_of_thrust():
    """The deviation from the drift equals that from a coast."""
    vary = '[study.vary]\n"craft.fails" = { chance = 1.0 }\n'
    to = 'to = { position = "0 -200 0 m", velocity = "0 0 0 m/s" }'
    move = f'do = "transfer"\ncraft = "A"\n{to}\nwithin = "3000 s"'
    text = ANEW.replace('do = "coast"\nfor = "3000 s"', move) + vary
    text = text.replace('name = ["A"', 'mass = "100 kg"\nname = ["A"').replace(
        'keep_out = { sphere = "25 m" }\n', ""
    )
    next_to_none = text.replace("1e-7 m", "1e-30 m").replace("2e-8 m", "1e-30 m")
    noisy, still = (plan_mission(case_of(scenario_of(one), 2)) for one in (text, next_to_none))
    assert len(noisy.lost) == 1
    assert 500.0 < noisy.lost[0].time < 2500.0
    times = np.linspace(1.0, 2999.0, 50)
    coasting = plan_mission(case_of(scenario_of(ANEW), 2)).paths.state(times) - ORBIT.coast(
        [[0, -60, 0, 0, 0, 0], np.zeros(6)], 3000.0
    ).state(times)
    off = noisy.paths.state(times) - still.paths.state(times)
    assert np.abs(off[..., :3] - coasting[..., :3]).max() < 1e-6 + 1e-6 * np.abs(coasting[..., :3]).max()


def test_excessive_noise_is_rejected():
    with pytest.raises(
        ValueError, match=r"^coasts.toml: craft.execution: noise of 1e\+06 m\^2/s\^3 moves a pair"
    ):
        evaluated(scenario_of(COASTS.replace("1e-7", "1e6")), 10)


# Simulations


def numbers(seed):
    """Return rows of six normal numbers of a level."""
    return lambda level, rows: np.random.default_rng([seed, level]).normal(size=(rows, 6))


def test_all_step_lengths_give_the_same_motion():
    """Compare even steps, uneven ones and ones shorter than the interval of the noise."""
    ends = []
    for times in (np.linspace(0.0, 900.0, 46), np.unique(np.random.default_rng(1).uniform(0.0, 900.0, 400))):
        nodes = np.unique([0.0, *times, 900.0])
        begin, added = process_noise(N, 1e-8, nodes, numbers(5))
        flows = np.array([expm(hill(N) * (900.0 - t)) for t in nodes])
        ends.append(flows[0][:, 3:] @ begin + np.einsum("kij,kj->i", flows[1:], added))
    assert ends[0] == pytest.approx(ends[1], rel=1e-9)
    pushes = increments(N, 9, 113, lambda level, rows: numbers(5)(level, rows)[None])
    kicks = 1e-4 * velocity_changes(N, NOISE_STEP, pushes)[0]
    exact = sum(expm(hill(N) * (900.0 - NOISE_STEP * k))[:, 3:] @ kick for k, kick in enumerate(kicks))
    assert ends[0] == pytest.approx(exact, rel=1e-9)
    late = process_noise(N, 1e-8, np.array([300.0, 480.0, 900.0]), numbers(5))[1]
    early = process_noise(N, 1e-8, np.array([0.0, 120.0, 300.0]), numbers(5))
    there = expm(hill(N) * 300.0)[:, 3:] @ early[0] + expm(hill(N) * 180.0) @ early[1][0] + early[1][1]
    again = expm(hill(N) * 600.0) @ there + expm(hill(N) * 420.0) @ late[0] + late[1]
    assert again == pytest.approx(exact, rel=1e-9)


def test_simulations_have_the_covariance_of_the_noise():
    """300 open-loop simulations of two spacecraft over half an orbit."""
    path = CHIEF.orbit.coast([[0, 200, 0, 0, 0, 0], [0, -100, 0, 0, 0, 0]], 2800.0)
    field = cf.Field(CHIEF)
    errors = [cf.Uncertainty(noise=1e-8), cf.Uncertainty(noise=4e-8)]
    quiet = cf.simulate(path, field, "open", cancel=False)
    flights = cf.simulate(path, field, "open", cancel=False, errors=errors, seeds=300)
    for place in (40, -1):
        time = flights.times[place]
        assert time % NOISE_STEP == 0.0  # where states are exact
        away = (flights.states - quiet.states)[:, :, place]
        for k, one in enumerate(errors):
            expected = noise_of(one.noise, CHIEF.orbit.mean_motion, time)
            assert has_covariance(away[:, k], expected)
            assert not has_covariance(away[:, k], 1.3 * expected)
    assert flights.delta_v.max() == 0.0
    alone = cf.simulate(path, field, "open", cancel=False, errors=[None, errors[1]], seeds=[4])
    np.testing.assert_array_equal(alone.states[0, 1], flights.states[4, 1])
    np.testing.assert_array_equal(alone.states[0, 0], quiet.states[0, 0])


def test_feedback_error_is_that_of_a_lyapunov_equation():
    """Corrections each minute leave a steady covariance."""
    path = CHIEF.orbit.coast([0, 200, 0, 0, 0, 0], 12_000.0)
    field, law, density = cf.Field(CHIEF), cf.Feedback(60.0, 600.0), 1e-8
    flights = cf.simulate(path, field, feedback=law, errors=cf.Uncertainty(noise=density), seeds=300)
    n = CHIEF.orbit.mean_motion
    flow, grown = expm(hill(n) * 60.0), noise_of(1.0, n, 600.0)
    # thrust of least energy to the plan, which takes 600 s, for 60 s: B(60) Phi(540)^T W(600)^-1 Phi(600)
    early = noise_of(1.0, n, 60.0)
    back = early @ expm(hill(n) * 540.0).T @ np.linalg.solve(grown, expm(hill(n) * 600.0))
    left, new = flow - back, noise_of(density, n, 60.0)
    steady = np.linalg.solve(np.eye(36) - np.kron(left, left), new.ravel()).reshape(6, 6)
    measured = np.isclose(flights.times % 60.0, 0.0) & (flights.times > 2000.0)
    away = flights.states[:, 0, measured] - path.state(flights.times[measured])
    found = (away**2).mean(axis=(0, 1))
    # 2 % for measurements amid 8 s, and four standard errors of some 10 000 independent samples
    assert found == pytest.approx(np.diag(steady), rel=0.08)
    assert (flights.feedback_delta_v > 0.1).all()


@pytest.mark.parametrize("pulsed", [False, True])
def test_noise_does_not_depend_on_the_thrust(pulsed):
    """Continuous and pulsed thrust deviate as much as a coast."""
    orbit, field = CHIEF.orbit, cf.Field(CHIEF)
    start, errors = [[0, 200, 0, 0, 0, 0], [0, -400, 0, 0, 0, 0]], cf.Uncertainty(noise=1e-8)
    path = orbit.transfer(start, [[0, 100, 0, 0, 0, 0], [0, -300, 0, 0, 0, 0]], 2400.0)
    more = {"thrusters": cf.Thrusters.rtn(acceleration=0.02, period=60.0)} if pulsed else {}
    moved, times = [], 240.0 * np.arange(1, 11)
    for plan, others in ((path, more), (orbit.coast(start, 2400.0), {"cancel": False})):
        options = {"control": "open", "seeds": [3], **others}
        quiet, noisy = (cf.simulate(plan, field, errors=one, **options) for one in (None, errors))
        moved.append(noisy.path(0).position(times) - quiet.path(0).position(times))
    assert np.abs(moved[1]).max() > 3.0  # m
    assert np.abs(moved[0] - moved[1]).max() < 0.01 * np.abs(moved[1]).max()


def test_noise_does_not_depend_on_replanning():
    """With a horizon as long as the simulation, replanning equals tracking."""
    start, final = (
        [[0, 200, 0, 0, 0, 0], [0, -400, 0, 0, 0, 0]],
        [[0, 100, 0, 0, 0, 0], [0, -300, 0, 0, 0, 0]],
    )
    path, field, law = CHIEF.orbit.transfer(start, final, 2400.0), cf.Field(CHIEF), cf.Feedback(300.0, 2400.0)
    options = {"feedback": law, "zones": cf.Sphere(20.0), "errors": cf.Uncertainty(noise=1e-8), "seeds": [3]}
    legs, one = (cf.simulate(path, field, control, **options) for control in ("replan", "track"))
    quiet = cf.simulate(path, field, "track", **(options | {"errors": None}))
    times = 300.0 * np.arange(1, 9)
    anew, led, still = (flight.path(0).position(times) for flight in (legs, one, quiet))
    assert legs.replans[0] == 0
    assert np.abs(led - still).max() > 1.0  # m
    assert anew == pytest.approx(led, abs=1e-3)


def test_replanning_margin_covers_the_noise_of_an_interval():
    """It is four standard deviations of the distance of the two spacecraft with most noise."""
    found = replanning_margin(cf.Navigation(), 300.0, np.zeros(3), np.array([4e-8, 0.0, 1e-7]))
    largest = np.linalg.eigvalsh(noise_of(1.4e-7, N, 300.0)[:3, :3])[-1]
    assert found == pytest.approx(4.0 * np.sqrt(largest), rel=0.03)
