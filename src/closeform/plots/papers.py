"""Schematic pictures of the papers on lost spacecraft: locks, body frame, near field, sets and joins."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, degrees, isinf, pi, sin

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.transforms import Bbox
from numpy.typing import ArrayLike

from closeform.arrays import finite, number, numbers, positive
from closeform.plots.drawing.inputs import picture
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
    OBLIQUE,
    SUNWARD,
    arrow,
    bare,
    cone,
    fill,
    ring,
    solid,
    to_sun,
)
from closeform.plots.drawing.style import (
    DASHED,
    DOTTED,
    dress,
    headline,
    plural,
    sheet,
    speed,
)
from closeform.plots.drawing.text import SMALL, TEXT, short_names, word
from closeform.search.gathering.result import Gathering
from closeform.search.lock_statistics import phase_index, phase_labels
from closeform.search.lock_times import lock_times
from closeform.search.proofs.lock_margins import lock_margins
from closeform.search.schedule import Search
from closeform.search.sensor import Sensor

PIXELS = 241  # of the picture, along each side
SETS = ("lost", "knowledge set", "formation set")
JOINS = (  # H03 figure 8: what a lock between craft of two sets does
    ("a set begins", "joins the knowledge set", "burns, joins the formation set"),
    ("joins the knowledge set", "one knowledge set", "its set burns and joins"),
    ("burns, joins the formation set", "its set burns and joins", "no change"),
)


@picture("shapes are wrong")
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


@picture("`shade` is not positive")
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


@picture("the near field is empty or unbounded")
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


@picture("`time` is outside the gathering")
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


@picture(
    "a shape is wrong, a number is not finite, `reach` is not positive, or the two are at the same position "
    "anywhere in the picture"
)
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
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) section V; docs/robustness.md.
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


@picture()
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
