"""Scenarios beside an eccentric or J2 chief: planned there, checked, refused where nothing holds."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from chiefs import MU, linear_matrix, matrices_by_integration
from closeform.cli.app import main
from closeform.mission.mission import plan_mission
from closeform.mission.simulation_verdict import mission_error
from closeform.motion.chief.oblate_or_supplied import frames, gravity
from closeform.scenario import ScenarioError, parse

EXAMPLES = Path(__file__).parents[1] / "examples"
ECCENTRIC = (EXAMPLES / "eccentric_chief.toml").read_text()
J2 = (EXAMPLES / "j2_chief.toml").read_text()
ONE_STAGE = "[[stage]]".join(ECCENTRIC.split("[[stage]]")[:2])
SCATTER = 'do = "scatter"\nwithin = "1 orbit"\nfactor = 3'
COVARIANCE = 'covariance = { position = "1 1 1 m", velocity = "1 1 1 mm/s" }'


def planned(text):
    return plan_mission(parse(text))


def test_a_mission_beside_an_eccentric_chief_is_planned_in_its_motion():
    """The executed thrust, integrated from the file's states, reaches the ends and stays out of zones."""
    mission = planned(ECCENTRIC)
    assert mission.clear
    assert mission.warnings == ()
    first, second, third = mission.results
    orbit = mission.orbit
    kepler = cf.Orbit.eccentric(0.3, semi_major_axis=1e7, true_anomaly=np.radians(150.0))
    assert np.allclose(orbit.transition(5000.0, 700.0), kepler.transition(5000.0, 700.0), rtol=1e-9)
    times = np.linspace(0.0, first.end, 400)
    own = first.after.paths

    def rates(time, x):
        pushed = linear_matrix(kepler, time) @ x.reshape(3, 6).T
        pushed[3:] += own.thrust(np.clip(time, 0.0, first.end)).T
        return pushed.T.ravel()

    begin = np.array([[0, 0, 0, 0, 0, 0], [0, 350, 0, 0, 0, 0], [0, -400, 0, 0, 0, 0]], dtype=float)
    found = solve_ivp(
        rates, (0.0, first.end), begin.ravel(), rtol=1e-9, atol=1e-9, t_eval=times, max_step=20.0
    )
    states = found.y.T.reshape(-1, 3, 6)
    assert np.abs(states[-1, 2] - [0, 500, 0, 0, 0, 0]).max() < 1e-3
    assert np.abs(states - own.state(times).swapaxes(0, 1)).max() < 1e-3
    apart = np.linalg.norm(states[:, 2, :3] - states[:, 1, :3], axis=1)
    assert 50.0 - 1e-3 < apart.min() < 50.5
    assert second.passive.safe
    assert all(pair.model == orbit._model for pair in second.passive.pairs)
    assert third.passive.safe
    assert 1.0 < third.passive.worst.ratio < 1.02  # planned: the cheapest clear path is not safe
    assert third.result.plan.lower_bound < third.result.plan.delta_v


def test_an_unsafe_drift_beside_a_chief_is_found():
    """Without thrust from some instant on, the servicer drifts into a zone from a transfer towards it."""
    text = ONE_STAGE.replace('"avoid"', '"transfer"').replace("0 500 0 m", "0 -130 0 m")
    mission = planned(text.replace('prove = "5 s"', 'drift = "2 h"'))
    worst = mission.results[0].passive.worst
    assert not mission.verdict.ok
    assert worst.fails == "servicer"
    assert worst.ratio < 1.0
    own = mission.results[0].after.path("servicer")
    drift = mission.orbit.coast(own.state(worst.failed_at), worst.time - worst.failed_at, worst.failed_at)
    met = mission.results[0].after.path(worst.meets)
    met = met if worst.time <= met.end else met.extended(worst.time)
    gap = drift.position(worst.time) - met.position(worst.time)
    assert worst.zone.norm(gap) == pytest.approx(worst.ratio, rel=1e-6)
    assert worst.lower <= worst.ratio


@pytest.mark.parametrize("model", ["kepler", "j2"])
def test_inertial_starts_move_as_integrated(model):
    """Beside both spacecraft integrated about the Earth, to first order in the distance."""
    bulge = 1.082635854e-3 * 6378137.0**2 if model == "j2" else 0.0
    chief = np.array([6.9e6, 1e5, -2e5, 300.0, 1200.0, 7900.0])
    apart = np.array([30.0, -50.0, 20.0, 0.02, 0.03, -0.01])
    orbit = " ".join(map(str, chief[:3])) + " m, " + " ".join(map(str, chief[3:])) + " m/s"
    other = chief + apart
    place = (
        " ".join(f"{x:.9f}" for x in other[:3]) + " m, " + " ".join(f"{x:.12f}" for x in other[3:]) + " m/s"
    )
    text = f"""closeform = 1
title = "inertial start"
[orbit]
epoch = "2026-11-22T12:00:00Z"
model = "{model}"
chief = {{ state = "{orbit}" }}
[craft]
name = ["F1"]
start = {{ inertial = "{place}" }}
[[stage]]
do = "coast"
for = "90 min"
"""
    flown = planned(text).results[0].after.paths[0]

    def rates(_, y):
        felt = gravity(y.reshape(2, 6)[:, :3], MU, bulge)
        return np.concatenate([y[3:6], felt[0], y[9:], felt[1]])

    times = np.linspace(0.0, 5400.0, 9)
    y = solve_ivp(
        rates, (0.0, 5400.0), [*chief, *other], rtol=1e-12, atol=1e-6, method="DOP853", t_eval=times
    ).y.T
    for time, row in zip(times, y, strict=True):
        known = frames(row[:6], MU, bulge)[0] @ (row[6:] - row[:6])
        assert np.abs(flown.state(time) - known)[:3].max() < 0.02
        assert np.abs(flown.state(time) - known)[3:].max() < 2e-5


def test_a_run_beside_a_j2_chief_is_written_and_loaded(tmp_path):
    assert main(["run", str(EXAMPLES / "j2_chief.toml"), "--out", str(tmp_path / "run")]) == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert "J2" in (tmp_path / "run" / "report.html").read_text()
    assert (tmp_path / "run" / "viewer.html").stat().st_size > 100_000
    loaded, flown = cf.load(tmp_path / "run"), planned(J2)
    assert summary["mean_motion_rad_s"] == pytest.approx(2 * np.pi / flown.orbit.period)
    for mine, known in zip(loaded.results, flown.results, strict=True):
        times = np.linspace(mine.start, mine.end, 50)
        assert np.allclose(mine.after.paths.state(times), known.after.paths.state(times), rtol=0, atol=1e-9)


@pytest.mark.parametrize("text", [ECCENTRIC[: ECCENTRIC.rindex("[[stage]]")], J2.replace('"24 h"', '"1 h"')])
def test_exported_states_are_those_of_gravity(tmp_path, text):
    """The craft's inertial states in the file, integrated about the Earth without thrust, agree with it."""
    bulge = 1.082635854e-3 * 6378137.0**2 if "j2" in text else 0.0
    mission = planned(text)
    last = mission.results[-1]
    cf.export(mission, tmp_path / "out", "oem")
    name = mission.scenario.names[-1]
    _, second = [
        np.array([list(map(float, line.split()[1:])) for line in part.splitlines() if line[:2] == "20"])
        for part in (tmp_path / "out" / f"{name}.oem").read_text().split("META_STOP")[-2:]
    ]
    begun, ended = 1e3 * second[0, :6], 1e3 * second[-1, :6]
    y = solve_ivp(
        lambda _, y: np.concatenate([y[3:], gravity(y[None, :3], MU, bulge)[0]]),
        (0.0, last.end - last.start),
        begun,
        rtol=1e-12,
        atol=1e-6,
        method="DOP853",
    ).y[:, -1]
    assert np.linalg.norm(y - ended) < 0.5  # of terms of second order in the distance from the chief
    hop = last.after.path(name)
    assert np.linalg.norm(hop.position(last.end) - hop.position(last.start)) > 1.0


def test_impulses_and_sigmas_are_planned_beside_a_chief():
    text = ONE_STAGE.replace('prove = "5 s"', 'cost = "delta-v"\nsigmas = 3').replace(
        "keep_out =", f"{COVARIANCE}\nkeep_out ="
    )
    mission = planned(text)
    assert mission.verdict.ok, mission.verdict
    plan = mission.results[0].result.plan
    assert plan.cost == "delta-v"
    assert plan.sigmas == 3.0
    assert plan.lower_bound <= plan.delta_v <= 1.3 * plan.lower_bound


@pytest.mark.parametrize(
    ("old", "new", "place", "remedy"),
    [
        ("eccentricity = 0.001", "eccentricity = 0.95", "orbit.chief", "0.9"),
        ('altitude = "500 km"', 'semi_major_axis = "6300 km"', "orbit.chief", "surface"),
        ('model = "j2"', 'model = "j2"\nfield = { zonals = 2 }', "orbit", "remove one"),
        ('drift = "24 h"', 'drift = "forever"', "orbit.chief", "24 h"),
        ("keep_out =", 'execution = { pointing = "1 deg" }\nkeep_out =', "craft.execution", "magnitude"),
        ('do = "coast"\nfor = "1 orbit"', SCATTER, "stage[2].do", "reconfigure"),
    ],
)
def test_what_does_not_hold_beside_a_chief_is_refused_in_one_line(old, new, place, remedy):
    uncertain = J2.replace("keep_out =", f"{COVARIANCE}\nkeep_out =")
    text = uncertain.replace(old, new)
    assert text != uncertain
    with pytest.raises(ScenarioError) as error:
        parse(text)
    assert any(place in line and remedy in line for line in error.value.lines), error.value.lines


def test_stages_beside_a_chief_state_their_clearance_in_sigmas(tmp_path):
    """Errors of the first stage are carried into the second, about the chief and not in Hill's equations."""
    text = J2.replace("keep_out =", f'{COVARIANCE}\nhard_body = "5 m"\nkeep_out =')
    (tmp_path / "one.toml").write_text(text)
    mission = cf.run(tmp_path / "one.toml")
    first, second = mission.results
    state = np.diag([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2
    errors = [cf.Uncertainty(state) for _ in range(2)]
    whole = [cf.join([first.after.paths[k], second.after.paths[k]]) for k in range(2)]
    expected = cf.clearance_in_sigmas(*whole, cf.Sphere(10.0), *errors).sigmas
    pairs = [pair for one in mission.results for pair in one.uncertain.bodies.pairs]
    found = min(pair.sigmas for pair in pairs if {pair.first, pair.second} == {"F1", "F2"})
    assert found == pytest.approx(expected, rel=1e-6)
    assert 1.0 < expected < 100.0


def uncertain():
    """Return a scenario of one stage with known errors, and matrices at times (T,) of its plan."""
    text = ONE_STAGE.replace("keep_out =", f'{COVARIANCE}\nhard_body = "2 m"\nkeep_out =')
    kepler = cf.Orbit.eccentric(0.3, semi_major_axis=1e7, true_anomaly=np.radians(150.0))
    times = np.linspace(0.0, 4800.0, 401)
    return text.replace('prove = "5 s"', ""), times, matrices_by_integration(kepler, times)


def test_conjunction_messages_are_written_beside_a_chief(tmp_path):
    """Beside integrated covariances: a craft's own axes differ from the chief's by less than 1e-4 rad."""
    text, times, flows = uncertain()
    mission = planned(text)
    cf.export(mission, tmp_path / "out", "cdm")
    (file,) = (tmp_path / "out").glob("*before*.cdm")
    known = {}
    for line in file.read_text().splitlines():  # values of the second object replace those of the first
        key, _, value = line.partition(" = ")
        known[key] = value.split(" [")[0]
    (met,) = mission.results[0].before.conflicts
    gaps = [mission.results[0].before.path(name).position(times) for name in (met.first, met.second)]
    apart = np.linalg.norm(gaps[1] - gaps[0], axis=1)
    k = int(apart.argmin())
    assert float(known["MISS_DISTANCE"]) == pytest.approx(apart[k], abs=0.3)
    spread = flows[k] @ np.diag([1.0, 1.0, 1.0, 1e-6, 1e-6, 1e-6]) @ flows[k].T
    names = [f"C{a}_{b}" for a, b in ("RR", "TR", "TT", "NN")]
    found = [float(known[name]) for name in names]
    assert found == pytest.approx([spread[0, 0], spread[1, 0], spread[1, 1], spread[2, 2]], rel=5e-3)


def test_errors_of_cases_beside_a_chief_are_those_of_independent_samples(tmp_path):
    """The share of cases that stay clear, beside 4000 samples with integrated transition matrices."""
    text, times, flows = uncertain()
    (tmp_path / "s.toml").write_text(f'{text}\n[study]\ncases = 400\nseed = 1\ndraws = "errors"\n')
    found = cf.study(tmp_path / "s.toml")
    own = found.mission.results[0].after
    sizes = np.array([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3])
    drawn = np.random.default_rng(2).normal(size=(3, 4000, 6)) * sizes
    clear = np.ones(drawn.shape[1], dtype=bool)
    for first, second, half in ((0, 2, [60.0, 120.0, 60.0]), (1, 2, 50.0), (0, 1, [60.0, 120.0, 60.0])):
        gap = own.paths[second].position(times) - own.paths[first].position(times)
        for k in range(len(times)):
            moved = gap[k] + (drawn[second] - drawn[first]) @ flows[k, :3].T
            clear &= np.linalg.norm(moved / half, axis=1) > 1.0
    share = clear.mean()
    assert 0.2 < share < 0.9
    allowed = 4.0 * np.sqrt(share * (1.0 - share) * (1 / 400 + 1 / 4000))
    assert len(found.failed) / 400 == pytest.approx(1.0 - share, abs=allowed)


@pytest.mark.parametrize("eccentricity", [0.05, 0.3])
def test_the_verdict_beside_an_eccentric_chief_counts_the_oblateness(eccentricity):
    """Coasts with and without J2 over an orbit: the estimate at 95 % exceeds most of their differences."""
    mission = planned(ONE_STAGE.replace("eccentricity = 0.3", f"eccentricity = {eccentricity}"))
    near = mission.verdict.zone_distance
    assert 0.0 < near.expected < near.unlikely
    assert near.exceeded == ('use model = "j2"' in str(mission.verdict))
    neglected, _, _ = mission_error(mission)
    angles = {"argument_of_perigee": np.radians(270.0), "true_anomaly": np.radians(150.0)}
    kepler = cf.Orbit.eccentric(eccentricity, semi_major_axis=1e7, true_anomaly=angles["true_anomaly"])
    oblate = cf.Orbit.perturbed(eccentricity, np.radians(63.4), semi_major_axis=1e7, **angles)
    times, rng = np.linspace(0.0, kepler.period, 50), np.random.default_rng(1)
    states = rng.normal(size=(200, 6)) * np.repeat([100.0, 100.0 * 2.0 * np.pi / kepler.period], 3)
    states[:, 4] = -2.0 * states[:, 0] * 2.0 * np.pi / kepler.period  # nearly without drift
    two = [orbit.transition(times)[:, :3] @ states.T for orbit in (kepler, oblate)]
    reach = np.linalg.norm(two[0], axis=1).max(axis=0)
    off = np.linalg.norm(two[0][-1] - two[1][-1], axis=0)
    half, most = neglected.error(reach, kepler.period, 1)
    assert np.mean(off < most) > 0.9
    assert np.median(off / half) > 0.1


def test_a_model_needs_a_chief():
    text = J2[: J2.index("[orbit.chief")] + 'altitude = "500 km"\n' + J2[J2.index("[craft]") :]
    with pytest.raises(ScenarioError, match="needs chief"):
        parse(text)
