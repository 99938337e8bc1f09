"""Missions with uncertainties: propagation between stages, sigma clearance, probabilities and reports."""

import json
import re
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
import closeform.campaign
from bridge import hill
from closeform.campaign import error_cases, evaluated
from closeform.campaign.error_cases import drawn
from closeform.cli.app import main
from closeform.mission.mission import plan_mission
from closeform.mission.uncertainty import UncertainStage
from closeform.report.run import RunReport
from closeform.scenario import ScenarioError, load, parse
from closeform.storage.result_folder import LOCK, PRIVATE
from closeform.uncertainty.covariance_propagation import uncertainty_at_end

pytestmark = pytest.mark.usefixtures("undrawn")

HEAD = """\
closeform = 1
title = "A closer hold"

[orbit]
altitude = "550 km"

[craft]
name = ["F1", "F2"]
position = ["0 0 0 m", "0 200 0 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "20 m" }
covariance = { position = "1 2 1 m", velocity = "1 1 1 mm/s" }
hard_body = "5 m"
"""
CLOSER = """
[[stage]]
do = "coast"
for = "0.3 orbits"

[[stage]]
do = "avoid"
craft = "F2"
to = { position = "0 60 0 m", velocity = "0 0 0 m/s" }
within = "0.5 orbits"

[[stage]]
do = "coast"
for = "0.5 orbits"
"""
EXECUTION = 'execution = { magnitude = "1 %", pointing = "0.5 deg", noise = "1e-12 m^2/s^3" }\n'
PASS = """
[[stage]]
do = "coast"
for = "0.6 orbits"
"""
NEAR = HEAD.replace("0 200 0 m", "0 40 0 m").replace('"20 m"', '"12 m"')


def test_covariance_is_propagated_from_stage_to_stage() -> None:
    """Stages give the same covariance as the whole path with its single burn."""
    mission = plan_mission(parse(HEAD + EXECUTION + CLOSER))
    whole = cf.join([result.after.path("F2") for result in mission.results])
    state = np.diag([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2
    errors = cf.Uncertainty(state, 0.01, np.radians(0.5), (0.0, 0.01, 0.0, np.radians(0.5)), 1e-12)
    for result in mission.results:
        found = result.uncertain.errors[1].state
        expected = errors.covariance(whole, result.start)
        sizes = np.sqrt(np.diag(expected))
        assert np.abs(found - expected).max() < 1e-9 * sizes.max() ** 2
        assert np.abs((found - expected) / np.outer(sizes, sizes)).max() < 1e-9
    impulses = plan_mission(
        parse(HEAD + EXECUTION + CLOSER.replace('craft = "F2"', 'craft = "F2"\ncost = "delta-v"'))
    )
    whole = cf.join([result.after.path("F2") for result in impulses.results])
    expected = errors.covariance(whole, whole.end)
    last = impulses.results[-1]
    found = uncertainty_at_end(last.uncertain.errors[1], last.after.path("F2")).state
    sizes = np.sqrt(np.diag(expected))
    assert np.abs((found - expected) / np.outer(sizes, sizes)).max() < 1e-9


def test_propagation_keeps_a_tiny_standard_deviation() -> None:
    """A covariance matrix would lose 1e-7 m beside 1e3 m to rounding."""
    orbit = cf.Orbit.circular(550e3)
    coast = orbit.coast([0, 200, 0, 0, 0, 0], 3000.0)
    errors = cf.Uncertainty(np.diag([1e3, 1e3, 1e-7, 1.0, 1.0, 1e-10]) ** 2)
    after = uncertainty_at_end(errors, coast)
    flow = orbit.transition(3000.0)
    assert after._root[2] @ after._root[2] == pytest.approx(
        (flow[2, 2] * 1e-7) ** 2 + (flow[2, 5] * 1e-10) ** 2, rel=1e-9
    )


def test_verdict_reports_the_least_sigma_clearance(tmp_path, monkeypatch, capsys) -> None:
    """A requirement that is not met names its stage and sets status 1."""
    monkeypatch.chdir(tmp_path)
    orbit = cf.Orbit.circular(550e3)
    paths = [orbit.coast([0, y, 0, 0, 0, 0], 0.6 * orbit.period) for y in (0.0, 40.0)]
    errors = cf.Uncertainty(np.diag([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2)
    least = cf.clearance_in_sigmas(*paths, cf.Sphere(12.0), errors, errors)
    k = float(least.sigmas)
    said = f"minimum {k:.3g} sigma, F1 - F2 at {least.time:.1f} s"
    Path("a.toml").write_text(NEAR + PASS + f"sigmas = {0.99 * k}\n")
    assert main(["run", "a.toml"]) == 0
    printed = capsys.readouterr().out
    assert f"clear at {0.99 * k:g} sigma ({said})" in " ".join(printed.split())
    assert f"Clear at {0.99 * k:g} sigma: {said}, of keep-out zones" in printed
    summary = json.loads(Path("a-results/summary.json").read_text())
    (stage,) = summary["stages"]
    assert summary["status"] == 0
    assert stage["uncertain"]["fewest"]["sigmas"] == pytest.approx(k, rel=1e-9)
    assert stage["uncertain"]["met"]
    stored = pyarrow.parquet.read_table("a-results/sigmas.parquet").to_pydict()
    assert stored["of"] == ["keep-out zone", "hard bodies"]
    assert stored["sigmas"][0] == pytest.approx(k, rel=1e-9)
    Path("a.toml").write_text(NEAR + PASS + f"sigmas = {1.01 * k}\n")
    assert main(["run", "a.toml", "--overwrite"]) == 1
    printed = " ".join(capsys.readouterr().out.split())
    assert f"not clear at {1.01 * k:g} sigma in stage 1 (coast): {said}" in printed
    assert f"Not clear at {1.01 * k:g} sigma: {said}" in printed
    assert f"not clear at {1.01 * k:g} sigma" in Path("a-results/report.html").read_text()


def test_verdict_reports_a_probability_without_a_limit() -> None:
    """It appears with "clear", with a limit if given, and not at all without uncertainty."""
    mission = plan_mission(parse(NEAR + PASS))
    odds = mission.results[0].uncertain.likeliest.probability
    told = f"probability of collision of F1 - F2 up to {odds.high:.3g}"
    assert odds.high > 1e-6
    assert mission.verdict.ok
    assert f"{told}, without a limit" in str(mission.verdict)
    limited = plan_mission(parse(NEAR + PASS + "max_probability = 1.0\n"))
    assert f"{told}, 1 at most" in str(limited.verdict)
    assert "probability" not in str(plan_mission(parse(HEAD + PASS)).verdict)


def test_probability_agrees_with_monte_carlo() -> None:
    """Propagate 10 000 pairs of states to 800 times; count those that come within 10 m."""
    mission = plan_mission(parse(NEAR + PASS + "max_probability = 0.5\n"))
    (result,) = mission.results
    pair = result.uncertain.likeliest
    orbit = mission.orbit
    random = np.random.default_rng(3)
    sizes = np.array([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3])
    apart = (random.standard_normal((2, 10_000, 6)) * sizes).T @ [1.0, -1.0]
    apart[1] += 40.0
    met = np.zeros(10_000, dtype=bool)
    for time in np.linspace(0.0, result.end, 800):
        met |= np.linalg.norm((orbit.transition(time) @ apart)[:3], axis=0) <= 10.0
    share = met.mean()
    assert abs(pair.probability.value - share) < 4.0 * np.sqrt(share * (1.0 - share) / len(met))
    assert mission.verdict.ok
    assert "probability of collision of F1 - F2 up to" in str(mission.verdict)
    asked = f"max_probability = {0.9 * pair.probability.value}\n"
    assert plan_mission(parse(NEAR + PASS + asked)).verdict.status == 1


def test_probability_of_any_collision_is_bounded_by_the_sum() -> None:
    """Four spacecraft in a row, one known exactly, against sampled formations."""
    known = '{ position = "1 2 1 m", velocity = "1 1 1 mm/s" }'
    text = NEAR.replace('["F1", "F2"]', '["F1", "F2", "F3", "F4"]').replace(
        '["0 0 0 m", "0 40 0 m"]', '["0 0 0 m", "0 40 0 m", "0 80 0 m", "0 400 0 m"]'
    )
    text = re.sub("covariance = .*", f'covariance = [{known}, {known}, "exact", {known}]', text)
    mission = plan_mission(parse(text + PASS))
    (result,) = mission.results
    bodies = result.uncertain.bodies
    assert bodies.exact == ("F3",)
    assert len(bodies.pairs) == 6
    draws, orbit = 8_000, mission.orbit
    sizes = np.array([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3])
    states = np.random.default_rng(4).standard_normal((4, draws, 6)) * sizes
    states[2] = 0.0
    states[:, :, 1] += np.array([[0.0], [40.0], [80.0], [400.0]])
    met = np.zeros(draws, dtype=bool)
    for time in np.linspace(0.0, result.end, 250):
        places = states @ orbit.transition(time)[:3].T
        for i, j in zip(*np.triu_indices(4, 1), strict=True):
            met |= np.linalg.norm(places[i] - places[j], axis=1) <= 10.0
    share = met.mean()
    bound = bodies.any_pair
    assert bound > share - 3.0 * np.sqrt(share / draws)
    assert bound < 1.2 * share  # few formations meet twice
    (section,) = RunReport(mission).sections
    (line,) = (line for line in section.closing if "any two" in line)
    assert line == f"Probability that any two collide: at most {bound:.4g}, the sum of 6 pairs"
    assert section.figures["uncertain"]["any_pair_at_most"] == bound


def test_hard_bodies_are_avoided_without_keep_out_zones() -> None:
    """Bodies of 18 m radius stay 36 m apart."""
    text = HEAD.replace('keep_out = { sphere = "20 m" }\n', "").replace("0 200 0 m", "0 40 0 m")
    text = text.replace('"5 m"', '"18 m"')
    move = CLOSER.split("[[stage]]")[2].replace("0 60 0 m", "0 -40 0 m")
    mission = plan_mission(parse(f"{text}\n[[stage]]{move}"))
    assert mission.verdict.ok
    for result in mission.results:
        assert result.uncertain.zones is None
        assert result.uncertain.bodies.pairs
    close = cf.closest_approach(*mission.results[0].after.paths, cf.Sphere(36.0))
    assert close.ratio == pytest.approx(1.0, abs=1e-6)


def test_zero_covariance_in_a_list_is_exact() -> None:
    known = '{ position = "1 2 1 m" }'
    nothing = '{ position = "0 0 0 m", velocity = "0 0 0 m/s" }'
    for exact in ('"exact"', nothing):
        text = re.sub("covariance = .*", f"covariance = [{exact}, {known}]", HEAD)
        scenario = parse(text + PASS)
        assert scenario.craft[0].errors is None
        assert scenario.craft[1].errors.state[1, 1] == 4.0
    text = re.sub("covariance = .*", f"covariance = {nothing}", HEAD)
    with pytest.raises(ScenarioError, match=r"craft\.covariance: "):
        parse(text + PASS)


def test_hard_bodies_are_judged_without_keep_out_zones() -> None:
    """A transfer has no keep-out zones; with noise the probability is a certain bound."""
    text = HEAD.replace('keep_out = { sphere = "20 m" }\n', EXECUTION)
    move = CLOSER.split("[[stage]]")[2].replace("avoid", "transfer")
    mission = plan_mission(parse(f"{text}\n[[stage]]{move}sigmas = 0.1\n"))
    (result,) = mission.results
    assert result.uncertain.zones is None
    assert result.uncertain.nearest is result.uncertain.bodies.pairs[0]
    assert result.uncertain.likeliest.probability.method == "bound"
    (section,) = RunReport(mission).sections
    (line,) = (line for line in section.closing if line.startswith("Probability"))
    assert re.search(r"in this stage: .*\(certified .* the hard bodies' 10 m", line)


def test_mission_without_uncertainty(monkeypatch) -> None:
    monkeypatch.setattr(UncertainStage, "of", None)
    text = re.sub(r"covariance = .*\n", "", HEAD)
    assert plan_mission(parse(text + CLOSER)).results[0].uncertain is None


def test_study_counts_agree_with_the_probability(tmp_path, monkeypatch, capsys) -> None:
    """A case does not depend on the number of cases, and `run --case` reproduces it."""
    monkeypatch.chdir(tmp_path)
    study = '\n[study]\ncases = 20000\nseed = 1\ndraws = "errors"\n'
    Path("a.toml").write_text(NEAR + EXECUTION.replace(', noise = "1e-12 m^2/s^3"', "") + PASS + study)
    assert main(["study", "a.toml"]) == 1
    printed = capsys.readouterr().out
    summary = json.loads(Path("a-study/summary.json").read_text())
    told = plan_mission(parse(NEAR + PASS)).results[0].uncertain.likeliest.probability
    share = summary["inside"]["Within the hard bodies"]["F1 - F2"]
    assert share["low"] < told.value < share["high"]
    count = round(20_000 * share["share"])
    assert f"{count} of 20000 cases not free of collisions: " in printed
    cases = pyarrow.parquet.read_table("a-study/cases/000000000.parquet").to_pydict()
    assert 20_000 - sum(cases["free_of_collisions"]) == count
    few = closeform.campaign.study("a.toml", cases=100)
    assert few.met["free of collisions"].tolist() == cases["free_of_collisions"][:100]
    inside = np.array(cases["zone_entries"]) + np.array(cases["zone_began"]).sum(axis=1)
    assert f"--case {int(inside.argmax())} shows the one with most entries" in printed
    assert main(["run", "a.toml", "--case", str(inside.argmax()), "--overwrite", "--no-viewer"]) == 1
    assert "with the errors of this case" in capsys.readouterr().out


def test_study_locks_its_folder_before_planning(tmp_path, monkeypatch) -> None:
    """Invalid options are rejected before planning."""
    monkeypatch.chdir(tmp_path)
    held = []

    def planned(scenario):
        held.append((Path("a-study") / PRIVATE / LOCK).exists())
        return plan_mission(scenario)

    monkeypatch.setattr(error_cases, "plan_mission", planned)
    Path("a.toml").write_text(NEAR + PASS + '[study]\ncases = 20\nseed = 1\ndraws = "errors"\n')
    assert main(["study", "a.toml", "--seed", "-1"]) == 2
    assert held == []
    assert main(["study", "a.toml"]) in (0, 1)
    assert held == [True]


def test_study_cases_against_an_integrator() -> None:
    """Integrate the errors of each case: initial states, and a burn with wrong size and direction.

    Cases within 5 cm of the zone boundary are not compared.
    """
    move = '[[stage]]\ndo = "transfer"\ncraft = "F2"\nwithin = "0.4 orbits"\n'
    move += 'to = { position = "0 -30 0 m", velocity = "0 0 0 m/s" }\n'
    known = EXECUTION.replace(', noise = "1e-12 m^2/s^3"', "").replace("1 %", "10 %").replace("0.5", "5")
    start = 'start = [{ palmer = "0 0 0 0 0 0 m" }, { palmer = "0 0 0 45 0 0 m" }]\n'
    head = re.sub(r"position = \[.*\n|velocity = \"0 0 0.*\n|keep_out.*\n", "", HEAD) + start
    scenario = parse(
        head.replace("5 m", "8 m") + known + move + '[study]\ncases = 24\nseed = 4\ndraws = "errors"\n'
    )
    campaign = evaluated(scenario, 24, 4)
    (pair,) = campaign.bodies
    paths = [campaign.mission.results[0].after.path(name) for name in scenario.names]
    times = np.linspace(paths[0].start, paths[0].end, 600)
    n, state = campaign.mission.orbit.mean_motion, np.array([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3])
    assert 2 < pair.inside.sum() < 24
    for case in range(24):
        first = drawn(4, "F1", 6, case, case + 1)[0]
        second = drawn(4, "F2", 10, case, case + 1)[0]
        turn = np.radians(5.0) * second[7:10]

        def rates(time, state, share=second[6], turn=turn):
            thrust = paths[1].thrust(time)
            return hill(n) @ state + np.r_[0, 0, 0, thrust * (1.0 + 0.1 * share) + np.cross(turn, thrust)]

        roots = [craft.errors._root for craft in scenario.craft]
        one = paths[0].state(times[0]) + roots[0] @ first
        two = paths[1].state(times[0]) + roots[1] @ second[:6]
        assert np.linalg.norm((two - paths[1].state(times[0])) / state) < 6.0
        ends = solve_ivp(rates, times[[0, -1]], two, t_eval=times, method="DOP853", rtol=1e-8, atol=1e-7).y
        other = np.array([campaign.mission.orbit.transition(time - times[0]) @ one for time in times]).T
        least = np.linalg.norm((ends - other)[:3], axis=0).min()
        if abs(least - 16.0) > 0.05:
            assert pair.inside[case] == (least < 16.0)


def test_correlation_matrix() -> None:
    rows = np.eye(6)
    rows[1, 3] = rows[3, 1] = -0.9
    covariance = (
        f'covariance = {{ position = "1 2 1 m", velocity = "1 1 1 mm/s", correlation = {rows.tolist()} }}'
    )
    known = parse(re.sub(r"covariance = .*", covariance, HEAD) + PASS).craft[0].errors.state
    assert known[1, 3] == pytest.approx(-0.9 * 2.0 * 1e-3)
    assert np.sqrt(np.diag(known)) == pytest.approx([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3])


@pytest.mark.parametrize(
    ("stage", "craft", "cost"), [("avoid", '"F2"', "energy"), ("reconfigure", '["F2"]', "delta-v")]
)
def test_stages_keep_the_requested_sigma_clearance(stage: str, craft: str, cost: str) -> None:
    """The clearance is active and costs more; 2000 samples at three sigmas stay outside."""
    target = '{ position = "0 -150 0 m", velocity = "0 0 0 m/s" }'
    to = target if stage == "avoid" else f"[{target}]"
    move = f'[[stage]]\ndo = "{stage}"\ncraft = {craft}\nto = {to}\nwithin = "0.4 orbits"\ncost = "{cost}"\n'
    head = HEAD.replace("0 200 0", "0 150 0").replace("1 2 1 m", "2 4 2 m").replace("1 1 1", "3 3 3")
    head = head.replace('"20 m"', '"60 m"') + EXECUTION.replace(', noise = "1e-12 m^2/s^3"', "")
    without, asked = plan_mission(parse(head + move)), plan_mission(parse(f"{head}{move}sigmas = 3.0\n"))
    assert without.results[0].uncertain.nearest.sigmas < 2.5
    near = asked.results[0].uncertain.nearest
    assert 3.0 - 1e-8 <= near.sigmas < 3.01
    assert asked.verdict.ok
    assert asked.spent_of_each[0].sum() > without.spent_of_each[0].sum()
    paths = [asked.results[0].after.path(name) for name in ("F1", "F2")]
    errors = asked.results[0].uncertain.errors
    times = np.linspace(0.0, paths[0].end, 200)
    random = np.random.default_rng(5)
    both = [one.covariance(path, times)[:, :3, :3] for one, path in zip(errors, paths, strict=True)]
    roots = np.linalg.cholesky(both[0] + both[1])
    ways = random.standard_normal((2000, 3))
    ways *= 3.0 / np.linalg.norm(ways, axis=1, keepdims=True)
    points = (paths[1].position(times) - paths[0].position(times))[:, None] + ways @ roots.transpose(0, 2, 1)
    assert np.linalg.norm(points, axis=2).min() > 60.0 * (1.0 - 1e-6)


def test_slow_encounter_example_agrees_with_its_message() -> None:
    """Scenario and CDM give one probability, far above that of a short encounter."""
    examples = Path(__file__).parents[1] / "examples"
    told = plan_mission(load(examples / "slow_encounter.toml")).results[0].uncertain.likeliest.probability
    message = cf.read_cdm(examples / "slow_encounter.cdm").encounter(None)
    pair = message.path, message.other, cf.Sphere(10.0), message.errors, message.other_errors
    assert told.value == pytest.approx(cf.collision_probability(*pair).value, rel=1e-3)
    short = cf.collision_probability(*pair, method="short-encounter")
    assert short.value < 0.2 * told.value


def test_unknown_probability_fails_its_limit(monkeypatch) -> None:
    """Trajectories with very many burns are not sampled, which the verdict reports."""
    monkeypatch.setattr("closeform.uncertainty.uncertain_flight.MOST_BURNS", 0)
    move = CLOSER.split("[[stage]]")[2]
    known = EXECUTION.replace(', noise = "1e-12 m^2/s^3"', "")
    mission = plan_mission(parse(f"{HEAD}{known}\n[[stage]]{move}max_probability = 0.5\n{PASS}"))
    assert "probability of collision of F1 - F2 is not known" in str(mission.verdict)
    assert mission.verdict.status == 1
    path = mission.results[0].after.path("F2")
    state = np.diag([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2
    errors = cf.Uncertainty(state, 0.01, np.radians(0.5), (0.0, 0.01, 0.0, np.radians(0.5)))
    expected = errors.covariance(path, path.end)
    sizes = np.sqrt(np.diag(expected))
    found = mission.results[1].uncertain.errors[1].state
    assert np.abs((found - expected) / np.outer(sizes, sizes)).max() < 1e-9
