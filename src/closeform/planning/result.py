"""What an avoidance is asked (obstacles, each with its zone) and what it answers."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from math import nan
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.all_pairs import search_pairs
from closeform.motion.arc import END, START
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path, stack
from closeform.zones.shapes import BALL, CUBE
from closeform.zones.zone import Zone

# The optimum touches the zone: plan against a slightly larger one, so that the march can
# certify the zone itself; further out only where no plan that close was found.
PLANNED = (1.0 + 1e-9, 1.001, 1.02)


class Status(StrEnum):
    """How an avoidance ended."""

    CLEAR = "clear already"
    AVOIDED = "avoided"
    END_INSIDE = "end inside a zone"
    NOT_FOUND = "no clear path found"
    TOO_WEAK = "thrust limit exceeded"


@dataclass(frozen=True, eq=False)
class Contact:
    """Where a shaped path touches a zone.

    `time` [s]; the `obstacle`'s index; the craft's `position` (3,) [m]; the unit `normal` (3,)
    of the zone there, pointing away from the obstacle; the `force` [m/s^3], a jump of the
    thrust's rate along the normal: twice the extra energy per metre of push, for one contact.
    """

    time: float
    obstacle: int
    position: Floats
    normal: Floats
    force: float


@dataclass(frozen=True, eq=False)
class Avoidance:
    """A path around obstacles, or why there is none.

    `path` is certified clear of every zone (None where not `ok`); `energy` [m^2/s^3] and
    `delta_v` [m/s] are its own, `extra_energy` what it costs beyond the unconstrained optimum
    between its end states (nan where not ok).  `contacts` are in order of time.  `proven`:
    the energy is proven the global optimum (for the zone enlarged by 1e-9); otherwise it is
    the best of the `tried` ways, and `exhausted` tells whether those were all the sides.
    `status` says how it ended, and `reason` why there is no path.
    """

    path: Path | None
    energy: float
    extra_energy: float
    delta_v: float
    contacts: tuple[Contact, ...]
    status: Status
    reason: str
    proven: bool = False
    exhausted: bool = False
    tried: int = 0

    @property
    def ok(self) -> bool:
        """Whether `path` is a clear path."""
        return self.status in (Status.CLEAR, Status.AVOIDED)


def refused(status: Status, reason: str, tried: int = 0) -> Avoidance:
    """An avoidance without a path."""
    return Avoidance(None, nan, nan, nan, (), status, reason, tried=tried)


def batch_of(paths: Path | Sequence[Path]) -> Path:
    """Obstacles as a Path of shape (M,); ValueError for a batch of another shape."""
    if not isinstance(paths, Path):
        return stack(paths)
    batch = paths if paths.shape else stack([paths])
    if len(batch.shape) != 1:
        raise ValueError(f"obstacles: expected a Path of shape (M,), got shape {batch.shape}")
    return batch


def planned_around(zones: Sequence[Zone | None]) -> None:
    """Raises ValueError for a zone of a shape that plans cannot pass."""
    for zone in zones:
        if zone is not None and zone.shape not in (BALL, CUBE):
            raise ValueError(
                f"zone: paths are planned around a Box, Ellipsoid or Sphere, not a {type(zone).__name__}; "
                "give one that holds it"
            )


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Paths to keep clear of, each with the matrix of its zone."""

    arcs: Floats
    offsets: Any
    matrices: Floats
    boxes: Any
    groups: list[tuple[Zone, Any]] = field(repr=False)  # obstacles that share a zone

    @classmethod
    def of(cls, paths: Path | Sequence[Path], zone: Zone | Sequence[Zone]) -> "Obstacles":
        """Raises ValueError for a batch that is not of shape (M,) or zones that do not match it."""
        if not isinstance(zone, Zone) and not (
            isinstance(zone, Sequence) and all(isinstance(one, Zone) for one in zone)
        ):
            raise ValueError(
                f"zone: expected a Box, Ellipsoid or Sphere, or one for each obstacle, got {zone!r}"
            )
        batch = batch_of(paths)
        zones = [zone] * len(batch) if isinstance(zone, Zone) else list(zone)
        if len(zones) != len(batch):
            raise ValueError(
                f"zone: give one zone, or one for each of {len(batch)} obstacles, not {len(zones)}"
            )
        planned_around(zones)
        groups: dict[int, tuple[Zone, list[int]]] = {}
        for k, one in enumerate(zones):
            groups.setdefault(id(one), (one, []))[1].append(k)
        return cls(
            batch.arcs,
            batch.offsets,
            np.array([one.matrix for one in zones]).reshape(-1, 3, 3),
            np.array([one.shape == CUBE for one in zones], dtype=bool),
            [(one, np.array(members)) for one, members in groups.values()],
        )

    def conflicts(self, rows: Floats) -> list[Floats]:
        """Conflicts of a path's arcs: rows of (obstacle, start, end, time, ratio)."""
        ends = np.array([0, len(rows)])
        found = []
        for zone, members in self.groups:
            own = np.zeros(len(members), dtype=np.int64)
            pairs, table = search_pairs(rows, ends, self.arcs, self.offsets, zone, own, members)
            found += [np.array([obstacle, *row]) for (_, obstacle), row in zip(pairs, table, strict=True)]
        return found

    def deepest(self, rows: Floats) -> tuple[int, float] | None:
        """Obstacle and time of the deepest conflict of a path's arcs."""
        found = self.conflicts(rows)
        if not found:
            return None
        worst = min(found, key=lambda row: row[4])
        return int(worst[0]), float(worst[3])

    def state(self, orbit: Orbit, obstacle: int, time: float) -> Floats:
        """State (6,) of one obstacle."""
        own = self.arcs[self.offsets[obstacle] : self.offsets[obstacle + 1]]
        return Path(orbit, own, np.array([0, len(own)]), ()).state(time)

    def at_end(self, path: Path) -> str | None:
        """Which end of a path is inside which zone, in words."""
        for name, time in (("start", path.start), ("end", path.end)):
            state = path.state(time)
            for k in range(len(self.boxes)):
                own = self.arcs[self.offsets[k] : self.offsets[k + 1]]
                if not own[0, START] <= time <= own[-1, END]:
                    continue
                gap = self.matrices[k] @ (state - self.state(path.orbit, k, time))[:3]
                ratio = np.abs(gap).max() if self.boxes[k] else np.linalg.norm(gap)
                if ratio <= PLANNED[0]:
                    return f"the path's {name} is {ratio:.2f} x zone from obstacle {k}; move it or the time"
        return None
