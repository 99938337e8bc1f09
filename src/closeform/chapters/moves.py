"""Chapters of a coast and of a move: conflicts before, the change made, conflicts after."""

from closeform.chapters.sheet import Chapter, Sheet
from closeform.conflicts.flight import Flight
from closeform.motion.path import Path
from closeform.stage_results import Change, Leg

MOST_PAIRS = 1000  # of closest approaches in a sheet; the table in Parquet has all


def coast(title: str, leg: Leg) -> Chapter:
    """Nothing burns."""
    lines, sheets = encounters("Conflicts", leg.after)
    return Chapter(title, lines, sheets + nearest("Closest approaches", leg.after))


def move(title: str, leg: Leg, change: Change) -> Chapter:
    """One craft moves."""
    lines, sheets = encounters("Conflicts before", leg.before)
    sheets += (efforts(change),)
    after_lines, after_sheets = encounters("Conflicts after", leg.after)
    if not change.avoidance.ok:
        after_lines = ("The direct path is kept: no way around was found",)
        after_sheets = ()
    sheets += after_sheets
    sheets += nearest("Closest approaches before", leg.before) + nearest(
        "Closest approaches after", leg.after
    )
    return Chapter(title, lines, sheets, (*how(change), *after_lines))


def encounters(title: str, flight: Flight) -> tuple[tuple[str, ...], tuple[Sheet, ...]]:
    """A sheet of conflicts, or a line that there are none, and how close the closest pair comes."""
    if not flight.encounters:
        close = flight.closest
        if close is None:
            return (f"{title}: none, there is only one craft",), ()
        at = close.approach
        return (
            f"{title}: none; closest are {close.first} and {close.second}, {at.ratio:.4f} x zone "
            f"({at.distance:.3f} m) at {at.time:.1f} s",
        ), ()
    rows = tuple(
        (
            f"{met.first} - {met.second}",
            f"{met.conflict.start:.3f}",
            f"{met.conflict.end:.3f}",
            f"{met.conflict.end - met.conflict.start:.3f}",
            f"{met.conflict.time:.3f}",
            f"{met.conflict.ratio:.4f} x zone",
        )
        for met in flight.encounters
    )
    return (), (Sheet(title, ("pair", "from [s]", "to [s]", "lasts [s]", "deepest at [s]", "least"), rows),)


def nearest(title: str, flight: Flight) -> tuple[Sheet, ...]:
    """Every pair's closest approach; of very many pairs the closest."""
    pairs = flight.nearest
    if len(pairs) > MOST_PAIRS:
        pairs = tuple(sorted(pairs, key=lambda pair: pair.approach.ratio)[:MOST_PAIRS])
        title += f", the {MOST_PAIRS} closest of {len(flight.nearest)}"
    rows = tuple(
        (
            f"{pair.first} - {pair.second}",
            f"{pair.approach.ratio:.4f} x zone",
            f"{pair.approach.distance:.3f}",
            f"{pair.approach.time:.3f}",
        )
        for pair in pairs
    )
    return (Sheet(title, ("pair", "least", "distance [m]", "at [s]"), rows, more=True),) if rows else ()


def efforts(change: Change) -> Sheet:
    """Energy and delta-v of the direct path and of the way around, beside each other."""
    columns = ("path", "energy [m²/s³]", "delta-v [m/s]", "peak thrust [mm/s²]")
    rows = [("direct", *(f"{value:#.6g}" for value in effort(change.direct)))]
    around = change.avoidance.path
    if around is not None and around is not change.direct:
        rows.append(("around", *(f"{value:#.6g}" for value in effort(around))))
        pairs = zip(effort(change.direct), effort(around), strict=True)
        rows.append(("change", *(f"{100 * (b / a - 1):+.3f} %" if a else "-" for a, b in pairs)))
    return Sheet("Change made", columns, tuple(rows))


def effort(path: Path) -> tuple[float, float, float]:
    """Energy [m²/s³], delta-v [m/s] and peak thrust [mm/s²]."""
    return path.energy, path.delta_v, 1e3 * path.peak_thrust


def how(change: Change) -> tuple[str, ...]:
    """How the way around was found, where it touches zones, and whether it is the best there is."""
    avoidance = change.avoidance
    if not avoidance.ok:
        return (f"Method {change.method}: {avoidance.status}: {avoidance.reason}",)
    if not avoidance.contacts:
        return (f"Method {change.method}: no change needed, {avoidance.status}",)
    touched = ", ".join(f"{change.others[at.obstacle]} at {at.time:.1f} s" for at in avoidance.contacts)
    sides = "all sides searched" if avoidance.exhausted else "not all sides searched"
    best = (
        "proven the global optimum" if avoidance.proven else f"best of {avoidance.tried} ways tried, {sides}"
    )
    return (
        f"Method {change.method}: touches the zone of {touched}",
        f"Extra energy {avoidance.extra_energy:.6g} m²/s³ beyond the free optimum; {best}",
    )
