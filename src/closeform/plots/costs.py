"""Cost of a plan: its primer, and minimum cost against transfer duration and size of the zones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from closeform.arrays import Floats, instance, whole
from closeform.fuel.allocation import Allocation
from closeform.fuel.arrivals import TransferCostTable
from closeform.fuel.bound import least_delta_v
from closeform.fuel.burns import burns_of
from closeform.fuel.thrusters import Thrusters
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path, ends_of
from closeform.planning.clearance_cost_curve import ClearanceCostCurve
from closeform.planning.max_clearance import MaxClearance
from closeform.planning.plan import Plan
from closeform.plots.drawing import style, units
from closeform.plots.drawing.inputs import crafts, one_craft, picture
from closeform.plots.drawing.palette import AFTER, BEFORE, CONFLICT, FAINT, INK, OTHER, ZONE
from closeform.plots.drawing.text import NEAR, label, word

EQUAL = 0.05  # per cent above a bound that count as equal to it
LABELLED = 12  # impulses or slots that are labelled
SMALLEST = 0.02  # of the largest impulse: smaller ones are not labelled
STEEP = 4.0  # times the minimum delta-v: a curve that rises higher has a logarithmic axis
GRID = 600  # instants at which a primer along thrusters is constrained to at most 1
PENALTY = 100.0  # for exceeding 1, in units of the sum of all impulses


@dataclass(frozen=True, eq=False)
class ContactTerms:
    """Contact terms of a spacecraft's primer: `times` (K,) [s] and `pushes` (K, 3) [1/m].

    A push is the multiplier of a contact along its normal, with opposite sign for the second spacecraft.
    """

    orbit: Orbit
    times: Floats
    pushes: Floats

    @classmethod
    def of(cls, plan: Path | Plan, craft: int, path: Path) -> Self:
        """Return the pushes at contacts inside the manoeuvre; none for a path or a minimum-energy plan."""
        first, last = path.start, path.end
        if isinstance(plan, Plan):
            first, last = plan.starts[craft], plan.starts[craft] + plan.durations[craft]
        touches = [] if isinstance(plan, Path) or plan.cost == "energy" else plan.contacts
        mine = [one for one in touches if craft in (one.first, one.second) and first < one.time < last]
        signs = [1.0 if one.first == craft else -1.0 for one in mine]
        pushes = [sign * one.multiplier * one.normal for sign, one in zip(signs, mine, strict=True)]
        return cls(path.orbit, np.array([one.time for one in mine]), np.reshape(pushes, (-1, 3)))

    def __len__(self) -> int:
        return len(self.times)

    def __call__(self, times: Floats) -> Floats:
        """Return the sum (T, 3) of the contributions of all later contacts at given times [s]."""
        ahead = self.times - np.asarray(times)[:, None]
        moves = self.orbit.transition(-ahead, self.times)[..., :3, 3:]
        felt = np.where(ahead > 0.0, 1.0, 0.0)[..., None] * -np.einsum("tkij,kj->tki", moves, self.pushes)
        return np.asarray(felt.sum(axis=1))


@dataclass(frozen=True, eq=False)
class Primer:
    """Primer p(t) = Psi(t) c plus the `contacts` terms, theory (38).

    With `thrusters`, its component along the best thruster counts; otherwise its length.
    """

    start: float
    first: Floats  # (6,): c
    contacts: ContactTerms
    thrusters: Thrusters | None = None

    @classmethod
    def of(cls, path: Path, contacts: ContactTerms, thrusters: Thrusters | None) -> Self:
        """Fit the primer to a path's impulses: along them and of length 1, as closely as possible."""
        times = np.array([time for time, _ in path.impulses])
        pushes = np.array([push for _, push in path.impulses])
        rows = positions(path.orbit, times, path.start)
        if thrusters is not None:
            return cls(path.start, _along(path, contacts, thrusters, pushes, rows), contacts, thrusters)
        sizes = np.linalg.norm(pushes, axis=1, keepdims=True)
        scale = np.array([1.0] * 3 + [1.0 / (path.end - path.start)] * 3)
        weights = np.sqrt(sizes)
        aim = weights * (pushes / sizes - contacts(times))
        found = np.linalg.lstsq((weights[..., None] * rows * scale).reshape(-1, 6), aim.ravel(), rcond=1e-9)
        return cls(path.start, scale * found[0], contacts)

    def __call__(self, times: Floats) -> Floats:
        """Return the primer p (T, 3) at given times [s]."""
        return positions(self.contacts.orbit, times, self.start) @ self.first + self.contacts(times)

    def heights(self, times: Floats) -> Floats:
        """Return the maximum value (T,) of an impulse per metre per second."""
        primer = self(times)
        if self.thrusters is None:
            return np.asarray(np.linalg.norm(primer, axis=1))
        toward = self.thrusters.directions_at(self.contacts.orbit, times)
        return np.asarray(np.einsum("tmi,ti->tm", toward, primer).max(axis=1))

    def spent(self, time: float, push: Floats) -> float:
        """Return the cost [m/s] of an impulse (3,), summed over thrusters."""
        if self.thrusters is None:
            return float(np.linalg.norm(push))
        allocation = Allocation.of(self.thrusters.directions_at(self.contacts.orbit, time))
        return float(allocation.amounts(allocation.facets(push[None], 0.0), push[None]).sum())


def positions(orbit: Orbit, times: Any, start: float) -> Floats:
    """Return Psi (T, 3, 6), which maps a state at a start to positions of its natural motion at `times`."""
    return orbit.transition(times - start, start)[..., :3, :]


def _along(path: Path, contacts: ContactTerms, thrusters: Thrusters, pushes: Floats, rows: Floats) -> Floats:
    """Return the initial c of the primer that maximises the value of impulses, d . p <= 1, theory (36)."""
    from scipy.optimize import linprog

    orbit, start = path.orbit, path.start
    scale = np.array([1.0] * 3 + [1.0 / (path.end - start)] * 3)
    times = np.union1d(np.linspace(start, path.end, GRID), [time for time, _ in path.impulses])
    toward = thrusters.directions_at(orbit, times)
    limits = np.einsum("tmi,tij->tmj", toward, positions(orbit, times, start) * scale).reshape(-1, 6)
    room = 1.0 - np.einsum("tmi,ti->tm", toward, contacts(times)).ravel()
    gain = np.einsum("ji,jik->k", pushes, rows * scale)
    penalty = PENALTY * np.linalg.norm(pushes, axis=1).sum()
    found = linprog(
        np.append(-gain, penalty),
        A_ub=np.column_stack([limits, -np.ones(len(limits))]),
        b_ub=room,
        bounds=[(None, None)] * 6 + [(0.0, None)],
    )
    return np.asarray(scale * found.x[:6])


@picture(
    "the path is a batch, is too long or is not a path, or if a plan has no path or no such spacecraft",
    source="docs/theory.md (26, 27, 36, 38)",
)
def primer(path: Path | Plan, craft: int = 0, thrusters: Thrusters | None = None) -> Figure:
    """Plot the magnitude of a primer against time: 1 at optimal impulses, nowhere above 1.

    Each dot is an impulse, labelled with its size, at the height p . v/|v|: its value per metre per second.
    Finite burns are grey. For a path, the primer is that of its end states without obstacles. On the optimal
    plan all dots lie at 1; on another path, a dot below 1 shows the wasted share. A plan around zones has a
    primer of its own, whose rate jumps at each contact with a zone; pass the plan itself to plot it.

    Parameters
    ----------
    path : Path or Plan
        Path of one spacecraft over at most 100 orbits, from `Orbit.impulsive` or any other between its end
        states; or a minimum-delta-v plan.
    craft : int, default 0
        Index of the spacecraft in a `Plan`.
    """
    planned_paths = path.paths if isinstance(path, Plan) else path
    several = isinstance(path, Plan) and planned_paths is not None
    if whole("craft", craft) >= (count := len(planned_paths) if several and planned_paths is not None else 1):
        raise ValueError(f"craft: must be from 0 to {count - 1}, got {craft}")
    one = one_craft("path", planned_paths[craft] if several and planned_paths is not None else planned_paths)
    contacts = ContactTerms.of(path, craft, one)
    burns, impulses = len(burns_of(one).significant.size), len(one.impulses)
    how = units.plural(burns, "burn") if burns > impulses else units.plural(impulses, "impulse")
    times, when = units.instants(one.start, one.end, one), np.array([time for time, _ in one.impulses])
    pushes = np.array([push for _, push in one.impulses]).reshape(-1, 3)
    note = ""
    if one.impulses and (len(contacts) or thrusters is not None):
        found = Primer.of(one, contacts, thrusters)
        lengths, values = found.heights(times), found(when)
        sizes = np.array([found.spent(time, push) for time, push in one.impulses])
        spent = float(sizes.sum())
        bound = float((values * pushes).sum()) / max(1.0, float(lengths.max()))
        whose = " of these thrusters" if thrusters is not None else ""
        whose += " for these passing sides" if len(contacts) else ""
        above = 100.0 * (spent / bound - 1.0)
        said = f"the minimum{whose}" if above < EQUAL else f"at most {above:.2g} % above the minimum{whose}"
    else:
        least = least_delta_v(one.orbit, *ends_of(one), one.end - one.start)
        curve, bound = least.primer, float(least.lower)
        lengths = np.linalg.norm(curve.position(times - one.start), axis=-1)
        values = curve.position(when - one.start) if len(when) else np.empty((0, 3))
        sizes, spent = np.linalg.norm(pushes, axis=1), float(one.delta_v)
        said = "the minimum" if least.proven else f"the minimum is at least {units.speed(bound)}"
        if spent > float(least.upper) * (1.0 + 1e-6):
            above = 100.0 * (spent / bound - 1.0) if bound > 0.0 else np.inf
            share = f"{above:.3g} % above" if np.isfinite(above) else "above"
            said = f"{f'within {EQUAL} % of' if above < EQUAL else share} the minimum, {units.speed(bound)}"
            note = "" if above < EQUAL else "primer of the end states without obstacles"
    heights = (values * pushes).sum(axis=1) / np.where(sizes > 0.0, sizes, 1.0)
    name = "primer magnitude" if thrusters is None else "primer along thrusters"
    figure = primer_curve(one, lengths, f"{units.speed(spent)} with {how}: {said}", name)
    mark_impulses(figure.axes[0], one, when, heights, sizes, contacts.times)
    word(figure.axes[0], (0.0, 0.0), note, shift=(6, 5), ha="left", va="bottom", xycoords="axes fraction")
    return figure


def primer_curve(path: Path, lengths: Floats | None, said: str, name: str = "primer magnitude") -> Figure:
    """Plot the magnitude of a primer against time, by default the length of the path's own positions."""
    times, ticks = units.instants(path.start, path.end, path), units.clock(path, path.start, path.end)
    lengths = np.linalg.norm(path.position(times), axis=-1) if lengths is None else lengths
    figure, (axes,) = style.chart(4.6)
    axes.axhline(1.0, color=ZONE, linewidth=1.6)
    axes.plot(ticks(times), lengths, color=AFTER, linewidth=2.0)
    axes.set_ylim(min(0.0, 1.1 * float(lengths.min())), max(1.45, 1.15 * float(lengths.max(initial=0.0))))
    axes.set_ylabel(name)
    style.time_axes([axes], ticks, path.start, path.end)
    style.headline(figure, said)
    return figure


def mark_impulses(
    axes: Axes, path: Path, when: Floats, heights: Floats, sizes: Floats, contacts: Floats
) -> None:
    """Draw finite burns, contacts with zones, and a labelled dot for each impulse."""
    ticks, burns = units.clock(path, path.start, path.end), burns_of(path)
    for begin, lasts in zip(burns.start.tolist(), burns.duration.tolist(), strict=True):
        if lasts > 0.0:
            axes.axvspan(ticks(begin), ticks(begin + lasts), color=OTHER, alpha=0.35, linewidth=0, zorder=1)
    for k, time in enumerate(contacts):
        axes.axvline(ticks(time), color=ZONE, linestyle=style.DASHED, linewidth=1.2, zorder=1.5)
        if k == 0:
            late = time > 0.5 * (path.start + path.end)
            look: dict[str, Any] = {"ha": "right" if late else "left", "va": "bottom"}
            word(
                axes,
                (float(ticks(time)), axes.get_ylim()[0]),
                "contact",
                "#9a6a00",
                (-5 if late else 5, 5),
                **look,
            )
    axes.plot(ticks(when), heights, "o", color=INK, markersize=7, linestyle="", zorder=5, clip_on=False)
    axes.set_ylim(min(axes.get_ylim()[0], 1.1 * float(heights.min(initial=0.0))))
    large = np.flatnonzero(sizes >= SMALLEST * sizes.max(initial=0.0))
    large = large[np.argsort(-sizes[large], kind="stable")][:LABELLED]
    if len(large):
        points = np.column_stack([ticks(when), np.maximum(heights, 1.0)])[large]
        label(axes, points, [units.speed(size) for size in sizes[large].tolist()])


@picture("the table has no duration")
def trade(found: TransferCostTable, plan: Path | Sequence[Path] | None = None) -> Figure:
    """Plot the minimum delta-v against the transfer duration, to the lowest-cost slot for each duration.

    The dashed line is the minimum over all durations. If the lowest-cost slot changes only a few times,
    labels name it by its index, from 0.

    Parameters
    ----------
    plan : Path or sequence of Path, optional
        Plan to mark with a ring at its duration and delta-v, summed over several spacecraft.
    """
    if not len(found.duration):
        raise ValueError("found: has no duration; give transfer_cost_table at least one")
    order = np.argsort(found.duration)
    across = units.plain_unit(float(found.duration.max()))
    up = units.speed_unit(float(found.delta_v[order[-1]]))
    durations, costs = found.duration[order] / across.size, found.delta_v[order] / up.size
    slots = found.slot[order]

    figure, (axes,) = style.chart(4.6)
    axes.axhline(costs.min(), color=BEFORE, linestyle=style.DASHED, linewidth=1.2)
    axes.plot(durations, costs, "o-", color=AFTER, linewidth=1.6, markersize=4)
    if costs.max() > STEEP * costs.min() > 0.0:
        style.log_axis(axes)
    changes = np.flatnonzero(np.diff(slots, prepend=slots[0] - 1))
    marks: list[tuple[float, float, str]] = []
    if 1 < len(changes) <= LABELLED:
        marks += [(durations[k], costs[k], f"slot {slots[k]}") for k in changes]
    if plan is not None:
        planned = crafts("plan", plan)
        lasts, spent = max(one.end - one.start for one in planned), sum(one.delta_v for one in planned)
        marks.insert(0, (lasts / across.size, spent / up.size, "plan"))
        axes.plot(*marks[0][:2], "o", markersize=10, markerfacecolor="none", color=INK)
    if marks:
        label(axes, np.array([mark[:2] for mark in marks]), [name for *_, name in marks], spots=NEAR)
    axes.set_xlabel(f"duration [{across.name}]")
    axes.set_ylabel(f"minimum delta-v [{up.name}]")
    ends = [f"{costs[k]:.4g} {up.name} in {durations[k]:.4g} {across.name}" for k in (0, -1)]
    style.headline(figure, f"Minimum delta-v {', '.join(ends[: len(durations)])}")
    return figure


@picture("there is no plan, or `most` has none or is a number of sigmas")
def clearance(found: ClearanceCostCurve, most: MaxClearance | None = None) -> Figure:
    """Plot the cost of a plan against the size of the zones: a point for each plan.

    Dots join two plans with different passing sides.
    Crosses at the top are sizes for which no clear plan was found. The dashed line is the cost without
    obstacles.
    """
    if not np.isfinite(found.spent).any():
        raise ValueError("found: no clear plan was found at any size; there is nothing to show")
    if most is not None and not instance("most", most, MaxClearance).ok:
        raise ValueError(f"most: has no plan; {most.reason}")
    factors, costs, plans = found.factor, found.spent, list(found.plans)
    if most is not None and most.sigmas == most.sigmas:
        raise ValueError("most: is a number of sigmas, not a size of zones; compute it without errors")
    if most is not None and most.plan is not None:  # an ordinary point of the curve
        factors, costs = np.append(factors, most.factor), np.append(costs, most.plan.spent)
        plans.append(most.plan)
    order = np.argsort(factors, kind="stable")
    factors, costs = factors[order], costs[order]
    plans = [plans[k] for k in order]
    highest = max(float(np.nanmax(costs)), 0.0 if most is None else most.budget)
    up = units.speed_unit(highest) if found.cost == "delta-v" else energy_unit(highest)

    figure, (axes,) = style.chart(5.2)
    axes.axvline(1.0, color=FAINT, linewidth=2.0)
    axes.axhline(found.free / up.size, color=BEFORE, linestyle=style.DASHED, linewidth=1.2)
    seen = np.flatnonzero(np.isfinite(costs))
    for k, m in zip(seen, seen[1:], strict=False):
        joined = m == k + 1 and alike(plans[k], plans[m])
        tint, dashes = (AFTER, "-") if joined else (OTHER, style.DOTTED)
        axes.plot(factors[[k, m]], costs[[k, m]] / up.size, color=tint, linestyle=dashes, linewidth=2.0)
    axes.plot(factors[seen], costs[seen] / up.size, "o", color=AFTER, markersize=4.5)
    lost = np.setdiff1d(np.arange(len(factors)), seen)
    if len(lost):
        look: dict[str, Any] = {"color": CONFLICT, "transform": axes.get_xaxis_transform(), "clip_on": False}
        axes.plot(factors[lost], np.full(len(lost), 1.0), "x", markersize=7, **look)
    if most is not None and most.plan is not None:
        place = most.factor, most.plan.spent / up.size
        axes.axhline(most.budget / up.size, color=ZONE, linewidth=1.6)
        axes.plot(*place, "o", markersize=12, markerfacecolor="none", color=INK, zorder=6)
        words = f"{most.factor:.4g} × zone, {most.metres:+.4g} m: {most.status}".replace("-", "−")
        label(axes, np.array([place]), [words], tracks=np.column_stack([factors, costs / up.size])[seen])
    axes.set_xlabel("scale factor of the zones")
    axes.set_ylabel(f"minimum {found.cost} [{up.name}]")
    metre = float(np.ptp(found.metres) / np.ptp(found.factor)) if np.ptp(found.factor) > 0.0 else 0.0
    if metre > 0.0:
        lengths = (lambda factor: (factor - 1.0) * metre), (lambda length: 1.0 + length / metre)
        style.other_axis(axes, "top", lengths, "distance added to the zones [m]")
    if (free := found.free / up.size) > 0.0:
        shares = (lambda cost: 100.0 * (cost / free - 1.0)), (lambda share: free * (1.0 + 0.01 * share))
        style.other_axis(axes, "right", shares, "increase over the plan without obstacles [%]")
    style.headline(figure, clearance_story(found, most, up))
    return figure


def clearance_story(found: ClearanceCostCurve, most: MaxClearance | None, up: units.Unit) -> str:
    """Return the headline of the clearance figure."""
    if most is not None:
        share = f" ({units.signed_percent(most.budget / found.free - 1.0)})" if found.free > 0.0 else ""
        return f"{up.text(most.budget)}{share} afford zones {most.factor:.4g} times as large"
    seen = np.flatnonzero(np.isfinite(found.spent))
    first, last = seen[np.argmin(found.factor[seen])], seen[np.argmax(found.factor[seen])]
    return ", ".join(f"{up.text(found.spent[k])} at {found.factor[k]:.4g} × zone" for k in (first, last))


def alike(one: Plan, other: Plan) -> bool:
    """Return True if no pair is passed on different sides in two plans."""
    return all(
        a.normal @ b.normal > 0.0
        for a in one.contacts
        for b in other.contacts
        if (a.first, a.second) == (b.first, b.second)
    )


def energy_unit(greatest: float) -> units.Unit:
    """Return the display unit for a maximum energy [m^2/s^3]."""
    for size, name in ((1.0, "m²/s³"), (1e-6, "mm²/s³")):
        if greatest >= size:
            return units.Unit(size, name)
    return units.Unit(1e-12, "µm²/s³")
