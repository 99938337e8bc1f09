"""Plans of least delta-v that are refused say so in delta-v; nothing that is dear is worked out twice."""

from collections import Counter

import numpy as np
import pytest

import closeform as cf
from closeform import stage_burns
from closeform.mission import fly
from closeform.planning import impulse_search
from closeform.planning.problem import Problem
from closeform.report.run import RunReport
from closeform.scenario import parse

ORBIT = cf.Orbit.circular(500e3)
A, B = np.array([0.0, -300.0, 5.0, 0.0, 0.0, 0.0]), np.array([10.0, 300.0, -4.0, 0.0, 0.0, 0.0])
DURATION = 2000.0
SIX = cf.Thrusters.rtn(acceleration=1e-3)


def counted(monkeypatch, owner, name):
    """How often a function is called from now on, by its name."""
    calls, function = Counter(), getattr(owner, name)

    def called(*given, **more):
        calls[name] += 1
        return function(*given, **more)

    monkeypatch.setattr(owner, name, called)
    return calls


@pytest.mark.parametrize("thrusters", [None, SIX], ids=["free", "thrusters"])
def test_an_end_inside_a_zone_is_told_in_delta_v(thrusters):
    there = ORBIT.coast(A + [0, 5, 0, 0, 0, 0], DURATION)
    path = ORBIT.transfer(A, B, DURATION)
    none = cf.avoid(path, there, cf.Sphere(20.0), cost="delta-v", thrusters=thrusters)
    assert none.status == cf.Status.END_INSIDE
    assert none.cost == "delta-v"
    least = ORBIT.impulsive(A, B, DURATION, thrusters=thrusters).delta_v
    assert none.lower_bound == pytest.approx(least, rel=1e-7)
    assert np.isnan(none.spent)
    by_energy = cf.avoid(path, there, cf.Sphere(20.0))
    assert by_energy.cost == "energy"
    assert by_energy.lower_bound == pytest.approx(path.energy)


def test_a_formation_whose_ends_are_inside_is_told_in_delta_v():
    initial, final = np.stack([A, A + [0, 5, 0, 0, 0, 0]]), np.stack([B, B + [0, 90, 0, 0, 0, 0]])
    none = cf.reconfigure(ORBIT, initial, final, DURATION, cf.Sphere(20.0), cost="delta-v")
    assert none.status == cf.Status.END_INSIDE
    assert none.cost == "delta-v"
    least = cf.least_delta_v(ORBIT, initial, final, DURATION)
    assert none.lower_bound == pytest.approx(least.lower.sum(), rel=1e-7)
    assert none.direct.delta_v == pytest.approx(least.upper, rel=1e-7)
    assert (none.direct.peak_thrust == 0.0).all()


def swap():
    angles = 2 * np.pi * np.arange(4) / 4
    ring = np.zeros((4, 6))
    ring[:, 1], ring[:, 2] = 60 * np.cos(angles), 60 * np.sin(angles)
    return ORBIT, ring, -ring, ORBIT.period / 4, cf.Sphere(12.0)


def test_the_plan_of_least_energy_is_made_once(monkeypatch):
    """Its sides are begun with, and it is flown where no impulses are clear; its slopes are of energy."""
    calls = counted(monkeypatch, impulse_search, "solve")
    monkeypatch.setattr(impulse_search.ImpulseSolver, "solve", lambda *_: None)
    plan = cf.reconfigure(*swap(), cost="delta-v", if_blocked=())
    assert plan.ok
    assert plan.cost == "delta-v"
    assert plan.contacts
    assert calls["solve"] == 1
    assert plan.delta_v == pytest.approx(plan.paths.delta_v.sum())
    assert plan.prices == ()
    assert np.isnan(plan.price)


def test_conflicts_of_a_path_that_is_not_flown_are_not_looked_for(monkeypatch):
    """Thrusters plan it anew, clear or not."""
    path = ORBIT.transfer(A, B, DURATION)
    far = ORBIT.coast([0, 5000.0, 0, 0, 0, 0], DURATION)
    calls = counted(monkeypatch, Problem, "conflicts")
    found = cf.avoid(path, far, cf.Sphere(20.0), cost="delta-v", thrusters=SIX)
    assert found.ok
    assert calls["conflicts"] == 1  # of the impulses


FILE = """\
closeform = 1
title = "One craft"

[orbit]
altitude = "500 km"

[craft]
name = "I"
position = "0 -2000 30 m"
velocity = "0 0 0 m/s"
mass = "12 kg"
specific_impulse = "60 s"
max_thrust = "0.1 N"
thrusters = "rtn"
minimum_bit = "1 mN s"
period = "30 s"

[[stage]]
do = "transfer"
to = { position = "0 -100 0 m", velocity = "0 0 0 m/s" }
within = "1.3 orbits"
"""


def test_the_list_of_burns_is_made_once(monkeypatch):
    flown = fly(parse(FILE))
    calls = counted(monkeypatch, stage_burns, "_of_craft")
    report = RunReport(flown)
    (section,) = report.sections
    (shown,) = (table for table in section.tables if table.title.startswith("Burns"))
    assert shown.rows == section.files["burns"].rows
    assert len(shown.rows) > 100
    assert calls["_of_craft"] == 1
