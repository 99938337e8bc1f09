"""Plots of primer vectors and of the trade between time and delta-v."""

import numpy as np
import pytest

import closeform as cf

ORBIT = cf.Orbit(1.15697e-3)
START = [20e3, 20e3, 20e3, -20.0, 20.0, -5.0]  # Curtis, chapter 7: to the origin in 8 h


def dots(figure):
    return np.concatenate([line.get_ydata() for line in figure.axes[0].lines if line.get_marker() == "o"])


def test_primer_touches_one_at_the_impulses():
    """Impulses are in time order with their sizes; a later start changes nothing."""
    for start in (0.0, 5e3):
        figure = cf.plots.primer(ORBIT.impulsive(START, np.zeros(6), 28800.0, start))
        assert figure.get_suptitle().startswith("78.53 m/s with 4 impulses")
        assert dots(figure) == pytest.approx(np.ones(4), abs=1e-9)
        assert {"41.33 m/s", "27.88 m/s", "8.214 m/s"} <= {*words_of(figure)}
        (curve,) = (line for line in figure.axes[0].lines if len(line.get_xdata()) > 100)
        assert curve.get_ydata().max() <= 1 + 1e-9


def test_primer_of_a_suboptimal_plan():
    """The sum of value times size is the minimum delta-v."""
    path = ORBIT.two_impulse(START, np.zeros(6), 28800.0)
    figure = cf.plots.primer(path)
    assert all(word in figure.get_suptitle() for word in ("109.7 m/s", "39.6 %", "78.53 m/s"))
    sizes = [np.linalg.norm(push) for _, push in path.impulses]
    assert dots(figure) @ sizes == pytest.approx(78.53298, abs=1e-4)


def test_trade_plot_shows_the_transfer_cost_table():
    slots = np.zeros((2, 6))
    slots[:, 1] = [-100.0, 100.0]
    found = cf.transfer_cost_table(ORBIT, [0, -500.0, 0, 0, 0, 0], slots, [9000.0, 3000.0, 6000.0])
    figure = cf.plots.trade(found)
    (curve,) = (line for line in figure.axes[0].lines if line.get_marker() == "o")
    order = [1, 2, 0]
    unit = 1e-3 if "mm/s" in figure.axes[0].get_ylabel() else 1.0
    assert curve.get_xdata() * 60.0 == pytest.approx(found.duration[order])
    assert curve.get_ydata() * unit == pytest.approx(found.delta_v[order])
    assert not figure.axes[0].texts  # there is but one slot to name
    assert all(f"{found.delta_v[k] / unit:.4g}" in figure.get_suptitle() for k in (1, 0))
    with pytest.raises(ValueError, match="found: has no duration"):
        cf.plots.trade(cf.transfer_cost_table(ORBIT, START, slots, []))


ROUND = cf.Orbit.circular(500e3)
BEGIN, END, LONG = [40.0, -200.0, 30.0, 0.0, -0.09, 0.0], [-40.0, 200.0, -30.0, 0.0, 0.09, 0.0], 5000.0
IN_THE_WAY = ROUND.coast(np.zeros(6), LONG), cf.Sphere(120.0)


def curve_of(figure):
    return next(line for line in figure.axes[0].lines if len(line.get_xdata()) > 100)


def words_of(figure):
    return [figure.get_suptitle(), *(text.get_text() for text in figure.axes[0].texts)]


def test_primer_of_a_plan_around_a_zone():
    """Its length is 1 and its direction that of the impulse at each impulse, and at most 1 elsewhere."""
    plan = cf.avoid(ROUND.impulsive(BEGIN, END, LONG), *IN_THE_WAY, cost="delta-v")
    assert len(plan.contacts) > 0
    assert len(plan.path.impulses) > 2
    figure = cf.plots.primer(plan)
    sizes = [np.linalg.norm(push) for _, push in plan.path.impulses]
    assert dots(figure) == pytest.approx(np.ones(len(sizes)), abs=1e-2)  # of the smallest ones
    assert dots(figure) @ sizes == pytest.approx(plan.delta_v, rel=5e-4)
    assert curve_of(figure).get_ydata().max() <= 1.002
    assert "for these passing sides" in figure.get_suptitle()
    touched = [
        line
        for line in figure.axes[0].lines
        if len(set(line.get_xdata())) == 1 and len(line.get_xdata()) == 2
    ]
    assert sorted(line.get_xdata()[0] * 60.0 for line in touched) == pytest.approx(
        [contact.time for contact in plan.contacts]
    )
    alone = cf.plots.primer(plan.path)  # of the ends alone
    assert dots(alone).min() < 0.99
    assert any("without obstacles" in word for word in words_of(alone))


def test_slope_of_the_primer_jumps_at_contacts_only():
    """The jump is the multiplier along the normal."""
    plan = cf.avoid(ROUND.impulsive(BEGIN, END, LONG), *IN_THE_WAY, cost="delta-v")
    from closeform.plots.costs import ContactTerms, Primer

    worth = Primer.of(plan.path, ContactTerms.of(plan, 0, plan.path), None)
    h = 1e-2
    for contact in plan.contacts:
        ahead = (worth(np.array([contact.time + h])) - worth(np.array([contact.time]))) / h
        behind = (worth(np.array([contact.time])) - worth(np.array([contact.time - h]))) / h
        jump = (ahead - behind)[0]
        here = [one for one in plan.contacts if abs(one.time - contact.time) < h]  # perhaps two at once
        expected = sum(one.multiplier * one.normal for one in here)
        assert jump == pytest.approx(expected, abs=1e-3 * np.linalg.norm(expected) + 1e-7)


def test_primer_of_each_spacecraft_of_a_joint_plan():
    angles = 2 * np.pi * np.arange(6) / 6
    ring = np.zeros((6, 6))
    ring[:, 1], ring[:, 2] = 120 * np.cos(angles), 120 * np.sin(angles)
    plan = cf.reconfigure(ROUND, ring, -ring, ROUND.period / 4, cf.Sphere(15.0), cost="delta-v")
    for craft in range(6):
        figure = cf.plots.primer(plan, craft)
        assert dots(figure) == pytest.approx(np.ones(len(plan.paths[craft].impulses)), abs=1e-2)
        sizes = [np.linalg.norm(push) for _, push in plan.paths[craft].impulses]
        assert dots(figure) @ sizes == pytest.approx(plan.paths[craft].delta_v, rel=5e-4)
        assert curve_of(figure).get_ydata().max() <= 1.005
    with pytest.raises(ValueError, match=r"^craft: must be from 0 to 5, got 6$"):
        cf.plots.primer(plan, 6)


def test_primer_of_a_plan_with_thrusters():
    six = cf.Thrusters.rtn()
    path = ROUND.impulsive(BEGIN, END, LONG, thrusters=six)
    figure = cf.plots.primer(path, thrusters=six)
    assert dots(figure) == pytest.approx(np.ones(len(path.impulses)), abs=1e-4)
    assert curve_of(figure).get_ydata().max() <= 1.001
    assert figure.get_suptitle().endswith("of these thrusters")
    around = cf.avoid(ROUND.impulsive(BEGIN, END, LONG), *IN_THE_WAY, cost="delta-v", thrusters=six)
    figure = cf.plots.primer(around, thrusters=six)
    assert dots(figure) == pytest.approx(np.ones(len(around.path.impulses)), abs=2e-2)
    assert curve_of(figure).get_ydata().max() <= 1.02
