"""Draw the figures of the source papers that no run of closeform draws: geometry, sets, joins, lemma 2.

`examples/papers.py` saves them beside the papers' other figures. They use the drawing primitives of
closeform's own pictures.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import cos, degrees, isinf, pi, sin
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.transforms import Bbox
from numpy.typing import ArrayLike

from closeform import Gathering, Search, Sensor, lock_margins, lock_times
from closeform.arrays import Floats, finite, number, numbers, positive
from closeform.papers import regions_searched
from closeform.plots.drawing.palette import (
    AFTER,
    ALTERNATIVE,
    BEFORE,
    CONFLICT,
    FAINT,
    INK,
    OTHER,
    ZONE,
    colours,
)
from closeform.plots.drawing.space import (
    GROUP_COLOURS,
    OBLIQUE,
    ROMAN,
    SUNWARD,
    Camera,
    arrow,
    bare,
    cone,
    fill,
    ring,
    solid,
    to_sun,
)
from closeform.plots.drawing.style import DASHED, DOTTED, dress, headline, sheet
from closeform.plots.drawing.text import SMALL, TEXT, short_names, word
from closeform.plots.drawing.units import length_unit, plural, speed
from closeform.search.leg import SUN
from closeform.search.lock_statistics import phase_index, phase_labels

REGION_COLOURS = {1: AFTER, 2: ZONE, 3: ALTERNATIVE, 4: "#AA4499"}
ORIGIN, LEVEL = np.zeros(3), np.array([1.0, 1.0, 0.0])
CAMERA = Camera.around(-1.0, 0.55, -SUN, np.array([1.0, 0.0, 0.0]))
ON = 1e-6  # degrees from the cone's edge that count as on it
PIXELS = 241  # of the picture, along each side
SETS = ("lost", "knowledge set", "formation set")
JOINS = (  # H03 figure 8: what a lock between craft of two sets does
    ("a set begins", "joins the knowledge set", "burns, joins the formation set"),
    ("joins the knowledge set", "one knowledge set", "its set burns and joins"),
    ("burns, joins the formation set", "its set burns and joins", "no change"),
)


def simultaneity(sensor: Sensor, positions: ArrayLike, boresights: ArrayLike) -> Figure:
    """Plot which spacecraft of a plane lock: those that are in each other's cone, S04 and H03 figures 1.

    A full line joins two sensors that see each other, and states the angles of H03's equations 1 and 2. A
    dashed arrow points to a spacecraft that is seen but does not see, which is no lock.

    Parameters
    ----------
    positions : array_like of shape (N, 2) [m]
        Positions in the plane.
    boresights : array_like of shape (N,) [rad]
        Directions of the boresights, from the first axis to the second.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) figure 1, eqs. 1-2; S04 (Scharf, Ploen, Hadaegh and Sohl 2004)
    figure 1.
    """
    places, angles = numbers("positions", positions), numbers("boresights", boresights)
    if places.ndim != 2 or places.shape[1] != 2 or angles.shape != places.shape[:1]:
        raise ValueError(
            f"positions, boresights: expected (N, 2) and (N,), got {places.shape}, {angles.shape}"
        )
    looks = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    eyes = places + sensor.offset * looks
    span = float(np.ptp(places, axis=0).max()) or 1.0
    figure = sheet(5.5)
    axes = figure.subplots()
    reach = 0.3 * span
    for k, (place, eye, look) in enumerate(zip(places, eyes, looks, strict=True)):
        turn = angles[k] + np.linspace(-sensor.half_angle, sensor.half_angle, 61)
        rim = eye + reach * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        fill(axes, np.vstack([eye, rim]), AFTER, 0.18)
        arrow(axes, np.array([place, eye + 0.8 * reach * look]), AFTER)
        axes.plot(*place, "o", color=INK, markersize=8, zorder=5)
        word(axes, place, f"craft {k + 1}", shift=(0, -15), fontweight="bold")
    locks = 0
    for i in range(len(eyes)):
        for j in range(i):
            gap = eyes[j] - eyes[i]
            size = float(np.linalg.norm(gap)) or 1.0
            off = [
                float(np.arccos(np.clip(sign * gap @ looks[k] / size, -1.0, 1.0)))
                for k, sign in ((i, 1.0), (j, -1.0))
            ]
            sees = [angle <= sensor.half_angle and size <= sensor.range for angle in off]
            if all(sees):
                locks += 1
                axes.plot(*eyes[[i, j]].T, color=ALTERNATIVE, linewidth=2.4)
                for k, end, angle in ((i, 0.22, off[0]), (j, 0.78, off[1])):
                    word(axes, eyes[i] + end * gap, f"θ{k + 1} = {degrees(angle):.0f}°", ALTERNATIVE, (0, 10))
            elif any(sees):
                ends = eyes[[i, j]] if sees[0] else eyes[[j, i]]
                arrow(axes, ends, BEFORE, linestyle=DASHED, linewidth=1.2)
    both = np.vstack([places, eyes + reach * looks])
    size = np.ptp(both, axis=0) + 0.5 * span
    bare(axes, (both.max(axis=0) + both.min(axis=0)) / 2, *size)
    headline(
        figure,
        f"Cones of {degrees(sensor.half_angle):.4g}°: {plural(locks, 'lock')}, where both see each other",
    )
    return figure


def spacecraft(search: Search, shade: float) -> Figure:
    """Plot the shade, body axes, sensor and sun limit of a spacecraft: S04 and H03 figures 2.

    Parameters
    ----------
    shade : float [m]
        Diameter of the sun shade.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) figure 2; S04 (Scharf, Ploen, Hadaegh and Sohl 2004) figure 2.
    """
    radius = 0.5 * positive("shade", shade)
    sensor, attitude = search.sensor, search.attitude(0.0)
    camera, centre = OBLIQUE, np.zeros(3)
    figure = sheet(5.6)
    axes = figure.subplots()
    bare(axes, (0.0, 0.35 * radius), 6.6 * radius, 4.6 * radius)
    limit = 1.9 * radius * ring(SUNWARD, search.sun_limit)
    cone(axes, camera, centre, limit, ZONE, 0.14, color=ZONE)
    disc = solid(camera, radius * ring(attitude[:, 0], pi / 2.0))
    fill(axes, disc, FAINT, 0.9)
    axes.plot(*np.vstack([disc, disc[:1]]).T, color=INK, linewidth=1.2)
    eye = sensor.offset * attitude[:, 2]
    cone(axes, camera, eye, 1.5 * radius * ring(attitude[:, 2], sensor.half_angle), AFTER, 0.16, color=AFTER)
    for name, axis in zip("xyz", attitude.T, strict=True):
        arrow(axes, camera(np.array([centre, 1.8 * radius * axis])), INK)
        word(axes, camera(1.8 * radius * axis), f"body {name}", shift=(8, 0), ha="left", fontsize=TEXT)
    if sensor.offset:
        axes.plot(*camera(np.array([centre, eye])).T, color=CONFLICT, linewidth=3.0, zorder=5)
        word(axes, camera(0.5 * eye), f"offset {sensor.offset:.4g} m", CONFLICT, (0, -11))
    axes.plot(*camera(eye), "o", color=AFTER, markersize=8, zorder=6)
    word(axes, camera(eye), f"sensor, cone of {degrees(sensor.half_angle):.4g}°", AFTER, (8, -16), ha="left")
    word(axes, camera(limit[0]), f"sun limit {degrees(search.sun_limit):.4g}°", BEFORE, (-40, 0), ha="right")
    to_sun(axes, camera, 2.0 * radius * SUNWARD, 0.5 * radius)
    headline(figure, f"Spacecraft with a shade of {shade:.4g} m: body x at the sun, body z the boresight")
    return figure


def near_field(search: Search) -> Figure:
    """Plot the region that one craft's own cone never covers, along the sun line: H03 figure 6.

    The axes have different scales. The dashed lines are the rims of the cone at its highest tips.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) figure 6; docs/theory.md (16).
    """
    length = search.near_field
    if not 0.0 < length < np.inf:
        why = "unbounded; increase the tip angle" if isinf(length) else "empty; give the sensor an offset"
        raise ValueError(f"search: its near field is {why}")
    height = length * np.linspace(-1.0, 1.0, 801)
    width = search.near_field_radius(height)
    figure = sheet(4.2)
    axes = figure.subplots()
    dress(axes)
    axes.fill_between(height, -width, width, color=ZONE, alpha=0.45, linewidth=0.0)
    offset, tip, half = search.sensor.offset, search.tip_angle, search.sensor.half_angle
    for up in (-1.0, 1.0):
        for side in (-1.0, 1.0):
            eye = offset * np.array([up * sin(tip), side * cos(tip)])
            rim = eye + 1.3 * length * np.array([up * sin(tip + half), side * cos(tip + half)])
            axes.plot(*np.array([eye, rim]).T, color=AFTER, linestyle=DASHED, linewidth=1.0)
            axes.plot(*eye, "o", color=AFTER, markersize=5)
    axes.plot([0.0, 0.0], [-offset, offset], color=INK, linewidth=4.0, solid_capstyle="butt")
    word(axes, (0.0, 0.0), "shade", shift=(20, 0))
    axes.set(xlim=(-1.1 * length, 1.1 * length), ylim=(-1.5 * offset, 1.5 * offset))
    axes.set(xlabel="along the sun line [m]", ylabel="distance from it [m]")
    headline(
        figure,
        f"Near field: {width.max():.3g} m from the sun line at most, tapering to zero at {length:.3g} m",
    )
    return figure


def sets(gathering: Gathering, time: float, names: Sequence[str] | None = None) -> Figure:
    """Plot the sets of a gathering at a time with their velocities: H03 figure 7.

    Arrows are velocities relative to the formation set, or to the mean of all before there is one. Spacecraft
    of the formation set have none; those of a knowledge set keep their own.

    Parameters
    ----------
    time : float [s]
        Time from the start of the search, up to the end of the gathering.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) figure 7.
    """
    when = number("time", time)
    if not 0.0 <= when <= gathering.duration:
        raise ValueError(f"time: must be from 0 to {gathering.duration:g} s, got {when:g}")
    called = short_names(names, len(gathering.groups))
    events = [event.time for event in gathering.events]
    labels = gathering.history[np.searchsorted(events, when, side="right")]
    places, speeds = gathering.paths.position(when), gathering.paths.velocity(when)
    speeds = speeds - (speeds[labels == 0] if (labels == 0).any() else speeds).mean(axis=0)
    span = float(np.ptp(places, axis=0).max())
    fastest = float(np.linalg.norm(speeds, axis=1).max())
    points, ways = OBLIQUE(places), OBLIQUE(speeds) * (0.3 * span / (fastest or 1.0))
    figure = sheet(5.5)
    axes = figure.subplots()
    for k, (point, way) in enumerate(zip(points, ways, strict=True)):
        colour = _colour(labels[k])
        if np.linalg.norm(speeds[k]) > 1e-9 * (fastest or 1.0):
            arrow(axes, np.array([point, point + way]), colour)
        axes.plot(*point, "o", color=colour, markeredgecolor=INK, markersize=11, zorder=5)
        side = 1 if point[0] >= points[labels == labels[k], 0].mean() else -1
        word(axes, point, called[k], shift=(26 * side, 0))
        for other in range(k):
            if labels[k] == labels[other] >= 0:
                style = "-" if labels[k] == 0 else DOTTED
                axes.plot(*points[[k, other]].T, color=colour, linestyle=style, linewidth=1.2, zorder=1)
    for label in sorted(set(labels.tolist())):
        name = {-1: "lost", 0: "formation set: one velocity"}.get(label, f"knowledge set {label}: coasts")
        axes.plot([], [], "o", color=_colour(label), markeredgecolor=INK, label=name)
    axes.legend(loc="lower right", fontsize=SMALL, frameon=False)
    both = np.vstack([points, points + ways])
    low, high = both.min(axis=0), both.max(axis=0)
    bare(axes, (low + high) / 2, *(1.15 * (high - low) + 0.25 * span))
    headline(figure, f"Sets at {when:.1f} s; the longest arrow is {speed(fastest)}")
    return figure


def _colour(label: int) -> str:
    """Return the colour of a set by its label."""
    return {-1: OTHER, 0: AFTER}.get(int(label), ZONE)


def lock_map(search: Search, position: ArrayLike, velocity: ArrayLike, reach: float) -> Figure:
    """Plot the phase of the first lock for initial positions around a given one, at the same velocity.

    The positions differ along x and y by up to `reach`. Within the circle `lock_margins` proves the same
    outcome. S04 asks whether the pairs that need the second mOPS have measure zero.

    Parameters
    ----------
    position : array_like of shape (3,) [m]
        Position of B relative to A at the start of the search, in the inertial frame.
    velocity : array_like of shape (3,) [m/s]
        Velocity of B relative to A, in the inertial frame.
    reach : float [m]
        Largest difference along each axis.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) section V; docs/search_robustness.md.
    """
    side = positive("reach", reach) * np.linspace(-1.0, 1.0, PIXELS)
    r, v = finite("position", position), finite("velocity", velocity)
    for name, vector in (("position", r), ("velocity", v)):
        if vector.shape != (3,):
            raise ValueError(f"{name}: expected shape (3,), got {vector.shape}")
    x, y = np.meshgrid(side, side)
    places = r + np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3)
    locks = lock_times(search, places, np.broadcast_to(v, places.shape))
    phase, names = phase_index(search, locks.time, locks.leg), phase_labels(search)
    margins = lock_margins(search, r, v)
    figure = sheet(5.5)
    axes = figure.subplots()
    dress(axes)
    for k in np.unique(phase):
        share = float((phase == k).mean())
        seen = np.ma.masked_where(phase.reshape(x.shape) != k, np.ones(x.shape))
        tint = colours(len(names))[k]
        axes.pcolormesh(side, side, seen, cmap=ListedColormap([tint]), shading="nearest", rasterized=True)
        axes.plot([], [], "s", color=tint, label=f"{names[k]}: {share:.1%}")
    axes.add_patch(Circle((0.0, 0.0), margins.position, fill=False, color="white", linewidth=1.5))
    axes.plot(0.0, 0.0, "+", color="white", markersize=9)
    axes.set(aspect="equal", xlabel="difference along x [m]", ylabel="difference along y [m]")
    axes.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=SMALL, frameon=False)
    headline(figure, f"Phase of the first lock; the same within {margins.position:.3g} m, proven")
    return figure


def join_table(gathering: Gathering | None = None) -> Figure:
    """Plot H03's table of joins, with the number of locks of a gathering in each of its nine cases: figure 8.

    Parameters
    ----------
    gathering : Gathering, optional
        Gathering whose locks are counted, with those of two spacecraft of one set.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) figure 8.
    """
    counts = None if gathering is None else gathering.join_table
    figure = sheet(3.6)
    axes = figure.subplots()
    axes.set_axis_off()
    cells = [
        [
            f"{3 * i + j + 1}: {JOINS[i][j]}" + ("" if counts is None else f"\n{counts[i, j]}")
            for j in range(len(SETS))
        ]
        for i in range(len(SETS))
    ]
    table = axes.table(
        cells, rowLabels=SETS, colLabels=SETS, cellLoc="center", bbox=Bbox.from_bounds(0.12, 0.0, 0.88, 1.0)
    )
    table.auto_set_font_size(False)
    for (row, column), cell in table.get_celld().items():
        seen = counts is not None and row > 0 <= column and counts[row - 1, column] > 0
        cell.set_text_props(
            fontsize=SMALL, color=INK, fontweight="bold" if row == 0 or column < 0 or seen else "normal"
        )
        cell.set(edgecolor=FAINT, facecolor="#E8F1F8" if seen else "white")
    total = "" if counts is None else f"; {int(counts.sum())} locks of this gathering"
    headline(figure, f"Joins: a lock between craft of two sets, cases 1 to 9{total}")
    return figure


def complementary_cones(search: Search, mops: int = 1) -> Figure:
    """Plot the four regions of the complementary cones and their search times: S04 figure 5.

    The view is from spacecraft i of group A. n3 points away from the Sun. Each region is half of a cone, cut
    by the plane of n2 and n3. The table lists the times at which a whole region lies in the cone of
    spacecraft i. It also lists the region that spacecraft j of group B then has in its own cone, from which
    it would see spacecraft i.

    Parameters
    ----------
    search : Search
        Search with a sensor that leaves complementary cones.
    mops : int, default 1
        Number of the mOPS that defines n1, the boresight of A at its start.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) figure 5.
    """
    if search.sensor.cosine <= 0.0:
        raise ValueError(
            f"search: a half-angle of {degrees(search.sensor.half_angle):g} deg leaves no complementary cones"
        )
    regions_searched(search, mops)  # raises ValueError without that mOPS
    start = next(leg for leg in search.legs if (leg.phase, leg.round) == ("mOPS", mops))
    first, third = start.attitude[:, 2], -SUN
    second = np.cross(third, first)
    camera = Camera.around(-1.05, 0.3, third, first)
    figure = sheet(6.2)
    axes, beside = figure.subplots(1, 2, width_ratios=[0.62, 0.38])
    bare(axes, (0.0, -0.04), 3.0, 2.75)
    wall = np.array([[-0.62, -1.1], [0.62, -1.1], [0.62, 1.1], [-0.62, 1.1]]) @ [second, third]
    rims = {number: half_rim(search, number, first) for number in ROMAN}
    near = [number for number, rim in rims.items() if camera.nearness(np.sign(rim[24] @ first) * first) > 0.0]
    for region in (*(rims.keys() - near), 0, *near):
        if region == 0:
            axes.fill(*camera(wall).T, facecolor=FAINT, alpha=0.6, edgecolor=OTHER, linewidth=0.8)
            continue
        colour, rim = REGION_COLOURS[region], rims[region]
        fill(axes, solid(camera, ORIGIN, rim), colour, 0.4)
        axes.plot(*camera(np.vstack([ORIGIN, rim, ORIGIN])).T, color=colour, linewidth=1.6)
    for name, axis in (("n₁", first), ("n₂", second), ("n₃", third)):
        reach = 1.2 if name == "n₃" else 0.95
        arrow(axes, camera(np.array([ORIGIN, reach * axis])), INK)
        word(axes, camera((reach + 0.1) * axis), name, fontsize=TEXT)
    axes.plot(*camera(ORIGIN), "o", color=INK, markersize=7)
    word(axes, camera(ORIGIN), "craft i", shift=(-12, -13), ha="right")
    for region, rim in rims.items():
        word(axes, camera(0.86 * rim[24]), ROMAN[region], fontsize=TEXT + 3, fontweight="bold")
    to_sun(axes, camera, 1.05 * SUN, 0.3)
    region_table(beside, search, mops)
    half = f"{degrees(pi / 2 - search.sensor.half_angle):.4g}°"
    headline(
        figure, f"The four regions of the complementary cones ({half}), and when mOPS {mops} searches them"
    )
    return figure


def half_rim(search: Search, number: int, first: Floats) -> Floats:
    """Return the rim (49, 3) of a region: half a circle centred in the plane of n1 and n3."""
    half = pi / 2 - search.sensor.half_angle
    third, ahead = (-SUN, SUN)[number in (1, 4)], (1.0 if number in (1, 2) else -1.0) * first
    turn = np.linspace(-pi / 2, pi / 2, 49)[:, None]
    aside = np.cos(turn) * ahead + np.sin(turn) * np.cross(-SUN, ahead)
    return np.asarray(np.cos(half) * third + np.sin(half) * aside)


def region_table(axes: Axes, search: Search, mops: int) -> None:
    """Add the table of search times with the regions of spacecraft i of A and spacecraft j of B."""
    axes.set_axis_off()
    seen = list(zip(*(regions_searched(search, mops, group) for group in ("A", "B")), strict=True))
    rows = [[f"{time:.1f}", ROMAN[own], ROMAN[other]] for (time, own), (_, other) in seen]
    heads = ["time [s]", "craft i\n(group A)", "craft j\n(group B)"]
    table = axes.table(
        rows,
        colLabels=heads,
        cellLoc="center",
        edges="horizontal",
        bbox=Bbox.from_bounds(0.0, 0.35, 1.0, 0.5),
    )
    table.auto_set_font_size(False)
    for (row, column), cell in table.get_celld().items():
        tint = ([INK, *GROUP_COLOURS.values()] if row == 0 else [INK] * 3)[column]
        if row and column:
            tint = REGION_COLOURS[(seen[row - 1][column - 1])[1]]
        cell.set_edgecolor(FAINT)
        cell.set_text_props(color=tint, fontsize=SMALL, fontweight="bold" if not row or column else "normal")
    said = (
        "At these times the whole region\nlies in the craft's cone: both see\neach other wherever j is in it."
    )
    axes.text(0.5, 0.28, said, ha="center", va="top", fontsize=SMALL, color=INK, linespacing=1.4)


@dataclass(frozen=True, eq=False)
class Meeting:
    """Spacecraft j at `craft` (3,) [m], seen from spacecraft i at the origin; `boresight` is in the plane."""

    craft: Floats
    boresight: Floats
    half_angle: float

    @property
    def foot(self) -> Floats:
        """Point S of S04 (3,): the projection of spacecraft j onto the plane."""
        return np.asarray(self.craft * LEVEL)

    @property
    def vertex(self) -> Floats:
        """Point T of S04 (3,): the vertex of the hyperbola, nearest to the foot."""
        return np.asarray(self.foot + abs(self.craft[2]) / np.tan(self.half_angle) * self.boresight)

    @property
    def size(self) -> float:
        """Distance between the spacecraft [m]."""
        return float(np.linalg.norm(self.craft))

    @property
    def reach(self) -> float:
        """Extent of the plane that is shown ahead of the foot and to its sides [m]."""
        return max(1.25 * float(np.linalg.norm(self.foot)), 0.5 * self.size)

    @cached_property
    def curve(self) -> Floats:
        """Hyperbola H (97, 3): s ahead of the foot and w aside, s tan(half_angle) = sqrt(w^2 + z^2)."""
        aside = self.reach * np.sin(self.half_angle) * np.linspace(-1.0, 1.0, 97)
        ahead = np.hypot(aside, self.craft[2]) / np.tan(self.half_angle)
        side = np.cross(-SUN, self.boresight)
        return np.asarray(self.foot + ahead[:, None] * self.boresight + aside[:, None] * side)

    @property
    def within(self) -> Floats:
        """Outline (99, 3) of the part of the plane inside the cone, as far as it is shown."""
        rest = max(0.0, self.reach - float((self.curve[0] - self.foot) @ self.boresight))
        return np.vstack([self.curve, self.curve[[-1, 0]] + rest * self.boresight])

    @property
    def floor(self) -> Floats:
        """Corners (4, 3) of the part of the plane that is shown."""
        points = np.vstack([self.within, self.foot, ORIGIN])
        (left, low, _), (right, high, _) = points.min(axis=0), points.max(axis=0)
        return np.array([[left, low, 0.0], [right, low, 0.0], [right, high, 0.0], [left, high, 0.0]])

    @property
    def state(self) -> str:
        """Position of spacecraft i relative to H, as text."""
        off = np.arccos(np.clip(-self.craft @ self.boresight / self.size, -1.0, 1.0))
        margin = degrees(off - self.half_angle)
        return "outside of H" if margin > ON else ("within H: locked" if margin < -ON else "on H, and locks")


def lemma_2(search: Search, position: ArrayLike, velocity: ArrayLike, time: float | None = None) -> Figure:
    """Plot why spacecraft outside each other's complementary cones lock in the in-plane search: S04 figure 6.

    The figure shows spacecraft j of group B as seen by spacecraft i of group A. The cone of spacecraft j
    meets the plane of the boresights in the hyperbola H. S is the projection of spacecraft j onto the plane
    and T the vertex of H. The ray from S through T passes over spacecraft i in every in-plane search.
    Spacecraft i is beyond T, because a spacecraft on the segment from S to T is in a complementary cone.
    Hence spacecraft i comes within H, and both lock.

    Parameters
    ----------
    search : Search
        Search with a half-angle below 90 deg and sensors at the centres of mass.
    position : array_like of shape (3,) [m]
        Position of B relative to A at the start of the search, in the inertial frame.
    velocity : array_like of shape (3,) [m/s]
        Velocity of B relative to A, in the inertial frame.
    time : float [s], optional
        Time in the first in-plane search; default: that of the first lock.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) figure 6, lemma 2.
    """
    if search.sensor.offset > 0.0 or search.sensor.cosine <= 0.0:
        raise ValueError(
            "search: lemma 2 requires sensors at the centres of mass and half-angles below 90 deg"
        )
    r, v = numbers("position", position), numbers("velocity", velocity)
    for name, vector in (("position", r), ("velocity", v)):
        if vector.shape != (3,):
            raise ValueError(f"{name}: expected shape (3,), got {vector.shape}")
    leg = search.legs[0]
    when = float(lock_times(search, r, v).time[0]) if time is None else number("time", time)
    if leg.phase != "IPS" or not 0.0 <= when <= leg.end:
        raise ValueError(f"time: {when:g} s is not in the first in-plane search, which ends at {leg.end:g} s")
    meeting = Meeting(r + v * when, -search.boresight(when), search.sensor.half_angle)
    line = r + v * np.array([[0.0], [leg.end]])

    figure = sheet(6.6)
    rest = 0.45 * meeting.size * np.array([ring(pole, pi / 2 - meeting.half_angle) for pole in (SUN, -SUN)])
    seen = CAMERA(np.vstack([line, meeting.floor, *rest, meeting.craft, 0.62 * meeting.size * SUN]))
    axes = figure.subplots()
    bare(axes, (seen.min(axis=0) + seen.max(axis=0)) / 2, *(1.16 * np.ptp(seen, axis=0)))
    cone(axes, CAMERA, ORIGIN, rest[0], BEFORE, 0.3, color=BEFORE)  # below the plane
    surfaces(axes, meeting)
    cone(axes, CAMERA, ORIGIN, rest[1], BEFORE, 0.3, color=BEFORE)
    course(axes, line)
    both_craft(axes, meeting)
    unit = length_unit(meeting.size)
    apart = f"{meeting.size / unit.size:.4g} {unit.name} apart"
    headline(figure, f"Lemma 2 at {when:.1f} s: {apart}; craft i is {meeting.state}")
    return figure


def surfaces(axes: Axes, meeting: Meeting) -> None:
    """Draw the plane, the cone of spacecraft j down to it, H, S and T."""
    colour, curve = GROUP_COLOURS["B"], meeting.curve
    fill(axes, CAMERA(meeting.floor), FAINT, 0.5)
    fill(axes, CAMERA(meeting.within), colour, 0.12)
    for part in (curve[: len(curve) // 2 + 1], curve[len(curve) // 2 :]):
        fill(axes, solid(CAMERA, meeting.craft, part), colour, 0.12)
    for point in curve[:: len(curve) // 8]:
        draw(axes, [meeting.craft, point], color=colour, linewidth=0.6, alpha=0.6)
    draw(axes, curve, color=colour, linewidth=2.2)
    draw(axes, [meeting.craft, meeting.foot], color=OTHER, linestyle=DOTTED, linewidth=1.4)
    end = meeting.foot + meeting.reach * meeting.boresight
    draw(axes, [meeting.foot, end], color=colour, linestyle=DASHED, linewidth=1.4)
    for point, text, shift in ((meeting.foot, "S", (-11, -8)), (meeting.vertex, "T", (3, -13))):
        axes.plot(*CAMERA(point), "o", color=colour, markersize=6)
        word(axes, CAMERA(point), text, shift=shift, fontsize=TEXT)
    far = curve[8] if np.linalg.norm(curve[8]) > np.linalg.norm(curve[-9]) else curve[-9]
    word(axes, CAMERA(far), "H", colour, (-11, 9), fontsize=TEXT)


def course(axes: Axes, line: Floats) -> None:
    """Draw the line L of the relative motion during the in-plane search."""
    draw(axes, line, color=INK, linewidth=1.2)
    axes.plot(*CAMERA(line[0]), "o", color=INK, markerfacecolor="white", markersize=6)
    way = CAMERA(line[1] - line[0])
    right, up = 14.0 * way / (np.linalg.norm(way) or 1.0)
    word(axes, CAMERA(line[0]), "0 s", shift=(-1.3 * right, -up))
    word(axes, CAMERA(line[1]), "L", shift=(right, up), style="italic", fontsize=TEXT)


def both_craft(axes: Axes, meeting: Meeting) -> None:
    """Draw the spacecraft with their boresights, the axes of the frame, and the Sun."""
    size = meeting.size
    for name, axis, reach in zip("xyz", np.eye(3), (0.3, 0.3, 0.58), strict=True):
        arrow(axes, CAMERA([ORIGIN, reach * size * axis]), INK, linewidth=1.1, mutation_scale=9)
        word(axes, CAMERA((reach + 0.05) * size * axis), f"$n_{name}$", fontsize=TEXT)
    pair = ((ORIGIN, -meeting.boresight, "A", "i"), (meeting.craft, meeting.boresight, "B", "j"))
    for point, way, group, name in pair:
        colour, tip = GROUP_COLOURS[group], point + 0.42 * size * way
        right, up = CAMERA(way) / np.linalg.norm(CAMERA(way))
        arrow(axes, CAMERA([point, tip]), colour, linewidth=2.4, zorder=5)
        word(axes, CAMERA(tip), f"$b_{name}$", colour, (13 * right, 13 * up), fontsize=TEXT)
        axes.plot(*CAMERA(point), "o", color=colour, markeredgecolor=INK, markersize=9, zorder=6)
        side = -1 if right > 0.0 else 1  # away from the boresight
        look = {"ha": "right" if side < 0 else "left", "fontweight": "bold", "zorder": 7}
        word(axes, CAMERA(point), f"craft {name}", colour, (12 * side, -11 * float(np.sign(up))), **look)
    to_sun(axes, CAMERA, 0.48 * size * SUN, 0.12 * size)


def draw(axes: Axes, points: Any, **look: Any) -> None:
    """Draw a line through points (K, 3)."""
    axes.plot(*CAMERA(points).T, **look)
