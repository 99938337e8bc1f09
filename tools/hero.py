"""Draw docs/images/hero.png: one spacecraft crosses a cluster, on the direct and on the certified path.

Run from the repository: python tools/hero.py
"""

from dataclasses import dataclass
from pathlib import Path as File

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import closeform as cf
from closeform.zones.outlines import shadow

PICTURE = File(__file__).parents[1] / "docs" / "images" / "hero.png"
NIGHT, STAR, GREY, BLUE, RED, GOLD = "#0b1526", "#f4f7fb", "#7f93ab", "#4cc2ff", "#ff5a3c", "#e8b04b"

# Phases [rad] of eight craft on two projected circles, and (radius [m], phase [rad]) of the ninth's ends.
INNER, OUTER = (-3.09, -1.09, 1.28), (-3.05, -1.8, -0.22, 1.08, 2.02)
FIRST, LAST = (335.0, -1.9), (332.0, 1.86)
ORBITS = 0.3
CIRCLES = np.array([2.0, 0.0, -1.0]) / np.sqrt(5)  # normal of the plane of the projected circles

Floats = NDArray[np.float64]


def projected_circle(orbit: cf.Orbit, radius: float, phase: float) -> Floats:
    """Return the state of natural motion on a projected circle of `radius` [m]."""
    n, cos, sin = orbit.mean_motion, np.cos(phase), np.sin(phase)
    return radius * np.array([sin / 2, cos, sin, n * cos / 2, -n * sin, n * cos])


@dataclass(frozen=True)
class View:
    """Directions to the right, upwards and towards the viewer."""

    right: Floats
    up: Floats
    near: Floats

    @property
    def plane(self) -> Floats:
        """Return the two directions of the picture, (2, 3)."""
        return np.array([self.right, self.up])


def clear_view(path: cf.Path, others: cf.Path, zone: cf.Zone, times: Floats) -> View:
    """Return the view with the least overlap of the path and the zones that it passes."""
    track = path.position(np.linspace(path.start, path.end, 200))
    rng = np.random.default_rng(3)
    least, chosen = np.inf, None
    for _ in range(6000):
        near, turn = rng.normal(size=3), rng.normal(size=3)
        near /= np.linalg.norm(near)
        right = np.cross(turn, near)
        right /= np.linalg.norm(right)
        view = View(right, np.cross(near, right), near)
        flat = track @ view.plane.T
        spread = np.ptp(flat, axis=0)
        if not 1.3 < spread[0] / spread[1] < 2.0 or not 0.3 < abs(near @ CIRCLES) < 0.7:
            continue
        crossed = 0.0
        half_axes = view.plane @ np.linalg.inv(zone.matrix)
        gauge = np.linalg.inv(half_axes @ half_axes.T)
        for k, time in enumerate(times):
            gap = flat - others[k].position(time) @ view.plane.T
            depth = 1 - np.sqrt(np.einsum("ki,ij,kj->k", gap, gauge, gap))
            crossed += np.clip(depth, 0, None).sum() + 60 * max(depth.max() - 0.05, 0)
        if crossed < least:
            least, chosen = crossed, view
    assert chosen is not None
    return chosen


def draw_zone(
    axes: Axes, outline: Floats, centre: Floats, depth: float, colour: str, strength: float
) -> None:
    """Draw a zone like glass, lit from the upper left."""
    light = 0.28 * np.array([-np.ptp(outline[:, 0]), np.ptp(outline[:, 1])]) / 2
    for step in np.linspace(0, 1, 14):
        axes.fill(
            *((1 - 0.9 * step) * outline + centre + step * light).T,
            color=colour,
            alpha=0.045 * strength,
            linewidth=0,
            zorder=depth,
        )
    axes.plot(
        *(outline + centre).T, color=colour, alpha=min(1.0, 0.75 * strength), linewidth=1.3, zorder=depth
    )
    axes.plot(*centre, "o", color=STAR, markersize=3.5, alpha=min(1.0, strength), zorder=depth)


def relative_orbit(path: cf.Path) -> Floats:
    """Return positions along the whole relative orbit of a coasting spacecraft."""
    period = path.orbit.period
    return path.orbit.coast(path.state(path.start), period).position(np.linspace(0, period, 120))


def draw_scene(axes: Axes, path: cf.Path, others: cf.Path, zone: cf.Zone, view: View) -> int:
    """Draw one panel and return the number of conflicts of the path."""
    outline = shadow(zone, view.plane)
    approach = cf.closest_approach(path, others, zone)
    conflicts = [cf.find_conflicts(path, others[k], zone) for k in range(len(others))]
    watched = np.argsort(approach.ratio)[:3]
    for k in range(len(others)):
        moment = approach.time[k]
        axes.plot(
            *(view.plane @ relative_orbit(others[k]).T), color=GREY, linewidth=0.8, alpha=0.3, zorder=-1000
        )
        trail = others[k].position(np.linspace(others.start[k], moment, 60)) @ view.plane.T
        for part in range(59):
            axes.plot(
                *trail[part : part + 2].T,
                color=GREY,
                linewidth=1.8,
                alpha=0.08 + 0.8 * part / 59,
                zorder=-999,
            )
        centre = others[k].position(moment)
        colour = RED if conflicts[k] else GOLD
        strength = 1.25 if k in watched else 0.65
        draw_zone(axes, outline, view.plane @ centre, float(view.near @ centre), colour, strength)
    times = np.linspace(path.start, path.end, 500)
    track = path.position(times)
    flat, depth = track @ view.plane.T, track @ view.near
    inside = np.zeros(len(times), dtype=bool)
    for stays in conflicts:
        for stay in stays:
            inside |= (times >= stay.start) & (times <= stay.end)
    for k in range(len(times) - 8):
        hit = inside[k] and inside[k + 1]
        look = {"color": RED if hit else BLUE, "linewidth": 5.5 if hit else 3.2, "solid_capstyle": "round"}
        axes.plot(*flat[k : k + 2].T, zorder=depth[k] + 1000 * hit, **look)
    axes.plot(
        *flat[0], "o", color=NIGHT, markeredgecolor=BLUE, markeredgewidth=2.2, markersize=8, zorder=2000
    )
    tip = {"arrowstyle": "-|>,head_width=0.45,head_length=0.9", "color": BLUE, "linewidth": 2.5, "shrinkB": 0}
    axes.annotate("", flat[-1], flat[-14], arrowprops=tip, zorder=2000)
    return sum(map(len, conflicts))


def main() -> None:
    orbit = cf.Orbit.circular(500e3)
    zone = cf.Ellipsoid([20.0, 40.0, 20.0])
    duration = ORBITS * orbit.period
    rings = [(110.0, phase) for phase in INNER] + [(210.0, phase) for phase in OUTER]
    others = orbit.coast(np.array([projected_circle(orbit, *ring) for ring in rings]), duration)
    planned = orbit.transfer(projected_circle(orbit, *FIRST), projected_circle(orbit, *LAST), duration)
    shaped = cf.avoid(planned, others, zone)
    assert shaped.path is not None
    approach = cf.closest_approach(shaped.path, others, zone)
    nearest = np.argsort(approach.ratio)[:3]
    view = clear_view(shaped.path, others[nearest], zone, approach.time[nearest])

    figure = Figure(figsize=(12, 5), dpi=133, facecolor=NIGHT)
    for k, (path, word) in enumerate(((planned, "planned"), (shaped.path, "shaped"))):
        axes = figure.add_axes((0.015 + 0.49 * k, 0.02, 0.48, 0.84))
        axes.set_axis_off()
        count = draw_scene(axes, path, others, zone, view)
        every = np.vstack([path.position(np.linspace(0, duration, 100)), others.position(0.0)]) @ view.plane.T
        low, high = every.min(axis=0), every.max(axis=0)
        axes.set_xlim(low[0] - 30, high[0] + 30)
        axes.set_ylim(low[1] - 30, high[1] + 30)
        axes.set_aspect("equal")
        if path is not planned:
            old = planned.position(np.linspace(0, duration, 200)) @ view.plane.T
            axes.plot(*old.T, color=RED, linewidth=1.4, linestyle=(0, (4, 3)), alpha=0.75, zorder=-500)
        share = 100 * shaped.extra_energy / planned.energy
        text = f"{count} conflicts" if count else f"clear for {share:.1f} % more energy"
        figure.text(0.03 + 0.49 * k, 0.92, word, color=GREY, fontsize=19, va="center")
        figure.text(
            0.128 + 0.49 * k,
            0.92,
            text,
            color=RED if count else BLUE,
            fontsize=20,
            weight="bold",
            va="center",
        )
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(PICTURE)


if __name__ == "__main__":
    main()
