"""Pictures of what missions cost: which there are, and that they say what the mission says."""

from pathlib import Path

import numpy as np
import pytest

import closeform as cf
from closeform.mission import fly
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
