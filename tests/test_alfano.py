"""Alfano's twelve conjunctions (AAS 09-233, 2009) against Monte Carlo of 1e8 trials, as published."""

import json
from pathlib import Path

import numpy as np
import pytest

import closeform as cf

ROOT = Path(__file__).parents[1]
DATA = json.loads((ROOT / "tests" / "data" / "alfano.json").read_text(encoding="utf-8"))
CASES = {case["case"]: case for case in DATA["cases"]}


def encounter(case):
    """Return the encounter; case 6 is printed asymmetric, of which the lower triangle counts."""
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


@pytest.mark.parametrize("number", [5, 6, *(pytest.param(k, marks=pytest.mark.slow) for k in (7, 8))])
def test_circular_orbits_are_within_the_published_intervals(number):
    found, figure = probability(number)
    low, high = CASES[number]["interval_95"]
    assert low < figure.value < high
    assert figure.high - figure.low < 2e-3 * figure.value  # 0.1 % either way
    assert figure.mean_entries == pytest.approx(CASES[number]["entries"], rel=1e-3)
    assert found.warnings == ()


@pytest.mark.parametrize("number", [11, pytest.param(12, marks=pytest.mark.slow)])
def test_mean_entries_of_neighbours_on_one_orbit(number):
    """The published figure counts entries only; `value` includes objects inside at the start."""
    _, figure = probability(number)
    assert figure.mean_entries == pytest.approx(CASES[number]["entries"], rel=1e-3)
    assert figure.at_start > 0.7 * figure.mean_entries
    assert figure.at_start < figure.value < figure.at_start + figure.mean_entries


@pytest.mark.parametrize("number", [1, *(pytest.param(k, marks=pytest.mark.slow) for k in (2, 3, 4))])
def test_small_eccentricity_is_warned_of(number):
    found, figure = probability(number)
    assert "eccentricity is 0.0119" in found.warnings[0]
    assert figure.value == pytest.approx(CASES[number]["monte_carlo_1e8"], rel=0.035)


@pytest.mark.parametrize("number", [9, 10])
def test_eccentric_orbit_is_refused(number):
    with pytest.raises(ValueError, match=r"eccentricity 0\.741"):
        encounter(CASES[number])


@pytest.mark.parametrize(("number", "short"), [(1, 0.14675), (2, 0.006222), (4, 0.049715), (5, 0.044492)])
def test_short_encounter_integral_of_slow_encounters(number, short):
    """The two-dimensional integral is wrong by factors of 1.5 to 2.5 in slow encounters."""
    _, figure = probability(number, method="short-encounter")
    assert figure.value == pytest.approx(short, rel=1e-3)
    assert (figure.value < 0.7 * CASES[number]["monte_carlo_1e8"]) == (number != 5)


def test_monte_carlo_agrees():
    _, figure = probability(5, method="monte-carlo", samples=100_000)
    assert figure.low < CASES[5]["monte_carlo_1e8"] < figure.high
