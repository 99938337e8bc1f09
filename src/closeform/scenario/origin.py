"""Initial states of the chief and of craft that start from an inertial state or a file."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from closeform.scenario.checks import ORBIT, Findings
from closeform.scenario.errors import Place
from closeform.scenario.inputs import Inputs
from closeform.scenario.scenario import Scenario


def located(
    scenario: Scenario, inputs: Inputs, wrong: Sequence[str], complain: Callable[[Place, str], None]
) -> Scenario:
    """Return the scenario with its chief and the initial states of all craft.

    `wrong` holds the lines already reported, whose keys are skipped; `complain` takes a place and a text.
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
                from closeform.scenario.start_state import at_start  # only these craft need it

                try:
                    placed[number] = craft.known_at(at_start(craft, chief, scenario.epoch, inputs, field))
                except ValueError as error:
                    complain(("craft", number, key), str(error))
    return replace(scenario, craft=tuple(placed))
