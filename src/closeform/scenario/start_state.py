"""The state at the epoch, in Hill's frame, of a craft that begins inertially or by a file."""

from typing import TYPE_CHECKING

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.chief import Chief
from closeform.exchange.covariance import canonical
from closeform.exchange.ephemeris import SAME_EPOCH
from closeform.exchange.epochs import Epoch
from closeform.exchange.exported import ROTATING
from closeform.exchange.interpolation import states_of
from closeform.motion.frames import relative_from_inertial
from closeform.scenario.craft import Craft
from closeform.scenario.errors import did_you_mean
from closeform.scenario.inputs import Inputs

if TYPE_CHECKING:
    from closeform.dynamics.field import Field

UNKNOWN = "UNKNOWN"  # what a table of states does not tell
HILL = (UNKNOWN, "HILL", "RTN", ROTATING)  # how it may call the frame of the scenario itself
FAR = 0.1  # of the orbit's radius: a craft so far from the chief is in another unit or frame


def at_start(
    craft: Craft, chief: Chief | None, epoch: Epoch | None, inputs: Inputs, field: "Field | None" = None
) -> Floats:
    """The state (6,) in Hill's frame, at the epoch, of a craft that begins inertially or by a file.

    In a field the frame is the one in which it is flown: straight, and turning with the orbital plane.
    """
    start = craft.start
    if craft.states is not None:
        frame, state = row_of(craft.name, craft.states, epoch, inputs)
        if canonical(frame) in HILL:
            return state
        return beside(known(chief), state, field, craft.states, "frame =", frame)
    assert start is not None
    chief = known(chief)
    if start.oem is None:
        return beside(chief, np.array(start.inertial), field)
    ephemeris = inputs.ephemeris(start.oem, chief.instant)
    if canonical(ephemeris.center) != canonical(chief.center):
        what = f"CENTER_NAME {ephemeris.center} differs from {chief.center} of the chief"
        raise ValueError(f"{start.oem}: {what}; give another file")
    (state,), (error,) = states_of(ephemeris, chief.instant, [0.0])
    inputs.interpolated(start.oem, error)
    return beside(chief, state, field, start.oem, "REF_FRAME", ephemeris.frame)


def known(chief: Chief | None) -> Chief:
    """The chief, which inertial states need."""
    if chief is None:
        remedy = 'add epoch = "2026-11-22T12:00:00Z" and chief = { oem = "chief.oem" } to [orbit]'
        raise ValueError(f"an inertial state needs the chief's beside it; {remedy}")
    return chief


def row_of(name: str, file: str, epoch: Epoch | None, inputs: Inputs) -> tuple[str, Floats]:
    """Frame and state (6,) of a craft in a table of states, at the epoch; after a burn at that instant."""
    rows = inputs.states(file)
    mine = [k for k, one in enumerate(rows.craft) if one == name]
    if not mine:
        raise ValueError(f"{file}: has no row of {name}; {did_you_mean(name, dict.fromkeys(rows.craft))}")
    if rows.times is None:
        if len(mine) > 1:
            raise ValueError(
                f"{file}: line {rows.lines[mine[1]]}: a second row of {name}; keep one, or add time_s"
            )
        return rows.about["frame"], rows.states[mine[0]]
    begin = 0.0
    if epoch is not None and rows.about["epoch"] != UNKNOWN:
        begin = Epoch(rows.about["epoch"], rows.about["time_system"]).until(epoch)
    now = [k for k in mine if abs(rows.times[k] - begin) <= SAME_EPOCH]
    if not now:
        raise ValueError(f"{file}: has no row of {name} at {begin:.9g} s, when the mission starts; add one")
    return rows.about["frame"], rows.states[now[-1]]


def beside(
    chief: Chief,
    inertial: Floats,
    field: "Field | None",
    file: str = "",
    keyword: str = "",
    frame: str = "",
) -> Floats:
    """An inertial state (6,) in the chief's Hill frame, at the epoch; a `file` tells in which frame it is."""
    if file and canonical(frame) != canonical(chief.frame):
        what = f"{keyword} {frame} differs from {chief.frame} of the chief"
        raise ValueError(f"{file}: {what}; convert one of them")
    apart, radius = (float(np.linalg.norm(one)) for one in (inertial[:3] - chief.state[:3], chief.state[:3]))
    if apart > FAR * radius:
        what = f"{apart / 1e3:.4g} km from the chief, where Hill's equations do not hold"
        raise ValueError(f"{what}; check units and frame")
    if field is None:
        return chief.relative_from_inertial(0.0, inertial)
    origin = field.chief_states([0.0])[0]
    felt = field.accelerations(0.0, origin, field._chief_ballistic)
    return relative_from_inertial(origin, inertial, acceleration=felt)
