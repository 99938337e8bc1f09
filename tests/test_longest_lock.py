"""Latest locks: against an independent model of turns, sampled neighbours and proofs."""

from math import inf, radians

import numpy as np
import pytest

import closeform as cf
from closeform.mission.mission import plan_mission
from closeform.scenario import parse
from scenarios import MODIFIED
from turns import Turning, first_lock, turns

RATE, LIMIT = radians(0.25), radians(25)
S04 = cf.Search.modified(cf.Sensor(radians(70)), RATE, LIMIT)
DRAWN = np.array([1000.0, 1000.0, 1000.0, 0.4, 0.4, 0.4])
FOURTH_REGION = S04.legs[12].end  # s, 7589.9: the second mOPS has region IV in its cone
SCENARIO = (
    """\
closeform = 1
title = "The latest lock"

[orbit]
deep_space = true

[craft]
name = ["A", "B"]
group = ["A", "B"]
position = ["0 0 0 m", "{} {} {} m"]
velocity = ["0 0 0 m/s", "{} {} {} m/s"]

[[stage]]
do = "lock"
"""
    + MODIFIED
)


@pytest.mark.slow
def test_latest_lock_of_s04():
    """The latest lock is within 0.01 s of that time, and almost the whole box is proven to lock by then."""
    longest = cf.longest_lock(S04, -DRAWN, DRAWN, seed=1)
    assert FOURTH_REGION - 0.01 < longest.time <= FOURTH_REGION
    assert longest.phase == "mOPS 2"
    assert longest.proof.open < 1e-5
    assert not len(longest.proof.counterexamples)
    turning = Turning(turns("modified", radians(70)), RATE)
    pair = longest.position, longest.velocity
    assert first_lock(turning, *pair, radians(70)) == pytest.approx(longest.time, abs=1e-3)
    text = SCENARIO.format(*(repr(float(one)) for one in np.concatenate(pair)))
    (stage,) = plan_mission(parse(text, "latest.toml")).results
    assert stage.result.locks.time[0] == longest.time
    later = cf.prove_locks(S04, -DRAWN, DRAWN, latest=FOURTH_REGION + 60.0, nodes=120_000)
    assert later.open < 1e-6
    assert not len(later.counterexamples)


def test_no_sampled_neighbour_locks_later():
    """5000 pairs around the latest one of a small box lock earlier."""
    low = np.array([-20.0, -300.0, 500.0, -0.01, 0.1, -0.4])
    high = np.array([20.0, -100.0, 700.0, 0.01, 0.2, -0.3])
    longest = cf.longest_lock(S04, low, high, nodes=300)
    state = np.concatenate([longest.position, longest.velocity])
    assert ((state >= low) & (state <= high)).all()
    assert longest.time > FOURTH_REGION - 0.01
    draw = np.random.Generator(np.random.Philox(3))
    size = 10.0 ** draw.uniform(-9.0, 0.0, (5_000, 1))
    around = np.clip(state + (high - low) * size * draw.normal(size=(5_000, 6)), low, high)
    assert cf.lock_times(S04, around[:, :3], around[:, 3:]).time.max() <= longest.time + 1e-3


@pytest.mark.slow
def test_pairs_that_never_lock_are_found():
    """A short range and a narrow cone leave pairs that never lock."""
    for sensor in (cf.Sensor(radians(70), offset=7.5, range=900.0), cf.Sensor(radians(12))):
        search = cf.Search.basic(sensor, RATE, LIMIT)
        longest = cf.longest_lock(search, -DRAWN, DRAWN, nodes=1000)
        assert longest.time == inf
        assert longest.phase == "never"
        assert cf.lock_times(search, longest.position, longest.velocity).leg[0] == -1
        assert not longest.proof.ok


def test_all_lock_at_the_start():
    low, high = np.array([200.0, -20, -20, 0, 0, 0]), np.array([300.0, 20, 20, 0, 0, 0])
    longest = cf.longest_lock(S04, low, high, nodes=100)
    assert (longest.time, longest.phase) == (0.0, "IPS 1")
    assert longest.proof.ok


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"low": np.zeros(6), "high": [0, 0, 0, 1, 1, 1]},
            "high: all pairs of the box start at the same position",
        ),
        ({"low": 2 * np.ones(6)}, "low: component 0 of 2 is above 1 of high"),
    ],
)
def test_invalid_input(arguments, message):
    given = {"search": S04, "low": -np.ones(6), "high": np.ones(6)} | arguments
    with pytest.raises(ValueError, match=message):
        cf.longest_lock(**given)
