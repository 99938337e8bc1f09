"""What the pictures of primers and of the trade between time and delta-v say."""

import numpy as np
import pytest

import closeform as cf

ORBIT = cf.Orbit(1.15697e-3)
START = [20e3, 20e3, 20e3, -20.0, 20.0, -5.0]  # Curtis, chapter 7: to the origin in 8 h


def dots(figure):
    return np.array([line.get_ydata()[0] for line in figure.axes[0].lines if line.get_marker() == "o"])


def test_primer_touches_one_at_the_impulses():
    """In time order with their sizes; started late, it looks the same."""
    for start in (0.0, 5e3):
        figure = cf.plots.primer(ORBIT.impulsive(START, np.zeros(6), 28800.0, start))
        assert figure._suptitle.get_text() == "78.53 m/s with 4 impulses: the least there is"
        assert dots(figure) == pytest.approx(np.ones(4), abs=1e-9)
        sizes = [text.get_text() for text in figure.axes[0].texts]
        assert sizes == ["41.33 m/s", "27.88 m/s", "8.214 m/s", "1.109 m/s"]
        (curve,) = (line for line in figure.axes[0].lines if len(line.get_xdata()) > 100)
        assert curve.get_ydata().max() <= 1 + 1e-9


def test_primer_shows_what_other_impulses_waste():
    """Worth times size, summed, is the least delta-v, whatever the plan."""
    path = ORBIT.two_impulse(START, np.zeros(6), 28800.0)
    figure = cf.plots.primer(path)
    assert figure._suptitle.get_text() == "109.7 m/s with 2 impulses: 39.6 % above the least, 78.53 m/s"
    sizes = [np.linalg.norm(push) for _, push in path.impulses]
    assert dots(figure) @ sizes == pytest.approx(78.53298, abs=1e-4)


def test_primer_of_a_coast():
    figure = cf.plots.primer(ORBIT.coast(START, 6000.0))
    assert figure._suptitle.get_text() == "0 mm/s with 0 impulses: the least there is"


def test_trade_is_what_arrivals_found():
    slots = np.zeros((2, 6))
    slots[:, 1] = [-100.0, 100.0]
    found = cf.arrivals(ORBIT, [0, -500.0, 0, 0, 0, 0], slots, [9000.0, 3000.0, 6000.0])
    figure = cf.plots.trade(found)
    (curve,) = (line for line in figure.axes[0].lines if line.get_marker() == "o")
    order = [1, 2, 0]
    unit = 1e-3 if "mm/s" in figure.axes[0].get_ylabel() else 1.0
    assert curve.get_xdata() * 60.0 == pytest.approx(found.duration[order])
    assert curve.get_ydata() * unit == pytest.approx(found.delta_v[order])
    assert [text.get_text() for text in figure.axes[0].texts] == ["slot 0"]
    with pytest.raises(ValueError, match="found: has no duration"):
        cf.plots.trade(cf.arrivals(ORBIT, START, slots, []))
