"""Distributed planning: what each spacecraft knows, message delays, and clear plans at the end."""

from dataclasses import replace

import numpy as np
import pytest

import closeform as cf
from closeform.planning.methods.sequential import by_messages
from closeform.planning.request import Request
from formations import DEEP_SPACE, LOW_ORBIT, reconfiguration

TASKS = [
    reconfiguration(count, 2, orbit, spacing=3.0) for count in (4, 8, 12) for orbit in (LOW_ORBIT, DEEP_SPACE)
]


def planned(task, **more):
    plan = cf.reconfigure(**task.arguments, method="distributed", if_blocked=(), **more)
    assert plan.ok, plan.reason
    return plan


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_plan_is_clear_and_meets_its_ends(task):
    plan = planned(task)
    times = np.linspace(0.0, task.duration, 3000)
    places = [plan.paths[k].position(times) for k in range(task.count)]
    for i in range(task.count):
        for j in range(i):
            assert np.linalg.norm(places[i] - places[j], axis=1).min() > 10.0 * (1.0 - 1e-9)
    for k in range(task.count):
        for time, state in ((0.0, task.initial[k]), (task.duration, task.final[k])):
            np.testing.assert_allclose(plan.paths[k].state(time), state, atol=1e-8)
    joint = cf.reconfigure(**task.arguments, if_blocked=())
    assert joint.energy <= plan.energy * (1.0 + 1e-6)
    assert plan.energy <= 1.2 * plan.lower_bound  # the most of these tasks is 15 %


@pytest.mark.parametrize("task", TASKS[2:4], ids=lambda task: task.name)
def test_boundary_conditions_are_all_that_is_published(task):
    """Between its contacts each path is the transfer of minimum energy, which others can compute."""
    plan = planned(task)
    assert len(plan.contacts) > 0
    for k in range(task.count):
        path = plan.paths[k]
        knots = np.append(path.arcs[:, 0], path.end)
        for start, end in zip(knots[:-1], knots[1:], strict=True):
            leg = task.orbit.transfer(path.state(start), path.state(end), end - start, start)
            between = np.linspace(start, end, 20)
            np.testing.assert_allclose(leg.position(between), path.position(between), atol=1e-6)


def test_right_of_way():
    """The paths of those before a craft do not depend on it, and the last in the order gives way to all."""
    task = TASKS[2]
    whole = planned(task)
    fewer = planned(replace(task, initial=task.initial[:6], final=task.final[:6]))
    for k in range(6):
        np.testing.assert_array_equal(fewer.paths[k].arcs, whole.paths[k].arcs)
    order = list(range(task.count))[::-1]
    reverse = planned(task, order=order)
    direct = task.orbit.transfer(task.initial, task.final, task.duration)
    for plan, first in ((whole, 0), (reverse, task.count - 1)):
        assert plan.paths[first].energy == pytest.approx(direct[first].energy, rel=1e-9)
    with pytest.raises(ValueError, match="order: requires method"):
        cf.reconfigure(**task.arguments, order=order)


@pytest.mark.parametrize("seed", range(3))
def test_message_delays(seed):
    """Plans are clear and end whatever the delays; equal ones only stretch the rounds."""
    task = TASKS[2]
    problem = Request.of_formation(**task.arguments, method="distributed").problem()
    count = task.count
    prompt = by_messages(problem, range(count))
    slow = by_messages(problem, range(count), delays=5)
    assert prompt.trajectories is not None
    assert slow.trajectories is not None
    np.testing.assert_array_equal(prompt.trajectories[0], slow.trajectories[0])
    delays = np.random.default_rng(seed).integers(1, 7, (count, count))
    found = by_messages(problem, range(count), delays=delays)
    assert found.trajectories is not None
    assert problem.conflicts(found.trajectories) == []
