"""Fixed planning cases and the costs recorded for them."""

import json
from pathlib import Path

import numpy as np
import pytest

import closeform as cf
from closeform.zones.shapes import CUBE
from formations import CASES, random_case
from passages import GROUPS, MARGIN, crowd, crowds, nearest, passages
from passages import passage as drawn_passage

RECORDED = json.loads((Path(__file__).parent / "data" / "plan_energies.json").read_text(encoding="utf-8"))
ENDS = 1e-6  # relative tolerance of the planner
SAME = 1e-9  # relative rounding between machines


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_direct_paths_conflict_with_every_obstacle(group):
    cases = passages(group)
    assert list(RECORDED[group]) == [passage.name for passage in cases]
    for passage in cases:
        assert passage.conflicts(passage.path) == list(range(len(passage.zones)))
        assert passage.end_ratio() >= MARGIN
        assert RECORDED[group][passage.name]["direct"] == pytest.approx(passage.path.energy, rel=SAME)


@pytest.mark.slow
def test_crowds_are_in_conflict_and_clear_at_their_ends():
    cases = crowds()
    assert list(RECORDED["crowds"]) == [task.name for task in cases]
    for task in cases:
        direct = task.orbit.transfer(task.initial, task.final, task.duration)
        assert len(cf.screen(direct, task.zone).pairs) > 0
        assert min(nearest(states[:, :3], task.zone) for states in (task.initial, task.final)) >= MARGIN
        assert RECORDED["crowds"][task.name]["direct"] == pytest.approx(direct.energy.sum(), rel=SAME)


def test_recorded_formations_are_the_random_cases():
    lines = RECORDED["random formations"]
    assert len(lines) == CASES
    for seed in range(0, CASES, 20):
        task = random_case(seed)
        direct = task.orbit.transfer(task.initial, task.final, task.duration, task.start)
        assert lines[task.name]["direct"] == pytest.approx(direct.energy.sum(), rel=SAME)


def test_recorded_costs_are_above_the_direct_optimum():
    plans = [
        (plan, line["direct"])
        for group, lines in RECORDED.items()
        if group != "made"
        for line in lines.values()
        for plan in (line.get("avoid", {}), line["reconfigure"])
        if plan.get("energy") is not None and "measures" not in plan
    ]
    energies = np.array([(plan["energy"], plan["extra"], direct) for plan, direct in plans])
    assert (energies[:, 1] >= 0).all()
    np.testing.assert_allclose(energies[:, 0] - energies[:, 1], energies[:, 2], rtol=SAME)


@pytest.mark.parametrize("share", [40, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("group", GROUPS)
def test_cost_is_close_to_the_best_recorded(group, share):
    """Extra energies are within 0.1 % of the best of three planners, 1 % for boxes."""
    shares = []
    for seed in range(0, GROUPS[group][0], share):
        passage = drawn_passage(group, seed)
        found = cf.avoid(passage.path, passage.obstacles, passage.zones)
        assert found.ok, passage.name
        shares.append(found.extra_energy / RECORDED[group][passage.name]["best"])
        edged = any(zone.shape == CUBE for zone in passage.zones)
        assert shares[-1] <= (1.01 if edged else 1.001), passage.name
    assert share > 1 or np.mean(shares) <= 1 + ENDS


def test_budget_is_kept():
    task = crowd(6, True, 0)
    assert cf.reconfigure(**task.arguments, budget=2, if_blocked=()).tried <= 2
