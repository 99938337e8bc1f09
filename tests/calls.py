"""A valid call of each public function."""

import re
from dataclasses import fields

import numpy as np

import closeform as cf

ORBIT = cf.Orbit(1.1e-3)
START = np.array([[0.0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], [0, 60, 80, 0, 0, 0]])
TIMES = np.array([9.0, 8.0, 7.0])
COAST = ORBIT.coast(START, 900.0)
MOVE = ORBIT.transfer(START[0], START[1], 900.0)
REST = ORBIT.coast(np.zeros(6), 900.0)
BALL = cf.Sphere(20.0)
SEARCH = cf.Search.modified(cf.Sensor(1.2), slew_rate=0.004, sun_limit=0.43)
PLACE, SPEED = np.array([300.0, -200.0, 100.0]), np.array([0.02, 0.01, -0.03])
PLACES, SPEEDS = np.array([PLACE, -PLACE, 0 * PLACE]), np.array([SPEED, -SPEED, 0 * SPEED])
CHIEF = np.array([7e6, 0.0, 0.0, 0.0, 7546.05, 0.0])
DEPUTY = CHIEF + [10.0, 20.0, 30.0, 0.01, 0.02, 0.03]
ELEMENTS = np.array([7e6, 0.3, 1e-3, 2e-3, 1.0, 0.5])
ROE = np.array([1e-6, 2e-5, 1e-6, 3e-6, 2e-6, 1e-6])
TABLE = cf.Ephemeris(
    *("A", "2020-001A", "EARTH", "GCRF", "UTC", "2020-01-01T00:00:00"),
    np.array([0.0, 60.0]),
    np.array([CHIEF, [6985270.0, 451800.0, 0, -487.8, 7530.3, 0]]),
)
SIX = cf.Thrusters.rtn(acceleration=1.0, period=90.0)
GATHERED = cf.gather(SEARCH, PLACES, SPEEDS)
KNOWN = cf.Uncertainty(np.diag([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2)
NEAR = ORBIT.coast(np.array([0.0, 30.0, 0.0, 0.0, 0.0, 0.0]), 900.0)
STAYS = ORBIT.coast(np.zeros(6), 1800.0)
MOVES = ORBIT.transfer(START, START[::-1], 900.0)
MESSAGE = np.diag([4.0, 30.0, 3.0, 0.03, 0.004, 0.003]) ** 2
OBJECTS = [
    cf.ConjunctionObject(name, name, "GCRF", state, MESSAGE, radius=2.0)
    for name, state in (("A", CHIEF), ("B", DEPUTY))
]
MEETING = cf.Conjunction("2020-01-01T00:00:00", OBJECTS)
LOW = cf.Chief("2020-01-01T00:00:00", CHIEF)
WORDS = "UNKNOWN", "EARTH", "GCRF", "TAI", "2020-01-01T00:00:00", [0.0, 60.0]
ROWS = LOW.states([0.0, 60.0])
TOGETHER = cf.common_frame([cf.Ephemeris("A", *WORDS, ROWS), cf.Ephemeris("B", *WORDS, ROWS + 10.0)])
AIR = cf.Drag(5e-13, 5e5, 6e4, ballistic=0.02, chief=0.01)
BLOCK = cf.Covariances([0.0], MESSAGE[None], ["RTN"])


def inputs(**arguments):
    return arguments


CALLS = {
    "Orbit": inputs(mean_motion=1.1e-3),
    "Orbit.circular": inputs(altitude=5e5, mu=4e14, radius=6.4e6),
    "Orbit.from_semi_major_axis": inputs(semi_major_axis=7e6, mu=4e14),
    "Orbit.from_period": inputs(period=5700.0),
    "Orbit.eccentric": inputs(
        eccentricity=0.2, semi_major_axis=8e6, true_anomaly=0.4, mu=4e14, radius=6.3e6
    ),
    "Orbit.perturbed": inputs(
        eccentricity=0.01,
        inclination=1.1,
        semi_major_axis=8e6,
        argument_of_perigee=0.2,
        true_anomaly=0.4,
        span=900.0,
        j2=1e-3,
        mu=4e14,
        radius=6.3e6,
    ),
    "Orbit.perturbed, perigee": inputs(eccentricity=0.01, inclination=1.1, perigee_altitude=5e5, span=900.0),
    "Orbit.from_transition": inputs(
        transition=lambda start, times: ORBIT.transition(times - start),
        period=5700.0,
        span=np.array([0.0, 900.0]),
        error=1e-12,
    ),
    "Orbit.eccentric, perigee": inputs(eccentricity=0.2, perigee_altitude=5e5),
    "Orbit.transition": inputs(self=ORBIT, duration=np.array([[1.0, 2.0]]), start=5.0),
    "Orbit.coast": inputs(self=ORBIT, state=START, duration=TIMES, start=TIMES),
    "Orbit.transfer": inputs(
        self=ORBIT, initial=START, final=START[::-1], duration=TIMES, start=TIMES, max_acceleration=100.0,
        cost="delta-v",
    ),
    "Orbit.two_impulse": inputs(
        self=ORBIT, initial=START, final=START[::-1], duration=TIMES, start=TIMES
    ),
    "Orbit.impulsive": inputs(
        self=ORBIT, initial=START, final=START[::-1], duration=TIMES, start=TIMES,
        thrusters=cf.Thrusters.rtn(),
    ),
    "least_delta_v": inputs(
        orbit=ORBIT, initial=START, final=START[::-1], duration=TIMES, max_acceleration=100.0, start=TIMES
    ),
    "delta_v_bound": inputs(orbit=ORBIT, initial=START, final=START[::-1], duration=TIMES),
    "transfer_cost_table": inputs(
        orbit=ORBIT, initial=START[0], slots=START, duration=np.array([900.0, 1800.0])
    ),
    "Orbit.burn": inputs(
        self=ORBIT, state=START, acceleration=1e-4 * START[:, :3], duration=TIMES, start=TIMES,
        frame="inertial",
    ),
    "Orbit.sampled": inputs(self=ORBIT, times=np.array([0.0, 60.0, 90.0]), states=np.stack([START, START])),
    "Path": inputs(orbit=ORBIT, arcs=COAST.arcs, offsets=COAST.offsets, shape=(3,)),
    "Path.state": inputs(self=COAST, time=np.array([1.0, 2.0])),
    "Path.position": inputs(self=COAST, time=np.array([1.0, 2.0])),
    "Path.velocity": inputs(self=COAST, time=np.array([1.0, 2.0])),
    "Path.thrust": inputs(self=MOVE, time=np.array([1.0, 2.0])),
    "Path.extended": inputs(self=COAST, until=1200.0),
    "join": inputs(paths=[COAST[0], ORBIT.coast(COAST[0].state(900.0), 9.0, start=900.0)]),
    "stack": inputs(paths=[COAST[0], MOVE]),
    "Box": inputs(half_widths=np.array([1.0, 2, 3]), axes=np.eye(3)),
    "Ellipsoid": inputs(semi_axes=np.array([1.0, 2, 3]), axes=np.eye(3)),
    "Ellipsoid.from_covariance": inputs(covariance=np.diag([1.0, 2, 3]), sigmas=3.0),
    "Sphere": inputs(radius=3.0),
    "Cylinder": inputs(radius=3.0, half_length=4.0, axis=np.array([0.0, 1, 0])),
    "HalfSpaces": inputs(normals=np.eye(3), offsets=np.array([1.0, 2, 3])),
    "CovarianceZone": inputs(covariance=np.diag([1.0, 2, 3]), sigmas=3.0),
    "Body": inputs(zone=BALL),
    "Zone.norm": inputs(self=BALL, position=START[:, :3]),
    "Zone.enlarged": inputs(self=BALL, factor=2.0),
    "Zone.padded": inputs(self=BALL, margin=2.0),
    "Zone.support": inputs(self=BALL, direction=START[:, :3]),
    "PairZones.of": inputs(zones=[BALL, None, BALL], names=["a", "b", "c"], moves=[True, True, False]),
    "find_conflicts": inputs(
        path=MOVE, other=REST, zone=BALL, sigmas=3.0, method="sauter-palmer", extend=True
    ),
    "closest_approach": inputs(path=COAST, other=REST, zone=BALL),
    "last_possible_conflict": inputs(path=COAST, other=REST, zone=BALL),
    "screen": inputs(paths=COAST, zone=BALL, sigmas=3.0, span=np.array([-1.0, 800.0])),
    "Screening.joined": inputs(parts=[cf.screen(COAST, BALL)]),
    "avoid": inputs(
        path=MOVE, obstacles=[REST], zone=BALL, budget=3, prove=0.0, gap=0.01,
        max_acceleration=1.0, longer=True, sigmas=3.0, margin=0.5,
    ),
    "reconfigure": inputs(
        orbit=ORBIT, initial=START[:2], final=START[1::-1], duration=900.0, zone=BALL, assign=True, start=0.0,
        obstacles=[REST], max_acceleration=1.0, order=None, names=["a", "b"], budget=3, prove=0.0, gap=0.01,
        sigmas=3.0, margin=np.zeros((3, 3)),
    ),
    "find_conflicts, errors": inputs(
        path=NEAR, other=REST, zone=BALL, errors=KNOWN, other_errors=KNOWN, sigmas=5.0
    ),
    "screen, errors": inputs(paths=COAST, zone=cf.Body(BALL), errors=[KNOWN, None, KNOWN], sigmas=40.0),
    "avoid, errors": inputs(
        path=MOVE, obstacles=[REST], zone=BALL, errors=KNOWN, other_errors=[KNOWN], sigmas=20.0,
        budget=1,
    ),
    "avoid, drift": inputs(path=MOVE, obstacles=[STAYS], zone=BALL, drift=600.0, budget=1),
    "avoid, delta-v": inputs(
        path=MOVE, obstacles=[REST], zone=cf.Sphere(60.0), method="exact", budget=1, names=["a"],
        cost="delta-v", thrusters=SIX, requirements=cf.requirements.SpeedLimit(limit=100.0),
    ),
    "reconfigure, errors": inputs(
        orbit=ORBIT, initial=START[:2], final=START[1::-1], duration=900.0, zone=cf.Sphere(60.0),
        errors=[KNOWN, None], sigmas=20.0, budget=1,
    ),
    "reconfigure, drift": inputs(
        orbit=ORBIT, initial=START[:2], final=START[1::-1], duration=900.0, zone=BALL, drift=600.0,
        budget=1,
    ),
    "reconfigure, delta-v": inputs(
        orbit=ORBIT, initial=START[:2], final=START[1::-1], duration=900.0, zone=BALL, method="joint",
        if_blocked=["more sides"], budget=1, cost="delta-v", thrusters=[SIX, None],
        requirements=cf.requirements.SpeedLimit(limit=100.0),
    ),
    "ThrustLost": inputs(),
    "MissedBurns": inputs(least=0.5),
    "DegradedThrust": inputs(least=0.5),
    "StuckOnThrust": inputs(longest=60.0, acceleration=np.array([1e-3, 0.0, 0.0])),
    "passively_safe": inputs(
        path=MOVE, other=STAYS, zone=BALL, until=1800.0, failure=cf.ThrustLost(), failing="path"
    ),
    "drift_approach": inputs(
        path=MOVE, other=STAYS, zone=BALL, until=1800.0, failure=cf.DegradedThrust(0.5), failing="path"
    ),
    "drift_screen": inputs(
        paths=MOVES, zone=cf.Sphere(60.0), until=1800.0, failure=cf.MissedBurns(0.5), failing="either"
    ),
    "Uncertainty": inputs(
        state=MESSAGE, magnitude=0.01, pointing=0.01, impulse=np.array([1e-3, 0.01, 1e-3, 0.01]), noise=1e-9
    ),
    "Uncertainty.from_rtn": inputs(
        covariance=MESSAGE, path=MOVE, time=9.0, chief=CHIEF, craft=DEPUTY, magnitude=0.01
    ),
    "Uncertainty.from_inertial": inputs(covariance=MESSAGE, path=MOVE, time=9.0, chief=CHIEF, magnitude=0.01),
    "Uncertainty.covariance": inputs(self=KNOWN, path=MOVE, time=TIMES),
    "Encounter.of": inputs(
        primary=CHIEF, secondary=DEPUTY, covariance=MESSAGE, secondary_covariance=MESSAGE, axes="rtn",
        half_window=60.0, mu=4e14,
    ),
    "clearance_in_sigmas": inputs(path=NEAR, other=REST, zone=BALL, errors=KNOWN, other_errors=[KNOWN]),
    "collision_probability": inputs(
        path=NEAR, other=REST, zone=BALL, errors=KNOWN, other_errors=KNOWN, method="entries", samples=100,
        seed=1,
    ),
    "max_clearance": inputs(path=MOVE, obstacles=[REST], zone=BALL, budget=1.01 * MOVE.energy),
    "max_clearance, errors": inputs(
        path=MOVE, obstacles=[REST], zone=BALL, budget=1.01 * MOVE.energy, errors=KNOWN, other_errors=KNOWN
    ),
    "clearance_cost_curve": inputs(path=MOVE, obstacles=[REST], zone=BALL, factors=np.array([0.5, 1.0])),
    "max_clearance, delta-v": inputs(  # below the cost of the direct path
        path=MOVE, obstacles=[REST], zone=BALL, budget=0.5, cost="delta-v", thrusters=SIX, names=["a"]
    ),
    "clearance_cost_curve, delta-v": inputs(
        path=MOVE, obstacles=[REST], zone=BALL, factors=np.array([0.5, 1.0]), cost="delta-v", thrusters=SIX,
        names=["a"],
    ),
    "papers.end_gradients": inputs(path=MOVE),
    "fire_thrusters": inputs(
        plan=MOVE, thrusters=SIX, mass=12.0, specific_impulse=60.0, zone=BALL, obstacles=[REST]
    ),
    "plots.primer": inputs(path=MOVE, craft=0, thrusters=SIX),
    "plots.trade": inputs(
        found=cf.transfer_cost_table(ORBIT, START[0], START, np.array([900.0, 1800.0])),
        plan=[MOVE],
    ),
    "plots.clearance": inputs(found=cf.clearance_cost_curve(MOVE, [REST], BALL, [0.5, 1.0]), most=None),
    "plots.pulses": inputs(firing=cf.fire_thrusters(MOVE, SIX), craft=0),
    "Thrusters": inputs(
        directions=np.eye(3), frame="inertial", acceleration=PLACE**2, minimum_bit=1e-3, period=9.0
    ),
    "Thrusters.rtn": inputs(frame="orbit", acceleration=0.1, minimum_bit=1e-3, period=9.0),
    "Thrusters.with_force": inputs(self=cf.Thrusters(np.eye(3)), force=0.1, mass=12.0, minimum_impulse=1e-3),
    "Thrusters.directions_at": inputs(self=cf.Thrusters(np.eye(3), "inertial"), orbit=ORBIT, time=TIMES),
    "least_time": inputs(
        orbit=ORBIT, initial=START[0], final=START[1], max_acceleration=1e-2, profile="least time", start=0.0
    ),
    "shortest_transfer": inputs(
        orbit=ORBIT, initial=START[0], final=START[1], max_acceleration=1e-2, start=0.0
    ),
    "propellant": inputs(mass=np.array([100.0]), delta_v=np.array([1.0]), specific_impulse=np.array([200.0])),
    "elements.relative_from_inertial": inputs(
        chief=CHIEF, deputy=DEPUTY, along_track="arc", radius=7e6, acceleration=np.array([-8.0, 0.0, 1e-3])
    ),
    "elements.inertial_from_relative": inputs(
        chief=CHIEF, relative=START, along_track="arc", radius=7e6, acceleration=np.array([-8.0, 0.0, 1e-3])
    ),
    "elements.mean_motion_from_semi_major_axis": inputs(semi_major_axis=np.array([7e6]), mu=4e14),
    "elements.mean_motion_from_altitude": inputs(altitude=np.array([5e5]), mu=4e14, radius=6.4e6),
    "elements.mean_motion_from_period": inputs(period=np.array([5700.0])),
    "elements.semi_major_axis_from_mean_motion": inputs(mean_motion=np.array([1e-3]), mu=4e14),
    "elements.altitude_from_mean_motion": inputs(mean_motion=np.array([1e-3]), mu=4e14, radius=6.4e6),
    "elements.period_from_mean_motion": inputs(mean_motion=np.array([1e-3])),
    "elements.palmer_from_state": inputs(state=START, mean_motion=1e-3),
    "elements.state_from_palmer": inputs(palmer=START, mean_motion=1e-3),
    "elements.elements_from_inertial": inputs(state=CHIEF, mu=4e14),
    "elements.inertial_from_elements": inputs(elements=ELEMENTS, mu=4e14),
    "elements.roe_from_elements": inputs(chief=ELEMENTS, deputy=ELEMENTS + [10, 1e-5, 0, 0, 0, 0]),
    "elements.elements_from_roe": inputs(chief=ELEMENTS, roe=ROE),
    "elements.scaled_roe_from_state": inputs(state=START, mean_motion=1e-3, latitude=0.2),
    "elements.state_from_scaled_roe": inputs(scaled=START, mean_motion=1e-3, latitude=0.2),
    "elements.roe_from_state": inputs(state=START, semi_major_axis=7e6, latitude=0.2, mu=4e14),
    "elements.state_from_roe": inputs(roe=ROE, semi_major_axis=7e6, latitude=0.2, mu=4e14),
    "Sensor": inputs(
        half_angle=1.2, offset=1.0, range=1e4, range_error=0.02, bearing_error=1e-3, fix_interval=9.0
    ),
    "Search.modified": inputs(sensor=cf.Sensor(1.2), slew_rate=0.004, sun_limit=0.43),
    "Search.basic": inputs(
        sensor=cf.Sensor(1.2), slew_rate=0.004, sun_limit=0.43, in_plane_turn=9.42, tip_angle=0.4,
        passes=1, relaxed=True,
    ),
    "Search.attitude": inputs(self=SEARCH, t=np.array([0.0, 9.0]), group="A"),
    "Search.boresight": inputs(self=SEARCH, t=np.array([0.0, 9.0]), group="A"),
    "Search.alignment": inputs(self=SEARCH, attitude=np.eye(3), group="A"),
    "Search.coverage": inputs(self=SEARCH, phase=SEARCH.legs[0].phase),
    "Search.near_field_radius": inputs(self=SEARCH, height=np.array([0.0, 9.0])),
    "lock_times": inputs(
        search=SEARCH,
        relative_position=PLACES[:2],
        relative_velocity=SPEEDS[:2],
        errors=cf.SearchErrors(start=[0.0, 2.0]),
        step=30.0,
        bearing=True,
    ),
    "SearchErrors": inputs(
        pointing=[[0.0, 0.01, 0.0], [0.01, 0.0, 0.0]],
        slew_rate=[0.001, 0.0],
        start=[0.0, 2.0],
        half_angle=[0.0, 0.01],
        range=[1e3, 2e3],
        slew_acceleration=[1e-4, 2e-4],
        silent=[False, True],
        solar_acceleration=[0.0, 1e-6],
        outages=[[[60.0, 120.0]], [[300.0, 1e9]]],
    ),
    "lock_margins": inputs(search=SEARCH, position=PLACE, velocity=SPEED),
    "prove_locks": inputs(
        search=SEARCH, low=np.append(PLACE, SPEED) - 1e-3, high=np.append(PLACE, SPEED) + 1e-3,
        pointing_error=0.01, timing_error=1.0, rate_error=0.001, slew_acceleration=0.01,
        latest=8000.0, nodes=9,
    ),
    "longest_lock": inputs(
        search=SEARCH, low=np.append(PLACE, SPEED) - 1e-3, high=np.append(PLACE, SPEED) + 1e-3, seed=2,
        nodes=9,
    ),
    "papers.theorem_case": inputs(search=SEARCH, position=PLACE, velocity=SPEED),
    "papers.cone_regions": inputs(search=SEARCH, position=PLACES[:2], mops=1),
    "papers.cone_crossings": inputs(search=SEARCH, position=PLACE, velocity=SPEED),
    "papers.regions_searched": inputs(search=SEARCH, mops=1, group="A"),
    "gather": inputs(
        search=SEARCH, positions=PLACES, velocities=SPEEDS, groups=list("ABA"), keep_out=BALL,
        rounds=2,
        burns="least", max_speed=9.0, errors=cf.SearchErrors(start=[0.0, 2.0, 1.0]), step=30.0,
        seed=3, case=1,
    ),
    "gather_cases": inputs(
        search=SEARCH, positions=PLACES[None], velocities=SPEEDS[None], groups=list("ABA"), keep_out=BALL,
        rounds=2,
        burns="least", max_speed=9.0, errors=cf.SearchErrors(start=[0.0, 2.0, 1.0]), step=30.0,
        seed=3, case=1,
    ),
    "Gathering.acquainted": inputs(self=GATHERED, first=0, second=1),
    "Gathering.known": inputs(self=GATHERED, first=0, second=1, time=3.0),
    "Ephemeris": inputs(
        name="A", object_id="1", center="EARTH", frame="GCRF", time_system="UTC", epoch="2020-01-01T00:00:00",
        times=TABLE.times, states=TABLE.states, covariances=BLOCK,
    ),
    "Covariances": inputs(times=np.array([0.0]), matrices=MESSAGE[None], frames=["RTN"]),
    "ConjunctionObject": inputs(
        name="A", designator="1", frame="GCRF", state=CHIEF, covariance=MESSAGE, radius=2.0, catalog="SATCAT",
        international_designator="2020-001A", ephemeris_name="NONE", covariance_method="CALCULATED",
        manoeuvrable="NO",
    ),
    "Conjunction": inputs(
        tca="2020-01-01T00:00:00", objects=OBJECTS, miss_distance=40.0, hard_body_radius=4.0,
        collision_probability=0.1, collision_probability_method="FOSTER-1992", originator="ME",
        message_id="1", creation_date="2020-01-01T00:00:00", message_for="A",
        exclusion_radii=np.array([1.0, 2.0]),
    ),
    "Conjunction.encounter": inputs(self=MEETING, half_window=60.0, mu=4e14),
    "Chief": inputs(
        epoch="2020-01-01T00:00:00", state=CHIEF, frame="GCRF", time_system="TAI", center="EARTH", mu=4e14,
    ),
    "Chief, along an ephemeris": inputs(epoch="2020-01-01T00:00:00", state=CHIEF, ephemeris=TABLE),
    "Chief.from_elements": inputs(
        epoch="2020-01-01T00:00:00", elements=ELEMENTS, frame="GCRF", time_system="TAI", center="EARTH",
        mu=4e14,
    ),
    "Chief.from_ephemeris": inputs(
        ephemeris=TABLE, epoch="2020-01-01T00:00:30", time_system="UTC", mu=4e14
    ),
    "CommonFrame.inertial_states": inputs(self=TOGETHER, name="A", times=np.array([0.0, 50.0])),
    "Chief.states": inputs(self=LOW, times=np.array([[0.0, 60.0]])),
    "Chief.interpolation_errors": inputs(self=LOW, times=np.array([0.0, 60.0])),
    "Chief.inertial_from_relative": inputs(
        self=LOW, times=np.array([0.0, 60.0, 90.0]), relative=START, along_track="arc"
    ),
    "Chief.relative_from_inertial": inputs(
        self=LOW, times=np.array([0.0, 60.0]), inertial=np.array([CHIEF, DEPUTY]), along_track="straight"
    ),
    "Chief.utc": inputs(self=LOW, times=np.array([0.0, 60.0])),
    "Drag": inputs(
        density=5e-13, altitude=5e5, scale_height=6e4, ballistic=np.array([0.01, 0.02]), chief=0.01, spin=7e-5
    ),
    "Field": inputs(chief=LOW, zonals=np.array([1e-3, -2e-6]), drag=AIR, radius=6.4e6),
    "Field, of a function": inputs(chief=LOW, acceleration=lambda times, states: -9e-7 * states[:, :3]),
    "Field.accelerations": inputs(
        self=cf.Field(LOW), times=np.array([0.0, 1.0]), states=np.array([CHIEF, DEPUTY]),
        ballistics=np.array([0.01, 0.02]),
    ),
    "Field.chief_states": inputs(self=cf.Field(LOW), times=np.array([0.0, 60.0])),
    "Orbit.from_elements": inputs(elements=ELEMENTS, mu=4e14),
    "Field.coast": inputs(
        self=cf.Field(LOW), states=START, duration=900.0, start=5.0, within=0.01, orbit=cf.Field(LOW).orbit
    ),
    "Field.transition": inputs(self=cf.Field(LOW), duration=np.array([[1.0, 2.0]]), start=5.0),
    "Feedback": inputs(every=60.0, horizon=600.0, impulses=0, delay=5.0),
    "Navigation": inputs(
        position=0.1, velocity=3e-4, position_bias=0.1, velocity_bias=1e-4, correlation=300.0
    ),
    "tube": inputs(
        orbit=ORBIT, feedback=cf.Feedback(), navigation=cf.Navigation(), residual=np.array([1e-6, 2e-6]),
        thrust_error=np.array([1e-6, 2e-6]), sigmas=3.0, minimum_bit=0.0,
    ),
    "Tube.containment": inputs(
        self=cf.tube(ORBIT, cf.Feedback(), cf.Navigation(0.1, 3e-4)), duration=5400.0, probability=0.99,
        craft=3,
    ),
    "Tube.of_pairs": inputs(
        self=cf.tube(ORBIT, cf.Feedback(), cf.Navigation(0.1, 3e-4)), craft=2, fixed=1
    ),
    "tracking_margins": inputs(
        plan=LOW.orbit.transfer(START, START[::-1], 900.0), field=cf.Field(LOW), feedback=cf.Feedback(),
        navigation=cf.Navigation(0.1, 3e-4), cancel=True, residual=np.full(len(START), 1e-7),
        thrust_error=np.array([0.01, 0.01]), errors=cf.Uncertainty(magnitude=0.01), sigmas=3.0,
        minimum_bit=0.0, thrusters=None, engine=True,
    ),
    "fit_margin": inputs(
        planned=lambda margin: cf.reconfigure(
            LOW.orbit, START[:2], START[1::-1], 900.0, cf.Sphere(3.0), margin=margin
        ),
        field=cf.Field(LOW), zones=cf.Sphere(3.0), feedback=cf.Feedback(),
        navigation=cf.Navigation(0.1, 3e-4), obstacles=[], held=False, before=None, cancel=True,
        residual=1e-7, thrust_error=np.array([0.0, 0.0]), errors=None, sigmas=3.0, max_acceleration=1.0,
        minimum_bit=0.0, thrusters=[None, None], engine=[True, True],
    ),
    "simulate": inputs(
        plan=LOW.orbit.transfer(START, START[::-1], 900.0), field=cf.Field(LOW), control="open",
        feedback=cf.Feedback(), navigation=cf.Navigation(), zones=BALL, cancel=True, known=cf.Field(LOW),
        thrust_error=np.array([0.01, 0.01]), max_acceleration=1.0, minimum_bit=1e-3, thrusters=None, seeds=2,
        errors=[None] * len(START), lost=np.full(len(START), 600.0), engine=[True] * len(START),
    ),
    "Simulation.path": inputs(
        self=cf.simulate(LOW.orbit.transfer(START, START[::-1], 900.0), cf.Field(LOW)), seed=0
    ),
    "compensated_thrust": inputs(
        plan=LOW.orbit.transfer(START[0], START[1], 900.0), field=cf.Field(LOW), every=60.0,
        max_acceleration=1.0, thrusters=cf.Thrusters.rtn(acceleration=1.0, period=60.0), mass=100.0,
        specific_impulse=200.0, engine=True,
    ),
    "validity": inputs(
        plan=LOW.orbit.transfer(START, START[::-1], 900.0), field=cf.Field(LOW), zones=BALL
    ),
    "common_frame": inputs(
        ephemerides=[TABLE, cf.Ephemeris("B", *(getattr(TABLE, f.name) for f in fields(TABLE)[1:]))],
        along_track="arc", interpolate=1.0, mu=4e14,
    ),
    "targets.safety_ellipse": inputs(
        orbit=ORBIT, count=3, radial=10.0, cross_track=20.0, along_track=3.0, phase=0.1
    ),
    "targets.separated_ring": inputs(
        orbit=ORBIT, count=3, eccentricity=10.0, inclination=20.0, first_phase=0.1
    ),
    "targets.projected_circular": inputs(orbit=ORBIT, count=3, radius=10.0, first_phase=0.1),
    "targets.string_of_pearls": inputs(orbit=ORBIT, count=3, spacing=10.0, along_track=0.0, time=0.0),
    "targets.pendulum": inputs(orbit=ORBIT, count=3, spacing=10.0, cross_track=5.0),
    "targets.line": inputs(count=3, spacing=10.0, direction=np.array([0.0, 1, 0])),
    "targets.without_eccentricity": inputs(orbit=ORBIT, states=START),
    "targets.without_altitude_difference": inputs(orbit=ORBIT, states=START),
    "targets.added_member": inputs(
        orbit=ORBIT, states=cf.targets.projected_circular(ORBIT, 3, 100.0)
    ),
    "targets.scattered": inputs(orbit=ORBIT, states=START, duration=900.0, factor=3.0),
    "targets.scattered_from": inputs(
        orbit=ORBIT, states=START, duration=900.0, point=np.zeros(3), distance=1e3
    ),
    "targets.regathered": inputs(orbit=ORBIT, states=START, elapsed=900.0),
}  # fmt: skip


def is_named(argument, error):
    return re.search(rf"\b{argument}\b", str(error)) and len(str(error).splitlines()) == 1
