"""Figure of the complementary cones that an in-plane search does not cover."""

from __future__ import annotations

from math import degrees, pi
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from closeform.arrays import Floats, instance
from closeform.plots.camera import GROUP_COLOURS, ROMAN, Camera, arrow, fill, solid, stage, to_sun, word
from closeform.plots.palette import AFTER, ALTERNATIVE, FAINT, INK, OTHER, ZONE
from closeform.plots.style import SMALL, TEXT, headline, sheet
from closeform.search.leg import SUN
from closeform.search.schedule import Search
from closeform.search.theorem import regions_searched

REGION_COLOURS = {1: AFTER, 2: ZONE, 3: ALTERNATIVE, 4: "#AA4499"}
ORIGIN = np.zeros(3)


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

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If the search has no such mOPS or leaves no complementary cones, or an argument has the wrong type.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) figure 5.
    """
    instance("search", search, Search)
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
    axes = stage(figure, (0.0, 0.0, 0.6, 0.93), (0.0, -0.04), 3.0)
    wall = np.array([[-0.62, -1.1], [0.62, -1.1], [0.62, 1.1], [-0.62, 1.1]]) @ [second, third]
    rims = {number: half_rim(search, number, first) for number in ROMAN}
    near = [number for number, rim in rims.items() if camera.nearness(np.sign(rim[24] @ first) * first) > 0.0]
    for number in (*(rims.keys() - near), 0, *near):
        if number == 0:
            axes.fill(*camera(wall).T, facecolor=FAINT, alpha=0.6, edgecolor=OTHER, linewidth=0.8)
            continue
        colour, rim = REGION_COLOURS[number], rims[number]
        fill(axes, solid(camera, ORIGIN, rim), colour, 0.4)
        axes.plot(*camera(np.vstack([ORIGIN, rim, ORIGIN])).T, color=colour, linewidth=1.6)
    for name, axis in (("n₁", first), ("n₂", second), ("n₃", third)):
        reach = 1.2 if name == "n₃" else 0.95
        arrow(axes, camera(np.array([ORIGIN, reach * axis])), INK)
        word(axes, camera((reach + 0.1) * axis), name, fontsize=TEXT)
    axes.plot(*camera(ORIGIN), "o", color=INK, markersize=7)
    word(axes, camera(ORIGIN), "craft i", shift=(-12, -13), ha="right")
    for number, rim in rims.items():
        word(axes, camera(0.86 * rim[24]), ROMAN[number], fontsize=TEXT + 3, fontweight="bold")
    to_sun(axes, camera, 1.05 * SUN, 0.3)
    table(figure, search, mops)
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


def table(figure: Figure, search: Search, mops: int) -> None:
    """Add the table of search times with the regions of spacecraft i of A and spacecraft j of B."""
    columns = (0.69, 0.80, 0.92)
    heads = ("time [s]", "craft i\n(group A)", "craft j\n(group B)")
    for x, head, colour in zip(columns, heads, (INK, *GROUP_COLOURS.values()), strict=True):
        figure.text(x, 0.74, head, ha="center", va="bottom", fontsize=SMALL, color=colour, fontweight="bold")
    seen = zip(*(regions_searched(search, mops, group) for group in ("A", "B")), strict=True)
    for row, ((time, own), (_, other)) in enumerate(seen):
        y = 0.68 - 0.062 * row
        figure.text(columns[0], y, f"{time:.1f}", ha="center", va="center", fontsize=TEXT, color=INK)
        for x, number in zip(columns[1:], (own, other), strict=True):
            look: dict[str, Any] = {"color": REGION_COLOURS[number], "fontweight": "bold"}
            figure.text(x, y, ROMAN[number], ha="center", va="center", fontsize=TEXT, **look)
    text = (
        "At these times the whole region\nlies in the craft's cone: both see\neach other wherever j is in it."
    )
    figure.text(0.80, 0.30, text, ha="center", va="top", fontsize=SMALL, color=INK, linespacing=1.4)
