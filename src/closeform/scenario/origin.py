"""Where the frame's origin is, and craft that begin inertially or by a file, beside it."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from closeform.scenario.checks import ORBIT, Findings
from closeform.scenario.errors import Place
from closeform.scenario.inputs import Inputs
from closeform.scenario.scenario import Scenario


def located(
    scenario: Scenario, inputs: Inputs, wrong: Sequence[str], complain: Callable[[Place, str], None]
) -> Scenario:
    """The scenario with its chief and the states of all craft.

    `wrong` are the lines on what is wrong already, about which nothing is looked at; `complain` takes more.
    """
    found, scenario = Findings(wrong), replace(scenario, inputs=inputs)
    if not found.sound(ORBIT):
        return scenario
    try:
        chief = scenario.orbit.origin(inputs)
    except ValueError as error:
        complain(("orbit", "chief"), str(error))
        return scenario
    field = None
    if chief is not None:
        scenario = replace(scenario, chief=chief, orbit=scenario.orbit.following(chief))
        if not found.sound(r"orbit\.field"):
            return scenario
        try:
            field = scenario.field
        except ValueError as error:
            key, _, words = str(error).partition(": ")
            complain(("orbit", key), words)
            return scenario
    placed = list(scenario.craft)
    for number, craft in enumerate(placed):
        inertially = craft.start is not None and craft.start.inertially
        for key, begins in (("start", inertially), ("states", craft.states is not None)):
            if begins and found.sound(rf"craft\.{key}"):
                from closeform.scenario.start_state import at_start  # whose files nothing else reads

                try:
                    placed[number] = craft.known_at(at_start(craft, chief, scenario.epoch, inputs, field))
                except ValueError as error:
                    complain(("craft", number, key), str(error))
    return replace(scenario, craft=tuple(placed))
