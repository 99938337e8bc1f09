"""Pulses of passively safe plans, integrated by DOP853 with hundreds of random failures."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import closeform as cf
from bridge import hill
from closeform.mission.mission import plan_mission
from closeform.report.sections import effort
from closeform.scenario import parse
from hold_transfers import hold_transfers

INSPECTOR = (Path(__file__).parents[1] / "examples" / "passive_inspector.toml").read_text()
ZONE = 20.0  # m
FAILURES = 400
EVERY = 10.0  # s, samples of a drift: between them 20 m are left by less than ROUGH
ROUGH = 2e-4  # of the zone: 5 s at 0.1 m/s, squared, in 20 m, halved


def inspector(bit="1 mm/s", period="30 s", drift="24 h", cost="energy"):
    """The example with six thrusters."""
    given = {"max_acceleration": "1 mm/s^2", "thrusters": "rtn", "minimum_bit": bit, "period": period}
    keys = "\n".join(f'{key} = "{value}"' for key, value in given.items())
    text = INSPECTOR.replace('keep_out = { sphere = "20 m" }', f'keep_out = {{ sphere = "20 m" }}\n{keys}')
    return text.replace('drift = "24 h"', f'cost = "{cost}"\ndrift = "{drift}"')


def failed(path, pulses, lost):
    """States (K, 6) at instants (K,) in order, of the pulses that are fired, by DOP853."""
    n, state = path.orbit.mean_motion, path.state(path.start)
    begin, over = pulses.start, pulses.start + pulses.duration
    push = pulses.direction * (pulses.impulse / pulses.duration)[:, None]
    edges = np.unique(np.concatenate([begin, over, [path.start, path.end]]).clip(path.start, path.end))
    found = []
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        kick = np.append(np.zeros(3), push[(begin <= a) & (over >= b)].sum(axis=0))
        within = lost[(lost >= a) & (lost < b)]
        flown = solve_ivp(
            lambda _, y, kick=kick: hill(n) @ y + kick,
            (a, b),
            state,
            method="DOP853",
            rtol=1e-11,
            atol=1e-11,
            t_eval=np.append(within, b),
        )
        found.append(flown.y.T[:-1])
        state = flown.y[:, -1]
    return np.concatenate(found)


def nearest_drift(path, pulses, until, seed):
    """The least distance [m] from the origin of drifts after failures at random, half of them in pulses."""
    rng = np.random.Generator(np.random.Philox(seed))
    some = rng.integers(len(pulses), size=FAILURES // 2)
    amid = pulses.start[some] + rng.random(len(some)) * pulses.duration[some]
    lost = np.sort(np.concatenate([amid, rng.uniform(path.start, path.end, FAILURES - len(some))]))
    lost = lost[lost < path.end]
    drifts, flow = failed(path, pulses, lost), expm(hill(path.orbit.mean_motion) * EVERY).T
    nearest = np.full(len(lost), np.inf)
    for _ in range(int((until - path.start) / EVERY)):
        nearest = np.minimum(nearest, np.linalg.norm(drifts[:, :3], axis=1))
        drifts = drifts @ flow
    return nearest.min()


@pytest.mark.parametrize(
    ("bit", "period", "larger"),
    [
        pytest.param("0.1 mm/s", "30 s", 1.02, marks=pytest.mark.slow),
        pytest.param("1 mm/s", "60 s", 1.06, marks=pytest.mark.slow),
        ("5 mm/s", "60 s", 1.25),
    ],
)
def test_pulses_are_passively_safe(bit, period, larger):
    """Without a margin, drifts after lost pulses would come to 0.99, 0.97 and 0.82 zones."""
    (plan, _) = plan_mission(parse(inspector(bit, period))).results
    assert plan.passive is not None
    assert (plan.passive.planned, plan.passive.safe, plan.pulsed.short) == (True, True, None)
    assert 1.0 < plan.pulsed.room.larger < larger
    (zone,) = plan.result.zones
    assert zone.norm(np.array([ZONE, 0.0, 0.0])) == pytest.approx(1.0)  # pictures show the required zone
    pulses, path = plan.pulsed.firing.pulses, plan.after.path("Inspector")
    least = nearest_drift(path, pulses, path.end + 86400.0, 7)
    assert least > ZONE * (1.0 - 1e-9)
    assert least > ZONE * (plan.passive.worst.ratio - ROUGH)


def test_pulses_that_are_not_safe_report_the_required_margin():
    """The final ellipse is 25 m from the client, so zones cannot be larger by a quarter."""
    mission = plan_mission(parse(inspector("10 mm/s", "300 s")))
    plan = mission.results[0]
    assert (plan.passive.safe, mission.verdict.status) == (False, 1)
    (said,) = (line for line in effort.pulse_lines(mission, plan) if "require larger margins" in line)
    assert "larger:" in said
    assert "at their end" in said
    path = plan.after.path("Inspector")
    least = nearest_drift(path, plan.pulsed.firing.pulses, path.end + 86400.0, 8)
    assert ZONE * (plan.passive.worst.ratio - ROUGH) < least < ZONE


@pytest.mark.parametrize("bit", [pytest.param(1.0, marks=pytest.mark.slow), 3.0])
def test_minimum_delta_v_plan_consists_of_its_pulses(bit):
    """Drifts after pulses of plain impulses, some below the bit, would come to 0.58 zones."""
    (plan, _) = plan_mission(parse(inspector(f"{bit} mm/s", cost="delta-v"))).results
    assert plan.passive is not None
    assert (plan.passive.planned, plan.passive.safe, plan.pulsed.short) == (True, True, None)
    assert (plan.pulsed.room.larger, plan.pulsed.room.time) == (1.0, 0.0)
    firing, path = plan.pulsed.firing, plan.after.path("Inspector")
    assert firing.pulses.impulse.min() >= 1e-3 * bit
    assert (len(firing.dropped), firing.deviation < 1e-6) == (0, True)
    assert firing.delta_v < 0.35  # m/s; 0.37 by impulses, 0.38 for zones larger by 20 %
    least = nearest_drift(path, firing.pulses, path.end + 86400.0, 9)
    assert least > ZONE * (plan.passive.worst.ratio - ROUGH) > ZONE * (1.0 - ROUGH)
    aim = plan.planned.path("Inspector")
    assert np.abs(path.state(path.end) - aim.state(aim.end)).max() < 1e-6


def test_excessive_minimum_bit_is_refused_with_a_reason(monkeypatch):
    """Within the transfer, a thruster of 1 mm/s^2 gives less than 6 m/s."""
    monkeypatch.setattr("closeform.planning.problem.problem.EFFORT", 4e6)  # of 9e7
    result = plan_mission(parse(inspector("10 m/s", drift="6 h", cost="delta-v"))).results[0]
    assert result.end - result.start < 6000.0
    assert not result.executed
    assert "minimum_bit" in result.failure


@pytest.mark.slow
def test_fired_pulses_equal_the_safe_plan():
    """Impulses need no period; continuous thrust does."""
    case = hold_transfers()[2]
    six = cf.Thrusters.rtn(acceleration=1e-2, minimum_bit=1e-3)
    plan = cf.avoid(case.path, case.client, case.zone, drift=case.drift, cost="delta-v", thrusters=six)
    firing = cf.fire_thrusters(plan, six)
    assert np.isclose(firing.delta_v, plan.delta_v, rtol=1e-9)
    assert firing.deviation < 1e-9
    assert firing.pulses.impulse.min() >= 1e-3
    assert np.abs(plan.path.state(plan.path.end) - case.final).max() < 1e-6
    assert cf.passively_safe(firing.path, case.client, case.zone, case.duration + case.drift)
    lasting = cf.avoid(case.path, case.client, case.zone, drift=case.drift)
    with pytest.raises(ValueError, match=r"^thrusters: continuous thrust requires a period"):
        cf.fire_thrusters(lasting, six)
