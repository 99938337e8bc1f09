"""The picture of a mission shows thrust, impulses, conflicts, locks and ratios at their times."""

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba

import closeform as cf
from closeform import plots
from closeform.plots.drawing.palette import CONFLICT

mpl.use("agg")
ORBIT = cf.Orbit.circular(500e3)
BALL, NAMES = cf.Sphere(60.0), ["Target", "Chaser", "Third"]
START = np.array([[0, 0, 0, 0, 0, 0], [0, 200, 0, 0, 0, 0], [0, 400, 0, 0, 0, 0]], dtype=float)


@pytest.fixture(scope="module")
def stages():
    """Return three stages: a coast, a transfer of the chaser past the target, and its return by impulses."""
    first = ORBIT.coast(START, 600.0)
    second = [ORBIT.coast(START[k], 900.0, 600.0) for k in (0, 2)]
    second.insert(1, ORBIT.transfer(START[1], [0, -200, 0, 0, 0, 0], 900.0, 600.0))
    third = [ORBIT.coast(START[k], 2000.0, 1500.0) for k in (0, 2)]
    third.insert(1, ORBIT.impulsive([0, -200, 0, 0, 0, 0], [0, 150, 0, 0, 0, 0], 2000.0, 1500.0))
    return [first, cf.stack(second), cf.stack(third)]


@pytest.fixture(scope="module")
def picture(stages):
    figure = plots.overview(stages, NAMES, BALL, ["1 wait", "2 pass", "3 return"], [(300.0, 0, 1)])
    figure.canvas.draw()
    return figure


def panels(figure):
    """The strip of stages, the rows of craft, and the ratio."""
    _, strip, rows, ratio = figure.axes[:4]
    return strip, rows, ratio


def test_burns_are_in_the_row_of_their_spacecraft(picture, stages):
    """The chaser thrusts in one stage and has impulses in the next; no other spacecraft burns."""
    _, rows, _ = panels(picture)
    every = [one for one in rows.collections if isinstance(one, PolyCollection)]
    corners = [path.vertices for one in every for path in one.get_paths()]
    assert all(shape[:, 1].min() >= 1.0 and shape[:, 1].max() < 2.0 for shape in corners)
    starts = sorted(60.0 * np.mean(shape[:2, 0]) for shape in corners)
    assert starts[0] == pytest.approx(600.0)  # the thrust of stage 2
    middles = [60.0 * np.ptp(shape[:4, 0]) / 2 + start for shape, start in zip(corners, starts, strict=False)]
    times = [time for time, _ in stages[2][1].impulses]
    assert len(middles) == 1 + len(times)


def test_conflicts_and_locks_connect_the_rows_of_a_pair(picture, stages):
    """Every stay of any pair in both rows, against the search for conflicts; a lock at its time."""
    _, rows, _ = panels(picture)
    bars = {}
    for one in rows.collections:
        if isinstance(one, LineCollection) and one.get_linewidth()[0] == 5.0:
            assert tuple(one.get_color()[0]) == to_rgba(CONFLICT)
            for piece in one.get_segments():
                bars.setdefault(round(piece[0, 1]), []).append(60.0 * piece[:, 0])
    expected = {}
    for paths in stages:
        for i, j in ((0, 1), (0, 2), (1, 2)):
            for stay in cf.find_conflicts(paths[i], paths[j], BALL):
                for k in (i, j):
                    expected.setdefault(2 - k, []).append([stay.start, stay.end])
    assert expected
    assert bars.keys() == expected.keys()
    for row, spans in expected.items():
        assert np.array(bars[row]) == pytest.approx(np.array(spans), abs=1e-6)
    links = [
        piece
        for one in rows.collections
        if isinstance(one, LineCollection) and one.get_linewidth()[0] == 1.1
        for piece in one.get_segments()
    ]
    assert len(links) == 1
    assert links[0] == pytest.approx(np.array([[5.0, 2.0], [5.0, 1.0]]))


def test_plotted_ratio_is_that_of_the_closest_pair(picture, stages):
    """Against the norms of all pairs at other times; dots at certified closest approaches."""
    *_, ratio = panels(picture)
    solid = [line for line in ratio.lines if len(line.get_xdata()) > 100 and line.get_linewidth() < 3.0]
    assert len(solid) == len(stages)
    for line, paths in zip(solid, stages, strict=True):
        times, drawn = 60.0 * line.get_xdata(), line.get_ydata()
        asked = np.linspace(times[0], times[-1], 77)[1:-1]
        places = paths.position(asked)
        gaps = [places[i] - places[j] for i, j in ((0, 1), (0, 2), (1, 2))]
        apart = np.linalg.norm(gaps, axis=-1).min(axis=0)
        assert np.interp(asked, times, drawn) == pytest.approx(apart / 60.0, abs=0.02)
    dots = [line for line in ratio.lines if line.get_marker() == "o"]
    for dot, paths in zip(dots, stages, strict=True):
        near = [cf.closest_approach(paths[i], paths[j], BALL).ratio for i, j in ((0, 1), (0, 2), (1, 2))]
        assert dot.get_ydata()[0] == pytest.approx(min(near), rel=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stages": []}, "stages: give at least one path"),
        ({"stages": [1, 0]}, "stages: 2 begins at 0 s, before 1 has ended"),
        ({"locks": [(1.0, 0, 3)]}, "locks: there is no craft 3 among 3"),
        ({"locks": [(1.0, 0)]}, r"locks: expected \(time, craft, craft\)"),
        ({"titles": ["one"]}, "titles: 1 titles for 3 stages"),
    ],
)
def test_invalid_input_is_refused(change, message, stages):
    chosen = [stages[k] for k in change.pop("stages", range(3))]
    with pytest.raises(ValueError, match=message):
        plots.overview(chosen, NAMES, BALL, **change)
