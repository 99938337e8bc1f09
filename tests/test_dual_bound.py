"""The dual bound against closed forms, a semidefinite program, and what clear deviations cost."""

import clarabel
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls
from scipy.sparse import csc_matrix

from closeform.planning.bounds.dual_bound import dual_bound

SEEDS = st.integers(0, 2**32 - 1)


def bound_of(places, gram, floors=(), enough=np.inf, tolerance=1e-7, start=0.0):
    """Bound, multipliers and forces of squares of three rows each, and after them rows with floors."""
    places, floors = np.asarray(places, dtype=float), np.asarray(floors, dtype=float)
    offsets = np.arange(0, len(places) - len(floors) + 1, 3)
    multipliers = np.full(len(offsets) - 1 + len(floors), start, dtype=float)
    forces = np.zeros(len(places))
    gram = np.ascontiguousarray(gram)
    bound = dual_bound(places, gram, offsets, floors, enough, tolerance, multipliers, forces)
    return bound, multipliers, forces


def sampled(seed, count, halves=0):
    """Contacts not far inside or outside of their balls, and their Gram as of paths that share craft."""
    rng = np.random.default_rng(seed)
    rows = 3 * count + halves
    factor = rng.normal(size=(rows, rng.integers(rows, 2 * rows + 1))) * np.exp(rng.normal(size=(rows, 1)))
    return rng.normal(size=rows) * rng.uniform(0.0, 0.9), factor @ factor.T * np.exp(rng.normal(scale=5.0))


def semidefinite(places, gram, floors):
    """The best multipliers' bound by an interior-point solver: maximise t such that

    [ I - L'WL      L'(W q + n)            ]
    [  .            sum(l) - q W q + 2 n (floor - q) - 2 t ]   is positive semidefinite, G = L L'.
    """
    scale = np.trace(gram) / len(gram)
    lower = np.linalg.cholesky(gram / scale)
    rows, halves = len(places), len(floors)
    groups = (rows - halves) // 3
    basis = []
    for g in range(groups):
        own = lower[3 * g : 3 * g + 3]
        q = places[3 * g : 3 * g + 3]
        block = np.zeros((rows + 1, rows + 1))
        block[:-1, :-1] = -own.T @ own
        block[:-1, -1] = block[-1, :-1] = own.T @ q
        block[-1, -1] = 1.0 - q @ q
        basis.append(block)
    for c in range(halves):
        at = rows - halves + c
        block = np.zeros((rows + 1, rows + 1))
        block[:-1, -1] = block[-1, :-1] = lower[at]
        block[-1, -1] = 2.0 * (floors[c] - places[at])
        basis.append(block)
    last = np.zeros((rows + 1, rows + 1))
    last[-1, -1] = -2.0
    constant = np.eye(rows + 1)
    constant[-1, -1] = 0.0

    def triangle(block):
        upper = [(i, j) for j in range(rows + 1) for i in range(j + 1)]
        return np.array([block[i, j] * (1.0 if i == j else np.sqrt(2.0)) for i, j in upper])

    columns = np.stack([triangle(block) for block in [*basis, last]], axis=1)
    count = len(basis)
    system = np.vstack([np.hstack([-np.eye(count), np.zeros((count, 1))]), -columns])
    rhs = np.concatenate([np.zeros(count), triangle(constant)])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cost = np.zeros(count + 1)
    cost[-1] = -1.0
    cones = [clarabel.NonnegativeConeT(count), clarabel.PSDTriangleConeT(rows + 1)]
    nothing = csc_matrix((count + 1, count + 1))
    solved = clarabel.DefaultSolver(nothing, cost, csc_matrix(system), rhs, cones, settings).solve()
    assert str(solved.status) in ("Solved", "AlmostSolved")
    return solved.x[-1] / scale


@given(st.integers(1, 5), SEEDS)
@settings(deadline=None, max_examples=50)
def test_no_sampled_clear_deviation_is_cheaper(count, seed):
    # the least deviation beyond planes that touch the balls, at random: clear, and near the optimum
    places, gram = sampled(seed, count)
    bound, _, _ = bound_of(places, gram)
    rng = np.random.default_rng(seed)
    for _ in range(60):
        normals = rng.normal(size=(count, 3)) + places.reshape(-1, 3)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        along = np.zeros((count, 3 * count))
        for k in range(count):
            along[k, 3 * k : 3 * k + 3] = normals[k]
        small = along @ gram @ along.T
        lower = np.linalg.cholesky(small)
        force, _ = nnls(lower.T, np.linalg.solve(lower, 1.0 - along @ places))
        reached = places + gram @ along.T @ force
        least = np.linalg.norm(reached.reshape(-1, 3), axis=1).min()
        assert least > 1.0 - 1e-6
        assert bound <= 0.5 * force @ small @ force * (1.0 + 1e-5)


@given(st.integers(1, 4), st.integers(0, 3), SEEDS)
@settings(deadline=None, max_examples=40)
def test_bound_agrees_with_a_semidefinite_program(count, halves, seed):
    places, gram = sampled(seed, count, halves)
    floors = np.random.default_rng(seed).uniform(0.2, 1.0, halves)
    bound, _, _ = bound_of(places, gram, floors)
    best = semidefinite(places, gram, floors)
    # the solver is good to about 1e-7 of its largest term
    assert bound == pytest.approx(max(best, 0.0), rel=1e-4, abs=1e-6 * 0.5 * count / gram.diagonal().min())


@pytest.mark.parametrize("norm", [0.0, 1e-9, 0.3, 0.999])
def test_bound_of_one_contact(norm):
    # in deep space the kernel at half time is T^3/192: theory (12)
    compliance = 1000.0**3 / 192.0
    places = norm * np.array([0.6, 0.0, 0.8])
    bound, _, _ = bound_of(places, compliance * np.eye(3))
    exact = 0.5 * (1.0 - norm) ** 2 / compliance
    assert bound <= exact
    assert bound == pytest.approx(exact, rel=1e-6)


def test_bound_of_a_contact_beyond_a_plane():
    bound, _, _ = bound_of(
        [0.1, 0.0, 0.0, 0.1], np.array([[2.0, 0, 0, 2], [0, 2, 0, 0], [0, 0, 2, 0], [2, 0, 0, 2]]), [3.0]
    )
    assert bound == pytest.approx(0.5 * 2.9**2 / 2.0, rel=1e-6)
    assert bound <= 0.5 * 2.9**2 / 2.0


def test_exclusive_planes_are_infeasible():
    gram = np.ones((2, 2)) * np.outer([1, -1], [1, -1])
    bound, _, _ = bound_of([0.0, 0.0], gram, [0.5, 0.5], enough=1e3)
    assert bound >= 1e3  # hundreds of times the cost of either plane alone


@given(SEEDS)
@settings(deadline=None, max_examples=40)
@example(210).via("a matrix S whose smallest eigenvalue is near the certified one")
@example(1301).via("a matrix S whose smallest eigenvalue is near the certified one")
def test_bound_is_the_lagrangian_of_its_multipliers(seed):
    places, gram = sampled(seed, 4, 2)
    floors = np.array([0.5, 0.9])
    bound, multipliers, forces = bound_of(places, gram, floors)
    weights = np.concatenate([np.repeat(multipliers[:4], 3), np.zeros(2)])
    pushes = np.concatenate([np.zeros(12), multipliers[4:]])
    stiff = np.eye(14) - np.sqrt(weights)[:, None] * gram * np.sqrt(weights)
    assert np.linalg.eigvalsh(stiff)[0] > 0.0
    assert (multipliers >= 0.0).all()
    # the Lagrangian where it is least
    reached = np.linalg.solve(np.eye(14) - gram * weights, places + gram @ pushes)
    np.testing.assert_allclose(weights * reached + pushes, forces, rtol=1e-4, atol=1e-6 * abs(forces).max())
    push = weights * reached + pushes
    squares = (reached[:12].reshape(4, 3) ** 2).sum(axis=1)
    value = 0.5 * push @ gram @ push + 0.5 * multipliers[:4] @ (1.0 - squares)
    value += multipliers[4:] @ (floors - reached[12:])
    assert bound <= value * (1.0 + 1e-9)
    assert bound == pytest.approx(value, rel=1e-5)


def test_coincident_times_count_once():
    places, gram = sampled(5, 3)
    twice = np.concatenate([places, places])
    alone, _, _ = bound_of(places, gram)
    both, _, _ = bound_of(twice, np.tile(gram, (2, 2)))
    assert both == pytest.approx(alone, rel=1e-5)


def test_fixed_contact_is_ignored():
    places, gram = sampled(5, 3)
    stiff = np.zeros((12, 12))
    stiff[:9, :9] = gram
    alone, _, _ = bound_of(places, gram)
    both, _, _ = bound_of(np.concatenate([places, [1.0, 0.5, 0.0]]), stiff)
    assert both == pytest.approx(alone, rel=1e-5)


def test_sufficient_multipliers_are_kept():
    places, gram = sampled(7, 3)
    best, multipliers, _ = bound_of(places, gram)
    kept = multipliers.copy()
    bound = dual_bound(places, gram, np.arange(0, 10, 3), np.empty(0), 0.999 * best, 1e-3, kept, np.zeros(9))
    assert (kept == multipliers).all()
    assert bound == pytest.approx(best, rel=1e-9)


def test_search_stops_if_the_target_is_out_of_reach():
    places, gram = sampled(7, 3)
    best, *_ = bound_of(places, gram)
    assert 0.8 * best < bound_of(places, gram, enough=2.0 * best, tolerance=0.1)[0] <= best
