"""Search of lost spacecraft: the in-plane search and the turns of a round."""

from __future__ import annotations

from math import cos, degrees, pi, sin
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from closeform.arrays import Floats, instance, whole
from closeform.plots.drawing import space
from closeform.plots.drawing.inputs import picture
from closeform.plots.drawing.palette import BEFORE, FAINT, INK, OTHER
from closeform.plots.drawing.style import DASHED, headline, sheet
from closeform.plots.drawing.text import SMALL, TEXT, word
from closeform.search.leg import SUN, Leg, rotation
from closeform.search.proofs.theorem import regions_searched
from closeform.search.schedule import Search
from closeform.zones.outlines import CIRCLE

ABOVE = space.Camera.around(-1.15, 0.38, -SUN, np.array([1.0, 0.0, 0.0]))  # n_z up, n_x to the right
OPPOSITE = {"A": 1.0, "B": -1.0}


def angle_text(angle: float, sign: bool = True) -> str:
    """Return an angle [rad] as text in degrees, rounded to a tenth."""
    text = f"{degrees(angle):+.1f}".removesuffix(".0") if sign else f"{degrees(angle):.1f}".removesuffix(".0")
    return text.replace("-", "−") + "°"


@picture("the search begins with another phase", source="S04 figure 3; H03 figure 4")
def in_plane_search(search: Search) -> Figure:
    """Plot the in-plane search of both groups: S04 figure 3, H03 figure 4.

    Each ball is the sky of one spacecraft. The sensor cone is drawn at the start of the turn about the sun
    line, and as rims along the turn. The spiral is the track of the boresight. The grey cones are the
    complementary cones that the turn does not cover.

    Parameters
    ----------
    search : Search
        Search that begins with an in-plane search.
    """
    leg = instance("search", search, Search).legs[0]
    if leg.phase != "IPS":
        raise ValueError(f"search: begins with {leg.phase}, not with an in-plane search")
    figure = sheet(5.5)
    axes = figure.subplots()
    space.bare(axes, (0.1, -0.33), 6.9, 3.3)
    for group, middle in (("A", -1.6), ("B", 1.6)):
        ball(axes, search, leg, group, np.array([middle, 0.0]))
    share = 100.0 * search.coverage("IPS")
    headline(
        figure,
        f"In-plane search: {angle_text(leg.angle, False)} about the sun line in {leg.end - leg.start:.4g} s "
        f"sweep {share:.2f} % of the sky",
    )
    return figure


def ball(axes: Axes, search: Search, leg: Leg, group: str, middle: Floats) -> None:
    """Draw the sky of one spacecraft around a point of the figure, with its turn and complementary cones."""
    home = middle @ ABOVE.basis[:2]  # position in space that projects to `middle`
    colour, sign = space.GROUP_COLOURS[group], OPPOSITE[group]
    half = search.sensor.half_angle
    sweep = np.linspace(leg.start, leg.end, 361)
    boresights = sign * leg.attitude_at(sweep)[:, :, 2]
    axes.fill(*(middle + CIRCLE).T, facecolor=colour, alpha=0.07, edgecolor=colour, linewidth=1.2)
    rest = pi / 2.0 - half
    for pole in (-SUN, SUN):
        if rest > 0.0:
            rim = space.ring(pole, rest)
            space.cone(axes, ABOVE, home, rim, BEFORE, 0.30, color=BEFORE, linewidth=1.2)
    for k in range(40, 241, 40):
        rim = space.ring(boresights[k], half)
        hidden(axes, middle, rim, colour, 0.8)
    start = boresights[0]
    space.cone(axes, ABOVE, home, space.ring(start, half), colour, 0.22, linewidth=1.8, alpha=1.0)
    space.fill(axes, middle + space.solid(ABOVE, 0.24 * space.ring(SUN, pi / 2.0)), INK, 0.85, zorder=4)
    space.arrow(axes, middle + ABOVE(np.array([0 * SUN, 0.55 * SUN])), INK, zorder=4)
    word(axes, middle + ABOVE(0.55 * SUN), "body x", shift=(-5, 9), ha="right", zorder=7)
    out = np.linspace(1.08, 1.34, len(sweep))[:, None]
    way = middle + ABOVE(out * boresights)
    near = ABOVE.nearness(boresights) > -0.05
    axes.plot(*np.where(near[:, None], np.nan, way).T, color=colour, linewidth=1.4, linestyle=DASHED)
    axes.plot(*np.where(near[:, None], way, np.nan).T, color=colour, linewidth=2.0)
    space.arrow(axes, way[-4:], colour, linewidth=2.0, mutation_scale=18, zorder=6)
    space.arrow(axes, middle + ABOVE(np.array([0 * start, start])), colour, linewidth=2.4, zorder=5)
    for time, where in ((leg.start, way[0]), (leg.end, way[-1])):
        right = where[0] > middle[0]
        look: dict[str, Any] = {"ha": "left" if right else "right", "zorder": 7}
        word(axes, where, f"{time:.4g} s", colour, (11 if right else -11, -6), **look)
    if rest > 0.0:
        top = middle + ABOVE(-SUN)
        word(axes, top, f"left out: {angle_text(rest, False)} about the sun line", BEFORE, (0, 17))
    space.to_sun(axes, ABOVE, home + 1.12 * SUN, 0.55)
    word(axes, middle + [0.0, -1.85], f"group {group}", colour, fontsize=TEXT, fontweight="bold")


def hidden(axes: Axes, middle: Floats, rim: Floats, colour: str, width: float) -> None:
    """Draw a closed line on the ball, faint on the far side."""
    points = middle + ABOVE(rim)
    front = (ABOVE.nearness(rim) > 0.0)[:, None]
    axes.plot(*np.where(front, points, np.nan).T, color=colour, linewidth=width, alpha=0.75)
    axes.plot(*np.where(front, np.nan, points).T, color=colour, linewidth=width, alpha=0.25)


@picture("the search has no such round", source="S04 figure 4")
def manoeuvres(search: Search, number: int = 1) -> Figure:
    """Plot every turn of one round of a search for both groups: S04 figure 4.

    Each panel looks along the body y axis as it is before the out-of-plane turns. It shows the attitude at
    the end of a turn: the shade with body x, the boresight and its cone (from the centre, as in S04). The
    dashed line is the boresight before the turn; grey cones are the complementary cones. The text below
    states the turn angle, its axis (body y or the sun line) and its times. Both groups make the same turns in
    space, so their angles about body y have opposite signs. A Roman numeral is the region of S04 figure 5
    that lies in the cone at the end of a turn.

    Parameters
    ----------
    search : Search
        Search that contains the round.
    number : int, default 1
        Number of the round, counted from 1.
    """
    whole("number", number)
    legs = [leg for leg in search.legs if leg.round == number and leg.angle]
    if not legs:
        raise ValueError(f"number: this search has rounds 1 to {search.legs[-1].round}, got {number!r}")
    tips = [leg for leg in legs if leg.about == "body y"]
    ahead = (tips[0] if tips else legs[0]).attitude[:, 2]
    camera = space.Camera.at(np.cross(ahead, -SUN), -SUN)
    seen = {group: searched(search, number, group) for group in space.GROUP_COLOURS}
    figure = sheet(5.6)
    for (group, sign), row in zip(
        OPPOSITE.items(), figure.subplots(2, len(legs), squeeze=False), strict=True
    ):
        for leg, axes in zip(legs, row, strict=True):
            space.bare(axes, (0.0, -0.45), 2.7, 4.0)
            side_view(axes, camera, search, leg, group, seen[group].get(leg.end))
            about = "body y" if leg.about == "body y" else "sun line"
            angle = leg.angle * (sign if leg.about == "body y" else 1.0)
            text = f"{angle_text(angle)}\n{about}\n{leg.start:.0f}–{leg.end:.0f} s"
            axes.text(0.0, -1.5, text, ha="center", va="top", fontsize=SMALL, color=INK, linespacing=1.25)
            if group == "A":
                axes.set_title(leg.phase, fontsize=TEXT, fontweight="bold", color=INK)
        look: dict[str, Any] = {"color": space.GROUP_COLOURS[group], "fontsize": TEXT, "fontweight": "bold"}
        row[0].text(-1.4, 0.0, f"group {group}", va="center", ha="right", rotation=90, **look)
    explained = "dashed: the boresight before the turn"
    if search.sensor.half_angle < pi / 2.0:
        explained += "; grey: complementary cones"
    if seen["A"]:
        explained += "; I to IV: the region that is then wholly in the cone"
    figure.supxlabel(explained, fontsize=SMALL, color=INK)
    headline(
        figure,
        f"The turns of round {number}: tips of {angle_text(search.tip_angle, False)}, "
        f"{degrees(search.slew_rate):.4g}°/s, body x within {angle_text(search.sun_angle, False)} of the Sun",
    )
    return figure


def searched(search: Search, number: int, group: Any) -> dict[float, int]:
    """Return the region of S04 figure 5 that lies in a group's cone, keyed by the end time [s] of the leg."""
    if not any((leg.phase, leg.round) == ("mOPS", number) for leg in search.legs):
        return {}
    return dict(regions_searched(search, number, group))


def side_view(
    axes: Axes, camera: space.Camera, search: Search, leg: Leg, group: str, region: int | None
) -> None:
    """Draw the attitude at the end of a turn in side view, with the turn that reaches it."""
    colour, half = space.GROUP_COLOURS[group], search.sensor.half_angle
    flip = np.array([1.0, OPPOSITE[group], OPPOSITE[group]])
    first, last = (leg.attitude_at(time) * flip for time in (leg.start, leg.end))
    origin = np.zeros(3)
    for pole in (SUN, -SUN) if half < pi / 2.0 else ():
        space.fill(axes, space.solid(camera, origin, space.ring(pole, pi / 2.0 - half)), FAINT, 1.0)
    axes.plot(*camera(np.array([1.25 * SUN, -1.3 * SUN])).T, color=OTHER, linestyle=DASHED, linewidth=1.0)
    axes.plot(*camera(1.3 * SUN), "o", color=space.SUN_COLOUR, markeredgecolor=INK, markersize=8)
    space.fill(axes, space.solid(camera, origin, space.ring(last[:, 2], half)), colour, 0.28)
    for side in (-1.0, 1.0):
        tip = cos(half) * last[:, 2] + side * sin(half) * last[:, 0]
        axes.plot(*camera(np.array([origin, tip])).T, color=colour, linewidth=0.9)
    axes.plot(*camera(np.array([origin, first[:, 2]])).T, color=colour, linestyle=DASHED, linewidth=1.3)
    space.arrow(axes, camera(np.array([origin, last[:, 2]])), colour, linewidth=2.2)
    shade = 0.34 * (last[:, 2] * np.array([[-1.0], [1.0]]))
    axes.plot(*camera(shade).T, color=INK, linewidth=4.5, solid_capstyle="butt")
    space.arrow(axes, camera(np.array([origin, 0.62 * last[:, 0]])), INK, linewidth=1.4, mutation_scale=9)
    turning(axes, camera, leg, first[:, 2])
    if region is not None:
        up, along = (1.0 if region in (2, 3) else -1.0), (1.0 if region in (1, 2) else -1.0)
        word(axes, (0.62 * along, 1.06 * up), space.ROMAN[region], fontweight="bold", fontsize=TEXT)


def turning(axes: Axes, camera: space.Camera, leg: Leg, boresight: Floats) -> None:
    """Draw an arrow along a turn: a tilted ring about the sun line, otherwise the track of the boresight."""
    angles = np.linspace(0.0, leg.angle, 60)
    if leg.about == "body y":
        space.arrow(
            axes,
            camera(1.12 * rotation(leg.axis, angles) @ boresight),
            BEFORE,
            linewidth=1.3,
            mutation_scale=10,
        )
        return
    tilted = space.Camera.at(camera.basis[2] + 0.45 * camera.basis[1], camera.basis[1])
    level = boresight - (boresight @ SUN) * SUN
    spiral = np.linspace(0.38, 0.38 + 0.1 * abs(leg.angle) / pi, 60)[:, None]
    way = spiral * (rotation(leg.axis, angles) @ (level / np.linalg.norm(level)))
    space.arrow(axes, tilted(way) + camera(-1.5 * SUN), BEFORE, linewidth=1.3, mutation_scale=10)
