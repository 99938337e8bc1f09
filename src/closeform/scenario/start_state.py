"""Initial state in Hill's frame of a craft that starts from an inertial state or a file."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.chief import Chief
from closeform.exchange.ephemerides.covariance import canonical
from closeform.exchange.ephemerides.ephemeris import SAME_EPOCH
from closeform.exchange.ephemerides.interpolation import states_of
from closeform.exchange.ephemerides.spans import Spans
from closeform.exchange.epochs import Epoch
from closeform.exchange.export_tracks.track import ROTATING
from closeform.exchange.formats.states_csv import ephemerides_of
from closeform.motion.elements.frames import relative_from_inertial
from closeform.scenario.craft import Craft
from closeform.scenario.inputs import DOUBTFUL, Inputs
from closeform.scenario.table import did_you_mean

if TYPE_CHECKING:
    from closeform.dynamics.force_model.field import Field
    from closeform.scenario.scenario import Scenario

UNKNOWN = "UNKNOWN"  # placeholder for metadata that a table of states lacks
ANY_EPOCH = {
    "epoch": "2000-01-01T00:00:00",
    "time_system": "TAI",
}  # times count from the mission's start
HILL = (UNKNOWN, "HILL", "RTN", ROTATING)  # names of the scenario's own frame in a table
LEAST = 1e-6  # s: shortest interval between states; shorter ones are rounding errors of epochs
FAR = 0.1  # of the orbit's radius: a larger distance from the chief indicates another unit or frame


def at_start(
    craft: Craft, chief: Chief | None, epoch: Epoch | None, inputs: Inputs, field: "Field | None" = None
) -> Floats:
    """Return the state (6,) in Hill's frame at the epoch from an inertial state or a file.

    With a `field`, the frame is that of the simulation: Cartesian, and rotating with the orbital plane.
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


def along(scenario: "Scenario", name: str, start: float, end: float) -> tuple[Floats, Floats, Floats]:
    """Return times (T,) [s], states (T, 6) and arrivals (T, 6) of a craft along the file of its start.

    States are in Hill's frame, from `start` to `end` of the mission [s]. An arrival differs from the state
    where the file has a burn. Raises ValueError if the file does not cover the whole interval.
    """
    craft, chief, inputs = scenario.craft[scenario.names.index(name)], scenario.chief, scenario.inputs
    file = craft.states or (craft.start.oem if craft.start is not None else None)
    assert file is not None  # of a checked scenario
    assert inputs is not None
    if craft.states is not None:
        rows = inputs.states(file)
        if rows.times is None:
            raise ValueError(f"{file}: has no times, so no path; add a column time_s")
        dated = scenario.epoch is not None and rows.about["epoch"] != UNKNOWN
        about = rows.about if dated else {**rows.about, **ANY_EPOCH}
        spans, begin = Spans.of(list(ephemerides_of(replace(rows, about=about), name))), 0.0
        if scenario.epoch is not None and dated:
            begin = Epoch(about["epoch"], about["time_system"]).until(scenario.epoch)
    else:
        spans = Spans.of(inputs.segments(file))
        begin = Epoch(spans.first.epoch, spans.first.time_system).until(known(chief).instant)
    first, last = spans.times[[0, -1]] - begin
    if first > start + SAME_EPOCH or last < end - SAME_EPOCH:
        has = f"has states of {name} from {first:.6g} to {last:.6g} s of the mission"
        raise ValueError(
            f"{file}: {has}, but the stage lasts from {start:.6g} to {end:.6g} s; give a longer file"
        )
    times = spans.times - begin
    times = np.array([start, *times[(times > start + LEAST) & (times < end - LEAST)], end])
    states, errors = spans.states(times + begin)
    arrivals = spans.states(times + begin, before=True)[0]
    if is_inertial(scenario, name):
        chief = known(chief)
        states, arrivals = (chief.relative_from_inertial(times, one) for one in (states, arrivals))
        errors = errors + chief.interpolation_errors(times)
    if (worst := float(errors.max())) > DOUBTFUL:
        what = f"{name} may be off by {worst:.3g} m between its states"
        raise ValueError(f"{file}: {what}; give states closer together")
    return times, states, arrivals


def is_inertial(scenario: "Scenario", name: str) -> bool:
    """Return True if the file of a craft's start is an ephemeris, not a path in Hill's frame."""
    craft, inputs = scenario.craft[scenario.names.index(name)], scenario.inputs
    if craft.states is None or inputs is None:
        return True
    return canonical(inputs.states(craft.states).about["frame"]) not in HILL


def known(chief: Chief | None) -> Chief:
    """Return the chief; raise ValueError, with a remedy, if there is none."""
    if chief is None:
        remedy = 'add epoch = "2026-11-22T12:00:00Z" and chief = { oem = "chief.oem" } to [orbit]'
        raise ValueError(f"an inertial state requires the inertial state of the chief; {remedy}")
    return chief


def row_of(name: str, file: str, epoch: Epoch | None, inputs: Inputs) -> tuple[str, Floats]:
    """Return the frame and the state (6,) of a craft at the epoch, after any burn, from a table of states."""
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
    """Return an inertial state (6,) in the chief's Hill frame at the epoch; check the `frame` of a `file`."""
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
