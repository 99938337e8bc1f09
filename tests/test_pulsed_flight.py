"""Simulations with pulsed thrusters under feedback against another integrator."""

import numpy as np
import pytest

import closeform as cf
from closeform.fuel.pulses import Pulses
from simulated import chief, pushed, task

ORBIT, FIELD = chief().orbit, cf.Field(chief())
SIGHT = cf.Navigation(0.5, 2e-3)
STRONG = 0.02  # m/s^2
GRID = 0.01  # s


def swap(kind: str, turns: float = 0.45) -> tuple[cf.Path, float]:
    start, final, duration = task(ORBIT, 7, count=2, turns=turns)
    make = ORBIT.two_impulse if kind == "impulses" else ORBIT.transfer
    return make(start, final, duration), duration


def on_times(
    flights: cf.Simulation, seed: int, craft: int, pulses: Pulses, change: float = np.inf, later: float = 0.0
) -> list[tuple[float, float, np.ndarray]]:
    """Return start, end and thrust of each firing of a spacecraft: pulses, then corrections in the free time.

    Free time is counted on a grid; the fired impulse is the commanded one. From the `change` on thrusters of
    an acceleration `later` replace those of STRONG.
    """
    pushes = pulses.direction * (pulses.impulse / pulses.duration)[:, None]
    found = list(zip(pulses.start, pulses.start + pulses.duration, pushes, strict=True))
    ends = [*flights.ordered[1:], flights.times[-1]]
    for begin, end, order in zip(flights.ordered, ends, flights.orders[seed, craft], strict=True):
        strength = STRONG if begin < change else later
        end = min(end, change) if begin < change else end
        for axis in np.flatnonzero(np.abs(order) > 1e-12):
            way = np.sign(order[axis]) * np.eye(3)[axis]
            grid = np.arange(begin, end, GRID)
            free = np.ones(len(grid), dtype=bool)
            for start, over, push in found[: len(pulses)]:
                free &= ~((push @ way > 0.5 * strength) & (grid >= start) & (grid < over))
            asked, left = max(round(abs(order[axis]) / strength / GRID), 1), grid[free]
            on = left[(len(left) - asked) // 2 :][:asked]
            runs = np.split(on, np.flatnonzero(np.diff(on) > 1.5 * GRID) + 1)
            found += [(run[0], run[-1] + GRID, way * abs(order[axis]) / (asked * GRID)) for run in runs]
    return found


@pytest.mark.parametrize(
    ("kind", "turns"), [("impulses", 0.45), pytest.param("energy", 0.15, marks=pytest.mark.slow)]
)
def test_simulated_states_agree_with_the_fired_pulses(kind, turns):
    """Integrate pulse by pulse; corrections are centred in the time in which their thruster is off."""
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


def of_two_stages() -> tuple[cf.Path, float]:
    """Return impulses out and back with a coast between, and a time in that coast."""
    start, final, duration = task(ORBIT, 7, count=2, size=40.0, turns=0.2)
    there, wait = ORBIT.two_impulse(start, final, duration), ORBIT.coast(final, 900.0, duration)
    back = ORBIT.two_impulse(wait.state(duration + 900.0), start, duration, duration + 900.0)
    legs = [cf.join([there[k], wait[k], back[k]]) for k in range(2)]
    return cf.stack(legs), duration + 450.0


def test_thrusters_change_between_stages():
    """Integrate pulses and corrections of the set in use; each set fires its own stage alone."""
    path, change = of_two_stages()
    first = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=5e-4)
    second = cf.Thrusters.rtn(acceleration=3.0 * STRONG, minimum_bit=2e-3)
    sets = [{0.0: first, change: second}] * 2
    flights = cf.simulate(path, FIELD, thrusters=sets, navigation=SIGHT, seeds=2)
    pulses, craft = flights.firing.pulses, 1
    strengths = np.where(pulses.start < change, STRONG, 3.0 * STRONG)
    assert pulses.impulse / pulses.duration == pytest.approx(strengths, rel=1e-9)
    own = pulses[pulses.craft == craft]
    fired = on_times(flights, 0, craft, own, change, 3.0 * STRONG)
    begin = FIELD.chief_states(flights.times[:1])[0]
    end = pushed(begin, flights.states[0, craft, 0], fired, (flights.times[0], flights.times[-1]))
    after = flights.ordered > change
    assert np.abs(flights.orders[0, craft, after]).sum() > 5e-3  # m/s, by the second set
    assert flights.states[0, craft, -1, :3] == pytest.approx(end, abs=0.02)
    sizes = np.abs(flights.orders[:, :, after])
    assert sizes[sizes > 1e-12].min() >= 2e-3 * (1.0 - 1e-9)
    both = flights.planned_delta_v + flights.field_delta_v + np.abs(flights.orders).sum(axis=(2, 3))
    assert flights.delta_v == pytest.approx(both, rel=1e-9)


def test_thrusters_change_in_the_coast_after_an_impulse():
    """No burn is fired twice."""
    path, change = of_two_stages()
    own = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=5e-4)
    same = cf.simulate(path, FIELD, "open", thrusters=own)
    changed = cf.simulate(path, FIELD, "open", thrusters=[{0.0: own, 0.5 * change: own}] * 2)
    assert changed.planned_delta_v == pytest.approx(same.planned_delta_v, rel=1e-9)
    assert changed.ends == pytest.approx(same.ends, abs=0.01)  # m; other steps


def test_margins_of_thrusters_that_change():
    path, change = of_two_stages()
    first = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=5e-4)
    second = cf.Thrusters.rtn(acceleration=3.0 * STRONG, minimum_bit=2e-3)
    sets = [{0.0: first, change: second}] * 2
    found = cf.tracking_margins(path, FIELD, navigation=SIGHT, thrusters=sets)
    flights = cf.simulate(path, FIELD, navigation=SIGHT, thrusters=sets, seeds=40)
    assert (flights.deviations.max(axis=(0, 2)) < found.greatest).all()
    assert (flights.deviations.max(axis=(0, 2)) > 0.2 * found.greatest).all()
    with pytest.raises(ValueError, match=r"^thrusters: "):
        cf.tracking_margins(path, FIELD, thrusters=[{0.0: None, change: second}, None])


def test_free_thrust_before_thrusters():
    """Each spacecraft moves by free impulses while it has no thrusters, and by pulses before or after."""
    path, change = of_two_stages()
    own = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=5e-4)
    options = {"navigation": SIGHT, "seeds": 2}
    mixed = cf.simulate(
        path, FIELD, thrusters=[{0.0: None, change: own}, {0.0: own, change: None}], **options
    )
    free, pulsed = cf.simulate(path, FIELD, **options), cf.simulate(path, FIELD, thrusters=own, **options)
    pulses = mixed.firing.pulses
    assert ((pulses.start > change) == (pulses.craft == 0)).all()
    before = np.linspace(0.0, change - 300.0, 50)  # the order before the change is cut by it
    for seed in range(2):
        for craft, alike in ((0, free), (1, pulsed)):
            apart = (one.path(seed)[craft].position(before) for one in (mixed, alike))
            assert np.abs(np.subtract(*apart)).max() < 0.01  # m; other steps
    assert mixed.ends.max() < 5.0
    weak = cf.Thrusters.rtn(acceleration=1e-6, minimum_bit=0.0)
    with pytest.raises(ValueError, match="craft 1: "):  # which cannot fire its burns one after the other
        cf.simulate(path, FIELD, thrusters=[own, {0.0: own, change: weak}])
    with pytest.raises(ValueError, match="thrusters: craft 0: change at 1 s, within a burn"):
        cf.simulate(swap("energy")[0], FIELD, thrusters=[{0.0: own, 1.0: None}, None])


def test_limit_counts_without_thrusters_only():
    """A limit below the plan's peak cuts the free stage as in a simulation without thrusters."""
    start, final, duration = task(ORBIT, 7, count=2, turns=0.3)
    there, wait = ORBIT.transfer(start, final, duration), ORBIT.coast(final, 900.0, duration)
    back = ORBIT.transfer(wait.state(duration + 900.0), start, duration, duration + 900.0)
    path, change = cf.stack([cf.join([there[k], wait[k], back[k]]) for k in range(2)]), duration + 450.0
    own, limit = cf.Thrusters.rtn(acceleration=STRONG, period=60.0), 0.7 * there.peak_thrust.min()
    sets = [{0.0: None, change: own}, {0.0: own, change: own}]
    free = cf.simulate(path, FIELD, "open", max_acceleration=limit)
    mixed, whole = (
        cf.simulate(path, FIELD, "open", thrusters=sets, max_acceleration=most) for most in (limit, None)
    )
    before = np.linspace(0.0, change, 50)
    places = [one.path(0)[0].position(before) for one in (mixed, free, whole)]
    assert np.abs(places[0] - places[1]).max() < 0.05  # m; other steps
    assert np.abs(places[0] - places[2]).max() > 5.0  # m
    assert not whole.limited.any()
    assert mixed.limited[0, 0] > 0.05
    assert mixed.states[0, 1] == pytest.approx(whole.states[0, 1], abs=1e-6)
    lost = whole.delta_v[0, 0] - mixed.delta_v[0, 0]  # m/s, all in the first stage
    unlimited = cf.simulate(path, FIELD, "open")
    first = np.linspace(0.0, duration, 4001)
    size = np.linalg.norm(cf.compensated_thrust(there, FIELD, every=1.0).commanded[0], axis=1)
    excess = np.maximum(np.interp(first, np.linspace(0.0, duration, len(size)), size) - limit, 0.0)
    assert lost == pytest.approx(np.trapezoid(excess, first), rel=0.01)
    assert free.delta_v[0, 0] < unlimited.delta_v[0, 0]


def test_corrections_respect_the_minimum_bit():
    path, _ = swap("energy")
    for bit in (1e-3,):
        thrusters = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=bit, period=60.0)
        led = cf.simulate(path, FIELD, thrusters=thrusters, navigation=SIGHT, seeds=5)
        sizes = np.abs(led.orders)
        assert sizes[sizes > 1e-12].min() >= bit * (1.0 - 1e-9)
        assert (sizes <= STRONG * 300.0).all()
        planned = cf.compensated_thrust(path, FIELD, thrusters=thrusters).firing.delta_v
        assert led.delta_v == pytest.approx(
            planned + sizes.sum(axis=(2, 3)), rel=1e-9
        )  # each thruster counts
        assert led.planned_delta_v == pytest.approx(cf.fire_thrusters(path, thrusters).delta_v)
        assert not led.limited.any()


def test_insufficient_thrust_is_reported():
    """Thrust too weak, or missing in one direction, is reported as a share of time."""
    path, _ = swap("energy")
    far = cf.Navigation(position_bias=300.0)
    weak = cf.Thrusters.rtn(acceleration=1.2 * path.peak_thrust.max(), minimum_bit=1e-5, period=60.0)
    free = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=1e-5, period=60.0)
    law = cf.Feedback(60.0, 300.0, impulses=5)
    options = [
        cf.simulate(path, FIELD, thrusters=own, navigation=far, feedback=law, seeds=5) for own in (weak, free)
    ]
    assert options[0].limited.max() > 0.03
    assert not options[1].limited.any()
    flat = cf.Thrusters(free.directions[:4], acceleration=STRONG, period=60.0)
    level = ORBIT.coast([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 90.0, 0.0, 0.0, 0.0, 0.0]], 3000.0)
    found = cf.simulate(level, FIELD, thrusters=[flat, free], navigation=SIGHT, seeds=3)
    assert (found.limited[:, 0] > 0.9).all()  # noise requires cross-track thrust all the time
    assert not found.limited[:, 1].any()
    assert not found.orders[:, 0, :, 2].any()


def test_mixed_thrusters_and_continuous_thrust():
    """Each spacecraft moves as in a simulation where all have its thrusters."""
    path, _ = swap("energy")
    thrusters = cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=5e-4, period=60.0)
    options = {"navigation": SIGHT, "seeds": 4}
    mixed = cf.simulate(path, FIELD, thrusters=[thrusters, None], **options)
    pulsed = cf.simulate(path, FIELD, thrusters=thrusters, **options)
    free = cf.simulate(path, FIELD, feedback=cf.Feedback(300.0, 1800.0, 6), **options)
    assert mixed.states[:, 0] == pytest.approx(pulsed.states[:, 0], abs=1e-6)
    assert mixed.orders[:, 0] == pytest.approx(pulsed.orders[:, 0], abs=1e-9)
    assert not mixed.orders[:, 1].any()
    assert mixed.states[:, 1, -1] == pytest.approx(free.states[:, 1, -1], abs=1e-3)  # other steps
    assert mixed.delta_v[:, 1] == pytest.approx(free.delta_v[:, 1], rel=1e-6)
    impulsive, _ = swap("impulses")
    kicked = cf.simulate(impulsive, FIELD, thrusters=[thrusters, None], **options)
    assert kicked.ends.max() < 8.0  # m
    start, end = (kicked.path(0).state(kicked.planned.start[0] + t)[1] for t in (0.0, 1.0))
    assert start == pytest.approx(kicked.states[0, 1, 0], abs=1e-9)
    assert end[:3] == pytest.approx(start[:3] + start[3:], abs=1e-3)  # it coasts until its impulse


def test_no_thrusters_means_continuous_thrust():
    path, _ = swap("energy")
    without, none = (
        cf.simulate(path, FIELD, thrusters=who, navigation=SIGHT) for who in ([None, None], None)
    )
    assert np.array_equal(without.states, none.states)
    assert without.firing is None


def test_one_firing_per_period():
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
def test_replanning_with_short_pulses_approaches_continuous_thrust():
    """The difference falls with the square of the period."""
    start, final, duration = task(ORBIT, 7, count=2, turns=0.6)
    path = ORBIT.transfer(start, final, duration)
    options = {
        "control": "replan",
        "zones": cf.Sphere(1.0),
        "navigation": cf.Navigation(1.0, 1e-3),
        "seeds": 2,
    }
    lasting, off = cf.simulate(path, FIELD, **options), []
    legs = lasting.times[0] + np.linspace(0.0, duration, 13)[1:7]  # later legs use feedback instead
    for period in (60.0, 15.0):
        thrusters = cf.Thrusters.rtn(acceleration=STRONG, period=period)
        pulsed = cf.simulate(path, FIELD, thrusters=thrusters, **options)
        assert (pulsed.replans == lasting.replans).all()
        assert pulsed.replans.min() > 3
        off.append(max(np.abs(at(pulsed, t) - at(lasting, t)).max() for t in legs))
    assert off[1] < 0.06  # m
    assert off[1] < 0.15 * off[0]


def at(flights: cf.Simulation, time: float) -> np.ndarray:
    """Return positions (S, N, 3) at some time."""
    return np.array([flights.path(seed).position(time) for seed in range(len(flights.states))])


def test_replanning_with_pulses_keeps_clear():
    """Two spacecraft pass, one with pulses; corrections are fired in the last quarter only."""
    start = np.array([[0, 0, 120, 0, 0, 0], [0, 0, -120, 0, 0, 0.0]])
    zone, thrusters = cf.Sphere(30.0), cf.Thrusters.rtn(acceleration=STRONG, minimum_bit=1e-4, period=30.0)
    plan = cf.reconfigure(ORBIT, start, start[::-1], 0.6 * ORBIT.period, zone, margin=14.0)
    options = {"control": "replan", "zones": zone, "navigation": cf.Navigation(1.0, 1e-3), "seeds": 1}
    lasting = cf.simulate(plan, FIELD, **options)
    found = cf.simulate(plan, FIELD, thrusters=[thrusters, None], **options)
    assert found.violated == 0.0
    assert found.greatest_end < 4.0  # m, of measurements of 1 m
    assert (found.replans == 8).all()
    legs = np.abs(found.orders[:, 0]).sum(axis=-1).reshape(1, 12, -1).sum(axis=-1)
    assert not legs[:, 1:9].any()  # a new plan starts at the measured states
    assert legs[:, 9:].all()
    given = found.pulses[0].impulse.sum() + np.abs(found.orders[0, 0]).sum()
    assert given == pytest.approx(found.delta_v[0, 0], rel=1e-9)  # pulses of new plans included
    ways = np.array(cf.compensated_thrust(plan, FIELD).commanded[0])
    sides = np.abs(ways).sum() / np.linalg.norm(ways, axis=1).sum()  # each thruster counts
    assert found.delta_v[:, 0].mean() == pytest.approx(sides * lasting.delta_v[:, 0].mean(), rel=0.25)
    assert found.delta_v[:, 1].mean() == pytest.approx(lasting.delta_v[:, 1].mean(), rel=0.25)


def test_new_plans_beyond_the_thrusters_are_rejected():
    """Late spacecraft would need more thrust; the last plan is tracked instead."""
    path = ORBIT.transfer([[0, 0, 120, 0, 0, 0]], [[0, 0, -120, 0, 0, 0]], 0.6 * ORBIT.period)
    weak = cf.Thrusters.rtn(acceleration=1.04 * float(path.peak_thrust[0]), period=30.0)
    options = {"control": "replan", "zones": cf.Sphere(1.0), "thrusters": weak, "seeds": 1}
    found = cf.simulate(path, FIELD, navigation=cf.Navigation(3.0, 1e-2), **options)
    assert len(found.refused) > 0
    assert "acceleration: craft 0: at about " in found.refused[0][2]
    assert found.replans[0] + len(found.refused) / 3 == 8
