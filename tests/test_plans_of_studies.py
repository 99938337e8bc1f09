"""Plans of the cases of a study: one if the planner sees no sample, with rows equal to single runs."""

import copy
import pickle
import re

import numpy as np
import pytest

from closeform.campaign import case_of, evaluated, mission_cases
from closeform.mission.mission import plan_mission
from closeform.scenario import parse
from studies import FAILS, MANY, TWICE

STARTS = '"craft.position" = { normal = "1 m" }\n'
LIMITS = '"craft.max_acceleration" = { choice = ["5 mm/s^2", "9 mm/s^2"] }\n'
FLIGHTS = MANY.replace(STARTS, "")  # plans do not depend on the sampled keys
FEW = MANY.replace(STARTS, LIMITS)
FAILURES = re.sub(r'"craft.(velocity|mass)" = .*\n', "", FAILS)


@pytest.mark.parametrize(
    ("text", "plans"),
    [
        pytest.param(FEW, 8, id="few"),
        pytest.param(FAILURES, 1, id="failures"),
        pytest.param(TWICE, 8, id="replanned"),
        pytest.param(FLIGHTS, 1, id="simulations", marks=pytest.mark.slow),
        pytest.param(MANY, 8, id="starts", marks=pytest.mark.slow),
        pytest.param(FAILS, 8, id="velocities", marks=pytest.mark.slow),
    ],
)
def test_common_plan_is_made_once(text, plans, monkeypatch):
    """Rows equal those of single runs bit by bit, in chunks of any order."""
    scenario, made = parse(text, "plans.toml"), []
    runs = [plan_mission(case_of(scenario, case)) for case in range(8)]
    planned = mission_cases.staged
    monkeypatch.setattr(
        mission_cases, "staged", lambda one, **told: (made.append(one), planned(one, **told))[1]
    )
    campaign = evaluated(scenario, 8)
    assert len(made) == plans
    kind = type(campaign.kind)(scenario, scenario.study.seed)
    parts = [kind.evaluate(first, last) for first, last in ((5, 8), (2, 5), (0, 2))][::-1]
    for case, run in enumerate(runs):
        for one in kind.figures:
            np.testing.assert_array_equal(campaign.column(one.column)[case], one.of(run))
        assert campaign.statuses[case] == ("met" if run.verdict.ok else "unmet")
        assert campaign.column("reason")[case] == ("" if run.verdict.ok else str(run.verdict))
    for name in kind.names:
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), campaign.column(name))


def test_copies_of_a_study_evaluate_the_same_cases():
    """A pickled or copied result gives the same rows."""
    campaign = evaluated(parse(FAILURES, "plans.toml"), 4)
    for twin in (pickle.loads(pickle.dumps(campaign)), copy.deepcopy(campaign)):
        rows, own = twin.kind.evaluate(2, 4), campaign.kind.evaluate(2, 4)
        for name in campaign.kind.names:
            np.testing.assert_array_equal(rows[name], own[name])
            np.testing.assert_array_equal(twin.column(name), campaign.column(name))
