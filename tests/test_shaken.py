"""White noise as studies and flights draw it: by matrix exponentials, the same however time is cut."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.special import ndtri
from scipy.stats import chi2

import closeform as cf
from bridge import hill
from closeform.campaign import case_of, flown
from closeform.dynamics.process_noise import STEP, shaken
from closeform.mission.executed_mission import ProcessNoise
from closeform.mission.mission import fly
from closeform.scenario import parse
from closeform.uncertainty.velocity_disturbance import kicked
from closeform.uncertainty.white_noise import BLOCK, increments, kicks_of
from philox import block
from test_histories import NEAR
from test_noisy_histories import noise_of

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
    """The same coast in several stages."""
    stage = '[[stage]]\ndo = "coast"\nfor = "3000 s"\n'
    return text.replace(stage, "".join(stage.replace("3000", f"{length:g}") for length in lengths))


def told(text):
    return parse(text, "coasts.toml", "study")


def are_spread_as(deviations, covariance):
    """Whether (C, 6) are drawn of a covariance: each moment within 5 deviations, all by chi squared."""
    count = len(deviations)
    white = np.linalg.solve(np.linalg.cholesky(covariance), deviations.T)
    moments = white @ white.T / count
    sizes = np.sqrt((1.0 + np.eye(6)) / count)
    low, high = chi2.ppf([1e-5, 1.0 - 1e-5], 6 * count)
    return (np.abs(moments - np.eye(6)) < 5.0 * sizes).all() and low < (white**2).sum() < high


@pytest.mark.parametrize(("level", "count"), [(0, 2), (3, 13), (6, 70)])
def test_halves_of_steps_are_drawn_by_their_exact_law(level, count):
    """All that is drawn, one normal number after another: squares sum to the covariance of all steps."""
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


def test_shorter_steps_are_of_the_same_noise():
    """Two of the next level add what one of this one does, whatever the time that is asked for."""
    random = [np.random.default_rng(k).standard_normal((4, 200, 6)) for k in range(8)]
    coarse, fine = (increments(N, k, n, lambda k, rows: random[k][:, :rows]) for k, n in ((6, 70), (7, 190)))
    flow = expm(hill(N) * BLOCK / 2**7)
    assert fine[:, 0:140:2] @ flow.T + fine[:, 1:140:2] == pytest.approx(coarse, rel=1e-9, abs=1e-6)


def test_numbers_are_those_of_seed_craft_case_and_interval():
    """A block's own, and how its halves share it, by NumPy's generator; the law of halves by conditioning."""
    craft = told(COASTS).craft[0]
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


def test_a_path_is_moved_by_natural_motion_from_each_kick():
    """Transfer, coast, burn fixed inertially, impulses: thrust as before, the rest by matrix exponentials."""
    plan = ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, 60, 0, 0, 0.01, 0], 2000.0)
    burn = ORBIT.burn(plan.state(2000.0), [1e-4, 2e-4, 0], 1500.0, start=2000.0, frame="inertial")
    last = ORBIT.impulsive(burn.state(3500.0), [0, 0, 0, 0, 0, 0], 1800.0, start=3500.0)
    path = cf.join([plan, burn, last])
    times = np.concatenate([[-300.0, 0.0], 41.0 * np.arange(1, 129), [path.end]])
    kicks = 1e-3 * np.random.default_rng(1).standard_normal((len(times), 3))
    moved = kicked(path, times, kicks)
    seen = np.random.default_rng(2).uniform(0.0, path.end, 400)
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


@pytest.mark.parametrize(
    "text", [pytest.param(COASTS, marks=pytest.mark.slow), ANEW], ids=["errors", "replanned"]
)
def test_cases_are_spread_as_covariances_say(text):
    """States after half an orbit, in two stages, of two craft with different noise."""
    scenario = told(in_stages(text, 1304.0, 1696.0))  # s; the first ends where velocities change
    ends = np.array([fly(case_of(scenario, case)).paths.state(2992.0) for case in range(150)])
    away = ends - ORBIT.coast([[0, -60, 0, 0, 0, 0], np.zeros(6)], 3000.0).state(2992.0)
    for k, density in ((0, 1e-7), (1, 2e-8)):
        assert are_spread_as(away[:, k], noise_of(density, N, 2992.0))
        assert not are_spread_as(away[:, k], noise_of(1.6 * density, N, 2992.0))
    both = away[:, 0].T @ away[:, 1] / len(away)
    sizes = np.sqrt(np.outer(*(np.diag(noise_of(q, N, 2992.0)) for q in (1e-7, 2e-8))))
    assert np.abs(both / sizes).max() < 5.0 / np.sqrt(len(away))


@pytest.mark.parametrize("text", [COASTS, ANEW], ids=["errors", "replanned"])
def test_noise_is_the_same_however_time_is_cut(text):
    """In one stage or four, some of which end where velocities change; of a longer one, and more craft."""
    whole = fly(case_of(told(text), 7))
    times = np.linspace(1.0, 2999.0, 500)
    texts = [in_stages(text, 800.0, 401.3, 1798.7, 0.001)]
    if text == ANEW:
        texts.append(in_stages(text, 4500.0))
    third = text.replace('["A", "B"]', '["C", "A", "B"]').replace(
        '["0 -60 0 m",', '["0 900 0 m", "0 -60 0 m",'
    )
    texts.append(third.replace('[{ noise = "1e-7', '[{ noise = "1e-9 m^2/s^3" }, { noise = "1e-7'))
    for other in texts:
        mission = fly(case_of(told(other), 7))
        names = mission.scenario.names
        some = [names.index("A"), names.index("B")]
        found, expected = mission.paths[some], whole.paths
        assert found.position(times) == pytest.approx(expected.position(times), abs=1e-7)
        assert found.velocity(times) == pytest.approx(expected.velocity(times), abs=1e-10)
        assert (found.delta_v == 0.0).all()
        assert all(found[k].impulses == () for k in range(2))


def test_cases_are_what_runs_of_them_show():
    """A transfer past a station, errors of starts and of burns beside the noise of both."""
    shaken_too = NEAR.replace(
        'pointing = "0.5 deg" }, "exact"]',
        'pointing = "0.5 deg", noise = "1e-7 m^2/s^3" }, { noise = "2e-8 m^2/s^3" }]',
    )
    scenario = parse(shaken_too, "near.toml", "study")
    campaign = flown(scenario, 200)
    entered = campaign.zones[0]
    assert 10 < campaign.counts["zone"].any < 190
    for case in [*np.flatnonzero(entered.inside)[:10].tolist(), *range(10)]:
        mission = fly(case_of(scenario, case))
        assert mission.verdict.conflicts == entered.entries[case] + entered.began[case]
        assert mission.delta_v.sum() == pytest.approx(mission.paths.delta_v.sum())
    np.testing.assert_array_equal(flown(scenario, 20).zones[0].entries, entered.entries[:20])


@pytest.mark.slow
def test_shares_are_probabilities():
    """Who comes within the zone, of 4000 cases, beside the histories that `collision_probability` draws."""
    text = COASTS.replace("execution = [{", 'covariance = { position = "2 5 2 m" }\nexecution = [{')
    found = flown(told(text), 4000).counts["zone"]
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


def test_who_drifts_is_shaken_on():
    """Thrust that is lost changes no noise: what is off the drift is what is off a coast."""
    vary = '[study.vary]\n"craft.fails" = { chance = 1.0 }\n'
    to = 'to = { position = "0 -200 0 m", velocity = "0 0 0 m/s" }'
    move = f'do = "transfer"\ncraft = "A"\n{to}\nwithin = "3000 s"'
    text = ANEW.replace('do = "coast"\nfor = "3000 s"', move) + vary
    text = text.replace('name = ["A"', 'mass = "100 kg"\nname = ["A"').replace(
        'keep_out = { sphere = "25 m" }\n', ""
    )
    next_to_none = text.replace("1e-7 m", "1e-30 m").replace("2e-8 m", "1e-30 m")
    shaken_one, still = (fly(case_of(told(one), 2)) for one in (text, next_to_none))
    assert len(shaken_one.lost) == 1
    assert 500.0 < shaken_one.lost[0].time < 2500.0
    times = np.linspace(1.0, 2999.0, 50)
    coasting = fly(case_of(told(ANEW), 2)).paths.state(times) - ORBIT.coast(
        [[0, -60, 0, 0, 0, 0], np.zeros(6)], 3000.0
    ).state(times)
    off = shaken_one.paths.state(times) - still.paths.state(times)
    assert np.abs(off[..., :3] - coasting[..., :3]).max() < 1e-6 + 1e-6 * np.abs(coasting[..., :3]).max()


def test_noise_that_no_step_resolves_is_refused():
    with pytest.raises(
        ValueError, match=r"^coasts.toml: craft.execution: noise of 1e\+06 m\^2/s\^3 moves a pair"
    ):
        flown(told(COASTS.replace("1e-7", "1e6")), 10)


# Flights


def numbers(seed):
    """Of a level, rows of six."""
    return lambda level, rows: np.random.default_rng([seed, level]).normal(size=(rows, 6))


def test_all_steps_of_a_flight_see_one_motion():
    """However it is cut: even steps, odd ones, some shorter than from one change of velocity to the next."""
    ends = []
    for times in (np.linspace(0.0, 900.0, 46), np.unique(np.random.default_rng(1).uniform(0.0, 900.0, 400))):
        nodes = np.unique([0.0, *times, 900.0])
        begin, added = shaken(N, 1e-8, nodes, numbers(5))
        flows = np.array([expm(hill(N) * (900.0 - t)) for t in nodes])
        ends.append(flows[0][:, 3:] @ begin + np.einsum("kij,kj->i", flows[1:], added))
    assert ends[0] == pytest.approx(ends[1], rel=1e-9)
    pushes = increments(N, 9, 113, lambda level, rows: numbers(5)(level, rows)[None])
    kicks = 1e-4 * kicks_of(N, STEP, pushes)[0]
    exact = sum(expm(hill(N) * (900.0 - STEP * k))[:, 3:] @ kick for k, kick in enumerate(kicks))
    assert ends[0] == pytest.approx(exact, rel=1e-9)
    late = shaken(N, 1e-8, np.array([300.0, 480.0, 900.0]), numbers(5))[1]
    early = shaken(N, 1e-8, np.array([0.0, 120.0, 300.0]), numbers(5))
    there = expm(hill(N) * 300.0)[:, 3:] @ early[0] + expm(hill(N) * 180.0) @ early[1][0] + early[1][1]
    again = expm(hill(N) * 600.0) @ there + expm(hill(N) * 420.0) @ late[0] + late[1]
    assert again == pytest.approx(exact, rel=1e-9)


def test_flights_are_spread_as_covariances_say():
    """Half an orbit in the real field, off the flight without noise, of two craft and 600 flights."""
    path = CHIEF.orbit.coast([[0, 200, 0, 0, 0, 0], [0, -100, 0, 0, 0, 0]], 2800.0)
    field = cf.Field(CHIEF)
    errors = [cf.Uncertainty(noise=1e-8), cf.Uncertainty(noise=4e-8)]
    quiet = cf.simulate(path, field, "open", cancel=False)
    flights = cf.simulate(path, field, "open", cancel=False, errors=errors, seeds=600)
    for place in (40, -1):
        time = flights.times[place]
        assert time % STEP == 0.0  # where states are exact
        away = (flights.states - quiet.states)[:, :, place]
        for k, one in enumerate(errors):
            expected = noise_of(one.noise, CHIEF.orbit.mean_motion, time)
            assert are_spread_as(away[:, k], expected)
            assert not are_spread_as(away[:, k], 1.3 * expected)
    assert flights.delta_v.max() == 0.0
    alone = cf.simulate(path, field, "open", cancel=False, errors=[None, errors[1]], seeds=[4])
    np.testing.assert_array_equal(alone.states[0, 1], flights.states[4, 1])
    np.testing.assert_array_equal(alone.states[0, 0], quiet.states[0, 0])


def test_feedback_answers_to_noise():
    """Led back each minute: what is left is steady, by Lyapunov's equation of what answers."""
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
    # 2 % for what is measured in the midst of 8 s, and four deviations of some 10 000 that are independent
    assert found == pytest.approx(np.diag(steady), rel=0.08)
    assert (flights.feedback_delta_v > 0.1).all()


@pytest.mark.parametrize("pulsed", [False, True])
def test_plans_are_shaken_by_the_same_noise(pulsed):
    """By thrust that lasts and by pulses, in steps of other lengths: off as far as a craft that coasts."""
    orbit, field = CHIEF.orbit, cf.Field(CHIEF)
    start, errors = [[0, 200, 0, 0, 0, 0], [0, -400, 0, 0, 0, 0]], cf.Uncertainty(noise=1e-8)
    path = orbit.transfer(start, [[0, 100, 0, 0, 0, 0], [0, -300, 0, 0, 0, 0]], 2400.0)
    more = {"thrusters": cf.Thrusters.rtn(acceleration=0.02, period=60.0)} if pulsed else {}
    moved, times = [], 240.0 * np.arange(1, 11)
    for plan, others in ((path, more), (orbit.coast(start, 2400.0), {"cancel": False})):
        told_so = {"control": "open", "seeds": [3], **others}
        quiet, noisy = (cf.simulate(plan, field, errors=one, **told_so) for one in (None, errors))
        moved.append(noisy.path(0).position(times) - quiet.path(0).position(times))
    assert np.abs(moved[1]).max() > 3.0  # m
    assert np.abs(moved[0] - moved[1]).max() < 0.01 * np.abs(moved[1]).max()


def test_legs_of_new_plans_see_the_same_noise():
    """Of a horizon as long as the flight no plan is made anew: leg by leg what feedback flies in one."""
    start, final = (
        [[0, 200, 0, 0, 0, 0], [0, -400, 0, 0, 0, 0]],
        [[0, 100, 0, 0, 0, 0], [0, -300, 0, 0, 0, 0]],
    )
    path, field, law = CHIEF.orbit.transfer(start, final, 2400.0), cf.Field(CHIEF), cf.Feedback(300.0, 2400.0)
    told_so = {"feedback": law, "zones": cf.Sphere(20.0), "errors": cf.Uncertainty(noise=1e-8), "seeds": [3]}
    legs, one = (cf.simulate(path, field, control, **told_so) for control in ("replan", "track"))
    quiet = cf.simulate(path, field, "track", **(told_so | {"errors": None}))
    times = 300.0 * np.arange(1, 9)
    anew, led, still = (flight.path(0).position(times) for flight in (legs, one, quiet))
    assert legs.replans[0] == 0
    assert np.abs(led - still).max() > 1.0  # m
    assert anew == pytest.approx(led, abs=1e-3)
