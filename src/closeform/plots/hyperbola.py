"""Figure of the hyperbola in which a sensor cone meets the plane of an in-plane search."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import degrees, pi
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, numbers
from closeform.plots.camera import (
    GROUP_COLOURS,
    Camera,
    arrow,
    cone,
    fill,
    framing,
    ring,
    solid,
    stage,
    to_sun,
    word,
)
from closeform.plots.palette import BEFORE, FAINT, INK, OTHER
from closeform.plots.style import DASHED, DOTTED, TEXT, headline, length_unit, sheet
from closeform.search.leg import SUN
from closeform.search.locks import lock_times
from closeform.search.schedule import Search

ORIGIN, LEVEL = np.zeros(3), np.array([1.0, 1.0, 0.0])
CAMERA = Camera.around(-1.0, 0.55, -SUN, np.array([1.0, 0.0, 0.0]))
ON = 1e-6  # degrees from the cone's edge that count as on it


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
    and T the vertex of H. The ray from S through T sweeps over spacecraft i in every in-plane search.
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

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If shapes are wrong, `time` is outside the first in-plane search or missing for a pair that does not
        lock in it, the search does not meet the requirements above, or an argument has the wrong type.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) figure 6, lemma 2.
    """
    instance("search", search, Search)
    if search.sensor.offset > 0.0 or search.sensor.cosine <= 0.0:
        raise ValueError("search: lemma 2 wants sensors at the centres of mass and half-angles below 90 deg")
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
    shown = [line, meeting.floor, *rest, meeting.craft, 0.62 * meeting.size * SUN]
    frame = framing(CAMERA(np.vstack(shown)), 10.6, 0.93 * 6.6, 1.16)
    axes = stage(figure, (0.0, 0.0, 1.0, 0.93), *frame)
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
