"""Pictures of one spacecraft agree with the conflict search, on every kind of path."""

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

import closeform as cf
from closeform import plots
from closeform.planning.methods.both_sides import ways_around
from closeform.zones.outlines import section, shadow

ORBIT = cf.Orbit.circular(500e3)
N = ORBIT.mean_motion
DURATION = 0.5 * ORBIT.period
ELLIPSOID = cf.Ellipsoid([20.0, 40.0, 20.0])
TILTED = cf.Box([15.0, 30.0, 20.0], [[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
LINE = cf.Box([20.0, 40.0, 20.0])
FIRST = [100.6566, 237.1632, 201.3132, 0.1312, -0.2228, 0.2625]
LAST = [-99.1597, 205.7376, -198.3193, 0.1139, 0.2195, 0.2277]


def projected_circle(radius, phase):
    cos, sin = np.cos(phase), np.sin(phase)
    return radius * np.array([sin / 2, cos, sin, N * cos / 2, -N * sin, N * cos])


OTHERS = ORBIT.coast(
    np.array([projected_circle(120.0, k * np.pi / 3) for k in range(6)] + [np.zeros(6)]), DURATION
)
MOVER = ORBIT.transfer(FIRST, LAST, DURATION)
HIT = OTHERS[1]  # 0.10 x zone on the way of MOVER
CLEAR = ORBIT.coast([0.0, 900.0, 0.0, 0.0, 0.0, 0.0], DURATION)
DEEP = cf.Orbit(0.0)
SPACE = cf.Ellipsoid([5.0, 5.0, 5.0])


def crossing(path, time, velocity):
    """Return a spacecraft that coasts past a path 4 m away at a time, with a relative velocity."""
    meeting = path.state(time) + [2.0, 3.0, -2.0, *velocity]
    return ORBIT.coast(np.linalg.solve(ORBIT.transition(time), meeting), path.end)


PINGS = ORBIT.two_impulse(FIRST, LAST, 0.4 * ORBIT.period)
CIRCLE = ORBIT.coast(projected_circle(150.0, 0.0), 5 * ORBIT.period)
KINDS = {
    "transfer": (MOVER, HIT, ELLIPSOID),
    "coast": (
        CIRCLE,
        ORBIT.coast(CIRCLE.state(0.0) + [25.0, 6.0, 3.0, 0.0, -2 * 25.0 * N, 0.0], 5 * ORBIT.period),
        TILTED,
    ),
    "impulsive": (PINGS, crossing(PINGS, 0.2 * ORBIT.period, [0.05, 0.1, -0.1]), LINE),
    "deep space": (
        DEEP.transfer([-50.0, 1.0, 0, 0, 0, 0], [60.0, 0.5, 2, 0, 0, 0], 900.0),
        DEEP.coast([0.0, -3.0, 0.0, 0.0, 0.005, 0.0], 1200.0),
        SPACE,
    ),
    "clear": (MOVER, CLEAR, ELLIPSOID),
    "sampled": (
        ORBIT.sampled(np.linspace(0, DURATION, 40), MOVER.state(np.linspace(0, DURATION, 40))),
        ORBIT.burn(HIT.state(0.0), [1e-6, 0, 0], 0.7 * DURATION),
        ELLIPSOID,
    ),
}


@pytest.fixture(params=KINDS.values(), ids=KINDS)
def kind(request):
    return request.param


def words(axes):
    return [axes.get_xlabel(), axes.get_ylabel()]


def assert_units(figure):
    """Check that every labelled axis of a drawn figure names its unit."""
    assert isinstance(figure, Figure)
    figure.draw_without_rendering()
    labels = [word for axes in figure.axes for word in words(axes) if word]  # none beside a scale bar
    assert all("[" in word and word.endswith("]") for word in labels)


def spans(figure):
    """Return the bars of the timeline by row: (start, end) in the unit of the axis."""
    found = {}
    for bars in figure.axes[3].collections:
        if isinstance(bars, PolyCollection):
            found[bars.get_label()] = [
                (p.vertices[:, 0].min(), p.vertices[:, 0].max()) for p in bars.get_paths()
            ]
    return found


def seconds(figure, path):
    """Return the unit of the time axis [s]."""
    name = figure.axes[3].get_xlabel().removeprefix("time [").removesuffix("]")
    return {"s": 1.0, "min": 60.0, "h": 3600.0, "orbits": path.orbit.period}[name]


def test_conflict_bars_agree_with_the_certified_search(kind):
    path, other, zone = kind
    figure = plots.distances(path, other, zone)
    assert_units(figure)
    rows, unit = spans(figure), seconds(figure, path)
    true = cf.find_conflicts(path, other, zone)
    drawn = rows.get("in the zone", rows.get("conflict"))
    assert len(drawn) == len(true)
    for bar, conflict in zip(drawn, true, strict=True):  # a microsecond: rounding of time / unit
        assert np.allclose(np.array(bar) * unit, [conflict.start, conflict.end], atol=1e-6)
    if "all three" in rows:
        box = cf.find_conflicts(path, other, cf.Box(zone.extents))
        edges = [time for stay in box for time in (stay.start, stay.end)]
        assert np.allclose(np.array(rows["all three"]).ravel() * unit, edges, atol=1e-6)


def test_paths_of_these_tests_conflict():
    counts = [len(cf.find_conflicts(*kind)) for kind in KINDS.values()]
    assert [count > 0 for count in counts] == [True, True, True, True, False, True]
    assert counts[1] > 4  # one or two in every orbit


def test_bars_of_each_axis_agree_with_the_distances(kind):
    path, other, zone = kind
    figure = plots.distances(path, other, zone)
    unit = seconds(figure, path)
    start, end = max(path.start, other.start), min(path.end, other.end)
    for axis, name in enumerate(("radial", "along-track", "cross-track")):
        times = np.linspace(start, end, 4001)
        inside = np.abs(path.position(times)[:, axis] - other.position(times)[:, axis]) <= zone.extents[axis]
        bars = np.array(spans(figure)[name]).reshape(-1, 2) * unit
        covered = ((times[:, None] > bars[:, 0]) & (times[:, None] < bars[:, 1])).any(axis=1)
        assert np.count_nonzero(inside != covered) <= 2 * len(bars)  # samples on an edge itself
        edges = bars[(bars > start + 1e-6) & (bars < end - 1e-6)]
        gap = path.position(edges)[:, axis] - other.position(edges)[:, axis]
        assert np.allclose(np.abs(gap), zone.extents[axis], rtol=1e-9)


def test_distance_curve_is_the_relative_position():
    curve = plots.distances(MOVER, HIT, ELLIPSOID).axes[1].get_lines()[0]
    times = np.asarray(curve.get_xdata()) * 60
    gap = MOVER.position(times)[:, 1] - HIT.position(times)[:, 1]
    assert np.allclose(curve.get_ydata(), gap, atol=1e-6)  # m; times went through minutes and back


@pytest.mark.parametrize("kind", ["impulsive", "deep space"])
def test_axis_labels_state_units(kind):
    path, other, zone = KINDS[kind]
    ways = ways_around(path, other, zone)
    after = ways[0] if ways else path
    for figure in (
        plots.two_ways(path, other, zone, ways),
        plots.before_after(path, after, [other], zone, ["target"]),
        plots.ratios(path, after, [other], zone),
        plots.thrust([path, after], ["before", "after"]),
    ):
        assert_units(figure)


def test_both_ways_are_clear_on_opposite_sides():
    ways = ways_around(MOVER, HIT, ELLIPSOID)
    assert len(ways) == 2
    gaps = []
    for way in ways:
        assert not cf.find_conflicts(way, HIT, ELLIPSOID)
        near = cf.closest_approach(way, HIT, ELLIPSOID)
        assert near.ratio == pytest.approx(1.0, abs=1e-8)
        assert np.allclose(way.state([way.start, way.end]), MOVER.state([MOVER.start, MOVER.end]), atol=1e-9)
        gaps.append(way.position(near.time) - HIT.position(near.time))
    assert gaps[0] @ gaps[1] < 0
    # the cost of a deviation is a quadratic form with no first-order term: both cost more
    assert MOVER.energy < ways[0].energy < ways[1].energy
    best = cf.avoid(MOVER, [HIT], ELLIPSOID)
    assert best.energy <= ways[0].energy * (1 + 1e-9)
    assert ways[0].energy < best.energy + 0.02 * MOVER.energy


def test_stems_have_the_height_of_impulses():
    path = KINDS["impulsive"][0]
    figure = plots.thrust([path], ["two impulses"])
    right = [axes for axes in figure.axes if axes.get_ylabel().startswith("impulse")]
    assert len(right) == 4
    tops = [float(line.get_ydata()[-1]) for line in right[0].get_lines()[::2]]
    assert tops == pytest.approx([np.linalg.norm(jump) for _, jump in path.impulses])  # m/s
    assert right[0].get_ylabel() == "impulse [m/s]"


@pytest.mark.parametrize(
    "zone", [ELLIPSOID, TILTED, cf.Sphere(7.0)], ids=["ellipsoid", "tilted box", "sphere"]
)
def test_shadow_and_section_of_a_zone(zone):
    plane = np.eye(3)[[1, 0]]
    rng = np.random.default_rng(4)
    points = rng.normal(size=(4000, 3))
    points /= zone.norm(points)[:, None]
    outline = shadow(zone, plane)
    for angle in np.linspace(0, 2 * np.pi, 9):
        direction = np.array([np.cos(angle), np.sin(angle)])
        reach = (outline @ direction).max()
        assert (points @ plane.T @ direction).max() <= reach * (1 + 1e-9)
        assert (points @ plane.T @ direction).max() >= 0.97 * reach  # 4000 points come that near
    assert np.allclose(zone.norm(section(zone, plane) @ plane), 1.0)


def test_marked_minimum_is_the_certified_ratio():
    axes = plots.ratios(MOVER, MOVER, OTHERS, ELLIPSOID).axes[0]
    dot = next(line for line in axes.get_lines() if line.get_marker() == "o")
    near = cf.closest_approach(MOVER, OTHERS, ELLIPSOID)
    assert float(dot.get_ydata()[0]) == near.ratio.min()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plots.distances(MOVER, OTHERS, ELLIPSOID), "other: pictures show one craft"),
        (lambda: plots.distances(MOVER, ORBIT.coast(FIRST, 9.0, 1e6), ELLIPSOID), "other: shares no time"),
        (lambda: plots.two_ways(MOVER, HIT, ELLIPSOID, [MOVER] * 3), "ways: give at most 2, got 3"),
        (lambda: plots.thrust([MOVER], []), "labels: 0 labels for 1 paths"),
        (lambda: plots.thrust([MOVER] * 4, "abcd"), "paths: give one to 3, got 4"),
        (lambda: plots.ratios(MOVER, MOVER, [], ELLIPSOID), "obstacles: give at least one path"),
        (lambda: plots.ratios(MOVER, MOVER, OTHERS, ELLIPSOID, ["A"]), "names: 1 names for 7 obstacles"),
        (
            lambda: plots.before_after(MOVER, MOVER, OTHERS, ELLIPSOID, ["A"]),
            "names: 1 names for 7 obstacles",
        ),
    ],
)
def test_invalid_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("most", [0.2, 0.04])
def test_speed_is_drawn_with_its_limit_and_smallest_margin(most):
    """The dot is at the smallest margin of dense samples, and the shade begins at the limit."""
    orbit = cf.Orbit.circular(500e3)
    path = orbit.transfer([0, -200, 0, 0, 0, 0], [0, -2, 0, 0, 0, 0], 2400.0)
    limit = cf.requirements.SpeedLimit(limit=most, rate=2e-4, axis=[0, -1, 0], start=600.0, end=2000.0)
    figure = plots.speed(path, limit)
    (axes,) = (one for one in figure.axes if "speed" in one.get_ylabel())
    states = path.state(times := np.linspace(600.0, 2000.0, 20_001))
    allowed = most + 2e-4 * -states[:, 1]
    margin = allowed - np.linalg.norm(states[:, 3:], axis=1)
    size = {"speed [m/s]": 1.0, "speed [mm/s]": 1e-3}[axes.get_ylabel()]
    drawn = {line.get_label(): line.get_xydata() * [60.0, size] for line in axes.lines}
    inner = slice(100, -100)  # between its samples
    assert np.interp(times[inner], *drawn["limit"].T) == pytest.approx(allowed[inner], abs=1e-4 * most)
    dot = next(line.get_xydata()[0] for line in axes.lines if line.get_marker() == "o") * [60.0, size]
    assert dot[0] == pytest.approx(times[margin.argmin()], abs=5.0)
    assert np.interp(dot[0], times, allowed) - dot[1] == pytest.approx(margin.min(), abs=1e-6)
    assert ("not kept" in figure.get_suptitle()) == (margin.min() < 0.0)
