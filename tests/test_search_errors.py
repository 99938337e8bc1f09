"""Searches with errors against independently sampled bodies, and special cases without errors."""

from itertools import pairwise
from math import inf, pi, radians

import numpy as np
import pytest

import closeform as cf
from bodies import RATE, Body, first_lock
from closeform.campaign import case_of, evaluated
from closeform.mission.mission import plan_mission
from closeform.scenario import parse
from scenarios import MODIFIED
from turns import turns

LIMIT = radians(25)


def generator(seed):
    return np.random.Generator(np.random.Philox(seed))


def drawn(count, seed, size=500.0):
    draw = generator(seed).uniform(-1.0, 1.0, (2, count, 2, 3))
    return size * (draw[0, :, 1] - draw[0, :, 0]), 0.2 * (draw[1, :, 1] - draw[1, :, 0])


def kinds(count, seed):
    """Return each kind of error alone and all together, far larger than real ones."""
    g = generator(seed)
    shape = count, 2
    each = {
        "pointing": g.normal(0.0, radians(8.0), (*shape, 3)),
        "slew_rate": g.normal(0.0, 0.05, shape),
        "start": g.normal(0.0, 120.0, shape),
        "half_angle": g.normal(0.0, radians(6.0), shape),
        "range": g.uniform(200.0, 900.0, shape),
        "slew_acceleration": RATE / g.uniform(10.0, 400.0, shape),
        "silent": g.uniform(size=shape) < 0.1,
        "solar_acceleration": g.uniform(0.0, 2e-5, shape),  # bends a path by hundreds of metres
    }
    return {**{name: {name: values} for name, values in each.items()}, "all": each}


@pytest.mark.parametrize("kind", kinds(1, 0))
@pytest.mark.parametrize(("half_angle", "offset", "longest"), [(70.0, 0.0, inf), (62.0, 7.5, 700.0)])
def test_locks_with_errors_against_sampled_bodies(kind, half_angle, offset, longest):
    count, wide = 6, radians(half_angle)
    sensor = cf.Sensor(wide, offset, longest)
    search = cf.Search.modified(sensor, RATE, radians(89))
    errors = kinds(count, 5)[kind]
    r, v = drawn(count, 6)
    found = cf.lock_times(search, r, v, cf.SearchErrors(**errors))
    for k in range(count):
        bodies = [
            Body(turns("modified", wide), group, **{name: values[k, m] for name, values in errors.items()})
            for m, group in enumerate("AB")
        ]
        truth = first_lock(*bodies, sensor, r[k], v[k])
        # the margin changes by 0.1 m/s and is accurate to 1e-9 m
        assert found.time[k] == pytest.approx(truth, rel=0.0, abs=1e-6, nan_ok=True)
    assert (found.time > 0.0).any()


@pytest.mark.parametrize("half_angle", [30.0, 70.0, 110.0])
@pytest.mark.parametrize(("offset", "longest"), [(0.0, inf), (7.5, 300.0)])
def test_negligible_errors_give_the_perfect_search(half_angle, offset, longest):
    """The march through both slew profiles agrees with the one of craft that face each other."""
    sensor = cf.Sensor(radians(half_angle), offset, longest)
    search = cf.Search.basic(sensor, RATE, LIMIT)
    r, v = drawn(4_000, 7)
    perfect = cf.lock_times(search, r, v)
    for errors in (
        cf.SearchErrors(),
        cf.SearchErrors(start=[0.0, 1e-10]),
        cf.SearchErrors(slew_acceleration=1e9),
    ):
        same = cf.lock_times(search, r, v, errors)
        np.testing.assert_array_equal(same.leg, perfect.leg)
        np.testing.assert_allclose(same.time, perfect.time, rtol=0.0, atol=1e-6)


def test_common_start_offset_shifts_the_search():
    search = cf.Search.modified(cf.Sensor(radians(70)), RATE, LIMIT)
    r, v = drawn(4_000, 8)
    late = cf.lock_times(search, r, v, cf.SearchErrors(start=50.0))
    then = cf.lock_times(search, r + 50.0 * v, v)
    moved = ~(late.time <= 50.0)
    np.testing.assert_allclose(late.time[moved], then.time[moved] + 50.0, rtol=0.0, atol=1e-6)
    assert moved.sum() > 1000


def test_common_rate_error_is_a_faster_search():
    sensor = cf.Sensor(radians(70))
    r, v = drawn(4_000, 9)
    pace = cf.lock_times(cf.Search.modified(sensor, RATE, LIMIT), r, v, cf.SearchErrors(slew_rate=0.25))
    fast = cf.lock_times(cf.Search.modified(sensor, 1.25 * RATE, LIMIT), r, v)
    np.testing.assert_array_equal(pace.leg, fast.leg)
    np.testing.assert_allclose(pace.time, fast.time, rtol=0.0, atol=1e-6)


def test_rotation_about_the_boresight_changes_nothing():
    search = cf.Search.modified(cf.Sensor(radians(70), 7.5), RATE, LIMIT)
    r, v = drawn(2000, 10)
    turned = cf.SearchErrors(pointing=[[0.0, 0.0, 0.3], [0.0, 0.0, -1.2]])
    np.testing.assert_allclose(
        cf.lock_times(search, r, v, turned).time, cf.lock_times(search, r, v).time, rtol=0.0, atol=1e-6
    )


def test_point_reflection_swaps_the_groups():
    """Boresights of B become those of A; the relative vector stays."""
    search = cf.Search.modified(cf.Sensor(radians(70), 7.5), RATE, LIMIT)
    r, v = drawn(2000, 11)
    g = generator(12)
    errors = {
        "pointing": g.normal(0.0, 0.1, (2000, 2, 3)),
        "slew_rate": g.normal(0.0, 0.01, (2000, 2)),
        "start": g.normal(0.0, 20.0, (2000, 2)),
        "half_angle": g.normal(0.0, 0.05, (2000, 2)),
        "slew_acceleration": RATE / g.uniform(10.0, 100.0, (2000, 2)),
    }
    one = cf.lock_times(search, r, v, cf.SearchErrors(**errors))
    swapped = {name: values[:, ::-1] for name, values in errors.items()}
    swapped["pointing"] = swapped["pointing"] * [
        1.0,
        -1.0,
        -1.0,
    ]  # a rotation is unchanged by the point reflection
    other = cf.lock_times(search, r, v, cf.SearchErrors(**swapped))
    np.testing.assert_allclose(other.time, one.time, rtol=0.0, atol=1e-6)


def test_silent_spacecraft_is_never_found():
    search = cf.Search.modified(cf.Sensor(radians(70)), RATE, LIMIT)
    r, v = drawn(100, 13)
    silent = np.zeros((100, 2), dtype=bool)
    silent[:50, 0] = silent[25:75, 1] = True
    found = cf.lock_times(search, r, v, cf.SearchErrors(silent=silent))
    np.testing.assert_array_equal(found.leg[:75], -1)
    perfect = cf.lock_times(search, r, v)
    np.testing.assert_allclose(found.time[75:], perfect.time[75:], rtol=0.0, atol=1e-6)


def test_outages():
    """Compare with sampled bodies in each interval in which both work."""
    count, wide = 8, radians(70.0)
    sensor = cf.Sensor(wide, 7.5, 700.0)
    search = cf.Search.modified(sensor, RATE, radians(89))
    r, v = drawn(count, 6)
    perfect = cf.lock_times(search, r, v).time
    begin = generator(3).uniform(-200.0, 100.0, (count, 2, 2)) + np.nan_to_num(perfect)[:, None, None]
    outages = np.stack([begin, begin + generator(4).uniform(50.0, 900.0, begin.shape)], axis=-1)
    outages[0], outages[1, 0, 1] = inf, [0.0, inf]  # none, and an infinite one
    found = cf.lock_times(search, r, v, cf.SearchErrors(outages=outages))
    for k in range(count):
        bodies = [Body(turns("modified", wide), group) for group in "AB"]
        cuts = np.unique(np.append(outages[k].ravel(), [0.0, 1e9]).clip(0.0, 1e9))
        truth = np.nan
        for start, end in pairwise(cuts):
            working = ~((outages[k, ..., 0] <= start) & (start < outages[k, ..., 1])).any()
            when = first_lock(*bodies, sensor, r[k], v[k], start) if working else np.nan
            if when < end:
                truth = when
                break
        assert found.time[k] == pytest.approx(truth, rel=0.0, abs=1e-6, nan_ok=True)
    assert found.time[0] == pytest.approx(perfect[0], abs=1e-6, nan_ok=True)
    assert (found.time > perfect + 1.0).sum() > 1
    assert found.leg[1] == -1


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"pointing": [0.0, 0.0, 2.0]}, "pointing: must be above -1 and below 1.5708, got 2"),
        ({"slew_rate": -1.0}, "slew_rate: must be above -1 and below inf, got -1"),
        ({"range": 0.0}, "range: must be positive, got 0"),
        ({"silent": 1}, "silent: expected True or False for each craft, got 1"),
    ],
)
def test_errors_out_of_bounds_are_rejected(given, told):
    with pytest.raises(ValueError, match=told):
        cf.SearchErrors(**given)


def test_errors_of_wrong_shape_are_rejected():
    search = cf.Search.modified(cf.Sensor(radians(70)), RATE, LIMIT)
    r, v = drawn(4, 14)
    with pytest.raises(
        ValueError, match=r"errors: start of 4 pairs is \(M, 2\), or common to all pairs; got \(4,\)"
    ):
        cf.lock_times(search, r, v, cf.SearchErrors(start=np.zeros(4)))
    with pytest.raises(ValueError, match=r"errors: half_angle leaves 3\.9.* rad; it must stay between"):
        cf.lock_times(search, r, v, cf.SearchErrors(half_angle=0.87 * pi))
    with pytest.raises(ValueError, match=r"errors: expected SearchErrors, got 0\.1"):
        cf.lock_times(search, r, v, 0.1)


RUN = (
    """\
closeform = 1
title = "Two, one of them late, both turned"

[orbit]
deep_space = true

[craft]
name = ["A", "B"]
group = ["A", "B"]
position = ["0 0 0 m", "20 40 300 m"]
velocity = "0 0 0 m/s"
pointing_error = ["1 2 0 deg", "0 -3 0 deg"]
slew_rate_error = ["1 %", "-2 %"]
start_offset = ["0 s", "30 s"]

[[stage]]
do = "lock"
"""
    + MODIFIED
)


def test_run_uses_the_errors_of_its_file(tmp_path):
    file = tmp_path / "late.toml"
    file.write_text(RUN)
    found = cf.run(file).results[0].result.locks.time
    errors = {"slew_rate": 0.01, "pointing": np.radians([1.0, 2.0, 0.0])}
    others = {"slew_rate": -0.02, "pointing": np.radians([0.0, -3.0, 0.0]), "start": 30.0}
    bodies = [
        Body(turns("modified", radians(70)), group, **given)
        for group, given in (("A", errors), ("B", others))
    ]
    truth = first_lock(*bodies, cf.Sensor(radians(70)), np.array([20.0, 40.0, 300.0]), np.zeros(3))
    assert found == pytest.approx([truth], rel=0.0, abs=1e-6)
    file.write_text(RUN.replace('start_offset = ["0 s", "30 s"]', "silent = [false, true]"))
    assert "never lock" in str(cf.run(file).verdict)
    quiet = f'silent = [false, "0 s to {truth + 60.0} s, 2 h to end"]'
    file.write_text(RUN.replace("slew_rate_error", f"{quiet}\nslew_rate_error"))
    assert cf.run(file).results[0].result.locks.time >= truth + 60.0 - 1e-6
    file.write_text(RUN.replace("slew_rate_error", 'silent = "5 min"\nslew_rate_error'))
    with pytest.raises(ValueError, match="not true, false or a list of increasing intervals"):
        cf.run(file)


STUDY = """
[study]
cases = 4
seed = 1
vary = { "craft.pointing_error" = { ball = "2 deg" } }
"""


def test_slew_acceleration_of_each_spacecraft_in_a_study():
    """A reaches its rate in a second, B in a minute; pointing is sampled."""
    ramps = 'slew_acceleration = ["0.25 deg/s^2", "0.004 deg/s^2"]'
    scenario = parse(RUN.replace('start_offset = ["0 s", "30 s"]', ramps) + STUDY)
    times = evaluated(scenario, 4).time
    alone = [plan_mission(case_of(scenario, case)).results[0].result.locks.time[0] for case in range(4)]
    assert alone == times.tolist()
    assert (times > 60.0).any()


def test_sun_limit_includes_the_errors():
    """Compare with sampled attitudes, for a run and each case of a study."""
    ball = STUDY.replace("2 deg", "8 deg")
    scenario = parse(RUN + ball)
    campaign = evaluated(scenario, 4)
    for case in range(4):
        one = case_of(scenario, case)
        run = plan_mission(one)
        errors = one.search_errors
        bodies = [
            Body(
                turns("modified", radians(70)),
                group,
                pointing=errors.pointing[k].copy(),
                slew_rate=errors.slew_rate[k],
                start=errors.start[k],
            )
            for k, group in enumerate("AB")
        ]
        sampled = [
            np.arccos(-body.bodies(np.linspace(body.start, body.begins[-1], 40_000))[:, 2, 0]).max()
            for body in bodies
        ]
        sun = run.results[0].sun
        assert sun.craft == "AB"[int(np.argmax(sampled))]
        assert sun.angle == pytest.approx(max(sampled), abs=2e-4)
        assert sun.limit == pytest.approx(LIMIT)
        assert run.verdict.ok == (max(sampled) <= LIMIT) == campaign.good[case]
        assert ("sun limit exceeded" in str(run.verdict)) != run.verdict.ok
    assert 0 < campaign.good.sum() < 4
