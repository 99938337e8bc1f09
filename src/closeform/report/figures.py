"""The pictures of a run."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from closeform.chapters.sheet import minutes
from closeform.result_folder import Folder
from closeform.search.gathering import EventKind, Gathering
from closeform.stage_results import Change, FirstLocks, Leg, Reshaping

MOMENTS = 6  # of a gathering that are shown
FILMED, FRAMES = 200, 100  # craft at most in an animation, and its pictures beside those of locks


def pictures(leg: Leg, folder: Folder, progress: Callable[[str], None]) -> list[tuple[Path, str]]:
    """The pictures of a stage with their captions."""
    if isinstance(leg.deed, Gathering):
        return list(views(leg, leg.deed, folder, progress))
    return [
        (folder.picture(f"stage-{leg.number}-{name}", figure), caption)
        for name, figure, caption in figures(leg)
    ]


def moments(gathering: Gathering) -> list[float]:
    """When something is to be seen, at most MOMENTS times [s].

    The kernel of the formation set, the end, then the locks by which most craft join the formation
    set, then those that begin another set, then the rest.
    """
    locks = [event for event in gathering.events if event.kind is EventKind.LOCK]
    joins = [event.time for event in gathering.events if event.kind is EventKind.BURN]
    ranked = sorted(locks, key=lambda lock: (-joins.count(lock.time), lock.case != 1, lock.time))
    times = [*(lock.time for lock in locks[:1]), gathering.duration, *(lock.time for lock in ranked)]
    return sorted(list(dict.fromkeys(times))[:MOMENTS])


def views(
    leg: Leg, gathering: Gathering, folder: Folder, progress: Callable[[str], None]
) -> Iterator[tuple[Path, str]]:
    """Three views at the key moments of a gathering, and its animation."""
    from closeform import plots

    names, times = leg.after.names, moments(gathering)
    if len(names) <= FILMED:
        film = folder.path / f"stage-{leg.number}-gathering.gif"

        def told(done: int, frames: int) -> None:
            progress(f"animation: picture {done} of {frames}")

        plots.animation(gathering, film, names=names, frames=FRAMES, progress=told)
        yield film, "The gathering from the start of its search to its end"
    for k, time in enumerate(times, 1):
        progress(f"three views: {k} of {len(times)}")
        picture = folder.picture(
            f"stage-{leg.number}-view-{k}", plots.three_views(gathering, time, names=names)
        )
        yield picture, f"{time:.2f} s ({minutes(time)} min:s) after the start of the search"


def figures(leg: Leg) -> Iterator[tuple[str, Any, str]]:
    """Name, figure and caption of every picture of a stage."""
    from closeform import plots

    if isinstance(leg.deed, Reshaping):
        yield from together(leg, leg.deed)
        return
    if isinstance(leg.deed, FirstLocks):
        search = leg.deed.search
        yield "in-plane-search", plots.in_plane_search(search), "The in-plane search of both groups"
        yield "manoeuvres", plots.manoeuvres(search), "The turns of the first round"
    change = leg.deed if isinstance(leg.deed, Change) else None
    mover = change.craft if change is not None else None
    pairs = [pair for pair in leg.before.nearest if mover in (None, pair.first, pair.second)]
    if not pairs or (change is None and not leg.after.encounters):
        return
    close = min(pairs, key=lambda pair: pair.approach.ratio)
    one = mover or close.first
    other = close.second if one == close.first else close.first
    path = leg.before.path(one) if change is None else change.direct
    obstacle = leg.before.path(other)
    yield "distances", plots.distances(path, obstacle, close.zone), f"{one} relative to {other}, before"
    if change is None:
        return
    met = [name for name, zone in zip(change.others, change.zones, strict=True) if zone is close.zone]
    others = [leg.before.path(name) for name in met]
    around = change.avoidance.path
    if leg.before.encounters:
        caption = f"Two ways of {one} around {other}"
        yield "two-ways", plots.two_ways(path, obstacle, close.zone), caption
    if around is None or around is path:
        return
    caption = f"The path of {one} before and after"
    yield "before-after", plots.before_after(path, around, others, close.zone, names=met), caption
    caption = f"How near {one} comes to the zones of the others, before and after"
    yield "nearness", plots.ratios(path, around, others, close.zone, names=met), caption
    yield "thrust", plots.thrust([path, around], ["before", "after"]), f"Thrust of {one}"


def together(leg: Leg, deed: Reshaping) -> Iterator[tuple[str, Any, str]]:
    """The pictures of a formation that moved: all paths, and how near the craft come to each other."""
    from closeform import plots

    names, zones = leg.after.names, deed.zones
    direct, flown = leg.before.paths, leg.after.paths
    caption = "All paths, direct and of the plan" if flown is not direct else "The direct paths"
    yield "paths", plots.formation_paths(direct, flown, names=names, zone=zones), caption
    if not leg.after.nearest:
        return
    if leg.before.encounters and flown is not direct:
        caption = "How near each two craft would come on their direct paths"
        yield "ratios-before", plots.ratio_matrix(direct, zones, names=names), caption
    caption = "How near each two craft come"
    yield "ratios", plots.ratio_matrix(flown, zones, names=names), caption
    caption = "The pairs that come closest, against time"
    yield "closest-pairs", plots.closest_pairs(flown, zones, names=names), caption
