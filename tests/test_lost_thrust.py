"""Loss of thrust in simulations, against an independent integrator of the drift."""

import json
from pathlib import Path

import numpy as np
import pytest

import closeform as cf
from closeform.campaign import case_of, evaluated
from closeform.cli.app import main
from closeform.mission.mission import plan_mission
from closeform.mission.simulation import SimulatedRun
from closeform.scenario import parse
from drifting_formation import ENDS, OFF, OWN, SPAN, START, drifted
from field_scenario import swap
from simulated import FIELD, ORBIT, SIGHT, chief

pytestmark = pytest.mark.usefixtures("undrawn")

LOST = 1234.567  # s; between measurements, during a burn
KINDS = {
    "thrust that lasts": ("transfer", {}),
    "thrust as commanded": ("transfer", {"control": "open"}),
    "impulses": ("two_impulse", {}),
    "pulses of one": ("transfer", {"thrusters": [None, OWN, None]}),
}


@pytest.mark.parametrize("kind", KINDS)
def test_spacecraft_drift_after_loss_of_thrust(kind):
    """Nothing changes before the loss, nor for other spacecraft; then DOP853 gives the drift."""
    make, options = KINDS[kind]
    path = getattr(ORBIT, make)(START, ENDS, SPAN)
    options = options | {"navigation": SIGHT, "thrust_error": OFF, "seeds": 3}
    sound, failing = (
        cf.simulate(path, FIELD, **options),
        cf.simulate(path, FIELD, lost=[np.inf, LOST, np.inf], **options),
    )
    assert LOST in failing.times
    assert LOST not in sound.times
    here, there = np.isin(failing.times, sound.times), np.isin(sound.times, failing.times)
    apart = np.linalg.norm(failing.states[:, :, here] - sound.states[:, :, there], axis=-1)
    assert apart[:, [0, 2]].max() < 1e-6  # m; one more step
    before = failing.times[here] < LOST
    assert apart[:, 1, before].max() < 1e-6
    assert apart[:, 1].max() > 3.0  # thrust is missing
    last = failing.times == LOST
    for flight in failing.states[:, 1]:
        assert flight[-1, :3] == pytest.approx(drifted(LOST, flight[last][0], SPAN), abs=1e-3)
    assert failing.delta_v[:, [0, 2]] == pytest.approx(sound.delta_v[:, [0, 2]], rel=1e-6)
    assert (failing.delta_v[:, 1] < 0.9 * sound.delta_v[:, 1]).all()
    assert (failing.limited == 0.0).all()


def test_delta_v_ends_with_the_thrust():
    """Delta-v is that commanded before the loss."""
    lost = [LOST, np.inf, 400.0]
    lasting, kicks = (getattr(ORBIT, make)(START, ENDS, SPAN) for make in ("transfer", "two_impulse"))
    table = cf.compensated_thrust(lasting, FIELD)
    sizes = np.linalg.norm(table.commanded, axis=-1)
    spent = [
        np.trapezoid(np.interp(some, table.times, own), some)
        for own, until in zip(sizes, lost, strict=True)
        for some in [np.linspace(0.0, min(until, SPAN), 5001)]
    ]
    options = {"control": "open", "lost": lost}
    assert cf.simulate(lasting, FIELD, **options).delta_v[0] == pytest.approx(spent, rel=1e-4)
    changed = cf.compensated_thrust(kicks, FIELD).impulses
    sums = [
        np.linalg.norm(changed.impulse[(changed.craft == k) & (changed.time < lost[k])], axis=1).sum()
        for k in range(3)
    ]
    assert cf.simulate(kicks, FIELD, **options).delta_v[0] == pytest.approx(sums, rel=1e-9)
    fired = cf.compensated_thrust(lasting, FIELD, thrusters=OWN).firing.pulses
    until = np.array(lost)[fired.craft]
    share = np.clip((until - fired.start) / fired.duration, 0.0, 1.0)
    pulsed = np.bincount(fired.craft, fired.impulse * share)
    assert cf.simulate(lasting, FIELD, thrusters=OWN, **options).delta_v[0] == pytest.approx(pulsed, rel=1e-9)


def test_loss_at_the_start_and_after_the_end():
    """Loss after the end changes nothing; loss at the start leaves a drift."""
    path = ORBIT.transfer(START, ENDS, SPAN)
    sound, late, early = (
        cf.simulate(path, FIELD, navigation=SIGHT, seeds=2, lost=lost) for lost in (None, SPAN + 1.0, 0.0)
    )
    assert late.states == pytest.approx(sound.states, abs=1e-9)  # rounding
    assert not early.delta_v.any()
    for k in range(3):
        assert early.states[1, k, -1, :3] == pytest.approx(drifted(0.0, START[k], SPAN), abs=1e-3)
    coasted = ORBIT.coast(START, SPAN).position(SPAN)
    assert early.ends[0] == pytest.approx(np.linalg.norm(early.states[0, :, -1, :3] - coasted, axis=1))


def test_drag_of_each_spacecraft_with_thrusters():
    """Each spacecraft has its own ballistic coefficient, as if it were alone."""
    path = ORBIT.transfer(START, ENDS, SPAN)

    def air(*own: float) -> cf.Field:
        return cf.Field(chief(), drag=cf.Drag(5e-12, 500e3, 60e3, ballistic=list(own), chief=0.02))

    sets = [OWN, None, OWN]
    flight = cf.simulate(path, air(0.02, 0.08, 0.03), "open", thrusters=sets)
    margins = cf.tracking_margins(path, air(0.02, 0.08, 0.03), thrusters=sets, thrust_error=OFF)
    alone = cf.simulate(path[[1]], air(0.08), "open")
    assert flight.states[0, 1, -1] == pytest.approx(alone.states[0, 0, -1], abs=1e-6)
    assert flight.delta_v[0, 1] == pytest.approx(alone.delta_v[0, 0], rel=1e-6)
    only = cf.tracking_margins(path[[1]], air(0.08), cf.Feedback(300.0, 1800.0, 6), thrust_error=OFF)
    assert margins.greatest[1] == pytest.approx(only.greatest[0], rel=1e-9)


STUDY = """
[navigation]
position = "10 cm"
velocity = "0.3 mm/s"

[simulation]

[study]
cases = 6
seed = 5

[study.vary]
"craft.fails" = { chance = 0.5 }
"""


def test_cases_with_failures_agree_with_simulate():
    """A row agrees with `simulate` with the sampled failures."""
    scenario = parse(swap(more='margin = "auto"\n' + STUDY), "fails.toml")
    campaign, seen = evaluated(scenario), set()
    sound = parse(swap(more='margin = "auto"\n' + STUDY.split("[study]")[0]), "sound.toml")
    plan = plan_mission(sound).paths
    for case in range(6):
        times = [campaign.column(f"{name}_fails_s")[case] for name in "AB"]
        lost = np.where(np.isnan(times), np.inf, times)
        own = cf.simulate(
            plan,
            scenario.field,
            navigation=cf.Navigation(0.1, 3e-4),
            zones=cf.Sphere(30.0),
            lost=lost,
            seeds=[int(campaign.column("flight_seed")[case])],
        )
        assert campaign.column("simulated_ratio")[case] == pytest.approx(own.least_ratio, abs=1e-9)
        assert campaign.column("simulated_delta_v_m_s")[case] == pytest.approx(own.delta_v.sum(), rel=1e-9)
        assert campaign.column("simulated_end_m")[case] == pytest.approx(own.greatest_end, abs=1e-6)
        failing = np.isfinite(lost)
        seen.add(tuple(failing.tolist()))
        assert (campaign.statuses[case] == "met") == (not failing.any())
    assert len(seen) >= 3  # no spacecraft, one, both
    first = int(np.flatnonzero(~np.isnan(campaign.column("A_fails_s")))[0])
    mission = plan_mission(case_of(scenario, first))
    assert mission.flights.tube is None  # no tube for a drift
    assert mission.flights.flight.least_ratio == campaign.column("simulated_ratio")[first]
    near = campaign.column("drift_ratio")[first]
    assert campaign.column("simulated_ratio")[first] == pytest.approx(min(near, 1.01), abs=0.1)


def test_loaded_case_gives_the_same_simulations(tmp_path: Path):
    """A loaded case gives the same simulations, with drifts as by DOP853."""
    stages = '\n[[stage]]\ndo = "coast"\nfor = "10 min"\n'
    scenario = parse(swap(more=stages + STUDY), "fails.toml")
    case = next(k for k in range(6) if len(plan_mission(case_of(scenario, k)).lost) == 1)
    file, out, again = (str(tmp_path / name) for name in ("fails.toml", "case", "flown"))
    Path(file).write_text(scenario.text)
    assert main(["run", file, "--case", str(case), "--out", out, "--no-viewer"]) == 1
    loaded, mission = cf.load(out), plan_mission(case_of(scenario, case))
    (lost,) = mission.lost
    assert loaded.lost == mission.lost
    own = SimulatedRun.of(loaded, "track", scenario.flight, seeds=range(3))
    then = SimulatedRun.of(mission, "track", scenario.flight, seeds=range(3))
    assert (own.flight.states == then.flight.states).all()
    k, failed = scenario.names.index(lost.craft), own.flight.times == lost.time
    for flight in own.flight.states[:, k]:
        end = drifted(lost.time, flight[failed][0], own.flight.times[-1], scenario.field)
        assert flight[-1, :3] == pytest.approx(end, abs=1e-3)
    status = main(["simulate", out, "--out", again, "--seeds", "3"])
    options = json.loads((Path(again) / "summary.json").read_text())
    assert status == (1 if (own.flight.ratios < 1.0).any() else 0)
    assert options["worst_flights"][0]["ratio"] == own.flight.least_ratio
    assert main(["simulate", out, "--out", str(tmp_path / "anew"), "--control", "replan"]) == 2
