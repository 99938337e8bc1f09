"""Paths around keep-out zones, for one craft; for a whole formation see `formation`."""

from collections.abc import Sequence
from typing import Literal

from closeform.motion.path import Path
from closeform.planning.result import Avoidance, Contact, Obstacles, Status, refused
from closeform.planning.sauter_palmer import deviated, end_gradients
from closeform.planning.shaping import shaped
from closeform.zones.zone import Zone

__all__ = ["Avoidance", "Contact", "Status", "avoid", "end_gradients"]


def avoid(
    path: Path,
    obstacles: Path | Sequence[Path],
    zone: Zone | Sequence[Zone],
    method: Literal["exact", "sauter-palmer"] = "exact",
) -> Avoidance:
    """The cheapest path with the end states and times of `path` that stays out of every zone.

    `obstacles`: one path, a Path of shape (M,) or a sequence; coasting, thrusting or sampled.
    `zone`: one for all, or one for each obstacle.  A path that is clear is returned as it is.

    "exact": least energy, by the kernel of paths with fixed ends and forces at contacts; every
    side of every conflict is searched, best first, and the best local optimum is returned,
    with a proof that it is global where there is one (theory 4).  "sauter-palmer": the paper's
    one deviation point for each conflict, perpendicular to the cost's gradients (SP11 section
    4), for n > 0.  Either way the path is certified clear of the zone itself, or the status
    says why there is none: an end inside a zone, or no clear path found.

    Raises ValueError for a batch of paths, another orbit, zones that do not match the
    obstacles, or an unknown method.
    """
    if path.shape:
        raise ValueError(f"path: of one craft, got shape {path.shape}; index it")
    if method not in ("exact", "sauter-palmer"):
        raise ValueError(f"method: 'exact' or 'sauter-palmer', not {method!r}")
    others = [obstacles] if isinstance(obstacles, Path) else list(obstacles or ())
    if not others or not all(isinstance(other, Path) for other in others):
        raise ValueError("obstacles: give at least one path")
    known = Obstacles.of(others[0] if isinstance(obstacles, Path) else others, zone)
    for obstacle in others:
        if obstacle.orbit.mean_motion != path.orbit.mean_motion:
            raise ValueError("obstacles: must be in the orbit of path")
    inside = known.at_end(path)
    if inside:
        return refused(Status.END_INSIDE, inside)
    if not known.conflicts(path.arcs):
        optimum = path.orbit.transfer(path.state(path.start), path.state(path.end), path.end - path.start)
        extra = max(path.energy - optimum.energy, 0.0)  # rounding, where it is the optimum itself
        return Avoidance(
            path, path.energy, extra, path.delta_v, (), Status.CLEAR, "no conflict", exhausted=True
        )
    return shaped(path, known) if method == "exact" else deviated(path, known)
