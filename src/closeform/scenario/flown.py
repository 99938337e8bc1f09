"""Checks of scenarios that are simulated in the high-fidelity model."""

from collections.abc import Iterator

import numpy as np

from closeform.fuel.thrusters import Thrusters
from closeform.motion.orbit import Orbit
from closeform.scenario.craft import Craft
from closeform.scenario.quantity import shown
from closeform.scenario.scenario import Scenario
from closeform.scenario.study import FAILS

FIRING = "thrusters", "max_thrust", "acceleration", "minimum_bit", "period"  # fields of a Craft
REMEDY = "add field, with epoch and chief, to [orbit], or remove it"


def in_field(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for a field of another planet, or for each key that requires a field."""
    table, chief = scenario.orbit.field, scenario.orbit.chief
    if table is not None:
        if chief is not None and (chief.center or "EARTH").upper() != "EARTH":
            yield f"orbit.field: is the Earth's, and the chief is about {chief.center}; remove field"
        return
    tables = {
        "feedback": scenario.feedback,
        "navigation": scenario.navigation,
        "simulation": scenario.flights,
    }
    for key, given in tables.items():
        if given is not None:
            yield f"{key}: is for flights in a field; {REMEDY}"
    for number, stage in enumerate(scenario.stages, 1):
        if getattr(stage, "margin", None) == "auto":
            key = f"stage[{number}].margin"
            yield f"{key}: auto is for flights in a field; add field to [orbit], or give a length"
    if any(any(craft.thrust_error) for craft in scenario.craft):
        yield f"craft.thrust_error: is for flights in a field; {REMEDY}"


def in_air(scenario: Scenario) -> Iterator[str]:
    """Yield an error line if atmospheric drag lacks a ballistic coefficient, or the reverse."""
    table, chief = scenario.orbit.field, scenario.orbit.chief
    ballistics = [craft.ballistic for craft in scenario.craft]
    if table is None or table.air is None:
        if any(one is not None for one in ballistics):
            what = REMEDY if table is None else "add density, at_altitude and scale_height to field"
            yield f"craft.ballistic: there is no air; {what}"
        return
    if None in ballistics:
        yield f"craft.ballistic: missing, in air; add for example ballistic = {Craft.examples()['ballistic']}"
    if chief is not None and chief.ballistic is None:
        yield (
            'orbit.chief: needs ballistic in air, like craft; add for example ballistic = "0.02 m^2/kg", '
            '"0 m^2/kg" of an orbit that feels none'
        )


def in_flight(scenario: Scenario) -> Iterator[str]:
    """Yield an error line for each setting that a simulation, or a margin for one, does not support."""
    autos = any(getattr(stage, "margin", None) == "auto" for stage in scenario.stages)
    if scenario.noisy and autos:
        remedy = "remove noise, or give margins in metres"
        yield f'craft.execution: margin = "auto" counts no white noise; {remedy}'
    if autos or scenario.flights is not None:
        try:
            flown_thrusters(scenario)
        except ValueError as error:
            yield str(error)
    if scenario.flights is None:
        return
    if scenario.flights.control == "replan":
        for why, without in not_anew(scenario):
            yield f'simulation.control: {why}; write control = "track", or have {without}'
    if scenario.study is not None and scenario.study.draws != "vary":
        yield "study.draws: a simulation draws its own errors in each case; remove draws or [simulation]"
    fails = scenario.study is not None and FAILS in scenario.study.vary
    if scenario.flights.control == "replan" and fails:
        remedy = 'write control = "track", or remove it'
        yield f"study.vary.{shown(FAILS)}: new plans would need the thrust that is lost; {remedy}"


def flown_thrusters(scenario: Scenario) -> list[Thrusters | None]:
    """Return the thrusters of each craft, which are the same in all stages; None for a craft without any.

    Raises ValueError, beginning with the key of a stage, if a craft has other thrusters in that stage.
    """
    return [throughout(scenario, k).fired(1.0) for k in range(len(scenario.craft))]


def throughout(scenario: Scenario, k: int) -> Craft:
    """Return a craft with the engine that it uses in every stage in which it moves."""
    name, first = scenario.names[k], None
    for number, stage in enumerate(scenario.stages, 1):
        if name not in stage.moving(scenario.names):
            continue
        craft = scenario.craft_in(stage)[k]
        first = craft if first is None else first
        differ = [key for key in FIRING if getattr(craft, key) != getattr(first, key)]
        if differ and (craft.thrusters or first.thrusters) is not None:
            raise ValueError(
                f"stage[{number}].{Craft.key_of(differ[0])}: {name} has another in an earlier stage, and "
                "flights have one set of thrusters for each craft; give it one, or each set a file of its own"
            )
    return first or scenario.craft[k]


def not_anew(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Yield each reason why a simulation cannot replan, with the remedy."""
    if len(scenario.stages) > 1:
        yield f"replan is for one stage, and there are {len(scenario.stages)}", "one stage"
    if any(scenario.plans_impulses(stage) for stage in scenario.stages):
        yield "replan is for thrust that lasts, and impulses are planned", 'cost = "energy" in the stage'
    law = scenario.feedback
    if law is not None and law.impulses:
        yield "replan is for thrust that lasts, and feedback has impulses", "none in [feedback]"
    if law is not None and law.delay:
        yield "replan has new plans at once, and feedback has a delay", "none in [feedback]"


def too_blind(scenario: Scenario, orbit: Orbit) -> Iterator[str]:
    """Yield an error line if the tracking error of a pair exceeds the smallest keep-out zone."""
    if scenario.field is None or scenario.navigation is None:
        return
    from closeform.dynamics.feedback import Feedback
    from closeform.dynamics.tube import tube

    told = scenario.flight
    room = tube(orbit, told["feedback"] or Feedback(), told["navigation"])
    zones = [zone for zone in scenario.zones.zones if np.isfinite(zone.extents).all()]
    least = min((float(np.min(zone.extents)) for zone in zones), default=np.inf)
    if room.of_a_pair > least:
        yield (
            f"navigation: leaves pairs {room.of_a_pair:.3g} m off ({room.sigmas:g} sigmas), and the smallest "
            f"zone reaches {least:.3g} m; give better navigation, another feedback or larger zones"
        )
