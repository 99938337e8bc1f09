"""Impulses of minimum delta-v about any chief: beside Hill's, flown by DOP853, and published optima."""

import numpy as np
import pytest

import closeform as cf
from chiefs import flown
from closeform.motion.chief.bernstein import DEGREE, basis_at, bernstein_of, chebyshev_of, nodes, pieces_of
from closeform.motion.chief.impulses import solve
from closeform.motion.minimum_delta_v.reduced import COUNT, FIRST, LOWER, PRIMER, UPPER

START = np.array([0.0, -200.0, 0.0, 0.0, 0.0, 0.0])
UNITS = np.array([200.0, 200.0, 200.0, 0.2, 0.2, 0.2])


def eccentric(e, anomaly=1.0):
    return cf.Orbit.eccentric(e, perigee_altitude=700e3, true_anomaly=anomaly)


@pytest.mark.parametrize("revolutions", [0.3, 1.0, 2.4])
def test_a_circular_chief_costs_what_hill_equations_cost(revolutions):
    orbit, hill = cf.Orbit.eccentric(0.0, semi_major_axis=7e6), cf.Orbit.from_semi_major_axis(7e6)
    random = np.random.default_rng(3)
    for _ in range(10):
        ends = random.normal(size=(2, 6)) * UNITS
        mine, known = (o.impulsive(*ends, revolutions * hill.period, 500.0) for o in (orbit, hill))
        assert mine.delta_v == pytest.approx(known.delta_v, rel=1e-8)


@pytest.mark.parametrize("e", [0.01, 0.3, 0.8])
@pytest.mark.parametrize("share", [0.2, 0.9, 2.2])
def test_plans_make_their_transfers_and_are_nearly_optimal(e, share):
    """Each plan, coasted by DOP853 between its impulses; no other plan that is tried costs less."""
    orbit, random = eccentric(e), np.random.default_rng(5)
    length, begin = share * orbit.period, 700.0
    for _ in range(4):
        ends = random.normal(size=(2, 6)) * UNITS
        path = orbit.impulsive(*ends, length, begin)
        assert (path.start, path.end) == (begin, begin + length)
        state, time = ends[0].copy(), begin
        for at, push in path.impulses:
            if at > time:
                state = flown(orbit, state, np.array([time, at]))[-1]
            state[3:] += push
            time = at
        if path.end > time:
            state = flown(orbit, state, np.array([time, path.end]))[-1]
        size = np.abs(path.position(np.linspace(begin, path.end, 50))).max()
        assert np.abs(state - ends[1])[:3].max() <= 1e-8 * size
        assert np.allclose(path.state(path.end), ends[1], rtol=0, atol=1e-9 * size)
        assert path.delta_v <= orbit.transfer(*ends, length, begin).delta_v
        assert path.delta_v <= orbit.two_impulse(*ends, length, begin).delta_v * (1.0 + 1e-9)


@pytest.mark.parametrize("e", [0.0, 0.001, 0.1, 0.5, 0.8])
def test_gaps_are_proven_to_be_small(e, monkeypatch):
    """A plan that is not within 1e-9 of its bound would be refused."""
    monkeypatch.setattr("closeform.motion.chief_orbit.PROVEN", 1e-9)
    orbit, random = eccentric(e), np.random.default_rng(8)
    for _ in range(40):
        ends = random.normal(size=(2, 6)) * UNITS
        orbit.impulsive(*ends, random.uniform(0.1, 3.0) * orbit.period, random.uniform(0.0, orbit.period))


def test_a_seventh_maximum_below_the_limit_gets_no_impulse(monkeypatch):
    """With six maxima of |p| = 1 and one of 0.91 other impulses reach the end as well, but cost more."""
    monkeypatch.setattr("closeform.motion.chief_orbit.PROVEN", 1e-9)
    orbit, random = cf.Orbit.eccentric(0.8, perigee_altitude=600e3), np.random.default_rng(1)
    for _ in range(9):  # the ninth is the case
        ends = random.normal(size=(2, 6)) * ([100.0] * 3 + [0.1] * 3)
        length, begin = 2.5 * orbit.period * random.uniform(0.8, 1.2), random.uniform(0.0, orbit.period)
    assert orbit.impulsive(*ends, length, begin).delta_v > 0.0


def test_bounds_hold_at_every_time():
    """|p| of the primer is at most 1 at dense samples, for rows of random polynomials in five windows."""
    random = np.random.default_rng(2)
    for _ in range(20):
        rows = np.einsum("wbq,aiq->waib", pieces_of(5), random.normal(size=(3, 6, DEGREE + 1)))
        change = random.normal(size=6)
        answer = solve(rows.copy(), change)
        u = np.linspace(0.0, 1.0, 400)
        primer = np.einsum("ub,waib,i->wua", basis_at(u), rows, answer[PRIMER:FIRST])
        assert np.linalg.norm(primer, axis=-1).max() <= 1.0 + 1e-9
        assert change @ answer[PRIMER:FIRST] >= answer[LOWER] * (1.0 - 1e-9)
        assert answer[UPPER] <= answer[LOWER] * (1.0 + 1e-8)
        made = np.zeros(6)
        for time, *push in answer[FIRST:].reshape(-1, 4)[: int(answer[COUNT])]:
            w = min(int(time), 4)
            made += np.einsum("b,aib,a->i", basis_at(np.array(time - w)), rows[w], push)
        assert np.allclose(made, change, atol=1e-9)


@pytest.mark.parametrize("e", [0.0, 0.3, 0.8])
def test_primers_prove_the_bound(e):
    """|p| is at most 1 at dense samples, 1 along each impulse, and the plan costs its bound."""
    orbit, random = eccentric(e), np.random.default_rng(4)
    ends = random.normal(size=(2, 6)) * UNITS
    bound = cf.least_delta_v(orbit, *ends, 0.9 * orbit.period, start=700.0)
    path = orbit.impulsive(*ends, 0.9 * orbit.period, 700.0)
    assert bound.proven
    assert path.delta_v == pytest.approx(bound.upper, rel=1e-9)
    assert (bound.primer.start, bound.primer.end) == (path.start, path.end)
    times = np.linspace(path.start, path.end, 4000)
    assert np.linalg.norm(bound.primer.position(times), axis=1).max() <= 1.0 + 1e-9
    for time, push in path.impulses:
        along = push / np.linalg.norm(push)
        assert np.allclose(bound.primer.position(time), along, atol=1e-4)


def test_states_of_one_coast_need_no_impulse():
    orbit = eccentric(0.4)
    coast = orbit.coast(START, 5000.0, 300.0)
    path = orbit.impulsive(START, coast.state(5300.0), 5000.0, 300.0)
    assert path.impulses == ()
    assert path.delta_v == 0.0


def test_minimum_delta_v_is_a_cost_of_transfers_and_batches():
    orbit = eccentric(0.3)
    ends = np.zeros((2, 6))
    ends[1, 1] = 100.0
    paths = orbit.transfer(START, ends, [[4000.0], [6000.0]], 100.0, cost="delta-v")
    assert paths.shape == (2, 2)
    assert paths.delta_v[1, 0] == pytest.approx(orbit.impulsive(START, ends[0], 6000.0, 100.0).delta_v)


class RelativeElements:
    """Sensitivities of J2-perturbed relative orbital elements (Koenig, Guffanti, D'Amico 2017).

    Constants are those of Koenig and D'Amico 2020, whose planner's cases these are.
    """

    MU, RADIUS, J2, A = 3.986e14, 6.378e6, 1.082e-3, 25_000e3

    def __init__(self, e, inclination, perigee, mean_anomaly, length):
        self.e, self.i, self.w, self.m, self.length = e, inclination, perigee, mean_anomaly, length
        self.root, self.n = np.sqrt(1 - e * e), np.sqrt(self.MU / self.A**3)
        rate, cosine = 0.75 * self.J2 * self.RADIUS**2 * np.sqrt(self.MU) / self.A**3.5, np.cos(inclination)
        self.k = rate / self.root**4
        self.w_rate = self.k * (5 * cosine**2 - 1)
        self.m_rate = self.n + rate / self.root**3 * (3 * cosine**2 - 1)

    def anomaly(self, t):
        mean = self.m + self.m_rate * t
        s = mean + self.e * np.sin(mean)
        for _ in range(60):
            s = s - (s - self.e * np.sin(s) - mean) / (1 - self.e * np.cos(s))
        lean = self.e / (1 + self.root)
        return s + 2 * np.arctan2(lean * np.sin(s), 1 - lean * np.cos(s))

    def at(self, t):
        """Return (T, 6, 3): what an impulse at times (T,) changes of the elements at the end."""
        e, root, k, w, left = self.e, self.root, self.k, self.w + self.w_rate * t, self.length - t
        nu = self.anomaly(t)
        u, rho, tan = w + nu, 1 + e * np.cos(nu), np.tan(self.i)
        change = np.zeros((len(t), 6, 3))
        change[:, 0, 0], change[:, 0, 1] = 2 * e * np.sin(nu) / root, 2 * rho / root
        change[:, 1, 0] = -2 * root**2 / rho
        change[:, 2, 0] = root * np.sin(u)
        change[:, 2, 1] = root * ((rho + 1) * np.cos(u) + e * np.cos(w)) / rho
        change[:, 2, 2] = root * e * np.sin(w) * np.sin(u) / (tan * rho)
        change[:, 3, 0] = -root * np.cos(u)
        change[:, 3, 1] = root * ((rho + 1) * np.sin(u) + e * np.sin(w)) / rho
        change[:, 3, 2] = -root * e * np.cos(w) * np.sin(u) / (tan * rho)
        change[:, 4, 2], change[:, 5, 2] = root * np.cos(u) / rho, root * np.sin(u) / rho
        cosine = np.cos(self.i)
        g, p, q = root**-2, 3 * cosine**2 - 1, 5 * cosine**2 - 1
        s, square = np.sin(2 * self.i), np.sin(self.i) ** 2
        turned = w + self.w_rate * left
        x0, y0, x1, y1 = e * np.cos(w), e * np.sin(w), e * np.cos(turned), e * np.sin(turned)
        c, d = np.cos(self.w_rate * left), np.sin(self.w_rate * left)
        flow = np.tile(np.eye(6), (len(t), 1, 1))
        flow[:, 1, 0] = -(1.5 * self.n + 7 * k * root * p) * left
        flow[:, 1, 2], flow[:, 1, 3] = 7 * k * x0 * p * left / root, 7 * k * y0 * p * left / root
        flow[:, 1, 4] = -7 * k * root * s * left
        flow[:, 2, 0], flow[:, 3, 0] = 3.5 * k * y1 * q * left, -3.5 * k * x1 * q * left
        flow[:, 2, 2], flow[:, 2, 3] = c - 4 * k * x0 * y1 * g * q * left, -d - 4 * k * y0 * y1 * g * q * left
        flow[:, 3, 2], flow[:, 3, 3] = d + 4 * k * x0 * x1 * g * q * left, c + 4 * k * y0 * x1 * g * q * left
        flow[:, 2, 4], flow[:, 3, 4] = 5 * k * y1 * s * left, -5 * k * x1 * s * left
        flow[:, 5, 0] = 3.5 * k * s * left
        flow[:, 5, 2], flow[:, 5, 3] = -4 * k * x0 * g * s * left, -4 * k * y0 * g * s * left
        flow[:, 5, 4] = 2 * k * square * left
        return flow @ change * np.sqrt(self.A / self.MU)

    def rows(self, windows):
        """Return the rows (W, 3, 6, 12) of p = change' c in windows that are short near perigee."""
        t = np.linspace(0.0, self.length, 40_001)
        density = (1 + self.e * np.cos(self.anomaly(t))) ** 1.5
        gathered = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
        joints = np.interp(np.linspace(0.0, gathered[-1], windows + 1), gathered, t)
        fit, u = bernstein_of() @ chebyshev_of(DEGREE), nodes(DEGREE)
        spans = zip(joints, joints[1:], strict=False)
        return np.array([np.einsum("bq,qia->aib", fit, self.at(a + u * (b - a))) for a, b in spans])


def test_published_optima_are_reproduced():
    """Koenig and D'Amico 2020: the case Hunter, and mDOT with the Euclidean cost.

    A cone program on a grid of 10 and 30 s gives 2.483555e-4 m/s and 80.8538 mm/s.
    """
    w = np.arctan2(-0.239, -0.658)
    hunter = RelativeElements(np.hypot(-0.658, -0.239), np.radians(51.0), w, np.radians(65.0) - w, 39_000.0)
    mdot = RelativeElements(0.7, np.radians(40.0), 0.0, np.pi, 117_990.0)
    for case, windows, wanted, known in (
        (hunter, 30, [0.66, -1.52, -0.38, -1.44, 0.29, -0.91], 2.483555e-4),
        (mdot, 90, [50.0, 5000.0, 100.0, 100.0, 0.0, 400.0], 80.85378e-3),
    ):
        answer = solve(case.rows(windows), np.array(wanted) / case.A)
        assert answer[UPPER] == pytest.approx(known, rel=3e-7)
        assert answer[UPPER] - answer[LOWER] <= 1e-9 * answer[UPPER]
