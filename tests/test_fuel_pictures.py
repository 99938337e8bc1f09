"""Pictures of what missions cost: which there are, and that they say what the mission says."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import closeform as cf
from closeform.fuel.burns import Burns
from closeform.mission import fly
from closeform.plots.names import overlap
from closeform.report.run import RunReport
from closeform.scenario import load

EXAMPLES = Path(__file__).parents[1] / "examples"
ORBIT = cf.Orbit.circular(500e3)
HOP = ORBIT.impulsive([0, -2000, 30, 0, 0, 0], [0, -100, 0, 0.01, 0, 0.02], 1.3 * ORBIT.period)
EXPECTED = {
    "safety_ellipse": {"paths", "burns", "primer", "trade"},
    "cubesats": {"paths", "ratios", "closest-pairs", "thrust", "burns", "pulses", "trade"},
    "swap_impulses": {"paths", "ratios", "closest-pairs", "burns", "primer", "trade"},
}


def texts(figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


@pytest.mark.parametrize("name", EXPECTED)
def test_a_stage_that_speaks_of_fuel_has_its_pictures(name):
    mission = fly(load(EXAMPLES / f"{name}.toml"))
    first = RunReport(mission).sections[0]
    names = {picture.name.removeprefix("stage-1-") for picture in first.pictures}
    assert names >= EXPECTED[name]
    for picture in first.pictures:
        if picture.plot in ("burns", "trade"):
            figure = getattr(cf.plots, picture.plot)(*picture.arguments, **picture.options)
            headline = figure.get_suptitle()
            if picture.plot == "trade":
                assert "this plan" in texts(figure)
            else:
                assert f"{mission.results[0].delta_v.sum():.4g} m/s" in headline


def test_bars_are_as_high_as_burns():
    figure = cf.plots.burns(HOP, ["I"])
    (bars,) = figure.axes[0].collections
    heights = np.array([np.ptp(path.vertices[:, 1]) for path in bars.get_paths()])
    sizes = np.array([np.linalg.norm(push) for _, push in HOP.impulses])
    assert heights / heights.max() == pytest.approx(sizes / sizes.max(), rel=1e-9)
    middles = (
        np.array([path.vertices[:, 0].min() + path.vertices[:, 0].max() for path in bars.get_paths()]) / 2
    )
    assert middles * 60.0 == pytest.approx([time for time, _ in HOP.impulses], abs=1e-6)  # minutes
    assert figure.get_suptitle().startswith(f"I: {len(sizes)} burns, {HOP.delta_v:.4g} m/s")


@pytest.mark.parametrize("seed", range(6))
def test_sizes_of_burns_stand_on_nothing(seed, monkeypatch):
    """Burns at random times, many near each other: no two words share a pixel, nor a word and a bar."""
    draws = np.random.default_rng(seed)

    def some(_):
        count = draws.integers(1, 9)
        times, sizes = np.sort(draws.uniform(0.0, HOP.end, count)), draws.uniform(0.01, 0.2, count)
        lasts = np.where(draws.random(count) < 0.5, 0.0, draws.uniform(0.0, 400.0, count))
        return Burns(times, lasts, np.zeros((count, 3)), sizes)

    monkeypatch.setattr("closeform.plots.burning.burns_of", some)
    figure = cf.plots.burns([HOP] * 6)
    FigureCanvasAgg(figure).draw()
    (axes,) = figure.axes
    words = [text.get_window_extent() for text in axes.texts]
    assert len(words) >= 6  # a row has one at least
    bars = [
        axes.transData.transform(path.vertices[:4]) for row in axes.collections for path in row.get_paths()
    ]
    taken = [(*one.min(axis=0), *one.max(axis=0)) for one in bars] + [one.extents for one in words]
    for k, word in enumerate(words):
        others = taken[: len(bars) + k] + taken[len(bars) + k + 1 :]
        assert not any(overlap(word.extents, other) for other in others)
        assert axes.get_window_extent().containsx(word.x0)
        assert axes.get_window_extent().containsx(word.x1)
        assert word.y1 <= axes.get_window_extent().y1


def test_nobody_burns_and_too_many_do():
    rest = ORBIT.coast(np.zeros((3, 6)), 600.0)
    assert cf.plots.burns(rest).get_suptitle() == "Nobody burns"
    with pytest.raises(ValueError, match="paths: up to 60, got 61"):
        cf.plots.burns([rest[0]] * 61)


def test_the_plan_stands_in_the_trade_by_the_sum_of_all():
    trade = cf.arrivals(ORBIT, [0, -2000, 30, 0, 0, 0], np.zeros((1, 6)), np.linspace(1000.0, 9000.0, 9))
    figure = cf.plots.trade(trade, [HOP, HOP])
    ring = figure.axes[0].lines[-1]
    assert ring.get_ydata()[0] == pytest.approx(
        2.0 * HOP.delta_v * (1e3 if "mm/s" in figure.axes[0].get_ylabel() else 1)
    )
    assert "slot 0" not in texts(figure)  # there is no other
