"""Fit the rule of thumb of how far off craft end in a real field, thrust played as planned: theory (84).

    python tools/rule_of_thumb.py --plans 3000

Half of the plans are transfers of least energy in 0.25 to 2 orbits, evenly by the logarithm, between states
within 100 m to 2 km of the chief, half of these at rest at both ends; half are coasts of 1 to 10 orbits on
relative orbits that stay.  Chiefs fly 400 to 800 km up, at any inclination and latitude, with eccentricities
of 0.0001 to 0.02, evenly by the logarithm, in J2.  How far off each ends is predicted by `validity`, which is
within a tenth of a percent of what is flown.  Curvature and drag are not fitted: they hardly count here.
Printed is what half of the plans, and 95 %, do not exceed by as little as the form allows, and how many of
each duration exceed it.  These are the numbers of `field/rule.py`.
"""

import argparse

import numpy as np
from scipy.optimize import minimize

import closeform as cf
from closeform.field.rule import HALF, MOST, ends_off, flattening_at

EPOCH = "2026-11-22T12:00:00"
SHARES = {"half": (0.5, HALF), "95 %": (0.95, MOST)}
DURATIONS = (0.25, 0.5, 1.0, 2.0), (1.0, 3.0, 6.0, 10.0)  # orbits, of transfers and of coasts


def drawn(draws: np.random.Generator, which: int) -> tuple[cf.Path, cf.Chief]:
    """A plan and its chief: coasts where `which` is even, else transfers, each other from rest to rest."""
    a, e = cf.EARTH_RADIUS + draws.uniform(4e5, 8e5), 10.0 ** draws.uniform(-4.0, np.log10(0.02))
    around, latitude = draws.uniform(0.0, 2.0 * np.pi, 2)
    inclination = np.arccos(draws.uniform(-1.0, 1.0))
    elements = [a, latitude, e * np.cos(around), e * np.sin(around), inclination, 0.0]
    chief = cf.Chief.from_elements(EPOCH, elements)
    orbit = chief.orbit
    size = 10.0 ** draws.uniform(2.0, np.log10(2000.0))
    states = draws.normal(size=(2, 6)) * size * np.repeat([0.5, 0.5 * orbit.mean_motion], 3)
    if which % 2 == 0:
        states[:, 4] = -2.0 * orbit.mean_motion * states[:, 0]
        return orbit.coast(states[0], draws.uniform(1.0, 10.0) * orbit.period), chief
    states[:, 3:] *= which % 4 == 1
    return orbit.transfer(*states, 2.0 ** draws.uniform(-2.0, 1.0) * orbit.period), chief


def row(draws: np.random.Generator, which: int) -> list[float]:
    """How far off a plan ends [m], its turns, greatest distance [m], and the chief's axis [m] and e."""
    path, chief = drawn(draws, which)
    off = float(cf.validity(path, cf.Field(chief)).ends[0])
    times = np.linspace(float(path.start), float(path.end), 400)
    distance = float(np.linalg.norm(path.position(times), axis=-1).max())
    turns = float(path.end) / chief.orbit.period
    return [off, turns, distance, chief.semi_major_axis, chief.eccentricity, which % 2]


def shares(rows: np.ndarray, rule: tuple[float, ...]) -> np.ndarray:
    """How far off plans ended, as a share of a rule."""
    told = [ends_off(one[2], one[1], one[3], one[4], flattening_at(one[3]), rule) for one in rows]
    return rows[:, 0] / np.array(told)


def fitted(rows: np.ndarray, share: float, rule: tuple[float, ...]) -> tuple[float, ...]:
    """The rule that a share of plans does not exceed, by quantile regression of logarithms."""

    def cost(weights: np.ndarray) -> float:
        logs = np.log(shares(rows, (rule[0], *np.abs(weights), rule[3])))
        return float(np.maximum(share * logs, (share - 1.0) * logs).mean())

    found = np.abs(minimize(cost, rule[1:3], method="Nelder-Mead").x)
    return (rule[0], float(found[0]), float(found[1]), rule[3])


def main() -> None:
    """Draw, fit and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--plans", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=1)
    told = parser.parse_args()
    draws = np.random.default_rng(told.seed)
    rows = np.array([row(draws, k) for k in range(told.plans)])
    for name, (share, rule) in SHARES.items():
        print(f"{name}: now {rule}, fitted {np.round(fitted(rows, share, rule), 2)}")
        over = shares(rows, rule) > 1.0
        print(f"  now exceeded by {100.0 * over.mean():.1f} %, at most {shares(rows, rule).max():.1f} times")
        for kind, edges in zip((1, 0), DURATIONS, strict=True):
            for first, last in zip(edges, edges[1:], strict=False):
                some = (rows[:, 5] == kind) & (rows[:, 1] >= first) & (rows[:, 1] < last)
                what = "transfers" if kind else "coasts"
                print(f"    {what} of {first:g} to {last:g} orbits: {100.0 * over[some].mean():.0f} %")


if __name__ == "__main__":
    main()
