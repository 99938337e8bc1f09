"""Columns for the craft and the phase of a row of a study's table, dictionary-encoded."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from closeform.search.schedule import Search

NAMES = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")  # components of a state


def named(names: Sequence[Any], which: Any) -> Any:
    """Return a column of names by index; a negative index gives null."""
    import pyarrow

    index = which.astype(np.int32)
    return pyarrow.DictionaryArray.from_arrays(pyarrow.array(index, mask=index < 0), pyarrow.array(names))


def ended(search: Search, leg: Any) -> dict[str, Any]:
    """Return the columns of phase, round and leg of a search; null for an absent leg."""
    import pyarrow

    phases = list(dict.fromkeys(one.phase for one in search.legs))
    phase = np.array([phases.index(one.phase) for one in search.legs] + [-1])
    rounds = np.array([one.round for one in search.legs] + [0], dtype=np.int16)
    absent = leg < 0
    return {
        "phase": named(phases, phase[leg]),
        "round": pyarrow.array(rounds[leg], mask=absent),
        "leg": pyarrow.array(leg, mask=absent),
    }
