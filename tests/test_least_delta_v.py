"""Delta-v of energy-optimal plans compared with the minimum, as stated in docs/models.md."""

import re
from pathlib import Path

import clarabel
import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import expm

import closeform as cf
from bridge import hill

PAGE = Path(__file__).parents[1] / "docs" / "models.md"
CASES, TIMES = 250, 121
N = np.sqrt(3.986004418e14 / 6878137.0**3)  # rad/s, at 500 km
ORBIT = cf.Orbit(N)


def relative_orbit_state(rng: np.random.Generator) -> np.ndarray:
    """Return a state on a bounded relative orbit of up to 200 m, centred up to 500 m along the track."""
    (wide, high), (phase, tilt) = rng.uniform(0, 200, 2), rng.uniform(0, 2 * np.pi, 2)
    x, vx = -wide * np.cos(phase), N * wide * np.sin(phase)
    along = rng.uniform(-500, 500) + 2 * wide * np.sin(phase)
    return np.array([x, along, high * np.cos(tilt), vx, -2 * N * x, N * high * np.sin(tilt)])


def least(initial: np.ndarray, final: np.ndarray, duration: float) -> float:
    """Return the minimum sum of impulses [m/s] at equal times by a cone program."""
    step, effects = expm(hill(N) * duration / (TIMES - 1)), [np.eye(6)[:, 3:]]
    for _ in range(TIMES - 1):
        effects.append(step @ effects[-1])
    gap = final - np.linalg.matrix_power(step, TIMES - 1) @ initial
    scale = np.array([1.0 / duration] * 3 + [1.0] * 3)
    size = np.linalg.norm(scale * gap)
    rows = np.zeros((6, 4 * TIMES))  # a norm and three components per impulse
    for k, effect in enumerate(reversed(effects)):
        rows[:, 4 * k + 1 : 4 * k + 4] = scale[:, None] * effect
    costs = np.zeros(4 * TIMES)
    costs[::4] = 1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix((4 * TIMES, 4 * TIMES)),
        costs,
        sparse.csc_matrix(np.vstack([rows, -np.eye(4 * TIMES)])),
        np.concatenate([scale * gap / size, np.zeros(4 * TIMES)]),
        [clarabel.ZeroConeT(6), *[clarabel.SecondOrderConeT(4)] * TIMES],
        settings,
    ).solve()
    assert solution.status == clarabel.SolverStatus.Solved
    return float(solution.obj_val * size)


def test_energy_plan_in_deep_space() -> None:
    """Rest to rest over L: linear thrust needs 3 L / T, impulses 2 L / T."""
    smooth, pushed = (
        plan(np.zeros(6), [0, 300, 0, 0, 0, 0], 600.0)
        for plan in (cf.Orbit(0.0).transfer, cf.Orbit(0.0).two_impulse)
    )
    assert smooth.delta_v == pytest.approx(3.0 * 300.0 / 600.0, rel=1e-9)
    assert pushed.delta_v == pytest.approx(2.0 * 300.0 / 600.0, rel=1e-9)


@pytest.mark.slow
def test_documented_excess_of_energy_plans() -> None:
    """The page's median and 90 % range agree with random cases."""
    rng = np.random.default_rng(11)
    above = []
    for _ in range(CASES):
        initial, final = relative_orbit_state(rng), relative_orbit_state(rng)
        duration = rng.uniform(0.2, 3.0) * ORBIT.period
        above.append(ORBIT.transfer(initial, final, duration).delta_v / least(initial, final, duration) - 1.0)
    above = 100.0 * np.sort(above)
    assert above[0] > -0.5  # %; restriction to equal times
    text = " ".join(PAGE.read_text(encoding="utf-8").split())
    claim = re.search(
        r"(\d+) % more delta-v than the minimum in the median, and (\d+) to (\d+) % more in 90 %", text
    )
    assert claim is not None
    rng = np.random.default_rng(12)
    draws = above[rng.integers(0, CASES, (4000, CASES))]
    for share, said in zip((50, 5, 95), map(float, claim.groups()), strict=True):
        low, high = np.quantile(np.percentile(draws, share, axis=1), [0.0005, 0.9995])
        assert low - 0.5 <= said <= high + 0.5  # rounded to 1 %


def test_primer_of_almost_constant_length():
    """Plan and bound agree where maxima of |p| are ill-conditioned."""
    begin = [81.11389721334135, -39.347089133280065, -164.55152794368283]
    begin += [-0.025041513676992325, -0.17845057386935098, 0.08579216631971859]
    end = [135.89608538263528, -141.79030383019548, -170.70148863047976]
    end += [0.1263454111471267, -0.2989713878417976, -0.010577684866489578]
    orbit, duration = cf.Orbit(1.1e-3), 14219.887613385805
    bound = cf.least_delta_v(orbit, begin, end, duration)
    longest = np.linalg.norm(bound.primer.position(np.linspace(0.0, duration, 100_001)), axis=-1).max()
    assert longest < 1.0 + 1e-10
    path = orbit.impulsive(begin, end, duration)
    assert np.abs(path.state(duration) - end).max() < 1e-6  # m, m/s
    assert path.delta_v <= bound.lower * (1.0 + 1e-9)
    assert bound.proven
