"""Pictures of uncertainty against samples and other functions of the package."""

import matplotlib as mpl
import numpy as np
import pytest

import closeform as cf

mpl.use("agg")
ORBIT = cf.Orbit.circular(550e3)
END = 5800.0
PATH = cf.join(
    [
        ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, 60, 0, 0, 0, 0], 2800.0),
        ORBIT.coast([0, 60, 0, 0, 0, 0], END - 2800.0, start=2800.0),
    ]
)
REST = ORBIT.coast(np.zeros(6), END)
KNOWN = cf.Uncertainty(np.diag([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2, 0.01, np.radians(0.5))
BALL = cf.Sphere(20.0)


def test_plotted_tube_contains_sampled_errors() -> None:
    """Of draws on the one-sigma surface none is outside of the tube, and the farthest are at its edge."""
    figure = cf.plots.tube(PATH, REST, BALL, KNOWN, sigmas=2.0, names=["A", "B"])
    least = cf.clearance_in_sigmas(PATH, REST, BALL, KNOWN)
    title = figure.get_suptitle()
    assert title.startswith("A relative to B: not clear at 2 sigma")
    assert f"{least.sigmas:.2f} sigma at 96.67 min" in title
    axes = figure.axes[0]  # along-track, radial
    swept = np.concatenate([path.vertices for path in axes.collections[0].get_paths()])
    random = np.random.default_rng(1)
    for time in (0.0, 2800.0, 4000.0, END):
        root = np.linalg.cholesky(KNOWN.covariance(PATH, time)[:3, :3])
        draws = random.standard_normal((4000, 3))
        draws *= 2.0 / np.linalg.norm(draws, axis=1, keepdims=True)
        points = PATH.position(time) + draws @ root.T
        for k, axis in enumerate((1, 0)):
            assert points[:, axis].max() <= swept[:, k].max() + 1e-6
            assert points[:, axis].min() >= swept[:, k].min() - 1e-6
    deviation = np.sqrt(KNOWN.covariance(PATH, END)[1, 1])
    assert swept[:, 0].min() == pytest.approx(60.0 - 2.0 * deviation, abs=0.01)  # drawn as chords
    with pytest.raises(ValueError, match="sigmas: must be finite and above 0"):
        cf.plots.tube(PATH, REST, BALL, KNOWN, sigmas=0.0)


def test_plotted_sigmas_are_minimum_distances_in_sigmas() -> None:
    """At the ends, by sampling the ball for the point with the fewest sigmas; the dot is the exact least."""
    figure = cf.plots.sigmas(PATH, REST, BALL, KNOWN, asked=1.5, names=["A - B"])
    least = cf.clearance_in_sigmas(PATH, REST, BALL, KNOWN)
    axes = figure.axes[0]
    dot = next(line for line in axes.lines if line.get_marker() == "o")
    curve = next(line for line in axes.lines if len(line.get_xdata()) > 100)
    assert float(np.squeeze(dot.get_ydata())) == pytest.approx(least.sigmas)
    assert curve.get_ydata().min() == pytest.approx(least.sigmas, rel=1e-3)
    height, around = np.meshgrid(np.linspace(-1.0, 1.0, 801), np.linspace(0.0, 2.0 * np.pi, 1601))
    flat = np.sqrt(1.0 - height**2)
    ball = 20.0 * np.stack([flat * np.cos(around), flat * np.sin(around), height], axis=-1).reshape(-1, 3)
    for k, time in ((0, 0.0), (-1, END)):
        gaps = ball - PATH.position(time)
        inverse = np.linalg.inv(KNOWN.covariance(PATH, time)[:3, :3])
        fewest = np.sqrt(np.einsum("pi,ij,pj->p", gaps, inverse, gaps).min())
        assert curve.get_ydata()[k] == pytest.approx(fewest, rel=1e-3)  # of so many samples
    assert f"{least.sigmas:.2f} sigma" in figure.get_suptitle()
    across = cf.Uncertainty(np.diag([0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
    with pytest.raises(ValueError, match="errors: no error of any size"):
        cf.plots.sigmas(PATH, REST, BALL, across)


def test_a_collision_ends_at_what_is_expected() -> None:
    found = cf.collision_probability(PATH, REST, cf.Sphere(10.0), KNOWN, KNOWN)
    figure = cf.plots.collision(found, PATH, limit=0.2, what="A - B")
    above, below = figure.axes
    so_far = below.lines[0].get_ydata()
    assert (np.diff(so_far) >= 0.0).all()
    assert so_far[0] == pytest.approx(found.at_start)
    assert so_far[-1] == pytest.approx(found.at_start + found.mean_entries)
    times, rates = above.lines[0].get_data()
    summed = (np.diff(times) * 0.5 * (rates[1:] + rates[:-1])).sum()
    assert 1e-3 * summed == pytest.approx(found.mean_entries, rel=0.01)  # of a curve between its points
    assert f"probability of collision {found.value:.4g}" in figure._suptitle.get_text()
    drawn = cf.collision_probability(PATH, REST, cf.Sphere(10.0), KNOWN, KNOWN, "monte-carlo", 1000)
    with pytest.raises(ValueError, match='found: method "monte-carlo" gave no rate of entries'):
        cf.plots.collision(drawn, PATH)
