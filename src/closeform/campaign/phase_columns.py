"""Ends: who a row of a study's table is about and in which phase it ended, as few bytes."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from closeform.search.schedule import Search

NAMES = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")  # of the components of a state


def named(names: Sequence[Any], which: Any) -> Any:
    """A column of names by their number, null where that is negative."""
    import pyarrow

    index = which.astype(np.int32)
    return pyarrow.DictionaryArray.from_arrays(pyarrow.array(index, mask=index < 0), pyarrow.array(names))


def ended(search: Search, leg: Any) -> dict[str, Any]:
    """The columns of phase and round for legs of a search, and of the leg; null where there is none."""
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
