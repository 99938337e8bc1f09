"""V-BAR's passive safety: the least keep-out margin of the drifts from some sampled instants of failure.

`vbar.metrics.passive` (Fehse's requirements) bounds the drift from each state that it is given, and refines
what its bounds leave open until the least margin is settled. Between the instants it does not look. Its
functions of arcs are not public names; called here as `passive_metrics` calls them.
"""

import numpy as np

from peers.motion import Array

SPACING = 30.0  # of its samples of a drift [s]


def least_margin(states: Array, n: float, radius: float, horizon: float) -> float:
    """Least margin [m] over drifts of one horizon from states (M, 6) relative to the other craft."""
    from vbar.metrics import passive

    none = np.zeros((len(states), 3))
    arcs = passive._cw_arcs(n, radius, states, none, 0.0, none, horizon, SPACING)
    return float(passive._settle(arcs, len(states), 1)[1])
