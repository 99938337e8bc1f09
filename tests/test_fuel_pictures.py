"""Pictures of the delta-v of missions agree with the results."""

import numpy as np
import pytest

import closeform as cf

ORBIT = cf.Orbit.circular(500e3)
HOP = ORBIT.impulsive([0, -2000, 30, 0, 0, 0], [0, -100, 0, 0.01, 0, 0.02], 1.3 * ORBIT.period)


def texts(figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_bars_have_the_height_of_burns():
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


def test_trade_plot_marks_the_total_delta_v_of_the_plan():
    trade = cf.transfer_cost_table(
        ORBIT, [0, -2000, 30, 0, 0, 0], np.zeros((1, 6)), np.linspace(1000.0, 9000.0, 9)
    )
    figure = cf.plots.trade(trade, [HOP, HOP])
    ring = figure.axes[0].lines[-1]
    assert ring.get_ydata()[0] == pytest.approx(
        2.0 * HOP.delta_v * (1e3 if "mm/s" in figure.axes[0].get_ylabel() else 1)
    )
    assert "slot 0" not in texts(figure)  # there is no other
