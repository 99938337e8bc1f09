"""Pictures of a formation: what they draw is what straight lines, samples and the search say."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PatchCollection, PathCollection
from matplotlib.colors import to_rgba
from PIL import Image

import closeform as cf
from closeform import plots
from closeform.palette import COLOURS, CONFLICT
from closeform.plots.flying import Flying
from closeform.plots.views import OBLIQUE, ORBITAL

DEEP = cf.Orbit(0.0)
ORBIT = cf.Orbit.circular(500e3)
N = ORBIT.mean_motion
END = 1000.0
BALL = cf.Sphere(15.0)
UNITS = ((1.0, "N"), (1e-3, "mN"), (1e-6, "µN"), (1e-9, "nN"))
DIRECTIONS = ["radial", "along-track", "cross-track"]
PLANES = {"radial": [1, 0], "cross-track": [1, 2]}  # components to the right and upwards


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


def sampled_conflicts(paths, zone, times):
    """(N, T): which craft is within the zone of any other at which time."""
    where = np.stack([paths[k].position(times) for k in range(len(paths))])
    norms = zone.norm(where[:, None] - where)
    norms[np.arange(len(where)), np.arange(len(where))] = np.inf
    return (norms <= 1.0).any(axis=1), norms.min(axis=2)


# formation_paths


def test_tracks_in_the_planes_are_the_paths():
    before, after, ring, final = swap(5)
    figure = plots.formation_paths(before, after)
    assert [a.get_ylabel().split(" [")[0] for a in figure.axes] == [
        "radial",
        "cross-track",
        "radial",
        "",
        "",
        "",
    ]
    assert [a.get_xlabel().split(" [")[0] for a in figure.axes] == ["", "along-track", "cross-track"] * 2
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


def test_both_sides_have_one_scale_in_all_planes():
    before, after, _, _ = swap(5)
    figure = plots.formation_paths(before, after, zone=BALL)
    inches = figure.get_size_inches()
    scales = set()
    for axes in figure.axes:
        box = axes.get_position()
        scales.add(round(np.ptp(axes.get_xlim()) / box.width / inches[0], 6))
        scales.add(round(np.ptp(axes.get_ylim()) / box.height / inches[1], 6))
    assert len(scales) == 1
    assert figure.axes[0].get_xlim() == figure.axes[3].get_xlim()


def test_oblique_views_show_all_in_deep_space_at_one_scale():
    states = straight(12)
    paths = DEEP.coast(states, END)
    figure = plots.formation_paths(paths, DEEP.coast(straight(12, seed=6), END), zone=BALL)
    assert len(figure.axes) == 2
    assert figure.axes[0].get_xlim() == figure.axes[1].get_xlim()
    assert np.allclose(OBLIQUE.basis @ OBLIQUE.basis.T, np.eye(3))
    right, up = OBLIQUE.basis[:2]
    assert up[2] < -0.8  # the sun is up, as in pictures of searches
    last = states[:, :3] + END * states[:, 3:]
    assert np.allclose(marks(figure.axes[0], "end"), np.stack([last @ right, last @ up], axis=1))
    for axes in figure.axes:
        for point in marks(axes, "start"):
            assert axes.get_xlim()[0] < point[0] < axes.get_xlim()[1]
            assert axes.get_ylim()[0] < point[1] < axes.get_ylim()[1]


def test_nearer_tracks_pass_over_farther_ones():
    toward = OBLIQUE.basis[2]
    across = OBLIQUE.basis[0]
    states = np.zeros(
        (2, 6)
    )  # they cross after 250 s, craft 0 nearer by 10 m then, and farther from 300 s on
    states[0, :3], states[0, 3:] = -50 * across + 60 * toward, 0.2 * across - 0.2 * toward
    states[1, :3], states[1, 3:] = -50 * OBLIQUE.basis[1], 0.2 * OBLIQUE.basis[1]
    paths = DEEP.coast(states, END)
    axes = plots.formation_paths(paths, paths).axes[0]
    collection = next(c for c in axes.collections if isinstance(c, LineCollection) and len(c.get_segments()))
    looks = [tuple(look) for look in collection.get_colors()]
    middle = [k for k, piece in enumerate(collection.get_segments()) if np.abs(piece).min(axis=0).max() < 3]
    on_top = [looks[k] for k in middle if looks[k] != (1, 1, 1, 1)]
    assert on_top[-1] == to_rgba(COLOURS[0])
    assert on_top[0] == to_rgba(COLOURS[1])


def test_stretches_in_conflict_end_where_straight_lines_meet_the_zone():
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


@pytest.mark.parametrize("count", [2, 5, 12, 50])
def test_headline_counts_pairs_in_conflict(count):
    states, others = straight(count), straight(count, seed=77, miss=200.0)
    before, after = DEEP.coast(states, END), DEEP.coast(others, END)
    figure = plots.formation_paths(before, after, zone=BALL)
    counts = [len(meetings(one)[1]) for one in (states, others)]
    title = figure.get_suptitle()
    assert title.startswith(f"{count} craft, {count * (count - 1) // 2} pair")
    said = [str(hits) if hits else "none" for hits in counts]
    ending = (
        f"{said[0]} in conflict before, {said[1]} after" if any(counts) else "paths clear before and after"
    )
    assert title.endswith(ending)
    figure.draw_without_rendering()


def test_the_zone_is_drawn_where_the_closest_pair_is():
    states = straight(5, seed=11)
    least, _ = meetings(states)
    i, j = sorted(np.unravel_index(np.nanargmin(least), least.shape))
    _, time, _ = meeting(states, i, j)
    slow = min(i, j, key=lambda k: np.linalg.norm(states[k, 3:]))  # its track is shorter
    paths = DEEP.coast(states, END)
    figure = plots.formation_paths(paths, paths, zone=BALL)
    (disc,) = figure.axes[0].patches[-1:] or [None]
    outline = next(p.get_xy() for p in figure.axes[0].patches if len(p.get_path().vertices) > 100)
    centre = OBLIQUE(states[slow, :3] + time * states[slow, 3:])
    assert np.allclose(np.linalg.norm(outline - centre, axis=1), 15.0)
    assert disc is not None
    words = [text.get_text() for text in figure.axes[0].texts]
    assert f"closest {i} and {j}, {least[i, j]:.2f} × zone" in words


def test_obstacles_are_drawn_and_conflicts_with_them_marked():
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


def test_names_stand_where_they_fit_and_nowhere_else():
    for count, most in ((5, 5), (12, 12), (50, 0)):
        states = straight(count, seed=2)
        paths = DEEP.coast(states, END)
        names = [f"Formation Flyer {k:02d}" for k in range(count)]
        figure = plots.formation_paths(paths, paths, names, BALL)
        shown = [text for text in figure.axes[0].texts if text.get_text().startswith("Format")]
        assert {text.get_text() for text in shown} <= {f"Format…yer {k:02d}" for k in range(count)}
        assert len(shown) <= most
        assert len(shown) >= 0.5 * most
        boxes = [text.get_window_extent() for text in shown]
        assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
        words = [text.get_window_extent() for text in figure.axes[0].texts if text not in shown]
        assert len(words) > 4  # the title, which pair is closest, the scale and the axes' names
        assert not any(a.overlaps(b) for a in boxes for b in words)


def test_names_leave_the_tracks_free():
    """Five tracks that lead to the upper right, where names stand first: they stand elsewhere."""
    along, up, _ = OBLIQUE.basis
    states = np.zeros((5, 6))
    states[:, :3] = np.outer(-40.0 * np.arange(5), up)
    states[:, 3:] = 0.2 * along + 0.16 * up
    figure = plots.formation_paths(DEEP.coast(states, END), DEEP.coast(states, END), list("ABCDE"))
    figure.draw_without_rendering()
    axes = figure.axes[0]
    tracks = states[:, None, :3] + np.linspace(0.0, END, 2000)[:, None] * states[:, None, 3:]
    seen = axes.transData.transform(OBLIQUE(tracks.reshape(-1, 3)))
    names = [text for text in axes.texts if text.get_text() in list("ABCDE")]
    assert len(names) == 5
    for text in names:
        box = text.get_window_extent()
        assert not ((seen > box.min) & (seen < box.max)).all(axis=1).any()


def test_craft_fly_at_their_own_times():
    states = straight(4)
    paths = cf.stack([DEEP.coast(state, 200.0 + 100 * k, 300.0 * k) for k, state in enumerate(states)])
    later = cf.stack([DEEP.coast(state, 900.0) for state in states])
    figure = plots.formation_paths(paths, later, zone=BALL)
    ends = states[:, :3] + (200.0 + 100 * np.arange(4))[:, None] * states[:, 3:]
    assert np.allclose(marks(figure.axes[0], "end"), OBLIQUE(ends))


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


def test_matrix_holds_the_least_ratios_of_straight_lines():
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
    frames = next(c for c in axes.collections if isinstance(c, PatchCollection) and len(c.get_edgecolor()))
    centres = {tuple(np.round(p.vertices[:4].mean(axis=0)).astype(int)) for p in frames.get_paths()}
    assert centres == {pair[::step] for pair in stays for step in (1, -1)}
    i, j = min(zip(*np.nonzero(least == np.nanmin(least)), strict=True))
    verdict = f"{len(stays)} of 66 pairs in conflict; closest {i} and {j}, {least[i, j]:.2f} × zone"
    assert figure.get_suptitle() == verdict


def test_one_is_the_border_of_two_colours():
    states = straight(5)
    image = plots.ratio_matrix(DEEP.coast(states, END), BALL).axes[0].images[0]
    top = image.norm.vmax
    assert np.allclose(image.norm([0.0, 0.5, 1.0, np.sqrt(top), top]), [0, 0.25, 0.5, 0.75, 1])
    below, above = image.to_rgba(np.linspace(0, 0.999, 20)), image.to_rgba(np.linspace(1.001, top, 20))
    assert (below[:, 0] > below[:, 2] + 0.2).all()  # orange
    assert (above[:, 2] > above[:, 0]).all()  # blue


def test_many_craft_have_crosses_and_no_numbers():
    states = straight(20)
    _, stays = meetings(states)
    axes = plots.ratio_matrix(DEEP.coast(states, END), BALL, [f"C{k}" for k in range(20)]).axes[0]
    crosses = next(line for line in axes.get_lines() if line.get_marker() == "x")
    cells = set(zip(crosses.get_ydata().tolist(), crosses.get_xdata().tolist(), strict=True))
    assert cells == {pair[::step] for pair in stays for step in (1, -1)}
    assert not axes.texts
    assert [label.get_text() for label in axes.get_yticklabels()] == [f"C{k}" for k in range(20)]


def test_each_pair_has_the_zone_that_holds_for_it():
    states = straight(4)
    least, _ = meetings(states)
    wide = cf.Sphere(30.0)
    groups = kept(4, {(0, 1): BALL, (2, 3): BALL, (1, 2): wide})
    drawn = shown_matrix(plots.ratio_matrix(DEEP.coast(states, END), groups))
    assert drawn[0, 1] == pytest.approx(least[0, 1])
    assert drawn[3, 2] == pytest.approx(least[2, 3])
    assert drawn[2, 1] == pytest.approx(least[1, 2] / 2)
    assert np.isnan(drawn[[0, 0, 1], [2, 3, 3]]).all()


def test_of_the_zones_of_each_craft_the_larger_holds():
    states = straight(4)
    least, _ = meetings(states)
    drawn = shown_matrix(plots.ratio_matrix(DEEP.coast(states, END), [BALL, cf.Sphere(30.0), None, None]))
    factor = np.array([[np.nan, 2, 1, 1], [2, np.nan, 2, 2], [1, 2, np.nan, np.nan], [1, 2, np.nan, np.nan]])
    assert np.allclose(drawn, least / factor, equal_nan=True)


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


def test_a_ratio_in_conflict_never_reads_as_one():
    states = np.array([[0.0, 0, 0, 0, 0, 0], [14.999, 0, 0, 0, 0, 0], [30.0, 0, 0, 0, 0, 0]])
    figure = plots.ratio_matrix(DEEP.coast(states, END), BALL)
    texts = {t.get_position(): t.get_text() for t in figure.axes[0].texts}
    assert texts[0, 1] == "<1"
    assert texts[1, 2] == "1.00"  # 15.001 m
    assert figure.get_suptitle() == "1 of 3 pairs in conflict; closest 0 and 1, <1 × zone"


def test_identical_paths_meet_all_the_time():
    same = DEEP.coast(np.ones((4, 6)), END)
    assert np.nanmax(shown_matrix(plots.ratio_matrix(same, BALL))) == 0.0
    figure = plots.closest_pairs(same, BALL)
    curves = [line for line in figure.axes[0].get_lines() if " and " in str(line.get_label())]
    assert all(not np.any(curve.get_ydata()) for curve in curves)
    assert figure.axes[0].get_ylim()[0] < 0.0  # the lines are not hidden by the frame
    figure.draw_without_rendering()


# closest_pairs


def pair_lines(figure):
    """Curves by their labels."""
    return {
        str(line.get_label()): line for line in figure.axes[0].get_lines() if " and " in str(line.get_label())
    }


def test_the_closest_pairs_come_first_and_follow_their_distance():
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


def test_wide_stretches_are_the_stays_in_the_zone():
    states = straight(6)
    _, stays = meetings(states)
    figure = plots.closest_pairs(DEEP.coast(states, END), BALL, count=15)
    wide = [line for line in figure.axes[0].get_lines() if line.get_color() == CONFLICT]
    drawn = []
    for line in wide:
        times = np.asarray(line.get_xdata())[np.isfinite(line.get_ydata())] * 60
        drawn.append((times.min(), times.max()))
    assert np.allclose(sorted(drawn), sorted(stays.values()), atol=1e-6)


def test_each_pair_is_drawn_over_its_common_time():
    before, _, _, _ = swap(4)
    parts = cf.stack([ORBIT.coast(before[k].state(0.0), 1000.0, 300.0 * k) for k in range(4)])
    curves = pair_lines(plots.closest_pairs(parts, cf.Ellipsoid([15.0, 30.0, 15.0]), list("ABCD"), count=6))
    assert len(curves) == 6
    for label, line in curves.items():
        i, j = "ABCD".index(label[0]), "ABCD".index(label[6])
        assert np.asarray(line.get_xdata())[[0, -1]] * 60 == pytest.approx([300.0 * j, 1000.0 + 300.0 * i])


def test_the_axis_is_linear_near_the_zone_and_logarithmic_far_out():
    near = DEEP.coast([[0.0, 0, 0, 0, 0, 0], [20.0, 0, 0, 0.02, 0, 0]], END)
    far = DEEP.coast([[0.0, 0, 0, 0, 0, 0], [20.0, 0, 0, 2.0, 0, 0]], END)
    for paths, kind in ((near, "linear"), (far, "symlog")):
        figure = plots.closest_pairs(paths, BALL)
        axes = figure.axes[0]
        assert axes.get_yscale() == kind
        assert axes.get_ylim()[1] > max(next(iter(pair_lines(figure).values())).get_ydata())
        figure.draw_without_rendering()


@pytest.mark.parametrize("draw", [plots.ratio_matrix, plots.closest_pairs])
def test_an_orbit_of_two_craft(draw):
    before, _, _, _ = swap(2)
    zone = cf.Ellipsoid([15.0, 30.0, 15.0])
    times = np.linspace(before.start[0], before.end[0], 40001)
    least = zone.norm(before[0].position(times) - before[1].position(times)).min()
    figure = draw(before, zone, ["Mango", "Tango"])
    assert figure.get_suptitle() == f"Mango and Tango: clear, {least:.2f} × zone"
    figure.draw_without_rendering()


SOME = DEEP.coast(straight(3), END)
APART = cf.stack([DEEP.coast(np.zeros(6), 9.0), DEEP.coast(np.zeros(6), 9.0, 20.0)])


@pytest.mark.parametrize(
    ("call", "message"),
    [
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
        (lambda: plots.ratio_matrix(SOME, ()), "zones: no two craft have a zone"),
        (lambda: plots.ratio_matrix(SOME, kept(4, {(0, 3): BALL})), "zones: zones of 4 craft for 3 paths"),
        (lambda: plots.ratio_matrix(SOME, [BALL] * 2), "zones: 2 zones for 3 craft"),
        (
            lambda: plots.ratio_matrix(SOME, [(BALL, [[0, 1]]), BALL]),
            "zones: expected a zone, one for each craft",
        ),
        (
            lambda: plots.ratio_matrix(SOME, [cf.Box([1, 9, 1]), cf.Box([9, 1, 1]), None]),
            "craft 0 and craft 1: neither zone holds the other",
        ),
        (lambda: plots.closest_pairs(SOME, BALL, count=0), "count: expected a whole number from 1 on, got 0"),
        (lambda: plots.closest_pairs(APART, BALL), "paths: no two craft that have a zone share a time"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_pairs_that_touch_are_counted():
    """Three craft in a row 15 m apart stay so; the outer two are 30 m from each other."""
    states = np.zeros((3, 6))
    states[:, 1] = 15.0 * (1.0 + 1e-7) * np.arange(3)
    figure = plots.ratio_matrix(DEEP.coast(states, END), cf.Sphere(15.0))
    assert figure.get_suptitle() == "All 3 pairs clear; 2 of them touch, 1.00 × zone"
    states[2, 1] *= 1.1
    figure = plots.closest_pairs(DEEP.coast(states, END), cf.Sphere(15.0))
    assert figure.get_suptitle() == "All 3 pairs clear; closest 0 and 1, 1.00 × zone"


# who stays, who merges, what is pushed


TARGET = ORBIT.coast(np.zeros(6), ORBIT.period)
INSPECTOR = ORBIT.coast([-50.0, 0, 0, 0, 100.0 * N, 50.0 * N], ORBIT.period)
APPROACH = ORBIT.transfer([0, 300.0, 0, 0, 0, 0], [-50.0, 0, 0, 0, 100.0 * N, 50.0 * N], ORBIT.period)


def zone_centre(axes):
    """The middle of the filled zone."""
    outline = next(p.get_xy() for p in axes.patches if len(p.get_path().vertices) > 100)
    return (outline.max(axis=0) + outline.min(axis=0)) / 2


@pytest.mark.parametrize("mover", [APPROACH, INSPECTOR], ids=["burns", "has the longer track"])
@pytest.mark.parametrize("turn", [1, -1])
def test_the_zone_is_around_the_craft_that_stays(mover, turn):
    paths = cf.stack([TARGET, mover][::turn])
    figure = plots.formation_paths(paths, paths, ["Target", "Inspector"][::turn], cf.Sphere(20.0))
    for axes in figure.axes[:3]:
        assert zone_centre(axes) == pytest.approx([0.0, 0.0], abs=0.1)
    alone = plots.formation_paths(paths[:1], paths[:1], zone=cf.Sphere(20.0), obstacles=paths[1])
    one = paths[1]  # an obstacle stays, whatever it does
    when = cf.closest_approach(paths[0], one, cf.Sphere(20.0)).time
    assert zone_centre(alone.axes[0]) == pytest.approx(one.position(when)[[1, 0]], abs=0.1)


def test_one_stage_in_an_orbit_has_three_planes_and_a_view_in_space():
    paths = cf.stack([TARGET, INSPECTOR])
    figure = plots.formation_paths(paths, paths, zone=cf.Sphere(20.0))
    words = {(axes.get_xlabel().split(" [")[0], axes.get_ylabel().split(" [")[0]) for axes in figure.axes}
    assert words == {("", "radial"), ("along-track", "cross-track"), ("cross-track", ""), ("", "")}
    circle = lines(figure.axes[2], COLOURS[1])[0]  # across the flight the inspector flies a circle
    assert np.allclose(np.linalg.norm(circle, axis=1), 50.0, atol=1e-6)


@pytest.mark.parametrize("picture", ["formation_paths", "before_after", "two_ways"])
def test_arrows_point_the_way_that_craft_fly(picture):
    """Each lies on its track, and its tip comes later on it than its middle."""
    before, after, _, _ = swap(4, 0.3 * ORBIT.period)
    figure = {
        "formation_paths": lambda: plots.formation_paths(after, after),
        "before_after": lambda: plots.before_after(before[0], after[0], list(before[1:3]), BALL),
        "two_ways": lambda: plots.two_ways(before[0], before[2], BALL),
    }[picture]()
    flown = [path for paths in (before, after) for path in paths]
    times = np.linspace(0.0, before[0].end, 3001)
    tracks = [path.position(times) for path in flown]
    count = 0
    for axes in figure.axes:
        labels = axes.get_xlabel().split(" [")[0], axes.get_ylabel().split(" [")[0]
        if not set(labels) <= set(DIRECTIONS):
            continue
        shown = [(track[:, [DIRECTIONS.index(label) for label in labels]]) for track in tracks]
        for arrows in axes.collections:
            if not isinstance(arrows, PathCollection) or len(arrows.get_paths()[0].vertices) != 5:
                continue
            for place, head in zip(arrows.get_offsets(), arrows.get_paths(), strict=True):
                near = [np.linalg.norm(track - place, axis=1) for track in shown]
                least = [one.min() for one in near]
                assert min(least) < 1.0  # [m], of tracks of 200 m
                on = shown[int(np.argmin(least))]
                k = min(int(np.argmin(near[int(np.argmin(least))])), len(times) - 2)
                way = on[k + 1] - on[k]
                assert head.vertices[0] @ way > 0.99 * np.linalg.norm(way)  # the tip, from the middle
                count += 1
    assert count >= 2


def test_craft_that_stay_have_no_arrow():
    still = DEEP.coast(np.outer([0.0, 50.0], np.eye(6)[0]), END)
    found = [
        path
        for axes in plots.formation_paths(still, still).axes
        for one in axes.collections
        if isinstance(one, PathCollection)
        for path in one.get_paths()
    ]
    assert found
    assert all(len(path.vertices) != 5 for path in found)


def test_tracks_that_merge_do_not_cut_each_other():
    """Seven craft on one circle: each plane has whole lines, no white among them; in space one is on top."""
    ring = 120 * np.array(
        [
            [s / 2, c, s, N * c / 2, -N * s, N * c]
            for s, c in ((np.sin(a), np.cos(a)) for a in np.arange(7) * 0.9)
        ]
    )
    paths = ORBIT.coast(ring, ORBIT.period)
    figure = plots.formation_paths(paths, paths)
    for axes in figure.axes[:3]:
        for k in range(7):
            assert len(lines(axes, COLOURS[k])) == 1
    for axes in figure.axes:
        assert lines(axes, "white") == []
    (woven,) = [
        c for c in figure.axes[3].collections if isinstance(c, LineCollection) and len(c.get_segments()) > 7
    ]
    on_top = []
    for point in ORBITAL(paths[0].position(np.linspace(0.0, ORBIT.period, 300))):
        over = [
            k
            for k, piece in enumerate(woven.get_segments())
            if np.linalg.norm(piece - point, axis=1).min() < 1.0
        ]
        on_top.append(tuple(woven.get_colors()[over[-1]]) == to_rgba(COLOURS[6]))
    assert np.mean(on_top) > 0.9  # all but within 1 m of the ends of layers, of which there are two times 40


def test_thrust_of_all_is_the_norm_in_newtons():
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
    assert len(axes.get_lines()) == 4  # limits that differ are in a panel of shares
    shares, has = figure.axes[1], [0, 2, 3]
    assert shares.get_ylabel() == "share of own limit [%]"
    for line, k in zip(shares.get_lines()[:3], has, strict=True):
        times = np.asarray(line.get_xdata()) * 60.0
        used = np.linalg.norm(before[k].thrust(times), axis=1) / limits[k]
        assert np.allclose(np.asarray(line.get_ydata()), 100.0 * used, rtol=1e-6)
    assert [float(line.get_ydata()[0]) for line in shares.get_lines()[3:]] == [100.0]
    over = sum(peak * unit > mass * limit for peak, mass, limit in zip(peaks, masses, limits, strict=True))
    most = "ABCD"[int(np.argmax(peaks))]
    assert figure.get_suptitle().startswith(f"{most} thrusts most: ")
    assert figure.get_suptitle().endswith(
        f"{over} of 4 craft above their limit" if over else "all within their limits"
    )
    plain = plots.formation_thrust(before)
    assert plain.axes[0].get_ylabel().endswith("m/s²]")
    still = plots.formation_thrust(DEEP.coast(straight(3), END))
    assert still.get_suptitle() == "Nobody thrusts"


@pytest.mark.parametrize(
    ("shares", "words"),
    [
        ([0.5, 1.2, 1e-3, 1e-9], ["the limit of each"]),  # of the limit of each
        ([0.01, 0.02, 1e-3, 1e-9], ["the limit of each, far above"]),
        ([0.8, None, None, None], ["limit {} of A"]),
        ([1e-3] * 4, ["limit {}, far above"]),
    ],
)
def test_limits_neither_flatten_the_curves_nor_fall_below_the_axis(shares, words):
    before, _, _, _ = swap(4, 0.3 * ORBIT.period)
    peaks = np.array([path.peak_thrust for path in before])
    masses = np.full(4, 2.0) if shares[0] != shares[-1] else 1e-3 / peaks  # the same limit in newtons
    limits = [peak / share if share else np.inf for peak, share in zip(peaks, shares, strict=True)]
    figure = plots.formation_thrust(before, list("ABCD"), limits, masses)
    newtons = limits[0] * masses[0]
    own = next(f"{newtons / size:.4g} {name}" for size, name in UNITS if newtons >= 0.1 * size)
    assert [text.get_text() for axes in figure.axes for text in axes.texts] == [
        said.format(own) for said in words
    ]
    for axes in figure.axes:
        low, high = axes.get_ylim()
        assert low == 0.0
        assert max(max(line.get_ydata()) for line in axes.get_lines()[:4]) > 0.3 * high
        for text in axes.texts:
            height = text.xy[1]
            assert height == 1.0 if text.xycoords == "axes fraction" else low < height < high


def test_a_legend_has_one_unit_of_delta_v():
    slow = ORBIT.transfer(np.zeros(6), [0, 1.0, 0, 0, 0, 0], ORBIT.period)
    fast = ORBIT.transfer(np.zeros(6), [0, 9000.0, 0, 0, 0, 0], ORBIT.period)
    assert slow.delta_v < 0.1 < fast.delta_v
    words = [text.get_text() for text in plots.thrust([slow, fast], ["a", "b"]).legends[0].get_texts()]
    assert [word.split("Δv ")[1].split(",")[0].split(" ")[1] for word in words] == ["m/s", "m/s"]
    assert [float(word.split("Δv ")[1].split(" ")[0]) for word in words] == pytest.approx(
        [slow.delta_v, fast.delta_v], rel=1e-3
    )


# formation_animation


def test_the_film_shows_who_is_where_and_closest():
    states = straight(5)
    scene = Flying(DEEP.coast(states, END), list("ABCDE"), BALL, 21)
    least, stays = meetings(states)
    closest = np.unravel_index(np.nanargmin(least), least.shape)
    assert scene.closest == pytest.approx(meeting(states, *sorted(closest))[1], abs=1e-3)
    (view,) = scene.views
    for time in scene.times:
        scene.show(time)
        where = states[:, :3] + time * states[:, 3:]
        assert np.allclose(view.dots.get_offsets(), OBLIQUE(where))
        gaps = np.linalg.norm(where[:, None] - where, axis=2) + 1e9 * np.eye(5)
        i, j = sorted(np.unravel_index(gaps.argmin(), gaps.shape))
        assert scene.story.get_text().startswith(f"closest now: {'ABCDE'[i]} and {'ABCDE'[j]}, ")
        assert float(scene.story.get_text().split(", ")[2][:-2]) == pytest.approx(gaps.min(), rel=1e-3)
        hit = [any(k in pair and a <= time <= b for pair, (a, b) in stays.items()) for k in range(5)]
        red = [np.allclose(edge, to_rgba(CONFLICT)) for edge in view.dots.get_edgecolors()]
        assert red == hit
        for trail, end in zip(view.trails.get_segments(), where, strict=False):
            assert not len(trail) or np.allclose(trail[-1], OBLIQUE(end))


def test_a_film_of_an_orbit(tmp_path):
    before, _, _, _ = swap(12)
    told = []
    file = tmp_path / "flight.gif"
    plots.formation_animation(before, file, zone=BALL, frames=12, progress=lambda *done: told.append(done))
    with Image.open(file) as film:
        assert film.n_frames == len(told) == 13  # the closest approach has its own
        stays, shown = [], []
        for k in range(film.n_frames):
            film.seek(k)
            stays.append(film.info["duration"])
            shown.append(np.asarray(film.convert("RGB"), dtype=int))
    assert told[-1] == (13, 13)
    assert sorted(stays)[-2:] == [1600, 2400]
    assert stays[-1] == 2400
    assert all(np.abs(a - b).sum() > 0 for a, b in zip(shown[:-1], shown[1:], strict=True))
    assert tuple(shown[0][1, 1]) == (255, 255, 255)
    assert file.stat().st_size * 101 / 13 < 3.5e6
    with pytest.raises(ValueError, match="frames: expected a whole number from 2 on, got 1"):
        plots.formation_animation(before, file, frames=1)


# What a long coast, a plan that changes nothing and on-off thrusters look like


def swaying(count, orbits):
    """Craft on relative orbits of different phases, whose distances sway with the orbit."""
    phases = 2.4 * np.arange(count)
    size = 60.0 + 15.0 * np.arange(count)
    x, y = 0.5 * size * np.sin(phases), size * np.cos(phases)
    states = np.stack([x, y, size * np.sin(phases), 0.5 * y * N, -2 * x * N, y * N], axis=1)
    return ORBIT.coast(states, orbits * ORBIT.period)


def test_pairs_over_many_orbits_have_a_panel_each():
    """The curve, the stays and the least of each pair are its own; names are above them."""
    paths = swaying(6, 10)
    figure = plots.closest_pairs(paths, BALL, list("ABCDEF"), count=8)
    assert len(figure.axes) == 8
    assert not figure.legends
    times = np.linspace(0.0, 10 * ORBIT.period, 20001)
    where = paths.position(times)
    apart = {
        (i, j): np.linalg.norm(where[i] - where[j], axis=1) / 15.0 for i in range(6) for j in range(i + 1, 6)
    }
    nearest = sorted(apart, key=lambda pair: round(apart[pair].min(), 4))[:8]
    shown = []
    for axes in figure.axes[:8]:
        words = axes.texts[0].get_text()
        pair = tuple("ABCDEF".index(name) for name in words.split("\n")[0].split(" and "))
        shown.append(pair)
        line = max(axes.lines, key=lambda one: len(one.get_xdata()))
        drawn = np.interp(times / ORBIT.period, line.get_xdata(), line.get_ydata())
        assert drawn == pytest.approx(apart[pair], rel=2e-2, abs=0.02)
        inside = apart[pair] <= 1.0
        entries = int(np.count_nonzero(np.diff(inside.astype(int), prepend=0) > 0))
        assert words.split("\n")[2:] == [f"{entries} conflict{'s' * int(entries > 1)}"] * int(entries > 0)
        dots = [one for one in axes.lines if one.get_marker() == "o"]
        assert dots[0].get_ydata()[0] == pytest.approx(apart[pair].min(), abs=1e-3)
    assert set(shown) == set(nearest)


def test_a_hundred_orbits_are_a_band():
    paths = swaying(3, 100)
    figure = plots.closest_pairs(paths, BALL)
    times = np.linspace(0.0, 100 * ORBIT.period, 40001)
    for axes in figure.axes[:3]:
        one, other = (int(name) for name in axes.texts[0].get_text().split("\n")[0].split(" and "))
        apart = np.linalg.norm(paths[one].position(times) - paths[other].position(times), axis=1) / 15.0
        line = max(axes.lines, key=lambda line: len(line.get_xdata()))
        assert len(line.get_xdata()) < 110
        assert line.get_ydata().min() == pytest.approx(apart.min(), rel=0.05)


def test_few_curves_stay_together():
    figure = plots.closest_pairs(swaying(3, 1), BALL)
    assert len(figure.legends) == 1


def test_pictures_of_a_plan_that_changes_nothing_have_one_side():
    before, after, _, _ = swap(3)
    again = ORBIT.transfer(before.state(0.0), before.state(before.end[0]), before.end[0])
    assert again is not before
    alike = plots.formation_paths(before, again, zone=BALL)
    assert len(alike.axes) == len(plots.formation_paths(before, before, zone=BALL).axes)
    assert "before" not in alike.get_suptitle()
    assert "before" in plots.formation_paths(before, after, zone=BALL).get_suptitle()
    one = plots.before_after(before[0], again[0], [before[1]], BALL)
    assert one.get_suptitle().startswith("The path: ")


def test_several_pairs_in_conflict_are_named():
    states = straight(5, miss=2.0)
    least, stays = meetings(states)
    assert len(stays) > 2
    figure = plots.formation_paths(DEEP.coast(states, END), DEEP.coast(states, END), list("ABCDE"), BALL)
    deep = sorted(stays, key=lambda pair: least[pair])
    named = [f"{'ABCDE'[i]} and {'ABCDE'[j]}" for i, j in deep]
    assert f": {len(stays)} in conflict: {named[0]}, {named[1]}, " in figure.get_suptitle()


def test_thrust_of_on_off_thrusters_is_what_the_plan_asks_for():
    before, _, _, _ = swap(4, 0.3 * ORBIT.period)
    peak = max(path.peak_thrust for path in before)
    figure = plots.formation_thrust(before, list("ABCD"), [20 * peak] * 4, [2.0] * 4, on_off=True)
    name, fires = figure.get_suptitle().split("'s plan asks for most, ")
    assert name in "ABCD"
    newtons = {unit: size for size, unit in UNITS}
    asked, given = fires.split("; thrusters fire ")
    for words, force in ((asked, 2 * peak), (given.removesuffix(" each, on or off"), 40 * peak)):
        value, unit = words.split(" ")
        assert float(value) * newtons[unit] == pytest.approx(force, rel=1e-3)
    assert figure.axes[0].get_ylabel().startswith("planned thrust")
    with pytest.raises(ValueError, match=r"^on_off: expected True, False, or one for each of 4 craft"):
        plots.formation_thrust(before, on_off=[True])
