"""Plots of searches and gatherings against independent geometry."""

import io
from math import acos, atan, cos, pi, radians, sin, sqrt

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from PIL import Image
from scipy.spatial import ConvexHull

from bodies import Body
from closeform import plots
from closeform.plots.drawing.space import GROUP_COLOURS, OBLIQUE, Camera, hull, ring
from closeform.plots.gatherings import SUN_VIEW, Moment, ThreeViews, knots_of, schedule
from closeform.plots.searches import ABOVE
from closeform.search.gathering.gather import gather
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors
from closeform.search.sensor import Sensor
from lost import POSITIONS, VELOCITIES
from turns import turns

RATE, HALF = radians(0.25), radians(70.0)
MODIFIED = Search.modified(Sensor(HALF), RATE, radians(25.0))
BASIC = Search.basic(Sensor(HALF, offset=7.5), RATE, radians(25.0), in_plane_turn=2 * pi)
TIP = atan(cos(HALF) / sqrt(1 - 2 * cos(HALF) ** 2))  # S04 eq. 1
FIVE = gather(BASIC, POSITIONS, VELOCITIES, "balanced", burns="second")
LOCKS = [event for event in FIVE.events if event.kind == "lock"]
RNG = np.random.default_rng(11)
MANY = gather(BASIC, RNG.uniform(-900, 900, (40, 3)), RNG.uniform(-0.1, 0.1, (40, 3)))


def moment(gathering, time):
    return Moment(gathering, knots_of(gathering), time)


def words(figure):
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    return texts + [text.get_text() for text in figure.texts]


def points(line):
    return np.transpose([line.get_xdata(), line.get_ydata()]).astype(float)


def sun_view_of(position):
    """Return coordinates seen from -z, where the Sun is: x to the right and y downwards."""
    return np.asarray(position)[..., :2] * [1.0, -1.0]


def angle_between(one, other):
    return acos(one @ other / np.linalg.norm(one) / np.linalg.norm(other))


def test_imperfect_attitudes_are_drawn():
    """Compare with independent bodies."""
    rng = np.random.default_rng(5)
    errors = {
        "pointing": rng.normal(0.0, 0.1, (5, 3)),
        "slew_rate": rng.normal(0.0, 0.03, 5),
        "start": rng.normal(0.0, 60.0, 5),
        "half_angle": rng.normal(0.0, 0.05, 5),
        "slew_acceleration": RATE / rng.uniform(10.0, 100.0, 5),
    }
    astray = gather(BASIC, POSITIONS, VELOCITIES, "balanced", rounds=1, errors=SearchErrors(**errors))
    turned = turns("basic", HALF, BASIC.tip_angle, in_plane=360.0)
    # a round ends with the turn back to where it began, the short way
    turned += [("OPS", "sun", leg.angle) for leg in astray.search.legs[len(turned) :]]
    bodies = [
        Body(turned, group, **{name: values[k] for name, values in errors.items()})
        for k, group in enumerate(astray.groups)
    ]
    anywhere = rng.uniform(0.0, astray.search.duration + 300.0, 40)
    times = np.concatenate([anywhere, bodies[0].begins[1:4] + 1.0])
    for time in times:
        truth = np.stack([body.bodies(np.array([time]))[0] for body in bodies])
        np.testing.assert_allclose(moment(astray, time).attitudes, truth, rtol=0.0, atol=1e-9)
    assert plots.three_views(astray, 0.0).axes


@pytest.mark.parametrize("camera", [SUN_VIEW, OBLIQUE, ABOVE, Camera.at([1, 2, 3], [0, 0, 1])])
def test_camera_shows_no_mirror_image(camera):
    assert np.allclose(camera.basis @ camera.basis.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(camera.basis) == pytest.approx(1.0)


def test_sun_view_is_from_the_sun():
    assert np.allclose(SUN_VIEW(np.eye(3)), [[1, 0], [0, -1], [0, 0]])
    assert SUN_VIEW.nearness([0, 0, -1]) == 1.0  # the sun is along -z
    # a right-handed turn about the direction to the sun is counter-clockwise there
    seen = SUN_VIEW(BASIC.boresight([0.0, 360.0, 720.0]))  # 0, 90 and 180 deg
    assert np.allclose(seen, [[1, 0], [0, 1], [-1, 0]], atol=1e-12)
    assert OBLIQUE.nearness([0, 0, -1]) > 0.0  # seen from the sunny side
    assert OBLIQUE([0, 0, -1]) @ [0, 1] > 0.5


def test_convex_hull():
    cloud = RNG.normal(size=(60, 2))
    true = cloud[ConvexHull(cloud).vertices]
    assert {tuple(point) for point in hull(cloud)} == {tuple(point) for point in true}
    assert len(hull(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]))) == 2  # edge-on


def test_rim_of_a_cone():
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    rim = ring(axis, HALF, 5.0)
    assert np.allclose(rim @ axis, 5.0 * cos(HALF))
    assert np.allclose(np.linalg.norm(rim, axis=1), 5.0)


# ----- one search


def test_manoeuvre_plot_shows_the_attitudes():
    """After the first tip A points to the Sun by the tip, and its shade is tilted as much."""
    axes = plots.manoeuvres(MODIFIED).axes[1]
    boresight = np.array([cos(TIP), -sin(TIP)])
    coloured = [line for line in axes.lines if line.get_color() == GROUP_COLOURS["A"]]
    edges = [points(line)[1] for line in coloured if line.get_linestyle() == "-"]
    assert [angle_between(edge, boresight) for edge in edges] == pytest.approx([HALF, HALF])
    (before,) = [points(line)[1] for line in coloured if line.get_linestyle() == "--"]
    assert np.allclose(before, [1.0, 0.0], atol=1e-12)
    (shade,) = [points(line) for line in axes.lines if line.get_linewidth() == 4.5]
    assert abs(angle_between(shade[1] - shade[0], boresight)) < 1e-7  # edge-on, along the boresight


# ----- many searches


def test_histogram_bars():
    given = np.concatenate([np.zeros(17), RNG.uniform(1e-3, MODIFIED.duration, 4000), [np.nan] * 3])
    given[20:30] = 120.0  # on an edge
    figure = plots.histogram(given, MODIFIED)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    (bars,) = [patch for patch in axes.patches if hasattr(patch, "get_data")]
    counts, edges, _ = bars.get_data()
    assert np.allclose(edges * 60.0, 60.0 * np.arange(144))  # minutes
    later = given[17:-3]
    true = [np.count_nonzero((later >= 60.0 * k) & (later < 60.0 * (k + 1))) for k in range(143)]
    assert counts.tolist() == true
    assert sum(true) == 4000
    assert axes.get_yscale() == "log"
    assert figure.get_suptitle() == "17 of 4 020 pairs lock at once (not shown), 4 000 later, 3 never"
    first = np.count_nonzero(later <= 2160.0)
    assert f"IPS 1: {first:,}".replace(",", " ") in words(figure)
    dashed = sorted(float(line.get_xdata()[0]) * 60.0 for line in axes.lines if line.get_linestyle() == "--")
    assert dashed == pytest.approx([leg.end for leg in MODIFIED.legs])
    other = plots.histogram([0.0, 5.0], BASIC, 10.0, "formations gather")
    assert other.get_suptitle() == "1 of 2 formations gather at once (not shown), 1 later"
    assert other.axes[0].get_ylabel() == "formations [1 per 10 s]"


# ----- a gathering


@pytest.mark.parametrize("time", [100.0, 543.0, 1200.0])
def test_cones_start_at_the_sensor(time):
    """In the in-plane search, the Sun sees every cone from the side."""
    views = ThreeViews(FIVE, 0, None)
    views.show(time)
    sun = views.parts[1]
    turn = RATE * time
    drawn = [patch for patch in sun.axes.patches if patch.get_facecolor()[3] == 0.2]
    order = [0, 1, 2, 3, 4]  # those of A come first, and three of five are A
    assert FIVE.groups == ("A", "A", "A", "B", "B")
    for patch, k in zip(drawn, order, strict=True):
        outline, colour = patch.get_xy()[:-1], patch.get_facecolor()
        sign = 1.0 if FIVE.groups[k] == "A" else -1.0
        boresight = sign * np.array([cos(turn), sin(turn)])  # counter-clockwise from the right
        apex = sun_view_of(FIVE.paths[k].position(time)) + 7.5 * boresight
        at = int(np.argmin(np.linalg.norm(outline - apex, axis=1)))
        assert np.allclose(outline[at], apex, atol=1e-9)
        edges = [outline[at - 1] - apex, outline[(at + 1) % len(outline)] - apex]
        assert [angle_between(edge, boresight) for edge in edges] == pytest.approx([HALF, HALF], abs=1e-3)
        assert max(np.linalg.norm(edge) for edge in edges) == pytest.approx(sun.cone, rel=1e-3)
        assert tuple(colour[:3]) == to_rgba(GROUP_COLOURS[FIVE.groups[k]])[:3]


def lock_lines(time):
    """Return the lines of the Sun view that join pairs which have locked."""
    views = ThreeViews(FIVE, 0, None)
    views.show(time)
    (lines,) = [one for one in views.parts[1].axes.collections if one.get_label() == "locks"]
    return lines.get_segments()


def test_lines_join_locked_pairs():
    for number, event in enumerate(LOCKS):
        ends = sun_view_of(FIVE.paths.position(event.time))[[event.first, event.second]]
        assert any(np.allclose(line, ends) for line in lock_lines(event.time))
        assert len(lock_lines(event.time - 1.0)) == number


# ----- animation


def test_animation(tmp_path):
    plots.animation(FIVE, tmp_path / "five.gif", frames=2)
    times, stays = zip(*schedule(FIVE, 2), strict=True)
    assert len(times) == 2 + 3  # the last lock is the last frame
    assert [stay > 1000 for stay in stays] == [time in {event.time for event in LOCKS} for time in times]
    with Image.open(tmp_path / "five.gif") as film:
        assert film.n_frames == 5
        shown = []
        for k in range(5):
            film.seek(k)
            shown.append(film.info["duration"])
        assert shown == list(stays)
        last = np.asarray(film.convert("RGB"), dtype=float)
    # moved artists show the same as a new figure
    figure = plots.three_views(FIVE, FIVE.duration)
    figure.set_dpi(last.shape[1] / figure.get_size_inches()[0])
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    anew = np.asarray(canvas.buffer_rgba(), dtype=float)[..., :3]
    assert anew.shape == last.shape
    assert np.abs(anew - last).mean() < 1.5  # of 255: the palette has 128 colours
    assert tuple(last[1, 1]) == (255, 255, 255)


def test_invalid_input():
    for call, message in [
        (lambda: plots.manoeuvres(MODIFIED, 3), "number: this search has rounds 1 to 2, got 3"),
        (lambda: plots.histogram([[1.0]], MODIFIED), "times: expected shape"),
        (lambda: plots.histogram([-1.0], MODIFIED), "times: must lie in the search, from 0 to 8566"),
        (lambda: plots.histogram([1.0], MODIFIED, 0.0), "bin: must be positive"),
        (lambda: plots.three_views(FIVE, 1e5), "time: must lie in the gathering, from 0 to 1509.47 s"),
        (lambda: plots.three_views(FIVE, 0.0, 5), "craft: must be from 0 to 4, got 5"),
        (lambda: plots.three_views(FIVE, 0.0, names=["a"]), "names: 1 names for 5 craft"),
        (
            lambda: plots.animation(FIVE, io.BytesIO(), frames=1),
            "frames: expected a whole number of at least 2",
        ),
    ]:
        with pytest.raises(ValueError, match=message):
            call()
