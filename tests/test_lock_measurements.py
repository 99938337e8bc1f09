"""Relative states that spacecraft measure at a lock, and the formation that their burns leave."""

import numpy as np
import pytest
from scipy.stats import kstest

import closeform as cf
from closeform.campaign import case_of, evaluated
from closeform.cli.app import main
from closeform.mission.mission import plan_mission
from closeform.scenario import ScenarioError, parse
from lost import with_kernel

DEGREE = np.pi / 180
IN_RANGE, IN_BEARING, INTERVAL = 0.05, 0.03 * DEGREE, 8.0
SENSOR = cf.Sensor(70 * DEGREE, 7.5, range_error=IN_RANGE, bearing_error=IN_BEARING, fix_interval=INTERVAL)
SEARCH = cf.Search.basic(SENSOR, 0.25 * DEGREE, 25 * DEGREE)
FIVE = """\
closeform = 1
title = "five"

[orbit]
deep_space = true

[craft]
name = ["P", "Q", "R", "S", "T"]
group = ["A", "B", "A", "B", "A"]
position = "0 0 0 m"
velocity = "0 0 0 m/s"

[sensor]
half_angle = "70 deg"
range_error = "5 cm"
bearing_error = "0.03 deg"
fix_interval = "8 s"

[search]
method = "basic"
slew_rate = "0.25 deg/s"
sun_limit = "25 deg"

[[stage]]
do = "gather"

[study]
cases = 60
seed = 4

[study.vary]
"craft.position" = { ball = "150 m" }
"craft.velocity" = { ball = "6 cm/s" }
"""


def states(count, craft, seed, size=150.0):
    g = np.random.Generator(np.random.Philox(seed))
    positions, velocities = g.normal(size=(2, count, craft, 3))
    return 0.5 * size * positions, 0.03 * velocities


def by_sampling(count, line, distance, seed=1):
    """Estimate the state of a target at rest by two fixes, each a noisy range and a noisy direction."""
    g, across = np.random.Generator(np.random.Philox(seed)), np.linalg.svd(line[None])[2][1:]
    directions = line + np.tensordot(g.normal(0.0, IN_BEARING, (2, count, 2)), across, 1)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    first, second = (distance + g.normal(0.0, IN_RANGE, (2, count, 1))) * directions
    return np.hstack([second, (second - first) / INTERVAL]) - np.append(distance * line, np.zeros(3))


@pytest.mark.parametrize("burns", ["second", "first", "half"])
def test_errors_of_one_lock_against_sampled_fixes(burns):
    """Position and velocity errors have the covariance of two fixes of range and direction."""
    line, distance, count = np.array([0.8, 0.6, 0.0]), 120.0, 200
    pair = np.array([np.zeros(3), distance * line]), np.array([np.zeros(3), [0.01, -0.02, 0.03]])
    found = [cf.gather(SEARCH, *pair, burns=burns, case=k) for k in range(count)]
    assert all(one.duration == 0.0 for one in found)
    errors = np.array([one.estimates[1] - one.estimates[0] for one in found])
    left = np.array([np.diff(one.paths.velocity(0.0), axis=0)[0] for one in found])
    np.testing.assert_allclose(left, -errors[:, 3:], atol=1e-15)  # a burn leaves the error of its estimate
    truth = np.cov(by_sampling(20_000, line, distance).T)
    sizes = np.sqrt(np.diag(truth))
    # closed form: each fix errs by the range error along the line, by distance times bearing error across it
    speeds = np.sqrt(2.0) * np.array([IN_RANGE, distance * IN_BEARING]) / INTERVAL
    axes = np.stack([line, [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(np.sqrt(np.diag(axes @ truth[3:, 3:] @ axes.T)), speeds, rtol=0.03)
    # a correlation of 200 samples has a standard deviation of 0.07
    np.testing.assert_allclose(
        np.cov(errors.T) / np.outer(sizes, sizes), truth / np.outer(sizes, sizes), atol=0.3
    )
    assert np.abs(errors.mean(axis=0) / sizes).max() < 4.0 / np.sqrt(count)


def test_every_lock_that_joins_has_independent_errors():
    """Backwards from the end, the errors of each joining pair are those of its own two fixes."""
    numbers, kinds = [], set()
    for case, (r, v) in enumerate(zip(*states(200, 6, 2), strict=True)):
        found = cf.gather(SEARCH, r, v, case=case)
        inside = list(found.sets[0])
        agreed = found.paths.velocity(found.duration) + found.estimates[:, 3:]
        assert np.abs(agreed[inside] - agreed[inside[0]]).max() < 1e-14  # one estimated velocity
        assert not found.estimates[list(found.lost)].any()
        for event in found.events:
            if event.kind != "lock":
                continue
            kinds.add(event.case)
            i, j = event.first, event.second
            place = np.diff(found.paths.position(event.time)[[i, j]], axis=0)[0]
            distance = np.linalg.norm(place)
            error = found.estimates[j] - found.estimates[i]
            speed, second = error[3:], error[:3] - (found.duration - event.time) * error[3:]
            first = second - INTERVAL * speed
            axes = np.vstack([place / distance, np.linalg.svd(place[None])[2][1:]])
            for fix in (first, second):
                numbers.append(axes @ fix / [IN_RANGE, distance * IN_BEARING, distance * IN_BEARING])
    assert {1, 2, 3, 4, 6, 7} <= kinds
    numbers = np.array(numbers)
    assert len(numbers) > 1500
    assert min(kstest(column, "norm").pvalue for column in numbers.T) > 1e-3
    assert np.abs(np.corrcoef(numbers[::2].T, numbers[1::2].T) - np.eye(6)).max() < 0.15


def test_corrections_keep_the_estimated_paths_clear():
    """A knowledge set avoids a collision between the states that it estimates, by the smallest burn."""
    accuracy = {"range_error": 0.5, "bearing_error": 0.5 * DEGREE, "fix_interval": 300.0}
    search = cf.Search.basic(cf.Sensor(70 * DEGREE, 0.0, 1e4, **accuracy), 0.25 * DEGREE, 25 * DEGREE)
    g, zone = np.random.Generator(np.random.Philox(3)), cf.Sphere(20.0)
    burned = entered = 0
    for case in range(40):
        r = g.normal(size=3)
        r *= g.uniform(60.0, 300.0) / np.linalg.norm(r)
        v = -r / g.uniform(1000.0, 3000.0) + g.normal(0.0, 0.002, 3)
        pair = with_kernel([np.zeros(3), r], [np.zeros(3), v])
        found = cf.gather(search, *pair, keep_out=zone, rounds=1, case=case)
        corrections = [one.time for one in found.events if one.kind == "correction"]
        times = np.linspace(max(corrections, default=found.events[-1].time), found.duration, 2000)
        true = found.paths.position(times)[3] - found.paths.position(times)[2]
        error = found.estimates[3] - found.estimates[2]
        estimated = true + error[:3] - (found.duration - times)[:, None] * error[3:]
        apart = np.linalg.norm(estimated, axis=1)
        if apart[0] < 20.0:
            continue  # they lock inside the zone
        assert apart.min() == pytest.approx(20.0, abs=0.01) if corrections else apart.min() > 20.0
        burned, entered = burned + len(corrections), entered + (np.linalg.norm(true, axis=1).min() < 20.0)
    assert burned > 20
    assert entered > 8  # of the true paths: estimates err to either side


def test_study_and_its_cases_agree():
    scenario = parse(FIVE)
    campaign = evaluated(scenario)
    speeds, places = campaign.column("residual_speed_m_s"), campaign.column("position_error_m")
    for case in (0, 7, 59):
        found = plan_mission(case_of(scenario, case)).results[0].result
        assert np.nanmax(found.residual_speeds) == pytest.approx(speeds[case], rel=1e-12)
        assert np.nanmax(found.position_errors) == pytest.approx(places[case], rel=1e-12)
        assert speeds[case] > 0.0
    kind = campaign.kind
    parts = [kind.evaluate(0, 13), kind.evaluate(13, 60)]
    np.testing.assert_array_equal(np.concatenate([one["residual_speed_m_s"] for one in parts]), speeds)
    exact = evaluated(parse(FIVE.replace('range_error = "5 cm"\nbearing_error = "0.03 deg"\n', "")))
    assert "residual_speed_m_s" not in exact.kind.evaluate(0, 1)


@pytest.mark.usefixtures("undrawn")
def test_a_stored_gathering_keeps_its_estimates(tmp_path, capsys):
    (tmp_path / "five.toml").write_text(FIVE)
    main(["run", str(tmp_path / "five.toml"), "--case", "7", "--no-viewer", "--out", str(tmp_path / "out")])
    assert "Error of estimated positions in the formation set" in capsys.readouterr().out
    loaded = cf.load(tmp_path / "out").results[0].result
    found = plan_mission(case_of(parse(FIVE), 7)).results[0].result
    np.testing.assert_array_equal(loaded.estimates, found.estimates)
    np.testing.assert_allclose(loaded.residual_speeds, found.residual_speeds, rtol=1e-9)


def test_groups_by_bearings():
    """Each pair of A and B begins with boresights towards each other, and locks more often."""
    r, v = states(300, 5, 5)
    search = cf.Search.basic(cf.Sensor(70 * DEGREE), 0.25 * DEGREE, 25 * DEGREE)
    some = cf.gather_cases(search, r, v, "bearing")
    for case in range(0, 300, 30):
        one = cf.gather(search, r[case], v[case], "bearing")
        second = np.array(one.groups) == "B"
        assert second.sum() == 2
        assert r[case, second, 0].min() > r[case, ~second, 0].max()
        assert one.duration == some.duration[case]
        assert one.delta_v.sum() == pytest.approx(some.delta_v[case], rel=1e-14)
    pairs, speeds = r[:, 1] - r[:, 0], v[:, 1] - v[:, 0]
    told, blind = cf.lock_times(search, pairs, speeds, bearing=True), cf.lock_times(search, pairs, speeds)
    ahead = pairs[:, 0] > 0.0
    np.testing.assert_array_equal(told.time[ahead], blind.time[ahead])
    np.testing.assert_array_equal(told.time[~ahead], cf.lock_times(search, -pairs, -speeds).time[~ahead])
    # S04's pairs lock at once in a third of all directions, and in two thirds of those of one hemisphere
    assert (blind.time == 0.0).mean() == pytest.approx(0.33, abs=0.09)
    assert (told.time == 0.0).mean() == pytest.approx(0.66, abs=0.09)
    wrong = np.random.Generator(np.random.Philox(6)).normal(0.0, 30.0, (300, 2))
    late = cf.lock_times(search, pairs, speeds, cf.SearchErrors(start=wrong), bearing=True)
    swapped = cf.lock_times(search, -pairs, -speeds, cf.SearchErrors(start=wrong[:, ::-1]))
    np.testing.assert_array_equal(late.time[~ahead], swapped.time[~ahead])


def test_bearing_in_scenarios():
    """A run, a study and its cases take the groups from the bearings."""
    text = FIVE.replace('group = ["A", "B", "A", "B", "A"]\n', "").replace(
        '"25 deg"', '"25 deg"\nbearing = true'
    )
    scenario = parse(text)
    campaign = evaluated(scenario)
    for case in (0, 31):
        found = plan_mission(case_of(scenario, case)).results[0].result
        x = found.paths.position(0.0)[:, 0]
        second = np.array(found.groups) == "B"
        assert x[second].min() > x[~second].max()
        assert found.duration == campaign.column("duration_s")[case]
        assert np.nanmax(found.residual_speeds) == pytest.approx(campaign.column("residual_speed_m_s")[case])
    pair = text.replace('"gather"', '"lock"').replace('name = ["P", "Q", "R", "S", "T"]', 'name = ["P", "Q"]')
    scenario = parse(pair)
    campaign = evaluated(scenario)
    for case in (0, 31):
        locks = plan_mission(case_of(scenario, case)).results[0].result.locks
        assert locks.time[0] == campaign.time[case]


def test_solar_pressure_in_scenarios():
    """A run and a study lock along the parabola of the difference, which is zero if both are alike."""
    text = FIVE.replace('"gather"', '"lock"').replace('name = ["P", "Q", "R", "S", "T"]', 'name = ["P", "Q"]')
    pushed = 'group = ["A", "B"]\nsolar_acceleration = ["0.02 mm/s^2", "0 mm/s^2"]'
    text = text.replace('group = ["A", "B", "A", "B", "A"]', pushed)
    search, scenario = cf.Search.basic(cf.Sensor(70 * DEGREE), 0.25 * DEGREE, 25 * DEGREE), parse(text)
    columns = evaluated(scenario).kind.evaluate(0, 60)
    states = np.stack([columns[name] for name in ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")], axis=1)
    pairs = search, states[:, :3], states[:, 3:]
    expected, straight = (
        cf.lock_times(*pairs, cf.SearchErrors(solar_acceleration=[2e-5, 0.0])),
        cf.lock_times(*pairs),
    )
    np.testing.assert_array_equal(columns["time_s"], expected.time)
    later = straight.time > 0.0
    assert (expected.time[later] != straight.time[later]).all()
    case = int(np.nanargmax(expected.time))
    assert plan_mission(case_of(scenario, case)).results[0].result.locks.time[0] == expected.time[case]
    alike = parse(text + '"craft.solar_acceleration" = { choice = ["0.02 mm/s^2"] }\n')
    same = evaluated(alike).kind.evaluate(0, 60)["time_s"]
    np.testing.assert_allclose(same, straight.time, rtol=0.0, atol=1e-6)


DRAWN_PUSH = 'ball = "6 cm/s" }\n"craft.solar_acceleration" = { choice = ["0.02 mm/s^2"] }'
REFUSED = {
    "craft.solar_acceleration: stage 1": ("[sensor]", 'solar_acceleration = "0.02 mm/s^2"\n[sensor]'),
    "craft.solar_acceleration: stage 1 ": ('ball = "6 cm/s" }', DRAWN_PUSH),
    "craft.group: search.bearing": ('"25 deg"', '"25 deg"\nbearing = true'),
    "sensor.bearing_error": ('"0.03 deg"', '"-1 deg"'),
    "sensor.fix_interval": ('"8 s"', '"0 s"'),
}


@pytest.mark.parametrize("key", REFUSED)
def test_scenarios_are_refused(key):
    with pytest.raises(ScenarioError) as error:
        parse(FIVE.replace(*REFUSED[key]))
    assert any(key in line for line in error.value.lines)


def test_more_than_two_cannot_lock_by_bearings_in_a_study():
    text = FIVE.replace('group = ["A", "B", "A", "B", "A"]\n', "").replace(
        '"25 deg"', '"25 deg"\nbearing = true'
    )
    with pytest.raises(ScenarioError, match="require two craft"):
        parse(text.replace('"gather"', '"lock"'))
    with pytest.raises(ScenarioError, match="pointing errors"):
        parse(text + '"craft.pointing_error" = { normal = "1 deg" }\n')
    with pytest.raises(ScenarioError, match="only the first stage"):
        parse(text.replace("[study]", '[[stage]]\ndo = "gather"\nagain = true\n\n[study]'))


@pytest.mark.parametrize(
    ("name", "value"), [("range_error", -1.0), ("bearing_error", np.nan), ("fix_interval", 0.0)]
)
def test_sensor_arguments(name, value):
    with pytest.raises(ValueError, match=name):
        cf.Sensor(1.0, **{name: value})
    pair = [[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]], np.zeros((2, 3))
    with pytest.raises(ValueError, match="solar_acceleration"):
        cf.gather(SEARCH, *pair, errors=cf.SearchErrors(solar_acceleration=1e-6))
    for name in ("seed", "case"):
        with pytest.raises(ValueError, match=name):
            cf.gather(SEARCH, *pair, **{name: -1})
