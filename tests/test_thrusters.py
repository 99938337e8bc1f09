"""Thrusters: reachable directions by linear programs, frames and invalid input."""

import numpy as np
import pytest
from scipy.optimize import linprog

import closeform as cf


def reaches(directions, wanted):
    """Return True if a combination of the directions is `wanted` (linear program)."""
    done = linprog(np.ones(len(directions)), A_eq=directions.T, b_eq=wanted, bounds=(0, None))
    return done.status == 0


@pytest.mark.slow
def test_unreachable_direction_is_named():
    """In 60 sets of 1 to 7 directions: all of 40 others are reached, or the one named is not."""
    rng = np.random.default_rng(5)
    seen = set()
    for _ in range(60):
        directions = rng.normal(size=(rng.integers(1, 8), 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        named = cf.Thrusters(directions).unreachable
        seen.add(named is None)
        if named is None:
            others = rng.normal(size=(40, 3))
            assert all(reaches(directions, other) for other in others)
        else:
            assert abs(np.linalg.norm(named) - 1) < 1e-12
            assert (directions @ named < 1e-9).all()
            assert not reaches(directions, named)
    assert seen == {True, False}


@pytest.mark.parametrize("kept", [[0], [2, 3], [0, 1, 2, 3], [0, 2, 4], [0, 1, 2, 3, 4]])
def test_subsets_of_six_thrusters_are_incomplete(kept):
    directions = cf.Thrusters.rtn().directions[kept]
    named = cf.Thrusters(directions).unreachable
    assert (directions @ named < 1e-12).all()
    assert not reaches(directions, named)


def test_inertial_thrusters_do_not_rotate():
    """Transform their directions back by the frames of two-body motion."""
    orbit = cf.Orbit.circular(500e3)
    radius = float(cf.elements.semi_major_axis_from_mean_motion(orbit.mean_motion))
    thrusters = cf.Thrusters.rtn("inertial")
    for time in (0.0, 700.0, -2000.0):
        angle = orbit.mean_motion * time
        speed = radius * orbit.mean_motion
        chief = np.array(
            [
                radius * np.cos(angle),
                radius * np.sin(angle),
                0,
                -speed * np.sin(angle),
                speed * np.cos(angle),
                0,
            ]
        )
        there = thrusters.directions_at(orbit, time)
        states = np.concatenate([there, np.zeros((6, 3))], axis=1)
        inertial = cf.elements.inertial_from_relative(chief, states, "straight")[:, :3] - chief[:3]
        assert np.abs(inertial - thrusters.directions).max() < 1e-8  # of 1 m beside 7e6 m


def test_force_becomes_acceleration():
    thrusters = cf.Thrusters(np.eye(3)).with_force([0.1, 0.2, 0.4], mass=20.0, minimum_impulse=0.01)
    assert np.allclose(thrusters.acceleration, [0.005, 0.01, 0.02])
    assert np.allclose(thrusters.minimum_bit, 5e-4)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"directions": [[1, 0, 0], [1, 1, 0]]},
            "directions[1]: must be of length 1, got 1.41421; give unit vectors, and the thrust as "
            "acceleration",
        ),
        (
            {"directions": [[1, 0, 0], [0, 1, 0], [1, 0, 0]]},
            "directions[2]: the same as directions[0]; give one with the sum of both accelerations",
        ),
        ({"frame": "body"}, "frame: must be 'orbit' or 'inertial', got 'body'"),
        ({"acceleration": -1.0}, "acceleration: must be positive and finite, got -1"),
        ({"period": 0.0}, "period: must be positive and finite, got 0 s"),
    ],
)
def test_invalid_input(arguments, message):
    with pytest.raises(ValueError, match=r": ") as error:
        cf.Thrusters(**{"directions": np.eye(3)} | arguments)
    assert str(error.value) == message
