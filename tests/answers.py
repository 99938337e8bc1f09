"""One small result of each class, for tests of pictures, texts and pickles."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import closeform as cf
from closeform.campaign import evaluated
from closeform.cli.app import main
from closeform.mission.mission import plan_mission
from closeform.scenario import parse

STUDY = """\
closeform = 1
title = "Ends <b>at once</b>"

[orbit]
altitude = "550 km"

[craft]
name = ["<i>A</i>", "B"]
position = ["0 0 0 m", "0 60 0 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "20 m" }
covariance = { position = "5 20 5 m", velocity = "5 5 5 mm/s" }
hard_body = "5 m"

[study]
draws = "errors"
cases = 50
seed = 1

[[stage]]
do = "coast"
for = "0.2 orbits"
"""
MISSIONS = """\
closeform = 1
title = "Past a station"

[orbit]
altitude = "550 km"

[craft]
name = ["<i>A</i>", "B"]
position = ["0 0 0 m", "0 60 0 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "20 m" }

[study]
cases = 3
seed = 1
vary = { "craft.position" = { normal = "1 m" } }

[[stage]]
do = "avoid"
craft = "<i>A</i>"
to = { position = "0 120 0 m", velocity = "0 0 0 m/s" }
within = "0.2 orbits"
"""
LOCKS = """\
closeform = 1
title = "Two lost craft"

[orbit]
deep_space = true

[craft]
name = ["L1", "L2"]
group = ["A", "B"]
position = ["0 0 0 m", "100 50 20 m"]
velocity = "0 0 0 m/s"

[sensor]
half_angle = "70 deg"

[search]
method = "modified"
slew_rate = "0.25 deg/s"
sun_limit = "25 deg"

[study]
cases = 20
seed = 1

[study.vary]
"craft.position" = { uniform = "500 m" }

[[stage]]
do = "lock"
"""
SWEEP = """
[study.sweep]
"sensor.half_angle" = ["70 deg", "75 deg"]
"""


def loaded() -> dict[str, Any]:
    """Return the loaded results of a run and two studies."""
    with TemporaryDirectory() as place:
        opened = {}
        for name, verb, text in (
            ("LoadedRun", "run", STUDY),
            ("LoadedStudy", "study", LOCKS),
            ("errors LoadedStudy", "study", STUDY),
        ):
            file = Path(place) / f"{name}.toml"
            file.write_text(text)
            main([verb, str(file), "--out", str(file.with_suffix(""))])
            opened[name] = cf.load(file.with_suffix(""))
    return opened | {"LoadedStage": opened["LoadedRun"].results[0]}


@cache
def answers() -> dict[str, Any]:
    """Return results by the name of their class; variants have words before it."""
    orbit, ball = cf.Orbit.circular(550e3), cf.Sphere(20.0)
    craft = np.array([[0.0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], [0, 10, 0, 0, 0, 0]])
    moves = orbit.transfer(craft, craft[[1, 0, 2]], 200.0)
    rest = orbit.coast(np.zeros(6), 200.0)
    past = orbit.transfer(craft[0], craft[1], 200.0)
    known = cf.Uncertainty(np.diag([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2)
    near = orbit.coast([0.0, 45.0, 0.0, 0.0, -0.05, 0.0], 200.0)
    stays = orbit.coast(np.zeros(6), 400.0)
    six = cf.Thrusters.rtn(acceleration=0.2, period=20.0)
    search = cf.Search.modified(cf.Sensor(1.2), slew_rate=0.004, sun_limit=0.43)
    places = np.array([[300.0, -200, 100], [-300, 200, -100], [0, 0, 0]])
    speeds = np.array([[0.02, 0.01, -0.03], [-0.02, -0.01, 0.03], [0, 0, 0]])
    locks = cf.lock_times(search, places[:2], speeds[:2])
    avoided = cf.avoid(past, rest, ball)
    plan = cf.reconfigure(orbit, craft[:2], craft[[1, 0]], 200.0, ball)
    chief = np.array([7e6, 0.0, 0.0, 0.0, 7546.05, 0.0])
    message = np.diag([4.0, 30.0, 3.0, 0.03, 0.004, 0.003]) ** 2
    objects = [
        cf.ConjunctionObject(name, name, "GCRF", state, message, radius=2.0)
        for name, state in (("A", chief), ("B", chief + [10.0, 20.0, 30.0, 0.01, 0.02, 0.03]))
    ]
    meeting = cf.Conjunction("2020-01-01T00:00:00", objects)
    table = cf.Ephemeris(
        *("A", "2020-001A", "EARTH", "GCRF", "UTC", "2020-01-01T00:00:00"),
        np.array([0.0, 60.0]),
        np.array([chief, [6985270.0, 45400.0, 0, -487.8, 7530.3, 0]]),
    )
    gathered = cf.gather(search, places, speeds)
    bound = cf.least_delta_v(orbit, craft[0], craft[1], 200.0)
    found = {
        "one craft": past,
        "batch of two axes": orbit.transfer(craft[:2, None], craft, 200.0),
        "paths in deep space": cf.Orbit(0.0).coast(craft, 200.0),
        "list of paths": [past, rest],
        "Path": moves,
        "Conflict": cf.find_conflicts(past, rest, ball)[0],
        "conflicts": cf.find_conflicts(past, rest, ball),
        "no conflicts": (),
        "PairConflict": cf.screen(moves, ball).conflicts[0],
        "Screening": cf.screen(moves, ball),
        "empty Screening": cf.screen(moves, cf.Sphere(1e-3)),
        "Approach": cf.closest_approach(past, rest, ball),
        "batch Approach": cf.closest_approach(moves[:, None], moves, ball),
        "DriftApproach": cf.drift_approach(past, stays, ball, 400.0),
        "batch DriftApproach": cf.drift_approach(moves[:2], stays, ball, 400.0),
        "DriftScreening": cf.drift_screen(moves, ball, 200.0),
        "DriftScreening of both": cf.drift_screen(moves, ball, 200.0, failing="both"),
        "SigmaApproach": cf.clearance_in_sigmas(near, rest, ball, known),
        "Probability": cf.collision_probability(near, rest, ball, known),
        "Probability of histories": cf.collision_probability(
            near, rest, ball, known, method="monte-carlo", samples=200
        ),
        "Bound": bound,
        "batch Bound": cf.least_delta_v(orbit, craft, craft[[1, 0, 2]] + [0, 1.0, 0, 0, 0, 0], 200.0),
        "TransferCostTable": cf.transfer_cost_table(orbit, craft[0], craft[1:], [150.0, 200.0]),
        "Plan of one": avoided,
        "Contact": avoided.contacts[0],
        "ShadowPrice": avoided.prices[0],
        "Plan": plan,
        "Plan for delta-v": cf.avoid(past, rest, ball, cost="delta-v"),
        "ThrustShortfall": cf.avoid(past, rest, ball, max_acceleration=1e-9).weak,
        "ClearanceCostCurve": cf.clearance_cost_curve(past, rest, ball, [0.5, 1.0]),
        "MaxClearance": cf.max_clearance(past, rest, ball, 1.1 * avoided.energy),
        "ThrusterFiring": cf.fire_thrusters(past, six),
        "Firing of two": cf.fire_thrusters(moves[:2], six),
        "Pulses": cf.fire_thrusters(past, six).pulses,
        "Search": search,
        "Leg": search.legs[0],
        "Locks": locks,
        "LockMargins": cf.lock_margins(search, places[0], speeds[0]),
        "LockProof": cf.prove_locks(search, -np.ones(6), np.ones(6), nodes=100),
        "LongestLock": cf.longest_lock(search, [90, 90, 90, 0, 0, 0], [99, 99, 99, 0.1, 0.1, 0.1], nodes=10),
        "TheoremCase": cf.papers.theorem_case(search, places[0], speeds[0]),
        "Gathering": gathered,
        "Event": gathered.events[0],
        "Gatherings": cf.gather_cases(search, places[None], speeds[None]),
        "Conjunction": meeting,
        "ConjunctionObject": objects[0],
        "Encounter": meeting.encounter(),
        "Ephemeris": table,
        "Covariances": cf.Covariances([0.0], message[None], ["RTN"]),
        "CommonFrame": cf.common_frame([table, replace(table, name="B", states=table.states + 10.0)]),
    }
    low = cf.Chief("2020-01-01T00:00:00", chief)
    field, steered = cf.Field(low), low.orbit.transfer(craft, craft[[1, 0, 2]], 200.0)
    found |= {
        "Validity": cf.validity(steered, field, ball),
        "CompensatedThrust": cf.compensated_thrust(steered, field, every=20.0),
        "Retargeted": cf.compensated_thrust(
            low.orbit.two_impulse(craft, craft[[1, 0, 2]], 200.0), field
        ).impulses,
        "Simulation": cf.simulate(steered, field),
        "TrackingMargins": cf.tracking_margins(steered, field, cf.Feedback(), cf.Navigation(0.1, 1e-3)),
        "Tube": cf.tube(low.orbit, cf.Feedback(), cf.Navigation(0.1, 1e-3), [1e-6, 2e-6]),
    }
    swap = low.orbit, craft, craft[[1, 0, 2]], 200.0, ball
    found["FittedMargin"] = cf.fit_margin(lambda margin: cf.reconfigure(*swap, margin=margin), field, ball)
    mission = plan_mission(parse(STUDY, "study.toml"))
    errors, locked = (
        evaluated(parse(STUDY, "study.toml")),
        evaluated(parse(LOCKS, "locks.toml")),
    )
    return found | {
        "Mission": mission,
        "StageResult": mission.results[0],
        **loaded(),
        "WatchedFlight": mission.results[0].after,
        "ErrorCampaign": errors,
        "SweepCampaign": evaluated(parse(LOCKS + SWEEP, "sweep.toml")),
        "MissionCampaign": evaluated(parse(MISSIONS, "missions.toml")),
        "LockCampaign": locked,
        "GatherCampaign": evaluated(parse(LOCKS.replace('"lock"', '"gather"'), "gather.toml")),
    }
