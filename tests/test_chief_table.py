"""Tables of chiefs: their errors beside Kepler's motion in 60 digits, and the algorithms on polynomials."""

import numpy as np
import pytest

from chiefs import transition_mp
from closeform.motion.chief.bernstein import basis_at, bernstein_of, chebyshev_at, integral_to, nodes
from closeform.motion.chief.yamanaka_ankersen import FEWEST, KeplerChief

ECCENTRICITIES = [0.0, 1e-3, 0.01, 0.1, 0.3, 0.6, 0.8, 0.9]


@pytest.mark.parametrize("e", ECCENTRICITIES)
def test_polynomials_stay_within_their_bounds_of_kepler_motion(e):
    table = KeplerChief(1.0, e, 0.0).table
    joints = table.joints
    random = np.random.default_rng(7)
    for k in np.unique([0, len(joints) // 2, *random.integers(len(joints) - 1, size=2)]):
        for u in (0.03, random.uniform(), 1.0):
            truth = transition_mp(e, joints[k], joints[k] + u * (joints[k + 1] - joints[k]))
            found = np.einsum("b,jib->ij", basis_at(np.array(u)), table.rows[k, :6])
            assert (np.abs(found - truth)[:3].max(axis=0) <= table.errors[k, :6]).all()
            assert np.abs(found - truth)[3:].max() <= 1e-11 * max(1.0, np.abs(table.rows[k, :6, 3:]).max())


@pytest.mark.parametrize("e", [0.0, 0.3, 0.8])
def test_responses_stay_within_their_bounds(e):
    """The integrals of the transition matrix, by Gauss's quadrature of the matrix in 60 digits."""
    table = KeplerChief(1.0, e, 0.0).table
    points, weights = np.polynomial.legendre.leggauss(16)
    for k in (0, len(table.joints) // 3):
        begin, end = table.joints[k : k + 2]
        for u in (0.37, 1.0):
            last, truth = begin + u * (end - begin), np.zeros((3, 9))
            for point, weight in zip(points, weights, strict=True):
                s = begin + 0.5 * (point + 1.0) * (last - begin)
                passed = 0.5 * weight * (last - begin) * (1.0 - e * np.cos(s))
                kernel = transition_mp(e, s, last)[:3, 3:]
                truth[:, :6] += passed * kernel @ transition_mp(e, begin, s)[:3]
                truth[:, 6:] += passed * kernel
            found = np.einsum("b,jib->ij", basis_at(np.array(u)), table.rows[k, 6:])[:3]
            assert (np.abs(found - truth).max(axis=0) <= table.errors[k, 6:] + 1e-14).all()


def test_errors_are_small_and_windows_few():
    for e in ECCENTRICITIES:
        table = KeplerChief(1.0, e, 0.0).table
        size = np.maximum(1.0, np.abs(table.rows[:, :, :3]).max(axis=(2, 3)))
        assert (table.errors / size).max() <= 1e-11
        assert FEWEST <= len(table.joints) - 1 <= FEWEST + 34 * e
        assert table.joints[0] == 0.0
        assert table.joints[-1] == 2.0 * np.pi
        assert (np.diff(table.joints) > 0.0).all()


def test_steps_are_the_rows_at_the_end():
    table = KeplerChief(1.0, 0.4, 0.0).table
    ends = table.rows[..., -1].swapaxes(1, 2)
    assert np.abs(table.steps[:, :6] - ends).max() < 1e-11 * np.abs(ends).max()
    assert np.array_equal(table.steps[:, 6:12, 6:12], table.steps[:, :6, :6])
    assert np.array_equal(table.steps[:, 12:, 12:], np.broadcast_to(np.eye(3), (len(ends), 3, 3)))


def test_angles_cut_all_windows():
    table = KeplerChief(1.0, 0.4, 0.0).table
    angles = table.angles(-5.0, 20.0, 3)
    assert angles[0] <= -5.0 < angles[3]
    assert angles[-4] < 20.0 <= angles[-1]
    turns = np.floor(angles / (2.0 * np.pi))
    assert np.isin(np.round(table.joints[:-1], 9), np.round(angles - 2.0 * np.pi * turns, 9)).all()


def test_chebyshev_and_bernstein_forms_are_one_polynomial():
    u = np.linspace(0.0, 1.0, 41)
    assert np.abs(basis_at(u) @ bernstein_of() - chebyshev_at(11, u)).max() < 1e-12


def test_integrals_of_polynomials_are_exact():
    for power in range(8):
        found = integral_to(9, (0.0, 0.3, 1.0)) @ nodes(9) ** power
        assert np.allclose(found, np.array([0.0, 0.3, 1.0]) ** (power + 1) / (power + 1), atol=1e-15)
