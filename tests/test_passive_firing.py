"""Passively safe plans that thrusters fire: their pulses are flown by DOP853, with a thousand failures."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from bridge import hill
from closeform.mission import fly
from closeform.report import burns
from closeform.scenario import parse

INSPECTOR = (Path(__file__).parents[1] / "examples" / "passive_inspector.toml").read_text()
ZONE = 20.0  # m
FAILURES = 1000
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
    [("0.1 mm/s", "30 s", 1.02), ("1 mm/s", "60 s", 1.06), ("5 mm/s", "60 s", 1.25)],
)
def test_pulses_leave_room_when_thrust_is_lost(bit, period, larger):
    """Planned to touch, pulses of the plan would drift to 0.99, 0.97 and 0.82 zones."""
    (plan, _) = fly(parse(inspector(bit, period))).results
    assert plan.passive is not None
    assert (plan.passive.planned, plan.passive.safe, plan.pulsed.short) == (True, True, None)
    assert 1.0 < plan.pulsed.room.larger < larger
    (zone,) = plan.result.zones
    assert zone.norm(np.array([ZONE, 0.0, 0.0])) == pytest.approx(1.0)  # pictures are of what was asked for
    pulses, path = plan.pulsed.firing.pulses, plan.after.path("Inspector")
    least = nearest_drift(path, pulses, path.end + 86400.0, 7)
    assert least > ZONE * (1.0 - 1e-9)
    assert least > ZONE * (plan.passive.worst.ratio - ROUGH)


def test_pulses_without_room_say_how_much_they_need():
    """The ellipse that is arrived on is 25 m from the client: zones cannot be larger by a quarter."""
    mission = fly(parse(inspector("10 mm/s", "300 s")))
    plan = mission.results[0]
    assert (plan.passive.safe, mission.verdict.status) == (False, 1)
    (said,) = (line for line in burns.lines(mission, plan) if "would need more room" in line)
    assert "larger: the path's end is" in said
    path = plan.after.path("Inspector")
    least = nearest_drift(path, plan.pulsed.firing.pulses, path.end + 86400.0, 8)
    assert ZONE * (plan.passive.worst.ratio - ROUGH) < least < ZONE
