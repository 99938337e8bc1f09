"""Simulation of craft and their chief in Basilisk; this module does not use closeform.

The steps of some seconds are integrated by Runge and Kutta's method of fourth order.  The force of a step is
determined at its start, and constant in inertial axes.  It is commanded as an acceleration in the axes of the
simulated chief: radial outward, along the motion, orbit normal.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from Basilisk.architecture import messaging, sysModel
from Basilisk.simulation import (
    dragDynamicEffector,
    exponentialAtmosphere,
    extForceTorque,
    gravityEffector,
    spacecraft,
    sphericalHarmonicsGravityModel,
)
from Basilisk.utilities import SimulationBaseClass, macros

MASS = 100.0  # kg; forces are accelerations times it
SPIN = 7.292115e-5  # rad/s, of the Earth
# Modules of a task run from the highest priority down.  What commands stands before the craft, or its force
# would act a step late.
EARTH, COMMANDS, AIR, FORCES, CRAFT = 400, 300, 250, 200, 100

Law = Callable[[float, np.ndarray], np.ndarray]  # of time [s] and inertial states: accelerations [m/s^2]


@dataclass(frozen=True)
class World:
    """A body: its pull, its coefficients (D + 1, D + 1) of full normalization, its air at rest."""

    mu: float  # m^3/s^2
    radius: float  # m, that the coefficients are about
    cosines: Any
    sines: Any
    turns: bool = False  # as the Earth does, its zero meridian on the x axis at first
    density: float = 0.0  # kg/m^3, at `air_radius`
    air_radius: float = 0.0  # m
    scale_height: float = 1.0  # m
    ballistic: tuple[float, ...] = ()  # m^2/kg, of the chief and all craft


class Flown(NamedTuple):
    """What came of a flight."""

    times: np.ndarray  # (T,) [s]
    states: np.ndarray  # (T, N + 1, 6) [m, m/s], inertial, the chief's first
    seconds: float  # of the processor, without what sets it up


def coefficients(file: Path, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Cosine and sine coefficients (degree + 1, degree + 1) of a table: degree, order, C, S."""
    cosines, sines = np.zeros((2, degree + 1, degree + 1))
    cosines[0, 0] = 1.0
    for n, m, c, s in np.loadtxt(file, delimiter=",", skiprows=1):
        if n <= degree:
            cosines[int(n), int(m)], sines[int(n), int(m)] = c, s
    return cosines, sines


class Commander(sysModel.SysModel):
    """Module that reads all states at the start of a step, and writes the forces that act during it."""

    def __init__(self, craft: list[Any], law: Law, step: float, earth: Any) -> None:
        super().__init__()
        self.ModelTag = "commander"
        self.readers = [messaging.SCStatesMsgReader() for _ in craft]
        for reader, one in zip(self.readers, craft, strict=True):
            reader.subscribeTo(one.scStateOutMsg)
        self.forces = [messaging.CmdForceInertialMsg() for _ in craft[1:]]
        self.law, self.step, self.earth = law, step, earth
        self.states: list[np.ndarray] = []

    def Reset(self, now: int) -> None:
        for message in self.forces:
            message.write(messaging.CmdForceInertialMsgPayload(), now, self.moduleID)

    def UpdateState(self, now: int) -> None:
        if now == 0:  # no step ends here
            return
        states = np.array([[*said.r_BN_N, *said.v_BN_N] for said in (reader() for reader in self.readers)])
        begin = now * macros.NANO2SEC - self.step
        self.states.append(states)
        pushes = MASS * self.law(begin, states) @ self.axes(begin, states[0])
        for message, push in zip(self.forces, pushes, strict=True):
            said = messaging.CmdForceInertialMsgPayload()
            said.forceRequestInertial = push.tolist()
            message.write(said, now, self.moduleID)

    def axes(self, begin: float, chief: np.ndarray) -> np.ndarray:
        """The chief's axes (3, 3), rows, half a step on: those in which the step's mean thrust points."""
        half, place, speed = 0.5 * self.step, chief[:3], chief[3:]
        felt = np.ravel(self.earth.computeGravityInertial(place[:, None].tolist(), macros.sec2nano(begin)))
        return axes_of(place + half * speed + 0.5 * half**2 * felt, speed + half * felt)


def axes_of(place: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Radial outward, along the motion and orbit normal (3, 3), rows."""
    radial, normal = place / np.linalg.norm(place), np.cross(place, speed)
    normal /= np.linalg.norm(normal)
    return np.array([radial, np.cross(normal, radial), normal])


class TurningEarth(sysModel.SysModel):
    """Says at each step how far the Earth has turned, and how fast it does."""

    def __init__(self) -> None:
        super().__init__()
        self.ModelTag = "earth"
        self.said = messaging.SpicePlanetStateMsg()

    def Reset(self, now: int) -> None:
        self.UpdateState(now)

    def UpdateState(self, now: int) -> None:
        angle = SPIN * now * macros.NANO2SEC
        c, s = np.cos(angle), np.sin(angle)
        message = messaging.SpicePlanetStateMsgPayload()
        message.PlanetName = "earth"
        message.J20002Pfix = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
        message.J20002Pfix_dot = [[-s * SPIN, c * SPIN, 0.0], [-c * SPIN, -s * SPIN, 0.0], [0.0, 0.0, 0.0]]
        message.computeOrient = 1
        self.said.write(message, now, self.moduleID)


def fly(start: np.ndarray, law: Law | None, duration: float, world: World, step: float = 10.0) -> Flown:
    """Simulate a chief and N craft from inertial states (N + 1, 6) for a multiple of the step [s].

    At the start of each step `law` returns the thrust of the craft (N, 3) in the middle of the step.  Without
    a law no craft thrusts, and only the first and last states are returned.
    """
    steps = round(duration / step)
    if abs(duration - steps * step) > 1e-6:  # Basilisk would stop early, without an error
        raise ValueError(f"duration: {duration:g} s is not a multiple of the step of {step:g} s")
    run = SimulationBaseClass.SimBaseClass()
    run.CreateNewProcess("all").addTask(run.CreateNewTask("flight", macros.sec2nano(step)))
    earth = gravityEffector.GravBodyData()
    kept: list[Any] = [earth]  # what only Basilisk knows is gone when Python forgets it
    earth.planetName, earth.mu, earth.radEquator, earth.isCentralBody = "earth", world.mu, world.radius, True
    earth.gravityModel = pulling(world, kept)
    if world.turns:
        turning = TurningEarth()
        kept.append(turning)
        earth.planetBodyInMsg.subscribeTo(turning.said)
        run.AddModelToTask("flight", turning, EARTH)
    craft = [of_state(state, f"craft {k}", earth) for k, state in enumerate(start)]
    returned = [start] if law is None else command(run, Commander(craft, law, step, earth), craft, kept)
    if world.density > 0.0:
        breathe(run, craft, world, kept)
    for one in craft:
        run.AddModelToTask("flight", one, CRAFT)
    run.InitializeSimulation()
    run.ConfigureStopTime(macros.sec2nano(steps * step))
    begin = process_time()
    run.ExecuteSimulation()
    seconds = process_time() - begin
    last = [one.scStateOutMsg.read() for one in craft]
    returned.append(np.array([[*said.r_BN_N, *said.v_BN_N] for said in last]))
    return Flown(np.linspace(0.0, steps * step, len(returned)), np.array(returned), seconds)


def command(run: Any, commander: Commander, craft: list[Any], kept: list[Any]) -> list[np.ndarray]:
    """Craft are pushed as the commander says; returns where it will note their states."""
    run.AddModelToTask("flight", commander, COMMANDS)
    kept.append(commander)
    for one, force in zip(craft[1:], commander.forces, strict=True):
        pusher = extForceTorque.ExtForceTorque()
        pusher.cmdForceInertialInMsg.subscribeTo(force)
        one.addDynamicEffector(pusher)
        kept.append(pusher)
        run.AddModelToTask("flight", pusher, FORCES)
    return commander.states


def pulling(world: World, kept: list[Any]) -> Any:
    """The body's gravity."""
    model = sphericalHarmonicsGravityModel.SphericalHarmonicsGravityModel()
    model.muBody, model.radEquator, model.maxDeg = world.mu, world.radius, len(world.cosines) - 1
    model.cBar = [list(map(float, row[: k + 1])) for k, row in enumerate(world.cosines)]
    model.sBar = [list(map(float, row[: k + 1])) for k, row in enumerate(world.sines)]
    kept.append(model)
    return model


def of_state(state: np.ndarray, name: str, earth: Any) -> Any:
    """A craft that is a point of some mass."""
    one = spacecraft.Spacecraft()
    one.ModelTag, one.pointMassTranslationalOnly = name, True
    one.hub.mHub = MASS
    one.hub.r_CN_NInit, one.hub.v_CN_NInit = state[:3].tolist(), state[3:].tolist()
    one.gravField.gravBodies = gravityEffector.GravBodyVector([earth])
    return one


def breathe(run: Any, craft: list[Any], world: World, kept: list[Any]) -> None:
    """Air at rest that thins exponentially; a step feels the density of its start."""
    air = exponentialAtmosphere.ExponentialAtmosphere()
    air.planetRadius, air.baseDensity, air.scaleHeight = world.air_radius, world.density, world.scale_height
    kept.append(air)
    for one in craft:
        air.addSpacecraftToModel(one.scStateOutMsg)
    run.AddModelToTask("flight", air, AIR)
    for one, ballistic, density in zip(craft, world.ballistic, air.envOutMsgs, strict=True):
        drag = dragDynamicEffector.DragDynamicEffector()
        drag.coreParams.projectedArea, drag.coreParams.dragCoeff = 1.0, ballistic * MASS
        drag.coreParams.comOffset = [0.0, 0.0, 0.0]
        drag.atmoDensInMsg.subscribeTo(density)
        one.addDynamicEffector(drag)
        kept.append(drag)
        run.AddModelToTask("flight", drag, AIR - 1)
