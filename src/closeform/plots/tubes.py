"""Figure of a covariance tube around a relative path, with the keep-out zone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from closeform.arrays import Floats, instance, number
from closeform.motion.path import Path
from closeform.plots.camera import Camera
from closeform.plots.fleet import SIDE, three_planes
from closeform.plots.fonts import short_names
from closeform.plots.palette import AFTER, CONFLICT, INK, ZONE
from closeform.plots.sigma_curves import Deviations
from closeform.plots.style import SMALL, clock, headline, legend
from closeform.plots.zones_and_tracks import headings, place
from closeform.uncertainty.clearance import SigmaApproach, clearance_in_sigmas
from closeform.uncertainty.errors import Uncertainty
from closeform.zones.outlines import CIRCLE, shadow
from closeform.zones.zone import Zone

TUBE = "#cfe4f3"
MOST = 400  # maximum number of ellipses of a tube
SHOWN = 9  # ellipses with an outline


def tube(
    path: Path,
    other: Path,
    zone: Zone,
    errors: Uncertainty,
    other_errors: Uncertainty | None = None,
    sigmas: float = 3.0,
    names: Sequence[str] | None = None,
) -> Figure:
    """Plot the relative position of two spacecraft within some sigmas, in three planes, with the zone.

    The tube is the union of the covariance ellipsoids of that size along the path. Some outlines are drawn at
    equal time steps. The outline in the conflict colour is at the closest approach in sigmas.

    Parameters
    ----------
    path, other : Path
        Paths of one spacecraft each, in one orbit; the position of the first relative to the other is shown.
    zone : Zone
        Keep-out zone around the other spacecraft.
    errors : Uncertainty
        Uncertainty of the first spacecraft, or of the relative state if `other_errors` is None.
    other_errors : Uncertainty, optional
        Uncertainty of the other spacecraft.
    sigmas : float, no unit, default 3
        Size of the tube in standard deviations.
    names : sequence of str, optional
        Names of the two spacecraft.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If a path is a batch, orbits differ, there is no common time, `sigmas` is not above 0, the number of
        names is not two, or an argument has the wrong type.
    """
    instance("zone", zone, Zone)
    many = number("sigmas", sigmas)
    if not 0.0 < many < np.inf:
        raise ValueError(f"sigmas: must be finite and above 0, got {many:g}")
    instance("errors", errors, Uncertainty)
    one, two = short_names(names, 2)
    found = Deviations.of(path, other, errors, other_errors)
    least = clearance_in_sigmas(path, other, zone, errors, other_errors)
    nearest = int(np.argmin(np.abs(found.times - least.time))) if np.isfinite(least.time) else None
    track = found.states[:, :3]
    wide = many * np.sqrt(np.einsum("tii->ti", found.covariances)[:, :3])
    zone_reach = zone.support(np.concatenate([np.eye(3), -np.eye(3)]))
    reach = np.where(np.isfinite(zone_reach), zone_reach, 0.0)
    low = np.minimum((track - wide).min(axis=0), -reach[3:])
    top = np.maximum((track + wide).max(axis=0), reach[:3])
    figure, unit, panels = three_planes(np.stack([low, top]), 1.12)
    across, high = figure.get_size_inches()
    some = np.unique(np.linspace(0, len(track) - 1, MOST).astype(int))
    for axes, camera, _ in panels:
        swept(axes, camera, unit.size, found, many, some, nearest)
        outline = shadow(zone, camera.basis[:2]) / unit.size
        place(axes, outline, (0.0, 0.0), facecolor=ZONE, edgecolor=ZONE, alpha=0.4, linewidth=1.2, zorder=4)
        headings(axes, camera, [track / unit.size], [AFTER], 6.0)
    marks(figure, many, nearest is not None)
    swept_by = f"All that errors within {many:g} sigma sweep; outlines at {SHOWN} equal times"
    figure.text(SIDE / across, 1.0 - 0.55 / high, swept_by, fontsize=SMALL, color=INK)
    ticks = clock(path, float(found.times[0]), float(found.times[-1]))
    headline(figure, f"{one} relative to {two}: {said(least, many, ticks)}")
    return figure


def swept(
    axes: Axes,
    camera: Camera,
    unit: float,
    found: Deviations,
    sigmas: float,
    some: Any,
    nearest: int | None,
) -> None:
    """Draw the tube in one plane: covariance ellipses, some outlines, and the path."""
    basis = camera.basis[:2] / unit
    centres = found.states[:, :3] @ basis.T
    ellipses = ellipse(basis @ found.covariances[:, :3, :3] @ basis.T, sigmas) + centres[:, None]
    joints = [np.concatenate([ellipses[a], ellipses[b]]) for a, b in zip(some[:-1], some[1:], strict=True)]
    axes.add_collection(
        PolyCollection([hulled(points) for points in joints], facecolor=TUBE, edgecolor=TUBE, zorder=1)
    )
    lined = ellipses[np.unique(np.linspace(0, len(ellipses) - 1, SHOWN).astype(int))]
    axes.add_collection(PolyCollection(lined, facecolor="none", edgecolor=AFTER, linewidth=0.7, zorder=2))
    axes.plot(*centres.T, color=AFTER, linewidth=2.2, zorder=3)
    axes.plot(*centres[0], "o", color=INK, markerfacecolor="none", markersize=9, zorder=6)
    axes.plot(*centres[-1], "o", color=INK, markersize=5, zorder=6)
    if nearest is not None:
        look: dict[str, Any] = {"facecolor": "none", "edgecolor": CONFLICT, "linewidth": 1.8}
        axes.add_collection(PolyCollection([ellipses[nearest]], zorder=5, **look))
        axes.plot(*centres[nearest], "o", color=CONFLICT, markersize=6, zorder=5.5)


def ellipse(covariances: Floats, sigmas: float) -> Floats:
    """Return outlines (T, K, 2) of covariances (T, 2, 2)."""
    values, vectors = np.linalg.eigh(covariances)
    axes = vectors * (sigmas * np.sqrt(np.maximum(values, 0.0)))[:, None, :]
    return np.asarray(CIRCLE @ axes.transpose(0, 2, 1))


def hulled(points: Floats) -> Floats:
    """Return the convex hull (K, 2) of points (M, 2), or the points if they lie on a line."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:  # collinear points
        return points


def marks(figure: Figure, sigmas: float, touched: bool) -> None:
    """Add the legend."""
    ring: dict[str, Any] = {"linestyle": "", "marker": "o", "color": INK}
    handles: list[Any] = [
        Line2D([], [], color=AFTER, linewidth=2.2, label="path"),
        Patch(facecolor=TUBE, edgecolor=AFTER, linewidth=0.7, label=f"within {sigmas:g} sigma"),
        Line2D([], [], markerfacecolor="none", markersize=8, label="start", **ring),
        Line2D([], [], markersize=6, label="end", **ring),
        Patch(facecolor=ZONE, edgecolor=ZONE, alpha=0.4, label="zone"),
    ]
    if touched:
        look: dict[str, Any] = {"marker": "o", "color": CONFLICT, "linewidth": 1.8}
        handles.append(Line2D([], [], label="closest approach in sigmas", **look))
    legend(figure, handles, [one.get_label() for one in handles], ncols=3, columnspacing=1.4, fontsize=SMALL)


def said(least: SigmaApproach, sigmas: float, ticks: Any) -> str:
    """Return the headline: whether the tube is clear, and the minimum clearance in sigmas."""
    if not np.isfinite(least.time):
        return "no error of any size leads into the zone"
    how = "clear" if least.sigmas >= sigmas else "not clear"
    return f"{how} at {sigmas:g} sigma, least {least.sigmas:.2f} sigma at {ticks.text(least.time)}"
