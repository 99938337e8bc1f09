"""Passive safety by V-BAR: minimum keep-out margin of free drifts from sampled instants of failure.

`vbar.metrics.passive` (Fehse's requirements) bounds the drift from each given state, and refines the open
cases until it knows the minimum margin. It does not check between the instants. The functions of arcs are not
public; this module calls them as `passive_metrics` does.
"""

from typing import Any

import numpy as np

from peers.motion import Array

SPACING = 30.0  # of its samples of a drift [s]


def least_margin(states: Array, n: float, radius: float, horizon: float) -> float:
    """Least margin [m] over drifts of one horizon from states (M, 6) relative to the other craft.

    As `passive_metrics` finds it: refined only for what can be the least.
    """
    from vbar.metrics import passive

    return float(passive._settle(_drifts(states, n, radius, horizon), len(states), 1)[1])


def refined_margins(states: Array, n: float, radius: float, horizon: float) -> Array:
    """Margins (M,) [m] of the drifts from each state, all refined."""
    arcs = _drifts(states, n, radius, horizon)
    return np.array([arcs.refine(k) for k in range(len(states))])


def _drifts(states: Array, n: float, radius: float, horizon: float) -> Any:
    from vbar.metrics import passive

    none = np.zeros((len(states), 3))
    return passive._cw_arcs(n, radius, states, none, 0.0, none, horizon, SPACING)
