"""Validity of a plan in a force model: its deviations with the planned thrust alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.clearance import clearance_ratios
from closeform.dynamics.force_model.field import Field, described
from closeform.dynamics.model_error import greatest_residual
from closeform.dynamics.simulation.simulate import simulate
from closeform.result import Result
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone


@dataclass(frozen=True, eq=False, repr=False)
class Validity(Result):
    """Predicted deviations of N paths in a field with the planned thrust; returned by `validity`.

    Attributes
    ----------
    field : str
        Description of the force model.
    residual : array of shape (N,) [m/s^2]
        Largest model error of Hill's equations along each path.
    times : array of shape (T,) [s]
        Times since the chief's epoch.
    deviations : array of shape (N, T, 6) [m, m/s]
        Predicted deviation of each spacecraft, in the chief's axes.
    pairs : array of int of shape (P, 2)
        Pairs i < j that have a zone.
    planned : array of shape (P,), no unit
        Minimum clearance ratio of each pair as planned, at these times and between them.
    simulated : array of shape (P,), no unit
        Predicted minimum clearance ratio of each pair; below 1 the zone is entered.
    """

    _told: ClassVar = ("field", "ends", "residual", "planned", "simulated")

    field: str
    residual: Floats
    times: Floats
    deviations: Floats
    pairs: Any
    planned: Floats
    simulated: Floats

    @property
    def ends(self) -> Floats:
        """Predicted deviation of each spacecraft at the end (N,) [m]."""
        return np.asarray(np.linalg.norm(self.deviations[:, -1, :3], axis=1))

    @property
    def lines(self) -> tuple[str, ...]:
        """Description in two lines: deviations, then the closest pair and the model error."""
        return in_words(self)


def validity(plan: Any, field: Field, zones: Zone | PairZones | None = None) -> Validity:
    """Predict the deviations of planned paths in a field with the planned thrust alone.

    Parameters
    ----------
    plan : Plan or Path
        Plan of one spacecraft or of N, in the chief's Hill frame with straight axes, times since its epoch.
    field : Field
        Force model in which they move.
    zones : Zone or PairZones, optional
        Zones of all pairs, or of each; without them no clearance ratios are predicted.

    Returns
    -------
    Validity
        Deviations, and minimum clearance ratios of pairs.

    Raises
    ------
    ValueError
        If the plan has no paths, is in deep space, has another mean motion than the chief, or an argument
        has the wrong type.

    Notes
    -----
    The deviations are those of a simulation in open loop, without compensation. With `compensated_thrust`
    there are none.

    References
    ----------
    docs/theory.md (82) and (83).

    Examples
    --------
    >>> import closeform as cf
    >>> chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, 0.9, 0.0])
    >>> path = chief.orbit.transfer([0, 200, 0, 0, 0, 0], [0, 50, 0, 0, 0, 0], 3000.0)
    >>> bool(0.1 < cf.validity(path, cf.Field(chief)).ends[0] < 10.0)
    True
    """
    flown = simulate(plan, field, "open", cancel=False, zones=zones)
    paths, times, states = flown.planned, flown.times, flown.states[0]
    as_planned = paths.state(times)
    planned = clearance_ratios(as_planned, as_planned - (states - flown.arrivals[0]), times, zones)[1]
    residual, off = greatest_residual(field, paths), states - as_planned
    return Validity(described(field), residual, times, off, flown.pairs, planned, flown.ratios[0])


def in_words(found: Validity, names: Sequence[str] | None = None) -> tuple[str, ...]:
    """Return the lines of a Validity, with the names of its spacecraft, or their indices."""
    worst = int(np.argmax(found.ends))
    who = f"craft {worst}" if names is None else names[worst]
    ends = f"In {found.field}, without compensation, {who} ends {found.ends[worst]:.3g} m from the plan"
    left_out = f"The model error of Hill's equations is {found.residual.max():.2g} m/s²"
    if not len(found.pairs):
        return (ends, left_out)
    near = int(np.argmin(found.simulated))
    i, j = found.pairs[near]
    pair = f"craft {i} and {j}" if names is None else f"{names[i]} and {names[j]}"
    entered = " (entered)" if found.simulated[near] < 1.0 else ""
    least = f"{found.simulated[near]:.4f}{entered}, {pair}; as planned {found.planned[near]:.4f}"
    return (ends, f"Minimum clearance ratio predicted: {least}. {left_out}")
