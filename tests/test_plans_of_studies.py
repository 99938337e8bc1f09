"""Plans shared by the cases of a study: made once, with rows equal to single runs."""

import copy
import pickle
import re
import threading

import numpy as np
import pytest

from closeform.campaign import case_of, evaluated, mission_cases
from closeform.campaign.mission_cases import MOST_PLANS, Plans
from closeform.mission.mission import plan_mission
from closeform.scenario import ScenarioError, parse
from studies import FAILS, MANY, TWICE

STARTS = '"craft.position" = { normal = "1 m" }\n'
LIMITS = '"craft.max_acceleration" = { choice = ["5 mm/s^2", "9 mm/s^2"] }\n'
FLIGHTS = MANY.replace(STARTS, "")  # plans do not depend on the sampled keys
FEW = MANY.replace(STARTS, LIMITS)
FAILURES = re.sub(r'"craft.(velocity|mass)" = .*\n', "", FAILS)


def plan_inputs(case):
    """Return the inputs of a plan."""
    return tuple((*one.position, *one.velocity, one.mass, one.max_acceleration) for one in case.craft)


@pytest.mark.parametrize(
    ("text", "plans"),
    [
        pytest.param(FEW, 4, id="few"),
        pytest.param(FAILURES, 1, id="failures"),
        pytest.param(TWICE, 8, id="replanned"),
        pytest.param(FLIGHTS, 1, id="simulations", marks=pytest.mark.slow),
        pytest.param(MANY, 8, id="starts", marks=pytest.mark.slow),
        pytest.param(FAILS, 8, id="velocities", marks=pytest.mark.slow),
    ],
)
def test_plan_is_made_once_for_equal_inputs(text, plans, monkeypatch):
    """Rows equal those of single runs bit by bit, in chunks of any order."""
    scenario, made = parse(text, "plans.toml"), []
    runs = [plan_mission(case_of(scenario, case)) for case in range(8)]
    planned = mission_cases.staged
    monkeypatch.setattr(
        mission_cases, "staged", lambda one, **told: (made.append(plan_inputs(one)), planned(one, **told))[1]
    )
    campaign = evaluated(scenario, 8)
    assert len(made) == plans
    if text is not TWICE:  # its plans start at disturbed states
        assert len({plan_inputs(one.scenario) for one in runs}) == plans
    kind = type(campaign.kind)(scenario, scenario.study.seed)
    parts = [kind.evaluate(first, last) for first, last in ((5, 8), (2, 5), (0, 2))][::-1]
    for case, run in enumerate(runs):
        for one in kind.figures:
            np.testing.assert_array_equal(campaign.column(one.column)[case], one.of(run))
        assert campaign.statuses[case] == ("met" if run.verdict.ok else "unmet")
        assert campaign.column("reason")[case] == ("" if run.verdict.ok else str(run.verdict))
    for name in kind.names:
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), campaign.column(name))


def test_threads_share_one_plan_or_one_error():
    """Four threads request a plan, one makes it, and all get its result."""
    for answer in ("plan", ScenarioError("file", ["stage[1]: no way"])):
        plans, made, told, ready = Plans(), [], [], threading.Barrier(4)

        def make(made=made, answer=answer):
            made.append(1)
            threading.Event().wait(0.05)  # while the others ask
            if isinstance(answer, Exception):
                raise answer
            return answer

        def ask(plans=plans, make=make, told=told, ready=ready):
            ready.wait()
            try:
                told.append(plans.of((b"same",), make))
            except ScenarioError as error:
                told.append(error)

        threads = [threading.Thread(target=ask) for _ in range(4)]
        for one in threads:
            one.start()
        for one in threads:
            one.join()
        assert made == [1]
        assert told == [answer] * 4


def test_number_of_stored_plans_is_bounded():
    plans, made = Plans(), []
    for key in [*range(MOST_PLANS + 1), MOST_PLANS, 0]:
        plans.of((bytes([key]),), lambda key=key: made.append(key))
    assert made == [*range(MOST_PLANS + 1), 0]


def test_copies_of_a_study_hold_no_plans():
    """A pickled or copied result gives the same rows."""
    campaign = evaluated(parse(FAILURES, "plans.toml"), 4)
    for twin in (pickle.loads(pickle.dumps(campaign)), copy.deepcopy(campaign)):
        assert campaign.kind.plans.held
        assert not twin.kind.plans.held
        rows, own = twin.kind.evaluate(2, 4), campaign.kind.evaluate(2, 4)
        for name in campaign.kind.names:
            np.testing.assert_array_equal(rows[name], own[name])
            np.testing.assert_array_equal(twin.column(name), campaign.column(name))
