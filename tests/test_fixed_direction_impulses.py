"""Impulses of thrusters with fixed directions, against linear programs."""

import clarabel
import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import expm

import closeform as cf
from bridge import hill

N = 1.1e-3
ORBIT = cf.Orbit(N)
FOUR = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)  # a tetrahedron's corners


def rotated_directions(thrusters, time):
    """Return directions in the rotating frame, which has turned by n t."""
    if thrusters.frame == "orbit":
        return thrusters.directions
    return thrusters.directions @ expm(N * time * np.array([[0, 1.0, 0], [-1, 0, 0], [0, 0, 0]])).T


def effect(duration, time, start, thrusters):
    """Return the effect of unit impulses of each thruster on the final state."""
    return expm(hill(N) * (duration - time))[:, 3:] @ rotated_directions(thrusters, start + time).T


def linear_program(initial, final, duration, times, start, thrusters):
    """Return the minimum sum of impulses [m/s] at given times by a linear program."""
    scale = np.array([1 / duration] * 3 + [1.0] * 3)
    gap = scale * (final - expm(hill(N) * duration) @ initial)
    rows = np.hstack([scale[:, None] * effect(duration, t, start, thrusters) for t in times])
    size, count = np.linalg.norm(gap), rows.shape[1]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix((count, count)),
        np.ones(count),
        sparse.csc_matrix(np.vstack([rows, -np.eye(count)])),
        np.concatenate([gap / size, np.zeros(count)]),
        [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(count)],
        settings,
    ).solve()
    return float(solution.obj_val * size)


def draw(rng):
    duration = 10 ** rng.uniform(-1.5, 1.0) / N
    initial, final = rng.normal(size=(2, 6)) * 100 * np.array([1, 1, 1, N, N, N])
    return initial, final, duration, rng.uniform(0, 1e4)


@pytest.mark.parametrize("frame", ["orbit", "inertial"])
@pytest.mark.parametrize("directions", [cf.Thrusters.rtn().directions, FOUR], ids=["six", "four"])
def test_cost_agrees_with_a_linear_program(frame, directions):
    """Impulses act along thrusters, reach the end, and cost the minimum."""
    thrusters, rng = cf.Thrusters(directions, frame), np.random.default_rng(1)
    for _ in range(8):
        initial, final, duration, start = draw(rng)
        path = ORBIT.impulsive(initial, final, duration, start, thrusters)
        end, spent = expm(hill(N) * duration) @ initial, 0.0
        assert len(path.impulses) <= 6
        for t, push in path.impulses:
            size = np.linalg.norm(push)
            assert (rotated_directions(thrusters, t) @ push).max() == pytest.approx(size, rel=1e-9)
            end += expm(hill(N) * (duration - t + start))[:, 3:] @ push
            spent += size
        assert np.abs(end - final)[:3].max() < 1e-7
        assert path.delta_v == pytest.approx(spent, rel=1e-12)
        equal = np.linspace(0, duration, 121)
        assert path.delta_v <= linear_program(initial, final, duration, equal, start, thrusters) * (1 + 1e-8)
        own = [min(max(t - start, 0.0), duration) for t, _ in path.impulses]
        both = np.unique(np.r_[equal[::6], own])
        truth = linear_program(initial, final, duration, both, start, thrusters)
        assert path.delta_v == pytest.approx(truth, rel=2e-8)
        assert path.delta_v >= cf.least_delta_v(ORBIT, initial, final, duration).lower


def test_cost_is_the_sum_over_thrusters():
    """In deep space, from rest, three thrusters fire at each end."""
    orbit = cf.Orbit(0.0)
    path = orbit.impulsive(np.zeros(6), [100.0, 200, 300, 0, 0, 0], 100.0, thrusters=cf.Thrusters.rtn())
    assert path.delta_v == pytest.approx(2 * (1 + 2 + 3), rel=1e-9)
    assert len(path.impulses) == 6
    assert path.state(100.0) == pytest.approx([100, 200, 300, 0, 0, 0], abs=1e-9)


@pytest.mark.parametrize(
    ("directions", "reason"),
    [
        ([[0, 1, 0], [0, -1, 0]], "no thruster acts cross-track"),
        ([[1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]], "no thruster changes the along-track drift"),
        ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], "no thruster acts along the required change"),
    ],
)
def test_infeasible_directions_are_named(directions, reason):
    final = [-4000.0, 0.0, 50.0, 0.0, 0.0, 0.0]
    with pytest.raises(ValueError, match=f"thrusters: no firing in 600 s achieves the transfer: {reason}"):
        ORBIT.impulsive(np.zeros(6), final, 600.0, thrusters=cf.Thrusters(directions))
    with pytest.raises(ValueError, match=f"thrusters: transfer 1 of 2: no firing in 600 s .* {reason}"):
        ORBIT.impulsive(np.zeros(6), [np.zeros(6), final], 600.0, thrusters=cf.Thrusters(directions))


def test_along_track_thrust_controls_the_plane():
    """Along-track thrust alone controls in-plane motion."""
    thrusters = cf.Thrusters([[0, 1, 0], [0, -1, 0]])
    path = ORBIT.impulsive([50.0, -200, 0, 0, 0, 0], np.zeros(6), 6000.0, thrusters=thrusters)
    assert path.state(6000.0) == pytest.approx(np.zeros(6), abs=1e-8)
    assert all(push[0] == push[2] == 0.0 for _, push in path.impulses)


def test_invalid_thrusters_are_refused():
    with pytest.raises(ValueError, match="thrusters: expected Thrusters, got 3"):
        ORBIT.impulsive(np.zeros(6), np.ones(6), 600.0, thrusters=3)
    with pytest.raises(ValueError, match="duration: the minimum delta-v is computed over at most 100 orbits"):
        ORBIT.impulsive(np.zeros(6), np.ones(6), 1e6, thrusters=cf.Thrusters.rtn())


def test_coast_needs_no_impulses():
    initial = np.array([10.0, 20.0, 5.0, 0.0, -0.01, 0.0])
    final = ORBIT.coast(initial, 3000.0).state(3000.0)
    assert ORBIT.impulsive(initial, final, 3000.0, thrusters=cf.Thrusters.rtn()).impulses == ()
