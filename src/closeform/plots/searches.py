"""Search of lost spacecraft: attitude manoeuvres, complementary cones, and lemma 2."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import cos, degrees, pi, sin
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, numbers, whole
from closeform.plots.drawing.inputs import picture
from closeform.plots.drawing.palette import AFTER, ALTERNATIVE, BEFORE, FAINT, INK, OTHER, ZONE
from closeform.plots.drawing.space import (
    GROUP_COLOURS,
    ROMAN,
    SUN_COLOUR,
    Camera,
    arrow,
    bare,
    cone,
    fill,
    ring,
    solid,
    to_sun,
)
from closeform.plots.drawing.style import DASHED, DOTTED, headline, length_unit, sheet
from closeform.plots.drawing.text import SMALL, TEXT, word
from closeform.search.leg import SUN, Leg, rotation
from closeform.search.lock_times import lock_times
from closeform.search.proofs.theorem import regions_searched
from closeform.search.schedule import Search
from closeform.zones.outlines import CIRCLE

ABOVE = Camera.around(-1.15, 0.38, -SUN, np.array([1.0, 0.0, 0.0]))  # n_z up, n_x to the right
OPPOSITE = {"A": 1.0, "B": -1.0}
REGION_COLOURS = {1: AFTER, 2: ZONE, 3: ALTERNATIVE, 4: "#AA4499"}
ORIGIN, LEVEL = np.zeros(3), np.array([1.0, 1.0, 0.0])
CAMERA = Camera.around(-1.0, 0.55, -SUN, np.array([1.0, 0.0, 0.0]))
ON = 1e-6  # degrees from the cone's edge that count as on it


def angle_text(angle: float, sign: bool = True) -> str:
    """Return an angle [rad] as text in degrees, rounded to a tenth."""
    text = f"{degrees(angle):+.1f}".removesuffix(".0") if sign else f"{degrees(angle):.1f}".removesuffix(".0")
    return text.replace("-", "−") + "°"


@picture("the search begins with another phase")
def in_plane_search(search: Search) -> Figure:
    """Plot the in-plane search of both groups: S04 figure 3, H03 figure 4.

    Each ball is the sky of one spacecraft. The sensor cone is drawn at the start of the turn about the sun
    line, and as rims along the turn. The spiral is the track of the boresight. The grey cones are the
    complementary cones that the turn does not cover.

    Parameters
    ----------
    search : Search
        Search that begins with an in-plane search.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) figure 3; H03 (Hadaegh, Scharf and Ploen 2003) figure 4.
    """
    leg = instance("search", search, Search).legs[0]
    if leg.phase != "IPS":
        raise ValueError(f"search: it begins with {leg.phase}, not with an in-plane search")
    figure = sheet(5.5)
    axes = figure.subplots()
    bare(axes, (0.1, -0.33), 6.9, 3.3)
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
    colour, sign = GROUP_COLOURS[group], OPPOSITE[group]
    half = search.sensor.half_angle
    sweep = np.linspace(leg.start, leg.end, 361)
    boresights = sign * leg.attitude_at(sweep)[:, :, 2]
    axes.fill(*(middle + CIRCLE).T, facecolor=colour, alpha=0.07, edgecolor=colour, linewidth=1.2)
    rest = pi / 2.0 - half
    for pole in (-SUN, SUN):
        if rest > 0.0:
            rim = ring(pole, rest)
            cone(axes, ABOVE, home, rim, BEFORE, 0.30, color=BEFORE, linewidth=1.2)
    for k in range(40, 241, 40):
        rim = ring(boresights[k], half)
        hidden(axes, middle, rim, colour, 0.8)
    start = boresights[0]
    cone(axes, ABOVE, home, ring(start, half), colour, 0.22, linewidth=1.8, alpha=1.0)
    fill(axes, middle + solid(ABOVE, 0.24 * ring(SUN, pi / 2.0)), INK, 0.85, zorder=4)
    arrow(axes, middle + ABOVE(np.array([0 * SUN, 0.55 * SUN])), INK, zorder=4)
    word(axes, middle + ABOVE(0.55 * SUN), "body x", shift=(-5, 9), ha="right", zorder=7)
    out = np.linspace(1.08, 1.34, len(sweep))[:, None]
    way = middle + ABOVE(out * boresights)
    near = ABOVE.nearness(boresights) > -0.05
    axes.plot(*np.where(near[:, None], np.nan, way).T, color=colour, linewidth=1.4, linestyle=DASHED)
    axes.plot(*np.where(near[:, None], way, np.nan).T, color=colour, linewidth=2.0)
    arrow(axes, way[-4:], colour, linewidth=2.0, mutation_scale=18, zorder=6)
    arrow(axes, middle + ABOVE(np.array([0 * start, start])), colour, linewidth=2.4, zorder=5)
    for time, where in ((leg.start, way[0]), (leg.end, way[-1])):
        right = where[0] > middle[0]
        look: dict[str, Any] = {"ha": "left" if right else "right", "zorder": 7}
        word(axes, where, f"{time:.4g} s", colour, (11 if right else -11, -6), **look)
    if rest > 0.0:
        top = middle + ABOVE(-SUN)
        word(axes, top, f"left out: {angle_text(rest, False)} about the sun line", BEFORE, (0, 17))
    to_sun(axes, ABOVE, home + 1.12 * SUN, 0.55)
    word(axes, middle + [0.0, -1.85], f"group {group}", colour, fontsize=TEXT, fontweight="bold")


def hidden(axes: Axes, middle: Floats, rim: Floats, colour: str, width: float) -> None:
    """Draw a closed line on the ball, faint on the far side."""
    points = middle + ABOVE(rim)
    front = (ABOVE.nearness(rim) > 0.0)[:, None]
    axes.plot(*np.where(front, points, np.nan).T, color=colour, linewidth=width, alpha=0.75)
    axes.plot(*np.where(front, np.nan, points).T, color=colour, linewidth=width, alpha=0.25)


@picture("the search has no such round")
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

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) figure 4.
    """
    whole("number", number)
    legs = [leg for leg in search.legs if leg.round == number and leg.angle]
    if not legs:
        raise ValueError(f"number: this search has rounds 1 to {search.legs[-1].round}, got {number!r}")
    tips = [leg for leg in legs if leg.about == "body y"]
    ahead = (tips[0] if tips else legs[0]).attitude[:, 2]
    camera = Camera.at(np.cross(ahead, -SUN), -SUN)
    seen = {group: searched(search, number, group) for group in GROUP_COLOURS}
    figure = sheet(5.6)
    for (group, sign), row in zip(
        OPPOSITE.items(), figure.subplots(2, len(legs), squeeze=False), strict=True
    ):
        for leg, axes in zip(legs, row, strict=True):
            bare(axes, (0.0, -0.45), 2.7, 4.0)
            side_view(axes, camera, search, leg, group, seen[group].get(leg.end))
            about = "body y" if leg.about == "body y" else "sun line"
            angle = leg.angle * (sign if leg.about == "body y" else 1.0)
            text = f"{angle_text(angle)}\n{about}\n{leg.start:.0f}–{leg.end:.0f} s"
            axes.text(0.0, -1.5, text, ha="center", va="top", fontsize=SMALL, color=INK, linespacing=1.25)
            if group == "A":
                axes.set_title(leg.phase, fontsize=TEXT, fontweight="bold", color=INK)
        look: dict[str, Any] = {"color": GROUP_COLOURS[group], "fontsize": TEXT, "fontweight": "bold"}
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


def side_view(axes: Axes, camera: Camera, search: Search, leg: Leg, group: str, region: int | None) -> None:
    """Draw the attitude at the end of a turn in side view, with the turn that reaches it."""
    colour, half = GROUP_COLOURS[group], search.sensor.half_angle
    flip = np.array([1.0, OPPOSITE[group], OPPOSITE[group]])
    first, last = (leg.attitude_at(time) * flip for time in (leg.start, leg.end))
    origin = np.zeros(3)
    for pole in (SUN, -SUN) if half < pi / 2.0 else ():
        fill(axes, solid(camera, origin, ring(pole, pi / 2.0 - half)), FAINT, 1.0)
    axes.plot(*camera(np.array([1.25 * SUN, -1.3 * SUN])).T, color=OTHER, linestyle=DASHED, linewidth=1.0)
    axes.plot(*camera(1.3 * SUN), "o", color=SUN_COLOUR, markeredgecolor=INK, markersize=8)
    fill(axes, solid(camera, origin, ring(last[:, 2], half)), colour, 0.28)
    for side in (-1.0, 1.0):
        tip = cos(half) * last[:, 2] + side * sin(half) * last[:, 0]
        axes.plot(*camera(np.array([origin, tip])).T, color=colour, linewidth=0.9)
    axes.plot(*camera(np.array([origin, first[:, 2]])).T, color=colour, linestyle=DASHED, linewidth=1.3)
    arrow(axes, camera(np.array([origin, last[:, 2]])), colour, linewidth=2.2)
    shade = 0.34 * (last[:, 2] * np.array([[-1.0], [1.0]]))
    axes.plot(*camera(shade).T, color=INK, linewidth=4.5, solid_capstyle="butt")
    arrow(axes, camera(np.array([origin, 0.62 * last[:, 0]])), INK, linewidth=1.4, mutation_scale=9)
    turning(axes, camera, leg, first[:, 2])
    if region is not None:
        up, along = (1.0 if region in (2, 3) else -1.0), (1.0 if region in (1, 2) else -1.0)
        word(axes, (0.62 * along, 1.06 * up), ROMAN[region], fontweight="bold", fontsize=TEXT)


def turning(axes: Axes, camera: Camera, leg: Leg, boresight: Floats) -> None:
    """Draw an arrow along a turn: a tilted ring about the sun line, otherwise the track of the boresight."""
    angles = np.linspace(0.0, leg.angle, 60)
    if leg.about == "body y":
        arrow(
            axes,
            camera(1.12 * rotation(leg.axis, angles) @ boresight),
            BEFORE,
            linewidth=1.3,
            mutation_scale=10,
        )
        return
    tilted = Camera.at(camera.basis[2] + 0.45 * camera.basis[1], camera.basis[1])
    level = boresight - (boresight @ SUN) * SUN
    spiral = np.linspace(0.38, 0.38 + 0.1 * abs(leg.angle) / pi, 60)[:, None]
    way = spiral * (rotation(leg.axis, angles) @ (level / np.linalg.norm(level)))
    arrow(axes, tilted(way) + camera(-1.5 * SUN), BEFORE, linewidth=1.3, mutation_scale=10)


@picture("the search has no such mOPS or leaves no complementary cones")
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


@picture(
    "shapes are wrong, `time` is outside the first in-plane search or missing for a pair that does not "
    "lock in it, or the search does not meet the requirements above"
)
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
