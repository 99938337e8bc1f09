"""Boxes of initial states, divided by halving; or the faces of a box, in a scale-invariant problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from closeform.arrays import Floats


@dataclass(frozen=True, eq=False)
class StateBoxes:
    """Boxes by centres and half-widths (M, 6), their shares (M,) of the whole, and first looks (M,)."""

    centres: Floats
    halves: Floats
    shares: Floats
    looks: Any

    def __len__(self) -> int:
        return len(self.centres)

    def __getitem__(self, which: Any) -> StateBoxes:
        return StateBoxes(self.centres[which], self.halves[which], self.shares[which], self.looks[which])

    @classmethod
    def of(cls, low: Floats, high: Floats) -> StateBoxes:
        """Return the box between two states (6,)."""
        middle = 0.5 * (low + high)
        reach = np.maximum(high - middle, middle - low)
        return cls(middle[None], reach[None], np.ones(1), np.zeros(1, dtype=np.int64))

    @classmethod
    def faces(cls, low: Floats, high: Floats) -> StateBoxes:
        """Return the faces of a box around the origin that do not contain it.

        Their multiples fill the box. The share of a face is that of the pyramid on it with its tip at the
        origin.  # theory (58)
        """
        widths = np.where(high > low, high - low, 1.0)
        found, volumes = [], []
        for axis in range(6):
            for end in (low[axis], high[axis]):
                if end != 0.0:
                    least, greatest = low.copy(), high.copy()
                    least[axis] = greatest[axis] = end
                    found.append(cls.of(least, greatest))
                    volumes.append(abs(end) / widths[axis])
        boxes = joined(found)
        return cls(boxes.centres, boxes.halves, np.array(volumes) / sum(volumes), boxes.looks)

    def halved(self, axes: Any) -> StateBoxes:
        """Return two boxes for each, halved along the given component."""
        rows = np.arange(len(self))
        halves = self.halves.copy()
        halves[rows, axes] *= 0.5
        step = np.zeros_like(halves)
        step[rows, axes] = halves[rows, axes]
        low = StateBoxes(self.centres - step, halves, 0.5 * self.shares, self.looks)
        return joined([low, StateBoxes(self.centres + step, halves, 0.5 * self.shares, self.looks)])

    @property
    def edges(self) -> Floats:
        """Minimum and maximum states (M, 2, 6)."""
        return np.stack([self.centres - self.halves, self.centres + self.halves], axis=1)


def joined(boxes: list[StateBoxes]) -> StateBoxes:
    """Return the concatenation of several sets of boxes."""
    columns = ("centres", "halves", "shares", "looks")
    return StateBoxes(*(np.concatenate([getattr(some, name) for some in boxes]) for name in columns))
