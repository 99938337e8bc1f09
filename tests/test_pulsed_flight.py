"""Thrusters under feedback: the burns that lead back, against another integrator; what is told of them."""

import numpy as np
import pytest

import closeform as cf
from closeform.fuel.pulses import Pulses
from test_field import chief, pushed, task

ORBIT, FIELD = chief().orbit, cf.Field(chief())
SIGHT = cf.Navigation(0.5, 2e-3)
STRONG = 0.02  # m/s^2
GRID = 0.01  # s


def swap(kind: str, turns: float = 0.45) -> tuple[cf.Path, float]:
    start, final, duration = task(ORBIT, 7, count=2, turns=turns)
    make = ORBIT.two_impulse if kind == "impulses" else ORBIT.transfer
    return make(start, final, duration), duration


def on_times(
    flights: cf.Simulation, seed: int, craft: int, pulses: Pulses
) -> list[tuple[float, float, np.ndarray]]:
    """From when to when a craft's thrusters are on, and their push: pulses, and orders in what is left.

    The time that is left is counted on a grid; what is fired in it is as large as ordered.
    """
    found = [
        (start, start + lasts, axis * STRONG)
        for start, lasts, axis in zip(pulses.start, pulses.duration, pulses.direction, strict=True)
    ]
    ends = [*flights.ordered[1:], flights.times[-1]]
    for begin, end, order in zip(flights.ordered, ends, flights.orders[seed, craft], strict=True):
        for axis in np.flatnonzero(np.abs(order) > 1e-12):
            way = np.sign(order[axis]) * np.eye(3)[axis]
            grid = np.arange(begin, end, GRID)
            free = np.ones(len(grid), dtype=bool)
            for start, over, push in found[: len(pulses)]:
                free &= ~((push @ way > 0.5 * STRONG) & (grid >= start) & (grid < over))
            asked, left = max(round(abs(order[axis]) / STRONG / GRID), 1), grid[free]
            on = left[(len(left) - asked) // 2 :][:asked]
            runs = np.split(on, np.flatnonzero(np.diff(on) > 1.5 * GRID) + 1)
            found += [(run[0], run[-1] + GRID, way * abs(order[axis]) / (asked * GRID)) for run in runs]
    return found


@pytest.mark.parametrize(("kind", "turns"), [("impulses", 0.45), ("energy", 0.15)])
def test_what_thrusters_fire_leads_where_it_is_told(kind, turns):
    """Pulse by pulse by DOP853: burns are about the middle of the time in which their thruster is off."""
    path, _ = swap(kind, turns)
    thrusters = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=5e-4, period=60.0)
    flights = cf.simulate(path, FIELD, thrusters=thrusters, navigation=SIGHT, seeds=3)
    pulses = cf.compensated_thrust(path, FIELD, thrusters=thrusters).firing.pulses
    seed, craft = 2, 1
    fired = on_times(flights, seed, craft, pulses[pulses.craft == craft])
    begin = FIELD.chief_states(flights.times[:1])[0]
    end = pushed(begin, flights.states[seed, craft, 0], fired, (flights.times[0], flights.times[-1]))
    assert np.abs(flights.orders[seed, craft]).sum() > 5e-3  # m/s: metres, by the end
    # m; burns end within steps of 5 s
    assert flights.states[seed, craft, -1, :3] == pytest.approx(end, abs=0.02)


def test_each_burn_is_a_bit_or_more():
    path, _ = swap("energy")
    for bit in (1e-4, 1e-3):
        thrusters = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=bit, period=60.0)
        led = cf.simulate(path, FIELD, thrusters=thrusters, navigation=SIGHT, seeds=10)
        sizes = np.abs(led.orders)
        assert sizes[sizes > 1e-12].min() >= bit * (1.0 - 1e-9)
        assert (sizes <= STRONG * 300.0).all()
        planned = cf.compensated_thrust(path, FIELD, thrusters=thrusters).firing.delta_v
        assert led.delta_v == pytest.approx(
            planned + sizes.sum(axis=(2, 3)), rel=1e-9
        )  # each thruster counts
        assert led.planned_delta_v == pytest.approx(cf.fire_thrusters(path, thrusters).delta_v)
        assert not led.limited.any()


def test_who_cannot_push_is_told():
    """Too weak to come back in time, or without a thruster to one side: the share of time is told."""
    path, _ = swap("energy")
    far = cf.Navigation(position_bias=300.0)
    weak = cf.Thrusters.rtn(acceleration=1.2 * path.peak_thrust.max(), minimum_bit=1e-5, period=60.0)
    free = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=1e-5, period=60.0)
    law = cf.Feedback(60.0, 300.0, impulses=5)
    told = [
        cf.simulate(path, FIELD, thrusters=own, navigation=far, feedback=law, seeds=5) for own in (weak, free)
    ]
    assert told[0].limited.max() > 0.03
    assert not told[1].limited.any()
    flat = cf.Thrusters(free.directions[:4], acceleration=STRONG, period=60.0)
    level = ORBIT.coast([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 90.0, 0.0, 0.0, 0.0, 0.0]], 3000.0)
    found = cf.simulate(level, FIELD, thrusters=[flat, free], navigation=SIGHT, seeds=3)
    assert (found.limited[:, 0] > 0.9).all()  # the noise asks for some push across, all the time
    assert not found.limited[:, 1].any()
    assert not found.orders[:, 0, :, 2].any()


def test_some_have_thrusters_and_some_have_none():
    """Each flies as in a flight where all are like it."""
    path, _ = swap("energy")
    thrusters = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=5e-4, period=60.0)
    told = {"navigation": SIGHT, "seeds": 4}
    mixed = cf.simulate(path, FIELD, thrusters=[thrusters, None], **told)
    pulsed = cf.simulate(path, FIELD, thrusters=thrusters, **told)
    free = cf.simulate(path, FIELD, feedback=cf.Feedback(300.0, 1800.0, 6), **told)
    assert mixed.states[:, 0] == pytest.approx(pulsed.states[:, 0], abs=1e-6)
    assert mixed.orders[:, 0] == pytest.approx(pulsed.orders[:, 0], abs=1e-9)
    assert not mixed.orders[:, 1].any()
    assert mixed.states[:, 1, -1] == pytest.approx(free.states[:, 1, -1], abs=1e-3)  # other steps
    assert mixed.delta_v[:, 1] == pytest.approx(free.delta_v[:, 1], rel=1e-6)
    impulsive, _ = swap("impulses")
    kicked = cf.simulate(impulsive, FIELD, thrusters=[thrusters, None], **told)
    assert kicked.ends.max() < 8.0  # m
    start, end = (kicked.path(0).state(kicked.planned.start[0] + t)[1] for t in (0.0, 1.0))
    assert start == pytest.approx(kicked.states[0, 1, 0], abs=1e-9)
    assert end[:3] == pytest.approx(start[:3] + start[3:], abs=1e-3)  # it coasts until its impulse


def test_where_nobody_has_thrusters_thrust_lasts():
    path, _ = swap("energy")
    nobody, none = (cf.simulate(path, FIELD, thrusters=who, navigation=SIGHT) for who in ([None, None], None))
    assert np.array_equal(nobody.states, none.states)
    assert nobody.firing is None


def test_thrust_that_lasts_is_fired_once_in_a_period():
    path, _ = swap("energy")
    thrusters = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=1e-5, period=60.0)
    every = cf.simulate(path, FIELD, thrusters=thrusters, feedback=cf.Feedback(60.0, 600.0))
    same = cf.simulate(path, FIELD, thrusters=thrusters, feedback=cf.Feedback(60.0, 600.0, impulses=10))
    assert np.array_equal(every.states, same.states)
    with pytest.raises(
        ValueError, match=r"^feedback: pulses 50 s apart, but thrusters fire once in 60 s; give"
    ):
        cf.simulate(path, FIELD, thrusters=thrusters, feedback=cf.Feedback(60.0, 600.0, impulses=12))


@pytest.mark.slow
def test_new_plans_by_brief_pulses_are_flown_as_thrust_that_lasts():
    """Measured within a metre: the briefer pulses are, the nearer to that, by the square of their period."""
    start, final, duration = task(ORBIT, 7, count=2, turns=0.6)
    path = ORBIT.transfer(start, final, duration)
    told = {"control": "replan", "zones": cf.Sphere(1.0), "navigation": cf.Navigation(1.0, 1e-3), "seeds": 2}
    lasting, off = cf.simulate(path, FIELD, **told), []
    legs = lasting.times[0] + np.linspace(0.0, duration, 13)[1:7]  # later ones lead back, by other means
    for period in (60.0, 15.0):
        thrusters = cf.Thrusters.rtn(acceleration=STRONG, period=period)
        pulsed = cf.simulate(path, FIELD, thrusters=thrusters, **told)
        assert (pulsed.replans == lasting.replans).all()
        assert pulsed.replans.min() > 3
        off.append(max(np.abs(at(pulsed, t) - at(lasting, t)).max() for t in legs))
    assert off[1] < 0.06  # m
    assert off[1] < 0.15 * off[0]


def at(flights: cf.Simulation, time: float) -> np.ndarray:
    """Where craft are (S, N, 3) at some time."""
    return np.array([flights.path(seed).position(time) for seed in range(len(flights.states))])


def test_new_plans_by_pulses_keep_clear_and_cost_what_they_fire():
    """Craft pass each other, one of them by pulses; what leads back is fired in the last quarter."""
    start = np.array([[0, 0, 120, 0, 0, 0], [0, 0, -120, 0, 0, 0.0]])
    zone, thrusters = cf.Sphere(30.0), cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=1e-4, period=30.0)
    plan = cf.reconfigure(ORBIT, start, start[::-1], 0.6 * ORBIT.period, zone, margin=14.0)
    told = {"control": "replan", "zones": zone, "navigation": cf.Navigation(1.0, 1e-3), "seeds": 3}
    lasting = cf.simulate(plan, FIELD, **told)
    found = cf.simulate(plan, FIELD, thrusters=[thrusters, None], **told)
    assert found.violated == 0.0
    assert found.greatest_end < 4.0  # m, of measurements of 1 m
    assert (found.replans == 8).all()
    legs = np.abs(found.orders[:, 0]).sum(axis=-1).reshape(3, 12, -1).sum(axis=-1)
    assert not legs[:, 1:9].any()  # a new plan begins where craft are measured to be
    assert legs[:, 9:].all()
    ways = np.array(cf.compensated_thrust(plan, FIELD).commanded[0])
    sides = np.abs(ways).sum() / np.linalg.norm(ways, axis=1).sum()  # each thruster counts
    assert found.delta_v[:, 0].mean() == pytest.approx(sides * lasting.delta_v[:, 0].mean(), rel=0.25)
    assert found.delta_v[:, 1].mean() == pytest.approx(lasting.delta_v[:, 1].mean(), rel=0.25)


def test_new_plans_that_thrusters_cannot_fire_are_refused():
    """Behind, craft hurry: beyond what thrusters give no plan is flown, and the last one is tracked."""
    path = ORBIT.transfer([[0, 0, 120, 0, 0, 0]], [[0, 0, -120, 0, 0, 0]], 0.6 * ORBIT.period)
    weak = cf.Thrusters.rtn(acceleration=1.04 * float(path.peak_thrust[0]), period=30.0)
    told = {"control": "replan", "zones": cf.Sphere(1.0), "thrusters": weak, "seeds": 1}
    found = cf.simulate(path, FIELD, navigation=cf.Navigation(3.0, 1e-2), **told)
    assert len(found.refused) > 0
    assert "acceleration: craft 0: at about " in found.refused[0][2]
    assert found.replans[0] + len(found.refused) / 3 == 8
