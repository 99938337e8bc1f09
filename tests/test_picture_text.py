"""Text in pictures: names are literal, no texts overlap, none is cut off."""

import io
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

import closeform as cf
from closeform import plots
from closeform.mission.mission import plan_mission
from closeform.plots.drawing.style import banner
from closeform.report.picture import Film
from closeform.report.run import RunReport
from closeform.scenario.load import parse
from closeform.storage.result_folder import Folder

ORBIT = cf.Orbit.circular(500e3)
DEEP = cf.Orbit(0.0)
N = ORBIT.mean_motion
BALL = cf.Sphere(20.0)
ODD = ["$x$", "_a_b", r"\frac{$", "{}%", "<b>F</b>", "航天器一", "שלום", "🛰sat", "W" * 200, "$", "ᶁ1", "F 12"]


def circle(radius, phase):
    cos, sin = np.cos(phase), np.sin(phase)
    return radius * np.array([sin / 2, cos, sin, N * cos / 2, -N * sin, N * cos])


RING = np.array([circle(150.0, k * np.pi / 6) for k in range(12)])
BEFORE = ORBIT.transfer(RING, np.roll(RING, 6, axis=0), 0.3 * ORBIT.period)
AFTER = ORBIT.transfer(RING, np.roll(RING, 5, axis=0), 0.3 * ORBIT.period)
SCATTERED = np.random.default_rng(3).uniform(-200.0, 200.0, (12, 6)) * [1, 1, 1, 2e-3, 2e-3, 2e-3]
STRAIGHT = DEEP.coast(SCATTERED, 900.0)
TARGET = ORBIT.coast(np.zeros(6), 3 * ORBIT.period)
INSPECTOR = ORBIT.coast([-50.0, 0, 0, 0, 100.0 * N, 50.0 * N], 3 * ORBIT.period)
SEARCH = cf.Search.modified(cf.Sensor(np.radians(70.0)), np.radians(0.25), np.radians(25.0))
LATE = np.concatenate([np.zeros(40), np.random.default_rng(5).uniform(1.0, 2000.0, 400)])
LONG_COAST = ORBIT.coast(RING * np.linspace(1.0, 1.6, 12)[:, None], 10 * ORBIT.period)
OTHERS = [AFTER[k] for k in range(1, 12)]
PICTURES = {
    "paths, before and after": lambda names: plots.formation_paths(BEFORE, AFTER, names, BALL),
    "paths": lambda names: plots.formation_paths(AFTER, AFTER, names, BALL),
    "paths in deep space": lambda names: plots.formation_paths(STRAIGHT, STRAIGHT, names, BALL),
    "ratios of all": lambda names: plots.ratio_matrix(AFTER, BALL, names),
    "closest pairs over orbits": lambda names: plots.closest_pairs(LONG_COAST, BALL, names, count=8),
    "thrust of all": lambda names: plots.formation_thrust(
        AFTER, names, [1e-3] * 6 + [np.inf] * 3 + [2e-3] * 3, range(20, 32)
    ),
    "distances": lambda names: plots.distances(INSPECTOR, TARGET, BALL, names[:2]),
    "one among others": lambda names: plots.before_after(BEFORE[0], AFTER[0], OTHERS, BALL, names[1:]),
    "ratios of one": lambda names: plots.ratios(BEFORE[0], AFTER[0], OTHERS, BALL, names[1:]),
    "thrust": lambda names: plots.thrust(AFTER[:2], names[:2]),
    "two ways": lambda names: plots.two_ways(BEFORE[0], BEFORE[6], BALL, name=names[1]),
    "histogram": lambda names: plots.histogram(LATE, SEARCH),
    "sweep": lambda names: plots.sweep(
        np.arange(3.0), np.full((12, 3), 0.5), np.zeros((12, 3)), np.ones((12, 3)), "range [m]", names
    ),
    "distribution": lambda names: plots.distribution([*LATE, np.nan], "delta-v of all craft [m/s]"),
}
STAGE = 'Stage 12 "around and back again": reconfigure failed: thrust limit exceeded; these are direct paths'


def written(figure):
    """Return every text that is drawn, with its box in pixels."""
    drawn = []

    draw = Text.draw

    def heard(text, renderer, *rest, **more):
        if text.get_visible() and text.get_text().strip():
            drawn.append(text)
        return draw(text, renderer, *rest, **more)

    canvas = FigureCanvasAgg(figure)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", heard)
        canvas.draw()
    renderer = canvas.get_renderer()
    return [(text, Text.get_window_extent(text, renderer)) for text in dict.fromkeys(drawn)]


@pytest.mark.parametrize("draw", PICTURES.values(), ids=PICTURES)
def test_texts_do_not_overlap_or_leave_the_page(draw):
    figure = draw(["Chaser", "Target"] + [f"Formation {k}" for k in range(10)])
    banner(figure, STAGE)
    found = written(figure)
    assert any(STAGE in text.get_text().replace("\n", " ") for text, _ in found)
    page = figure.bbox
    out = [
        text.get_text()
        for text, box in found
        if box.x0 < -1 or box.y0 < -1 or box.x1 > page.x1 + 1 or box.y1 > page.y1 + 1
    ]
    assert out == []
    clash = [
        (one.get_text(), other.get_text())
        for (one, a), (other, b) in combinations(found, 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > 2 and min(a.y1, b.y1) - max(a.y0, b.y0) > 4  # pixels
    ]
    assert clash == []


@pytest.mark.parametrize("draw", [*PICTURES.values()][1::5], ids=[*PICTURES][1::5])
def test_names_are_drawn_literally(draw):
    """No name is parsed as a formula, no glyph warns (warnings are errors), no text is cut off."""
    figure = draw(ODD)
    found = written(figure)
    named = [text for text, _ in found if any(name in text.get_text() for name in ODD[:5])]
    assert not any(text.get_parse_math() for text in named)
    assert all(box.x0 >= -1 and box.x1 <= figure.bbox.x1 + 1 for _, box in found)


def test_views_and_animations_accept_any_name():
    search = cf.Search.basic(cf.Sensor(np.radians(70.0)), np.radians(0.25), np.radians(25.0))
    positions = [[0.0, 0, 0], [-49, 75, 18], [-35, -31, -227]]
    found = cf.gather(search, positions, 1e-3 * np.array([[0.0, 0, 0], [-16, 69, -12], [-35, 83, -24]]))
    figure = plots.three_views(found, found.duration, names=ODD[:3])
    FigureCanvasAgg(figure).draw()
    assert {"$x$", "_a_b"} <= {text.get_text() for text in figure.findobj(Text)}
    plots.animation(found, io.BytesIO(), names=ODD[:3], frames=2)
    plots.formation_animation(AFTER, io.BytesIO(), ODD, BALL, frames=2)


def test_histogram_curve_is_the_cumulative_share():
    figure = plots.histogram(np.concatenate([LATE, [np.nan] * 10]), SEARCH)
    (curve,) = figure.axes[1].get_lines()
    minutes, share = curve.get_xdata(), curve.get_ydata()
    for time in (0.0, 300.0, 1500.0):
        shown = share[np.searchsorted(minutes, time / 60.0, side="right") - 1]
        assert shown == pytest.approx(100.0 * np.count_nonzero(time >= LATE) / 450)
    end = next(end for *_, end in SEARCH.phases if end >= LATE.max())
    assert figure.axes[0].get_xlim() == pytest.approx((0.0, end / 60.0))
    assert figure.axes[1].get_ylabel().endswith("[%]")


EVERY = """
closeform = 1
title = "Every stage that moves"
[orbit]
altitude = "500 km"
[craft]
name = ["A", "B", "C"]
start = [{ palmer = "0 -60 0 0 0 120 m" }, { palmer = "0 60 0 0 0 -120 m" }, { palmer = "0 0 0 -300 0 0 m" }]
keep_out = { sphere = "10 m" }
[[stage]]
do = "coast"
for = "0.1 orbits"
animation = true
[[stage]]
do = "transfer"
craft = "C"
to = { palmer = "0 0 0 -200 0 0 m" }
within = "0.3 orbits"
animation = true
[[stage]]
do = "avoid"
craft = "C"
to = { palmer = "0 0 0 0 0 0 m" }
within = "0.4 orbits"
animation = true
[[stage]]
name = "threat"
do = "scatter"
factor = 1.5
within = "0.3 orbits"
animation = true
[[stage]]
do = "regather"
as_before = "threat"
within = "0.5 orbits"
cost = "delta-v"
animation = true
[[stage]]
do = "reconfigure"
to = { projected_circular = { radius = "100 m" } }
within = "0.6 orbits"
animation = true
"""


@pytest.mark.slow
def test_every_stage_with_motion_has_an_animation(tmp_path):
    mission = plan_mission(parse(EVERY))
    assert mission.stopped is None
    for told in RunReport(mission).sections:
        (film,) = [picture for picture in told.pictures if isinstance(picture, Film)]
        short = replace(film, options={**film.options, "frames": 2})
        shot = short.draw(Folder(tmp_path))
        assert shot.file.read_bytes().startswith(b"GIF89a")
