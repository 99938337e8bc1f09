"""Results of many gatherings as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from closeform.arrays import Floats
from closeform.result import Rows
from closeform.search.schedule import Search


@dataclass(frozen=True, eq=False, repr=False)
class Gatherings(Rows):
    """Results of C gatherings of N craft.

    Attributes
    ----------
    search : Search
        The search over all rounds, with the near-field search.
    duration : array of shape (C,) [s]
        Time until gathered, or of all rounds.
    leg : array of int of shape (C,)
        Leg of `search` in which they ended; -1 if incomplete.
    rounds : array of int of shape (C,)
        Number of searches begun.
    left : array of int of shape (C,)
        Number of craft not in the formation set.
    delta_v : array of shape (C,) [m/s]
        Delta-v of all craft together.
    corrections, near_field : array of shape (C,) [m/s]
        Parts for corrections against collisions and in the near-field search; the rest is spent on joining.
    each_delta_v : array of shape (C, N) [m/s]
        Delta-v of each craft.
    met_unknown : array of int of shape (C,)
        Number of pairs that entered their keep-out zone before they knew each other.
    met_known : array of int of shape (C,)
        Number of pairs that entered it only after they knew each other.
    adrift : array of int of shape (C,)
        Number of craft of the formation set without the thrust to match its velocity, in a study.
    """

    _columns: ClassVar = {
        "duration": "duration_s",
        "leg": "leg",
        "rounds": "rounds",
        "left": "left",
        "delta_v": "delta_v_m_s",
        "corrections": "corrections_m_s",
        "near_field": "near_field_m_s",
        "met_unknown": "met_unknown",
        "met_known": "met_known",
        "adrift": "adrift",
    }

    search: Search
    duration: Floats
    leg: Any
    rounds: Any
    left: Any
    delta_v: Floats
    corrections: Floats
    near_field: Floats
    each_delta_v: Floats
    met_unknown: Any
    met_known: Any
    adrift: Any

    def __len__(self) -> int:
        return len(self.duration)
