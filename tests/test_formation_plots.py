"""Pictures of a formation against straight lines, dense samples and the conflict search."""

import io

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_rgba
from PIL import Image

import closeform as cf
from closeform import plots
from closeform.plots.animations import FormationFilm
from closeform.plots.drawing.moving import write_gif
from closeform.plots.drawing.palette import COLOURS, CONFLICT
from closeform.plots.drawing.space import OBLIQUE

DEEP = cf.Orbit(0.0)
ORBIT = cf.Orbit.circular(500e3)
N = ORBIT.mean_motion
END = 1000.0
BALL = cf.Sphere(15.0)


def straight(count, seed=5, spread=150.0, miss=12.0):
    """Craft that coast on straight lines through the middle: states (N, 6)."""
    rng = np.random.default_rng(seed)
    states = rng.uniform(-spread, spread, (count, 6))
    states[:, 3:] = -states[:, :3] / (END / 2) + rng.normal(size=(count, 3)) * miss / (END / 2)
    return states


def meeting(states, i, j):
    """Least distance of two straight lines over [0, END], when, and when they are within 15 m."""
    r, v = states[j, :3] - states[i, :3], states[j, 3:] - states[i, 3:]
    time = np.clip(-(r @ v) / (v @ v), 0.0, END)
    roots = np.roots([v @ v, 2 * r @ v, r @ r - 15.0**2])
    inside = None
    if np.isrealobj(roots) and roots.max() > 0 and roots.min() < END:
        inside = max(roots.min(), 0.0), min(roots.max(), END)
    return np.linalg.norm(r + v * time), time, inside


def meetings(states):
    """All pairs: least ratios (N, N) to the 15 m, and the stays by pair."""
    count = len(states)
    least, stays = np.full((count, count), np.nan), {}
    for i in range(count):
        for j in range(i + 1, count):
            distance, _, inside = meeting(states, i, j)
            least[i, j] = least[j, i] = distance / 15.0
            if inside is not None:
                stays[i, j] = inside
    return least, stays


def swap(count, duration=0.5 * ORBIT.period):
    """Craft of a ring that change places in an orbit, and a way around that need not be clear."""
    phases = np.arange(count) * 2 * np.pi / count
    cos, sin = np.cos(phases), np.sin(phases)
    ring = 120 * np.stack([sin / 2, cos, sin, N * cos / 2, -N * sin, N * cos], axis=1)
    final = np.roll(ring, count // 2, axis=0)
    before = ORBIT.transfer(ring, final, duration)
    middle = before.state(duration / 2)
    middle[:, :3] += np.random.default_rng(8).normal(size=(count, 3)) * 40
    first = ORBIT.transfer(ring, middle, duration / 2)
    return before, cf.join([first, ORBIT.transfer(middle, final, duration / 2, duration / 2)]), ring, final


def lines(axes, colour, width=None):
    """Pieces of line (K, 2) of a colour."""
    found = []
    for collection in axes.collections:
        if isinstance(collection, LineCollection):
            segments = collection.get_segments()
            looks = np.broadcast_to(collection.get_colors(), (len(segments), 4))
            found += [
                piece
                for piece, look in zip(segments, looks, strict=True)
                if np.allclose(look, to_rgba(colour))
            ]
    return found


def marks(axes, label):
    return next(
        c.get_offsets() for c in axes.collections if isinstance(c, PathCollection) and c.get_label() == label
    )


def distance_to(points, curve):
    """Greatest distance of points from the nearest of many points of a curve."""
    return max(np.linalg.norm(curve - point, axis=1).min() for point in points)


# formation_paths


def test_tracks_in_the_planes_are_the_paths():
    before, after, ring, final = swap(5)
    figure = plots.formation_paths(before, after)
    times = np.linspace(before.start[0], before.end[0], 8001)
    for column, paths in enumerate((before, after)):
        for row, plane in enumerate(([1, 0], [1, 2], [2, 0])):
            axes = figure.axes[3 * column + row]
            for k in range(5):
                drawn = np.vstack(lines(axes, COLOURS[k]))
                curve = paths[k].position(times)[:, plane]
                assert distance_to(drawn[::40], curve) < 0.1  # m: the samples are 0.08 m apart
                assert distance_to(curve[::200], drawn) < 0.6  # as are those of the picture, 0.7 m
            assert np.allclose(marks(axes, "start"), ring[:, plane], atol=1e-6)
            assert np.allclose(marks(axes, "end"), final[:, plane], atol=1e-6)


def test_marked_conflicts_end_at_the_zone():
    states = straight(6)
    _, stays = meetings(states)
    assert len(stays) > 3
    paths = DEEP.coast(states, END)
    axes = plots.formation_paths(paths, paths, zone=BALL).axes[0]
    pieces = [piece for piece in lines(axes, CONFLICT) if len(piece) > 2]
    covered = np.zeros((6, 20001), dtype=bool)
    times = np.linspace(0, END, 20001)
    for (i, j), (start, end) in stays.items():
        covered[[i, j]] |= (times >= start) & (times <= end)
    runs = np.diff(covered.astype(int), axis=1, prepend=0, append=0)
    begin, finish = np.argwhere(runs == 1), np.argwhere(runs == -1)
    assert len(pieces) == len(begin)
    for piece, (k, first), (_, past) in zip(pieces, begin, finish, strict=True):
        ends = states[k, :3] + times[[first, past - 1], None] * states[k, 3:]
        assert np.allclose(piece[[0, -1]], OBLIQUE(ends), atol=0.05)  # m: 0.05 s at 0.6 m/s


def test_conflicts_with_obstacles_are_marked():
    states = straight(4, seed=3)
    paths = DEEP.coast(states, END)
    hit = states[1].copy()
    hit += [3.0, 4.0, 0.0, 1e-3, 0.0, 0.0]  # beside craft 1 all the time
    still = np.array([[500.0, 0, 0, 0, 0, 0], [505.0, 0, 0, 0, 0, 0]])  # in each other's zone, far away
    obstacles = DEEP.coast(np.vstack([hit, still]), END)
    figure = plots.formation_paths(paths, paths, zone=BALL, obstacles=obstacles)
    alone = plots.formation_paths(paths, paths, zone=BALL)
    before, after = (
        int(one.get_suptitle().split(": ")[1].split(" ")[0].replace("all", "0")) for one in (alone, figure)
    )
    close = [meeting(np.vstack([states, hit]), k, 4)[2] is not None for k in range(4)]
    assert close[1]
    assert after == before + sum(close)
    assert figure.get_suptitle().startswith("4 craft, 18 pairs")  # 6 and 4 x 3, none of two obstacles
    drawn = [c for c in figure.axes[0].collections if c.get_label() == "obstacles"]
    assert len(drawn[0].get_segments()) == 3
    whole = max(lines(figure.axes[0], CONFLICT), key=lambda piece: np.ptp(piece, axis=0).sum())
    assert np.allclose(whole[[0, -1]], OBLIQUE(paths[1].position([0.0, END])))


def kept(count, zones):
    """Zones of some pairs alone."""
    table = np.full((count + 1, count + 1), -1)
    for k, pair in enumerate(zones):
        table[pair] = k
    return cf.PairZones(tuple(zones.values()), np.arange(count), table, np.ones(count, dtype=bool))


def test_pairs_without_a_zone_are_not_in_conflict():
    same = DEEP.coast(np.zeros((3, 6)) + [5.0, 0, 0, 0, 0, 0.1], END)
    groups = kept(3, {(0, 2): BALL})
    figure = plots.formation_paths(same, same, zone=groups)
    assert figure.get_suptitle() == "3 craft, 1 pair: 1 in conflict"
    assert len([piece for piece in lines(figure.axes[0], CONFLICT) if len(piece) > 2]) == 2
    assert plots.formation_paths(same, same).get_suptitle() == "3 craft: all paths"


# ratio_matrix


def shown_matrix(figure):
    return np.ma.filled(figure.axes[0].images[0].get_array().astype(float), np.nan)


def test_ratio_matrix_has_the_minimum_ratios_of_straight_lines():
    states = straight(12)
    least, stays = meetings(states)
    figure = plots.ratio_matrix(DEEP.coast(states, END), BALL)
    drawn = shown_matrix(figure)
    assert np.allclose(drawn, least, rtol=2e-9, equal_nan=True)
    assert np.array_equal(drawn, drawn.T, equal_nan=True)
    axes = figure.axes[0]
    numbers = {(t.get_position()[1], t.get_position()[0]): t.get_text() for t in axes.texts}
    assert len(numbers) == 12 * 11
    for (i, j), text in numbers.items():
        assert float(text) == pytest.approx(least[i, j], abs=0.0051 if least[i, j] < 9.99 else 0.051)
    bold = {tuple(np.array(t.get_position(), dtype=int)) for t in axes.texts if t.get_fontweight() == "bold"}
    assert bold == {pair[::step] for pair in stays for step in (1, -1)}
    i, j = min(zip(*np.nonzero(least == np.nanmin(least)), strict=True))
    verdict = figure.get_suptitle()
    assert verdict.startswith(f"{len(stays)} of 66 pairs")
    assert verdict.endswith(f"{i} and {j}, {least[i, j]:.2f} × zone")


def test_ratio_matrix_uses_the_zone_of_each_pair():
    states = straight(4)
    least, _ = meetings(states)
    wide = cf.Sphere(30.0)
    groups = kept(4, {(0, 1): BALL, (2, 3): BALL, (1, 2): wide})
    drawn = shown_matrix(plots.ratio_matrix(DEEP.coast(states, END), groups))
    assert drawn[0, 1] == pytest.approx(least[0, 1])
    assert drawn[3, 2] == pytest.approx(least[2, 3])
    assert drawn[2, 1] == pytest.approx(least[1, 2] / 2)
    assert np.isnan(drawn[[0, 0, 1], [2, 3, 3]]).all()


def test_pairs_without_common_time_are_blank():
    states = straight(3)
    paths = cf.stack([DEEP.coast(state, 400.0, 500.0 * (k == 2)) for k, state in enumerate(states)])
    figure = plots.ratio_matrix(paths, BALL)
    assert np.isfinite(shown_matrix(figure)).tolist() == [
        [False, True, False],
        [True, False, False],
        [False] * 3,
    ]
    blank = figure.axes[0].images[0].make_image(None, unsampled=True)[0]
    assert blank[0, 2, 3] == 0  # transparent: the hatching behind is seen
    assert len(figure.axes[0].texts) == 2


# closest_pairs


def pair_lines(figure):
    """Curves by their labels."""
    return {
        str(line.get_label()): line for line in figure.axes[0].get_lines() if " and " in str(line.get_label())
    }


def test_closest_pairs_are_ordered_and_follow_their_distance():
    states = straight(12)
    least, _ = meetings(states)
    figure = plots.closest_pairs(DEEP.coast(states, END), BALL, count=6)
    upper = np.argwhere(np.triu(np.ones((12, 12)), 1))
    ranked = sorted(upper.tolist(), key=lambda pair: least[tuple(pair)])[:6]
    curves = pair_lines(figure)
    for (i, j), (label, line) in zip(ranked, curves.items(), strict=True):
        distance, time, _ = meeting(states, i, j)
        assert label == f"{i} and {j}: {distance / 15:.2f} × zone at {time / 60:.2f} min"
        times = np.asarray(line.get_xdata()) * 60
        gap = states[j, :3] - states[i, :3] + times[:, None] * (states[j, 3:] - states[i, 3:])
        assert np.allclose(line.get_ydata(), np.linalg.norm(gap, axis=1) / 15, atol=1e-9)
        assert np.abs(times - time).min() < 1e-3  # s: the least is among the samples
        assert min(line.get_ydata()) == pytest.approx(distance / 15, abs=1e-8)
    dots = [line for line in figure.axes[0].get_lines() if line.get_marker() == "o"]
    at = [[float(np.squeeze(v)) for v in (dot.get_xdata(), dot.get_ydata())] for dot in dots]
    true = [[meeting(states, i, j)[1] / 60, least[i, j]] for i, j in ranked]
    assert np.allclose(at, true, atol=1e-4)
    assert (
        len({(line.get_color(), line.get_linestyle(), str(line._dash_pattern)) for line in curves.values()})
        == 6
    )


def test_thick_lines_mark_conflicts():
    states = straight(6)
    _, stays = meetings(states)
    figure = plots.closest_pairs(DEEP.coast(states, END), BALL, count=15)
    drawn_red = [line for line in figure.axes[0].get_lines() if line.get_color() == CONFLICT]
    wide = [line for line in drawn_red if line.get_marker() == "None"]
    drawn = []
    for line in wide:
        times = np.asarray(line.get_xdata())[np.isfinite(line.get_ydata())] * 60
        drawn.append((times.min(), times.max()))
    assert np.allclose(sorted(drawn), sorted(stays.values()), atol=1e-6)


SOME = DEEP.coast(straight(3), END)
APART = cf.stack([DEEP.coast(np.zeros(6), 9.0), DEEP.coast(np.zeros(6), 9.0, 20.0)])


def test_invalid_input_is_named():
    for call, message in [
        (lambda: plots.formation_paths(SOME, SOME[:2]), r"before, after: must be .* got \(3,\) and \(2,\)"),
        (lambda: plots.formation_paths(SOME[0], SOME[0]), r"before, after: must be .* got \(\) and \(\)"),
        (lambda: plots.formation_paths(SOME, ORBIT.coast(straight(3), END)), "before, after: must be of one"),
        (
            lambda: plots.formation_paths(SOME, None),
            "after: expected a Path, got None; a plan that is not ok",
        ),
        (lambda: plots.closest_pairs(None, BALL), "paths: expected a Path, got None; a plan that is not ok"),
        (lambda: plots.formation_paths(SOME, SOME, ["A"]), "names: 1 names for 3 craft"),
        (lambda: plots.ratio_matrix(SOME[:1], BALL), "paths: give at least two craft, got 1"),
        (lambda: plots.ratio_matrix(SOME, BALL, ["A"]), "names: 1 names for 3 craft"),
        (lambda: plots.ratio_matrix(SOME, ()), "zones: no pair of craft has a zone"),
        (
            lambda: plots.ratio_matrix(SOME, kept(4, {(0, 3): BALL})),
            "zones: zones of 4 spacecraft for 3 paths",
        ),
        (lambda: plots.ratio_matrix(SOME, [BALL] * 2), "zones: 2 zones for 3 spacecraft"),
        (
            lambda: plots.ratio_matrix(SOME, [(BALL, [[0, 1]]), BALL]),
            "zones: expected a zone, one for each spacecraft",
        ),
        (
            lambda: plots.ratio_matrix(SOME, [cf.Box([1, 9, 1]), cf.Box([9, 1, 1]), None]),
            "craft 0 and craft 1: neither zone contains the other",
        ),
        (
            lambda: plots.closest_pairs(SOME, BALL, count=0),
            "count: expected a whole number of at least 1, got 0",
        ),
        (lambda: plots.closest_pairs(APART, BALL), "paths: no pair of craft with a zone has a common time"),
    ]:
        with pytest.raises(ValueError, match=message):
            call()


def test_thrust_of_a_formation_is_the_norm_in_newtons():
    before, _, _, _ = swap(4, 0.3 * ORBIT.period)
    masses, limits = [10.0, 20.0, 30.0, 40.0], [1e-4, np.inf, 2e-4, 2e-4]
    figure = plots.formation_thrust(before, list("ABCD"), limits, masses)
    axes = figure.axes[0]
    unit = {"N": 1.0, "mN": 1e-3, "µN": 1e-6}[axes.get_ylabel().split("[")[1][:-1]]
    curves = axes.get_lines()[:4]
    peaks = []
    for k, (line, mass) in enumerate(zip(curves, masses, strict=True)):
        times = np.asarray(line.get_xdata()) * 60.0
        assert np.allclose(
            np.asarray(line.get_ydata()) * unit,
            mass * np.linalg.norm(before[k].thrust(times), axis=1),
            rtol=1e-6,
        )
        peaks.append(max(line.get_ydata()))
    drawn = [float(line.get_ydata()[0]) * unit for line in axes.get_lines()[4:]]
    own = [mass * limit for mass, limit in zip(masses, limits, strict=True) if np.isfinite(limit)]
    assert set(np.round(drawn, 9)) <= set(np.round(own, 9))  # except those far above all curves
    assert f"{1e3 * max(own):g} mN" in axes.texts[0].get_text()
    over = sum(peak * unit > mass * limit for peak, mass, limit in zip(peaks, masses, limits, strict=True))
    most = "ABCD"[int(np.argmax(peaks))]
    assert figure.get_suptitle().startswith(f"{most} has the largest thrust")
    assert (f"{over} of 4" if over else "all within") in figure.get_suptitle()
    plain = plots.formation_thrust(before)
    assert plain.axes[0].get_ylabel().endswith("m/s²]")
    still = plots.formation_thrust(DEEP.coast(straight(3), END))
    assert still.get_suptitle() == "No spacecraft thrusts"


# formation_animation


def test_animation_shows_positions_and_the_closest_pair():
    states = straight(5)
    film = FormationFilm([DEEP.coast(state, END) for state in states], list("ABCDE"), BALL)
    least, stays = meetings(states)
    closest = np.unravel_index(np.nanargmin(least), least.shape)
    assert film.closest == pytest.approx(meeting(states, *sorted(closest))[1], abs=1e-3)
    ((axes, camera, _),) = film.views
    background = axes.get_children()
    for time in [*np.linspace(0.0, END, 21), film.closest]:
        story = film.show(time)
        drawn = [one for one in axes.get_children() if one not in background]
        (dots,) = [one for one in drawn if isinstance(one, PathCollection)]
        (trails,) = [one for one in drawn if isinstance(one, LineCollection)]
        where = states[:, :3] + time * states[:, 3:]
        assert np.allclose(dots.get_offsets(), camera(where))
        gaps = np.linalg.norm(where[:, None] - where, axis=2) + 1e9 * np.eye(5)
        i, j = sorted(np.unravel_index(gaps.argmin(), gaps.shape))
        assert f"{'ABCDE'[i]} and {'ABCDE'[j]}, " in story
        assert float(story.split(", ")[-1][:-2]) == pytest.approx(gaps.min(), rel=1e-3)
        hit = [any(k in pair and a <= time <= b for pair, (a, b) in stays.items()) for k in range(5)]
        assert [np.allclose(edge, to_rgba(CONFLICT)) for edge in dots.get_edgecolors()] == hit
        ends = [trail[-1] for trail in trails.get_segments()]
        assert np.allclose(ends, camera(where)) if time > 0.0 else not ends
        for one in drawn:
            one.remove()


@pytest.mark.parametrize("orbit", [DEEP, ORBIT])
def test_animation_keeps_the_scales_of_its_background(orbit):
    film = FormationFilm([orbit.coast(state, END) for state in straight(5)], None, BALL)
    scales = []

    def show(time: float) -> str:
        said = film.show(time)
        ends = [axes.transData.transform([[0.0, 0.0], [1.0, 1.0]]) for axes, *_ in film.views]
        scales.append(np.diff(ends, axis=1)[:, 0])
        return said

    write_gif(io.BytesIO(), film.figure, show, [(0.3 * END, 80), (0.6 * END, 80)], 400)
    assert np.allclose(np.array(scales)[..., 0], np.array(scales)[..., 1])
    assert np.allclose(scales, scales[0])


def test_animation_of_an_orbit(tmp_path):
    before, _, _, _ = swap(12)
    file = tmp_path / "flight.gif"
    plots.formation_animation(before, file, zone=BALL, frames=5)
    with Image.open(file) as film:
        assert film.n_frames == 6  # the closest approach has its own
        stays, shown = [], []
        for k in range(film.n_frames):
            film.seek(k)
            stays.append(film.info["duration"])
            shown.append(np.asarray(film.convert("RGB"), dtype=int))
    assert sorted(stays)[-2:] == [1600, 2400]
    assert stays[-1] == 2400
    assert all(np.abs(a - b).sum() > 0 for a, b in zip(shown[:-1], shown[1:], strict=True))
    assert tuple(shown[0][1, 1]) == (255, 255, 255)
    assert file.stat().st_size * 101 / 6 < 3.5e6
    with pytest.raises(ValueError, match="frames: expected a whole number of at least 2, got 1"):
        plots.formation_animation(before, file, frames=1)


def test_closest_pairs_of_a_large_formation_are_drawn():
    """300 craft in rows 100 m apart, two of which swap places: these and their neighbours have tracks."""
    count = 300
    states = np.zeros((count, 6))
    states[:, 1] = 100.0 * np.arange(count)
    states[7, 4], states[8, 4] = 100.0 / END, -100.0 / END
    states[8, 0] = 3.0
    paths = DEEP.coast(states, END)
    for zone, told in ((cf.Sphere(10.0), "1 in conflict"), (None, "all paths")):
        figure = plots.formation_paths(paths, paths, zone=zone)
        axes = figure.axes[0]
        assert told in figure.get_suptitle()
        if zone is not None:
            assert "closest 7 and 8" in axes.get_title(loc="left")
            assert 2 <= len(marks(axes, "start")) <= 20
        assert any("of the others" in text.get_text() for one in figure.legends for text in one.get_texts())
        assert bool(lines(axes, CONFLICT)) == (zone is not None)
