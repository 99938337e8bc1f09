"""Mathematics of `avoid`: the kernel, the costs of deviations and end states, and claims of SP11."""

import mpmath as mp
import numba
import numpy as np
import pytest

import closeform as cf
from bridge import bridge
from closeform.kernel_loans import lent
from closeform.planning.problem.deflection import fill_block, fill_factors
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts
from truth import Reference

N = 1.1e-3
INITIAL = np.array([120.0, -180.0, 45.0, 0.11, -0.27, 0.06])
FINAL = np.array([-60.0, 150.0, -20.0, -0.05, 0.13, 0.09])
FRACTIONS = np.array([0.03, 0.3, 0.5, 0.61, 0.97])


@numba.njit
def filled(scene, contacts, blocks):
    """Fill blocks (K, K, 3, 3) of deflections."""
    count = len(contacts.times)
    factors = np.empty((count, 2, 2, 3, 6))
    scene, contacts = lent(scene), lent(contacts)
    fill_factors(scene, contacts, count, factors)
    for k in range(count):
        for m in range(count):
            fill_block(scene, contacts, factors, k, m, blocks[k, m])


def compliance(n, duration, fractions=FRACTIONS):
    """Return the deflections (A, B, 3, 3) at A by a unit force at B."""
    orbit, count = cf.Orbit(n), len(fractions)
    direct = cf.stack([orbit.transfer(INITIAL, FINAL, duration)])
    far = cf.stack([orbit.coast([1e6, 0, 0, 0, 0, 0], duration)])
    problem = Problem.of(direct, far, [(cf.Sphere(1.0), np.array([[0, 1]]))])
    contacts = Contacts.none(count)._replace(times=fractions * duration)
    blocks = np.empty((count, count, 3, 3))
    filled(problem.bare, contacts, blocks)
    return blocks


def theory_kernel(reference, t, s, duration):
    """Return K(t, s), theory (12), from Gramians in 200 digits."""
    if t > s:
        return theory_kernel(reference, s, t, duration).T
    n = reference.n
    t, s, end = n * mp.mpf(t), n * mp.mpf(s), n * mp.mpf(duration)
    gramian, flow = reference.gramian, reference.flow
    back = gramian(end) ** -1 * flow(end - s) * gramian(s)
    block = gramian(t) * flow(s - t).T - gramian(t) * flow(end - t).T * back
    units = mp.eye(6)
    position = mp.matrix([reference.cartesian(units[:, k])[:3] for k in range(6)]).T
    return position * block * position.T / n**3


@pytest.mark.parametrize("angle", [1e-6, 0.9, 6.3, 19.0])
def test_kernel_agrees_with_theory(angle):
    """To 1e-9 of its largest entry, from deep space to three orbits."""
    duration = angle / N
    times = FRACTIONS * duration
    got = compliance(N, duration)
    reference = Reference(N)
    with mp.workdps(80):
        exact = [[theory_kernel(reference, t, s, duration).tolist() for s in times] for t in times]
    exact = np.array(exact).astype(float)
    largest = np.abs(exact).max()
    np.testing.assert_allclose(got, exact, atol=1e-9 * largest, rtol=0)
    np.testing.assert_allclose(bridge(N, duration, times, times), exact, atol=1e-8 * largest, rtol=0)


@pytest.mark.parametrize("n", [0.0, 1e-12])
def test_kernel_of_deep_space(n):
    """Compare with its polynomial, which also holds for n T = 6e-10."""
    duration = 600.0
    times = FRACTIONS * duration
    t, s = np.meshgrid(times, times, indexing="ij")
    t, s = np.minimum(t, s), np.maximum(t, s)
    exact = t**2 * (duration - s) ** 2 * (3 * duration * s - duration * t - 2 * t * s) / (6 * duration**3)
    got = compliance(n, duration)
    wanted = exact[..., None, None] * np.eye(3)
    np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9 * exact.max())
    np.testing.assert_allclose(bridge(n, duration, times, times), got, atol=1e-9 * exact.max())


@pytest.mark.parametrize("angle", [0.0, 1e-4, 0.5, 6.3, 19.0])
def test_kernel_is_symmetric_and_positive(angle):
    n, duration = (N, angle / N) if angle else (0.0, 600.0)
    rng = np.random.default_rng(5)
    for _ in range(5):
        fractions = np.linspace(0.1, 0.8, 4) + rng.uniform(0, 0.1, 4)
        gram = compliance(n, duration, fractions).transpose(0, 2, 1, 3).reshape(12, 12)
        size = np.abs(gram).max()
        np.testing.assert_allclose(gram, gram.T, atol=1e-11 * size, rtol=0)
        assert np.linalg.eigvalsh(0.5 * (gram + gram.T))[0] > 0


@pytest.mark.parametrize("angle", [0.0, 1e-3, 0.8, 6.0, 19.0])
def test_end_gradients_agree_with_differences_of_the_energy(angle):
    """The energy is quadratic, so that central differences of any size are exact."""
    orbit, duration = (cf.Orbit(N), angle / N) if angle else (cf.Orbit(0.0), 900.0)
    ends = np.array([INITIAL, FINAL])
    steps = np.diag(np.repeat([100.0, 100.0 / duration], 3))
    initial, final = cf.papers.end_gradients(orbit.transfer(*ends, duration, start=50.0))
    for gradient, plus, minus in (
        (initial, (ends[0] + steps, ends[1]), (ends[0] - steps, ends[1])),
        (final, (ends[0], ends[1] + steps), (ends[0], ends[1] - steps)),
    ):
        rise = orbit.transfer(*plus, duration).energy - orbit.transfer(*minus, duration).energy
        got = 2 * np.diag(steps) * gradient
        np.testing.assert_allclose(got, rise, rtol=1e-8, atol=1e-8 * np.abs(rise).max())


def test_end_gradients_agree_with_sp11():
    """SP11 eqs. 20-21: n^3 mu at the end, -n^3 Phi^T mu at the start."""
    duration = 2000.0
    reference = Reference(N)
    tau = reference.n * duration
    gap = reference.palmer(FINAL) - reference.flow(tau) * reference.palmer(INITIAL)
    mu = mp.lu_solve(reference.gramian(tau), gap)
    start = -(reference.n**3) * (reference.flow(tau).T * mu)
    coordinates = np.array([[float(v) for v in reference.cartesian(mp.eye(6)[:, k])] for k in range(6)])
    initial, final = cf.papers.end_gradients(cf.Orbit(N).transfer(INITIAL, FINAL, duration))
    np.testing.assert_allclose(coordinates @ final, [float(v) for v in reference.n**3 * mu], rtol=1e-10)
    np.testing.assert_allclose(coordinates @ initial, [float(v) for v in start], rtol=1e-10)


def test_end_gradients_of_a_batch():
    orbit = cf.Orbit(N)
    batch = orbit.transfer(INITIAL + np.zeros((2, 1, 6)), FINAL * np.arange(3)[:, None], 2000.0)
    initial, final = cf.papers.end_gradients(batch)
    assert initial.shape == final.shape == (2, 3, 6)
    for got, alone in zip((initial, final), cf.papers.end_gradients(batch[1, 2]), strict=True):
        np.testing.assert_array_equal(got[1, 2], alone)


def test_end_gradients_of_a_shaped_path():
    """The contact moves with the end; compare with central differences."""
    orbit, duration, zone = cf.Orbit(N), 2000.0, cf.Ellipsoid([30.0, 50.0, 40.0])
    met = orbit.transfer(INITIAL, FINAL, duration).state(1100.0) + [4, -7, 9, 0.01, 0.03, 0]
    obstacle = orbit.coast(orbit.transition(-1100.0) @ met, duration)

    def shaped(initial, final):
        return cf.avoid(orbit.transfer(initial, final, duration), obstacle, zone)

    initial, final = cf.papers.end_gradients(shaped(INITIAL, FINAL).path)
    for k in range(6):
        step = np.zeros(6)
        step[k] = 0.01 if k < 3 else 1e-5
        rise = shaped(INITIAL + step, FINAL).energy - shaped(INITIAL - step, FINAL).energy
        assert rise == pytest.approx(2 * step[k] * initial[k], rel=1e-5, abs=1e-13)
        rise = shaped(INITIAL, FINAL + step).energy - shaped(INITIAL, FINAL - step).energy
        assert rise == pytest.approx(2 * step[k] * final[k], rel=1e-5, abs=1e-13)


@pytest.mark.parametrize("kind", ["burn", "two_impulse", "sampled"])
def test_end_gradients_reject_paths_that_are_not_optimal(kind):
    orbit = cf.Orbit(N)
    path = {
        "burn": lambda: orbit.burn(INITIAL, [1e-5, 0, 0], 500.0),
        "two_impulse": lambda: orbit.two_impulse(INITIAL, FINAL, 500.0),
        "sampled": lambda: orbit.sampled([0.0, 300.0], [INITIAL, FINAL]),
    }[kind]()
    with pytest.raises(ValueError, match="path: must be energy-optimal"):
        cf.papers.end_gradients(path)


@pytest.mark.parametrize("fraction", [0.07, 0.5, 0.99])
def test_gradients_of_two_legs_are_opposite(fraction):
    """SP11 states this at T/2; it holds at any time of an optimal path."""
    orbit, duration = cf.Orbit(N), 5000.0
    whole = orbit.transfer(INITIAL, FINAL, duration)
    time = fraction * duration
    before = orbit.transfer(INITIAL, whole.state(time), time)
    after = orbit.transfer(whole.state(time), FINAL, duration - time, start=time)
    ending, beginning = cf.papers.end_gradients(before)[1], cf.papers.end_gradients(after)[0]
    np.testing.assert_allclose(ending, -beginning, rtol=1e-8, atol=1e-8 * np.abs(ending[:3]).max())
    # and away from the path they are not
    aside = whole.state(time) + [30.0, 0, 0, 0, 0, 0]
    ending = cf.papers.end_gradients(orbit.transfer(INITIAL, aside, time))[1]
    beginning = cf.papers.end_gradients(orbit.transfer(aside, FINAL, duration - time))[0]
    assert np.linalg.norm(ending + beginning) > 0.01 * np.linalg.norm(ending)


@pytest.mark.parametrize("fraction", [0.1, 0.5, 0.83])
def test_cost_of_a_deviation(fraction):
    """J0 + n^3 delta' M delta / 2 with M of theory (11), from 200-digit Gramians."""
    orbit, duration = cf.Orbit(N), 4000.0
    whole = orbit.transfer(INITIAL, FINAL, duration)
    time = fraction * duration
    reference = Reference(N)
    first, second = reference.n * time, reference.n * (duration - time)
    flow = reference.flow(second)
    matrix = reference.gramian(first) ** -1 + flow.T * reference.gramian(second) ** -1 * flow
    for deviation in np.random.default_rng(2).normal(size=(2, 6)) * np.repeat([30.0, 0.03], 3):
        via = whole.state(time) + deviation
        cost = orbit.transfer(INITIAL, via, time).energy + orbit.transfer(via, FINAL, duration - time).energy
        delta = reference.palmer(deviation)
        extra = float(reference.n**3 * (delta.T * matrix * delta)[0] / 2)
        assert cost - whole.energy == pytest.approx(extra, rel=1e-9, abs=1e-12 * cost)


def test_path_of_sp11_is_not_globally_optimal():
    """A single deviation across the gradients in each plane costs far more than the optimum."""
    orbit, duration, zone = cf.Orbit(N), 5000.0, cf.Ellipsoid([20.0, 40.0, 20.0])
    path = orbit.transfer([0, -200, 0, 0, 0, 0], [60, 200, 40, 0, -0.13, 0], duration)
    met = path.state(2300.0) + [5, 3, -4, 0.01, 0, 0.02]
    obstacle = orbit.coast(orbit.transition(-2300.0) @ met, duration)
    exact, paper = (cf.avoid(path, obstacle, zone, method=method) for method in ("exact", "sauter-palmer"))
    assert exact.ok
    assert paper.ok
    assert exact.proven
    for found in (exact, paper):
        np.testing.assert_allclose(found.path.state(duration), path.state(duration), atol=1e-6)
        assert cf.closest_approach(found.path, obstacle, zone).ratio >= 1
    assert paper.extra_energy > 1.3 * exact.extra_energy
