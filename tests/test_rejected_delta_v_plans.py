"""Rejected plans of minimum delta-v report their cost as delta-v."""

import numpy as np
import pytest

import closeform as cf

ORBIT = cf.Orbit.circular(500e3)
A, B = np.array([0.0, -300.0, 5.0, 0.0, 0.0, 0.0]), np.array([10.0, 300.0, -4.0, 0.0, 0.0, 0.0])
DURATION = 2000.0
SIX = cf.Thrusters.rtn(acceleration=1e-3)


@pytest.mark.parametrize("thrusters", [None, SIX], ids=["free", "thrusters"])
def test_end_inside_a_zone_reports_delta_v(thrusters):
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


def test_formation_with_ends_inside_reports_delta_v():
    initial, final = np.stack([A, A + [0, 5, 0, 0, 0, 0]]), np.stack([B, B + [0, 90, 0, 0, 0, 0]])
    none = cf.reconfigure(ORBIT, initial, final, DURATION, cf.Sphere(20.0), cost="delta-v")
    assert none.status == cf.Status.END_INSIDE
    assert none.cost == "delta-v"
    least = cf.least_delta_v(ORBIT, initial, final, DURATION)
    assert none.lower_bound == pytest.approx(least.lower.sum(), rel=1e-7)
    assert none.direct.delta_v == pytest.approx(least.upper, rel=1e-7)
    assert (none.direct.peak_thrust == 0.0).all()
