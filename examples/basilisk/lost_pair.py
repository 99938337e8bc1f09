"""Simulates S04's modified search in Basilisk: two rigid spacecraft with reaction wheels and thrusters.

H03 and S04 turn their spacecraft kinematically and burn in an instant. Here wheels of limited torque follow
turns with ramps, from an initial attitude error. At the lock both stop turning, and the second nulls its
relative velocity with thrusters along its body axes, whose lever arm disturbs its attitude.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from Basilisk.architecture import messaging, sysModel
from Basilisk.simulation import extForceTorque, reactionWheelStateEffector, spacecraft
from Basilisk.utilities import SimulationBaseClass, macros, simIncludeRW
from scipy.spatial.transform import Rotation

import closeform as cf

DEGREE = np.pi / 180
MASS, INERTIA = 700.0, np.array([1500.0, 1100.0, 1100.0])  # kg, kg m^2: the class of H03, with its shade
TORQUE = 0.2  # N m, of a Honeywell HR16 of 50 N m s, one along each body axis
RAMP = 0.006 * DEGREE  # rad/s^2: 0.157 N m about body x, so that 0.043 N m are left for control
FORCE, LEVER = 0.2, np.array([0.05, -0.03, 0.08])  # N along each axis; m, thrust line from the centre of mass
BAND, STEP = 0.06, 0.5  # rad/s, control bandwidth; s, of control and integration
WHEEL = 50.0 / (6000.0 * 2.0 * np.pi / 60.0)  # kg m^2: 50 N m s at 6000 rpm
AFTER = 600.0  # s, flown after the lock
PAIR = [2.08, 25.2, -305.6], [0.0, 0.0, 0.0831]  # S04's pair, which requires the second mOPS
OFF_AT_START = {"A": (0.2, -0.1, 0.15), "B": (-0.1, 0.2, 0.1)}  # deg, rotation vectors
GROUP_AXES = {"A": np.array([1.0, 1.0, 1.0]), "B": np.array([1.0, -1.0, -1.0])}


@dataclass(frozen=True)
class Ramped:
    """Angle, rate and acceleration of all turns of a search with trapezoidal rates, one after another."""

    search: Any
    acceleration: float

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the attitude of A (3, 3), its angular velocity and acceleration (3,) in inertial axes."""
        begin = 0.0
        for leg in self.search.legs:
            angle, way = abs(leg.angle), np.sign(leg.angle)
            rate = min(self.search.slew_rate, np.sqrt(angle * self.acceleration))
            ramp = rate / self.acceleration
            length = angle / rate + ramp
            if time < begin + length or leg is self.search.legs[-1]:
                break
            begin += length
        since = np.clip(time - begin, 0.0, length)
        left = length - since
        if since < ramp:
            turned, speed, push = (
                0.5 * self.acceleration * since**2,
                self.acceleration * since,
                self.acceleration,
            )
        elif left > ramp:
            turned, speed, push = rate * (since - 0.5 * ramp), rate, 0.0
        else:
            turned, speed, push = angle - 0.5 * self.acceleration * left**2, self.acceleration * left, 0.0
            push = -self.acceleration if left > 0.0 else 0.0
        attitude = Rotation.from_rotvec(way * turned * leg.axis).as_matrix() @ leg.attitude
        return attitude, way * speed * leg.axis, way * push * leg.axis


@dataclass
class Flown:
    """Simulated pair at times (T,) [s]: states (T, 2, 6), attitudes (T, 2, 3, 3), torques (T, 2, 3) [N m].

    `off` (T, 2): angle from the commanded attitude [rad]; `lock`: first sample of a lock [s].
    """

    times: list = field(default_factory=list)
    states: list = field(default_factory=list)
    attitudes: list = field(default_factory=list)
    torques: list = field(default_factory=list)
    off: list = field(default_factory=list)
    lock: float | None = None


class Pilot(sysModel.SysModel):
    """Attitude control of both spacecraft, detection of their lock, and the burn of the second."""

    def __init__(self, craft: list[Any], wheels: list[Any], turns: Ramped, sensor: cf.Sensor) -> None:
        super().__init__()
        self.ModelTag, self.turns, self.sensor, self.flown = "pilot", turns, sensor, Flown()
        self.states = [messaging.SCStatesMsgReader() for _ in craft]
        self.speeds = [messaging.RWSpeedMsgReader() for _ in craft]
        for k, one in enumerate(craft):
            self.states[k].subscribeTo(one.scStateOutMsg)
            self.speeds[k].subscribeTo(wheels[k].rwSpeedOutMsg)
        self.motors = [messaging.ArrayMotorTorqueMsg() for _ in craft]
        self.force, self.torque = messaging.CmdForceBodyMsg(), messaging.CmdTorqueBodyMsg()
        self.stop: list[tuple[np.ndarray, np.ndarray]] = []  # attitude and angular velocity at the lock

    def Reset(self, now: int) -> None:
        for motor in self.motors:
            motor.write(messaging.ArrayMotorTorqueMsgPayload(), now, self.moduleID)
        self.force.write(messaging.CmdForceBodyMsgPayload(), now, self.moduleID)
        self.torque.write(messaging.CmdTorqueBodyMsgPayload(), now, self.moduleID)

    def commanded(self, k: int, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the commanded attitude, angular velocity and acceleration, of the search or of the stop."""
        if not self.stop:
            attitude, speed, push = self.turns.at(time)
            return attitude * GROUP_AXES["AB"[k]], speed, push
        attitude, speed = self.stop[k]
        size = np.linalg.norm(speed)
        axis = speed / size if size > 0.0 else speed
        since = min(time - self.flown.lock, size / RAMP)
        slower = size - RAMP * since
        turned = (size - 0.5 * RAMP * since) * since
        push = -RAMP * axis if slower > 0.0 else 0.0 * axis
        return Rotation.from_rotvec(turned * axis).as_matrix() @ attitude, slower * axis, push

    def UpdateState(self, now: int) -> None:
        time = now * macros.NANO2SEC
        said = [reader() for reader in self.states]
        states = np.array([[*one.r_BN_N, *one.v_BN_N] for one in said])
        bodies = [Rotation.from_mrp(one.sigma_BN).as_matrix() for one in said]  # columns: body axes
        if self.flown.lock is None and sees(bodies, states, self.sensor):
            stop = [self.commanded(k, time)[:2] for k in range(2)]
            self.stop, self.flown.lock = stop, time
        torques, off = [], []
        for k, one in enumerate(said):
            attitude, speed, push = self.commanded(k, time)
            spin = np.array(one.omega_BN_B)
            wrong = Rotation.from_matrix(attitude.T @ bodies[k]).as_rotvec()
            wheel = WHEEL * np.array(self.speeds[k]().wheelSpeeds[:3])
            law = INERTIA * (bodies[k].T @ push) + np.cross(spin, INERTIA * spin + wheel)
            law -= INERTIA * (BAND**2 * wrong + 1.8 * BAND * (spin - bodies[k].T @ speed))
            asked = messaging.ArrayMotorTorqueMsgPayload()
            asked.motorTorque = np.clip(-law, -TORQUE, TORQUE).tolist()
            self.motors[k].write(asked, now, self.moduleID)
            torques.append(asked.motorTorque[:3])
            off.append(np.linalg.norm(wrong))
        self.burn(now, time, states, bodies[1])
        self.flown.times.append(time)
        self.flown.states.append(states)
        self.flown.attitudes.append(bodies)
        self.flown.torques.append(torques)
        self.flown.off.append(off)

    def burn(self, now: int, time: float, states: np.ndarray, body: np.ndarray) -> None:
        """Thrust along the body axes of the second until it moves with the first, after it has stopped."""
        force = np.zeros(3)
        if self.flown.lock is not None and time > self.flown.lock + 60.0:
            force = np.clip(MASS * body.T @ (states[0, 3:] - states[1, 3:]) / STEP, -FORCE, FORCE)
        pushed, turned = messaging.CmdForceBodyMsgPayload(), messaging.CmdTorqueBodyMsgPayload()
        pushed.forceRequestBody, turned.torqueRequestBody = force.tolist(), np.cross(LEVER, force).tolist()
        self.force.write(pushed, now, self.moduleID)
        self.torque.write(turned, now, self.moduleID)


def sees(bodies: list[np.ndarray], states: np.ndarray, sensor: cf.Sensor) -> bool:
    """Return True if both look at each other: H03 eqs. 1-2."""
    looks = [body[:, 2] for body in bodies]
    line = states[1, :3] + sensor.offset * looks[1] - states[0, :3] - sensor.offset * looks[0]
    line /= np.linalg.norm(line)
    return bool(min(line @ looks[0], -line @ looks[1]) >= sensor.cosine)


def fly(search: cf.Search, position: Any, velocity: Any, duration: float) -> Flown:
    """Simulate a pair, B at a position and velocity relative to A, for at most a duration [s]."""
    run, kept, craft, wheels = SimulationBaseClass.SimBaseClass(), [], [], []
    run.CreateNewProcess("all").addTask(run.CreateNewTask("flight", macros.sec2nano(STEP)))
    for k, group in enumerate("AB"):
        one = spacecraft.Spacecraft()
        one.ModelTag = f"craft {group}"
        one.hub.mHub, one.hub.IHubPntBc_B = MASS, np.diag(INERTIA).tolist()
        one.hub.r_CN_NInit, one.hub.v_CN_NInit = (
            (k * np.asarray(position)).tolist(),
            (k * np.asarray(velocity)).tolist(),
        )
        off = Rotation.from_rotvec(OFF_AT_START[group], degrees=True).as_matrix()
        one.hub.sigma_BNInit = Rotation.from_matrix(search.attitude(0.0, group) @ off).as_mrp().tolist()
        factory, effector = simIncludeRW.rwFactory(), reactionWheelStateEffector.ReactionWheelStateEffector()
        for axis in np.eye(3):
            factory.create("Honeywell_HR16", axis.tolist(), maxMomentum=50.0, Omega=0.0)
        factory.addToSpacecraft(f"wheels {group}", effector, one)
        craft.append(one)
        wheels.append(effector)
        kept.append(factory)
    pilot = Pilot(craft, wheels, Ramped(search, RAMP), search.sensor)
    pusher = extForceTorque.ExtForceTorque()
    pusher.cmdForceBodyInMsg.subscribeTo(pilot.force)
    pusher.cmdTorqueInMsg.subscribeTo(pilot.torque)
    craft[1].addDynamicEffector(pusher)
    for effector, motor in zip(wheels, pilot.motors, strict=True):
        effector.rwMotorCmdInMsg.subscribeTo(motor)
    for module, priority in (
        (pilot, 400),
        (pusher, 300),
        *((one, 200) for one in wheels),
        *((one, 100) for one in craft),
    ):
        run.AddModelToTask("flight", module, priority)
    run.InitializeSimulation()
    until = 0.0
    while until < duration and (pilot.flown.lock is None or until < pilot.flown.lock + AFTER):
        until += 100.0
        run.ConfigureStopTime(macros.sec2nano(until))
        run.ExecuteSimulation()
    flown = pilot.flown
    flown.times, flown.states, flown.attitudes, flown.torques, flown.off = map(
        np.array, (flown.times, flown.states, flown.attitudes, flown.torques, flown.off)
    )
    return flown


def main() -> None:
    search = cf.Search.modified(cf.Sensor(70 * DEGREE), 0.25 * DEGREE, 25 * DEGREE)
    predicted = cf.lock_times(search, *PAIR, cf.SearchErrors(slew_acceleration=RAMP)).time[0]
    flown = fly(search, *PAIR, predicted + 500.0)
    before = flown.times < flown.lock
    settled = before & (flown.times > 120.0)
    shade = np.arccos(np.clip(-flown.attitudes[:, :, 2, 0], -1.0, 1.0)).max()
    print(f"lock without ramps {cf.lock_times(search, *PAIR).time[0]:.2f} s, with ramps {predicted:.2f} s")
    print(f"lock in Basilisk {flown.lock:.1f} s")
    print(f"attitude off by at most {flown.off[settled].max() / DEGREE:.4f} deg before the lock")
    print(f"attitude off by at most {flown.off[~before].max() / DEGREE:.4f} deg in the stop and the burn")
    print(
        f"largest wheel torque {np.abs(flown.torques).max():.3f} N m; "
        f"body x at most {shade / DEGREE:.2f} deg off the sun"
    )
    relative = np.linalg.norm(flown.states[:, 1, 3:] - flown.states[:, 0, 3:], axis=1)
    print(
        f"relative speed {1e3 * relative[0]:.2f} mm/s at first, {1e3 * relative[-1]:.4f} mm/s after the burn"
    )


if __name__ == "__main__":
    main()
