"""Figures of the source papers against independent geometry."""

from math import acos, cos, pi, radians, sin, tan

import numpy as np
import paper_figures as figures
import pytest

import closeform as cf
from closeform.papers import cone_regions
from lost import POSITIONS, VELOCITIES

RATE, HALF = radians(0.25), radians(70.0)
MODIFIED = cf.Search.modified(cf.Sensor(HALF), RATE, radians(25.0))
BASIC = cf.Search.basic(cf.Sensor(HALF, offset=7.5), RATE, radians(25.0), in_plane_turn=2 * pi)
FIVE = cf.gather(BASIC, POSITIONS, VELOCITIES, "balanced", burns="second")
LOCKS = [event for event in FIVE.events if event.kind == "lock"]


def points(line):
    return np.transpose([line.get_xdata(), line.get_ydata()]).astype(float)


def angle_between(one, other):
    return acos(one @ other / np.linalg.norm(one) / np.linalg.norm(other))


@pytest.mark.parametrize("mops", [1, 2])
@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_region_plot(mops, number):
    first = MODIFIED.boresight([2160.0, 4283.0 + 2160.0][mops - 1])  # the start of an mOPS
    rim = figures.half_rim(MODIFIED, number, first)[1:-1]
    inside = 0.999 * rim + 0.001 * rim.mean(axis=0)
    expected = [k == number for k in (1, 2, 3, 4)]
    assert (cone_regions(MODIFIED, inside, mops) == expected).all()
    assert not cone_regions(MODIFIED, 1.001 * rim - 0.001 * rim.mean(axis=0), mops).any()


@pytest.mark.parametrize("time", [None, 200.0, 1500.0])
def test_lemma_2_plot(time):
    r, v = np.array([-100.0, 240.0, 170.0]), np.array([-0.05, -0.1, 0.03])
    figure = figures.lemma_2(MODIFIED, r, v, time)
    figure.draw_without_rendering()
    when = float(cf.lock_times(MODIFIED, r, v).time[0]) if time is None else time
    craft, turn = r + v * when, RATE * when
    boresight = np.array([-cos(turn), sin(turn), 0.0])  # of B
    meeting = figures.Meeting(craft, boresight, HALF)
    assert np.allclose(meeting.curve[:, 2], 0.0)
    gaps = meeting.curve - craft
    assert np.allclose(gaps @ boresight, cos(HALF) * np.linalg.norm(gaps, axis=1))
    assert np.allclose(meeting.vertex, craft * [1, 1, 0] + 1 / tan(HALF) * abs(craft[2]) * boresight)
    (drawn,) = [line for line in figure.axes[0].lines if len(line.get_xdata()) == 97]
    assert np.allclose(points(drawn), meeting.curve @ figures.CAMERA.basis[:2].T, atol=1e-9)
    margin = angle_between(-craft, boresight) - HALF
    where = "on H" if time is None else ("outside of H" if margin > 0 else "within H")
    assert where in figure.get_suptitle()
    assert time is not None or abs(margin) < 1e-9


def test_simultaneity_by_angles():
    """Craft 1 and 2 see each other, craft 3 is seen by none of them and sees both."""
    places, looks = np.array([[0.0, 0.0], [100.0, 30.0], [40.0, 110.0]]), np.radians([20.0, 190.0, -75.0])
    figure = figures.simultaneity(cf.Sensor(radians(35.0)), places, looks)
    between = np.arctan2(30.0, 100.0)
    angles = [np.degrees(abs(looks[0] - between)), np.degrees(abs(looks[1] - pi - between))]
    said = [text.get_text() for text in figure.axes[0].texts]
    assert {f"θ1 = {angles[0]:.0f}°", f"θ2 = {angles[1]:.0f}°"} <= set(said)
    lines = [line for line in figure.axes[0].lines if len(line.get_xdata()) == 2]
    assert [line.get_xydata().tolist() for line in lines] == [[[100.0, 30.0], [0.0, 0.0]]]


def test_near_field_picture_is_the_region_that_the_cone_leaves():
    figure = figures.near_field(BASIC)
    (region,) = figure.axes[0].collections
    outline = region.get_paths()[0].vertices
    assert abs(outline[:, 0]).max() == pytest.approx(BASIC.near_field)
    assert abs(outline[:, 1]).max() == pytest.approx(7.5)
    with pytest.raises(ValueError, match="near field is empty"):
        figures.near_field(MODIFIED)


def test_join_table_counts_the_locks():
    figure = figures.join_table(FIVE)
    (table,) = figure.axes[0].tables
    shown = [
        int(cell.get_text().get_text().split("\n")[-1])
        for (i, j), cell in sorted(table.get_celld().items())
        if i and j >= 0
    ]
    assert shown == FIVE.join_table.ravel().tolist()
    assert sum(shown) == len(LOCKS) + len(FIVE.known_locks)


def test_sets_show_velocities_relative_to_the_formation_set():
    time = 0.5 * (LOCKS[1].time + LOCKS[2].time)
    axes = figures.sets(FIVE, time).axes[0]
    labels = FIVE.history[np.searchsorted([event.time for event in FIVE.events], time)]
    moving = labels != 0
    assert len(axes.patches) == moving.sum()
    assert {text.get_text() for text in axes.get_legend().get_texts()} >= {
        "formation set: one velocity",
        "lost",
    }


def test_invalid_input():
    for call, message in [
        (lambda: figures.complementary_cones(BASIC), "mops: this search has no mOPS 1"),
        (
            lambda: figures.complementary_cones(cf.Search.modified(cf.Sensor(pi / 2), RATE, 0.4)),
            "search: a half-angle of 90 deg leaves no complementary cones",
        ),
        (
            lambda: figures.lemma_2(BASIC, [9, 0, 0], [0, 0, 0]),
            "search: lemma 2 requires sensors at the centres",
        ),
        (lambda: figures.lemma_2(MODIFIED, [9, 0], [0, 0, 0]), "position: expected shape"),
        (lambda: figures.lemma_2(MODIFIED, [9, 0, 0], [0, 0, 0], 2200.0), "time: 2200 s is not in the first"),
        (lambda: figures.lemma_2(MODIFIED, [0, 0, 9], [0, 0, 0]), "time: .* is not in the first in-plane"),
    ]:
        with pytest.raises(ValueError, match=message):
            call()
