"""Where the frame's origin is, and where craft are beside it that begin inertially."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.chief import Chief
from closeform.exchange.covariance import canonical
from closeform.exchange.interpolation import states_of
from closeform.scenario.checks import Findings
from closeform.scenario.errors import Place
from closeform.scenario.formation import Start
from closeform.scenario.inputs import Inputs
from closeform.scenario.scenario import Scenario

FAR = 0.1  # of the orbit's radius: a craft so far from the chief is in another unit or frame


def located(
    scenario: Scenario, inputs: Inputs, wrong: Sequence[str], complain: Callable[[Place, str], None]
) -> Scenario:
    """The scenario with its chief and the states of all craft.

    `wrong` are the lines on what is wrong already, about which nothing is looked at; `complain` takes more.
    """
    found, scenario = Findings(wrong), replace(scenario, inputs=inputs)
    if not found.sound("orbit.*"):
        return scenario
    try:
        chief = scenario.orbit.origin(inputs)
    except ValueError as error:
        complain(("orbit", "chief"), str(error))
        return scenario
    if chief is not None:
        scenario = replace(scenario, chief=chief, orbit=scenario.orbit.following(chief))
    if not found.sound(r"craft\.start"):
        return scenario
    placed = list(scenario.craft)
    for number, craft in enumerate(placed):
        if craft.start is not None and craft.start.inertially:
            try:
                placed[number] = craft.known_at(beside(chief, craft.start, inputs))
            except ValueError as error:
                complain(("craft", number, "start"), str(error))
    return replace(scenario, craft=tuple(placed))


def beside(chief: Chief | None, start: Start, inputs: Inputs) -> Floats:
    """The state (6,) in the chief's Hill frame, at the epoch, of a craft that begins inertially."""
    if chief is None:
        remedy = 'add epoch = "2026-11-22T12:00:00Z" and chief = { oem = "chief.oem" } to [orbit]'
        raise ValueError(f"an inertial state needs the chief's beside it; {remedy}")
    inertial: Floats = np.array(start.inertial)
    if start.oem is not None:
        ephemeris = inputs.ephemeris(start.oem)
        for keyword, its, wanted in (
            ("CENTER_NAME", ephemeris.center, chief.center),
            ("REF_FRAME", ephemeris.frame, chief.frame),
        ):
            if canonical(its) != canonical(wanted):
                raise ValueError(
                    f"{start.oem}: {keyword} {its} differs from {wanted} of the chief; convert one of them"
                )
        (inertial,), (error,) = states_of(ephemeris, chief.instant, [0.0])
        inputs.interpolated(start.oem, error)
    apart, radius = (float(np.linalg.norm(one)) for one in (inertial[:3] - chief.state[:3], chief.state[:3]))
    if apart > FAR * radius:
        raise ValueError(
            f"{apart / 1e3:.4g} km from the chief, where Hill's equations do not hold; check units and frame"
        )
    return chief.relative_from_inertial(0.0, inertial)
