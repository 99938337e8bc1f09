"""`plots.pulses` shows the fired pulses and the planned thrust."""

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import PolyCollection

import closeform as cf
from firings import CUBE

mpl.use("agg")
ORBIT = cf.Orbit.circular(500e3)
MOVE = ORBIT.transfer([0, 200, 0, 0, 0, 0], [40, -150, 60, 0, -0.09, 0.02], 3000.0)
SIX = cf.Thrusters.rtn(acceleration=2e-3, minimum_bit=3e-3, period=60.0)


def test_pulses_are_drawn_by_axis_with_the_planned_thrust():
    firing = cf.fire_thrusters(MOVE, SIX)
    figure = cf.plots.pulses(firing)
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "radial [mm/s]",
        "along-track [mm/s]",
        "cross-track [mm/s]",
    ]
    times = np.linspace(0.0, 3000.0, 301)
    for axis, axes in enumerate(figure.axes):
        own = firing.pulses[firing.pulses.thruster // 2 == axis]
        signs = 1.0 - 2.0 * (own.thruster % 2)
        bars = [(bar.get_x() * 60.0, bar.get_width() * 60.0, bar.get_height()) for bar in axes.patches]
        fired = np.stack([own.start, own.duration, 1e3 * signs * own.impulse], axis=1)
        assert np.allclose(sorted(bars), sorted(fired.tolist()), atol=1e-9)
        areas = [one for one in axes.collections if isinstance(one, PolyCollection)]
        corners = np.concatenate([path.vertices for area in areas for path in area.get_paths()])
        asked = 60e3 * MOVE.thrust(times)[:, axis]
        assert corners[:, 1].max() == pytest.approx(max(asked.max(), 0.0), rel=1e-2, abs=0.1)
        assert corners[:, 1].min() == pytest.approx(min(asked.min(), 0.0), rel=1e-2, abs=0.1)
        low, high = axes.get_ylim()
        assert low <= fired[:, 2].min()
        assert high >= fired[:, 2].max()


def test_pulses_of_one_spacecraft_of_a_formation():
    both = cf.stack([ORBIT.coast(np.zeros(6), 3000.0), MOVE])
    firing = cf.fire_thrusters(both, cf.Thrusters(CUBE, acceleration=2e-3, period=60.0))
    figure = cf.plots.pulses(firing, craft=1)
    assert figure.get_suptitle().startswith(f"Craft 1: {len(firing.pulses)} pulses")
    assert [axes.get_ylabel().split(" [")[0] for axes in figure.axes] == [
        f"{k + 1} up, {8 - k} down" for k in range(4)
    ]
    assert "no pulses" in cf.plots.pulses(firing).get_suptitle()
    with pytest.raises(ValueError, match=r"^craft: must be from 0 to 1, got 2$"):
        cf.plots.pulses(firing, craft=2)
