"""Alfano's twelve conjunctions (AAS 09-233, 2009) against Monte Carlo of 1e8 trials, as published."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

import closeform as cf

ROOT = Path(__file__).parents[1]
DATA = json.loads((ROOT / "tests" / "data" / "alfano.json").read_text(encoding="utf-8"))
CASES = {case["case"]: case for case in DATA["cases"]}


def encounter(case):
    """The two objects; of case 6, published with four digits of symmetry, the lower triangles of messages."""
    both = [case["primary"], case["secondary"]]
    states = [np.concatenate([one["position_m"], one["velocity_m_s"]]) for one in both]
    matrices = [np.array(one["covariance"]) for one in both]
    if case["case"] == 6:
        matrices = [np.tril(matrix) + np.tril(matrix, -1).T for matrix in matrices]
    return cf.Encounter.of(*states, *matrices, axes="inertial", half_window=case["half_window_s"])


def probability(number, **options):
    case = CASES[number]
    found = encounter(case)
    zone = cf.Sphere(case["hard_body_radius_m"])
    return found, cf.collision_probability(
        found.path, found.other, zone, found.errors, found.other_errors, **options
    )


@pytest.mark.parametrize("number", [5, 6, 7, 8])
def test_circular_orbits_are_within_the_published_intervals(number):
    found, figure = probability(number)
    low, high = CASES[number]["interval_95"]
    assert low < figure.value < high
    assert figure.high - figure.low < 2e-3 * figure.value  # 0.1 % either way
    assert figure.mean_entries == pytest.approx(CASES[number]["entries"], rel=1e-3)
    assert found.warnings == ()


@pytest.mark.parametrize("number", [11, 12])
def test_neighbours_on_one_orbit_by_entries(number):
    """The published figure counts entries, and nobody who is inside at the start; `value` has them too."""
    _, figure = probability(number)
    assert figure.mean_entries == pytest.approx(CASES[number]["entries"], rel=1e-3)
    assert figure.at_start > 0.7 * figure.mean_entries
    assert figure.at_start < figure.value < figure.at_start + figure.mean_entries


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_an_eccentricity_of_a_hundredth_is_warned_of_and_costs_some_percent(number):
    found, figure = probability(number)
    assert "eccentricity is 0.0119" in found.warnings[0]
    assert figure.value == pytest.approx(CASES[number]["monte_carlo_1e8"], rel=0.035)


@pytest.mark.parametrize("number", [9, 10])
def test_an_ellipse_is_refused(number):
    with pytest.raises(ValueError, match=r"eccentricity 0\.741"):
        encounter(CASES[number])


@pytest.mark.parametrize(("number", "short"), [(1, 0.14675), (2, 0.006222), (4, 0.049715), (5, 0.044492)])
def test_a_slow_encounter_is_not_a_short_one(number, short):
    """The integral in two dimensions is wrong by 1.5 to 2.5 in slow encounters, as others find it, too."""
    _, figure = probability(number, method="short-encounter")
    assert figure.value == pytest.approx(short, rel=1e-3)
    assert (figure.value < 0.7 * CASES[number]["monte_carlo_1e8"]) == (number != 5)


def test_monte_carlo_counts_the_same():
    _, figure = probability(5, method="monte-carlo", samples=300_000)
    assert figure.low < CASES[5]["monte_carlo_1e8"] < figure.high


def test_the_example_of_a_slow_encounter(capsys):
    """It flies what it says, in two-body motion, and asserts that it agrees."""
    runpy.run_path(str(ROOT / "examples" / "slow_encounter.py"))
    assert "short-encounter" in capsys.readouterr().out
