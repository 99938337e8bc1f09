"""Fit and check the estimate of the model error of Hill's equations: theory (84).

    python tools/rule_of_thumb.py --missions 4000
    python tools/rule_of_thumb.py --missions 4000 --seed 2 --check

Each mission has 16 spacecraft within 30 m to 2 km of the chief, of which the first 1, 8 or 16 count. Half of
the missions are minimum-energy transfers in 0.1 to 8 orbits, half of these from rest to rest. Half are coasts
of 0.1 to 16 orbits on closed relative orbits. Chiefs are at 300 to 1000 km and any inclination and latitude.
One in ten is circular, the others have eccentricities of 0.0001 to 0.02, all in J2. Durations, sizes and
eccentricities are uniform in the logarithm. The model error is the maximum deviation of any spacecraft at any
time from `validity`, within a tenth of a percent of a simulation. The tool prints the numbers of
`dynamics/model_error_estimate.py` and the share of missions within the estimate, by duration.
"""

import argparse
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize

import closeform as cf
from closeform.dynamics import model_error_estimate

EPOCH = "2026-11-22T12:00:00"
CRAFT = 16
LONGEST = {model_error_estimate.MOVES: 8.0, model_error_estimate.COASTS: 16.0}  # orbits


def drawn(draws: np.random.Generator, which: int) -> tuple[cf.Path, cf.Chief]:
    """Sample a mission and its chief: a coast for even `which`, otherwise a transfer."""
    a = cf.elements.EARTH_RADIUS + draws.uniform(3e5, 1e6)
    e = 0.0 if draws.random() < 0.1 else 10.0 ** draws.uniform(-4.0, np.log10(0.02))
    perigee, latitude = draws.uniform(0.0, 2.0 * np.pi, 2)
    inclination = np.arccos(draws.uniform(-1.0, 1.0))
    elements = [a, latitude, e * np.cos(perigee), e * np.sin(perigee), inclination, 0.0]
    chief = cf.Chief.from_elements(EPOCH, elements)
    orbit = chief.orbit
    size = 10.0 ** draws.uniform(1.5, np.log10(2000.0))
    states = draws.normal(size=(2, CRAFT, 6)) * size * np.repeat([0.5, 0.5 * orbit.mean_motion], 3)
    table = model_error_estimate.COASTS if which % 2 == 0 else model_error_estimate.MOVES
    duration = 10.0 ** draws.uniform(-1.0, np.log10(LONGEST[table])) * orbit.period
    if table is model_error_estimate.COASTS:
        states[0, :, 4] = -2.0 * orbit.mean_motion * states[0, :, 0]
        return orbit.coast(states[0], duration), chief
    states[..., 3:] *= which % 4 == 1
    return orbit.transfer(*states, duration), chief


def row(draws: np.random.Generator, which: int) -> list[float]:
    """Return orbits, chief's axis [m] and e, then reach and deviation [m] of 1, 8, 16 spacecraft."""
    path, chief = drawn(draws, which)
    found = cf.validity(path, cf.Field(chief))
    off = np.linalg.norm(found.deviations[..., :3], axis=-1).max(axis=1)
    far = np.linalg.norm(path.position(found.times), axis=-1).max(axis=1)
    each = [float(some[:count].max()) for count in (1, 8, CRAFT) for some in (far, off)]
    return [float(path.end[0]) / chief.orbit.period, chief.semi_major_axis, chief.eccentricity, *each]


def fitted(rows: np.ndarray, share: float) -> np.ndarray:
    """Return the table that a share of missions does not exceed, by quantile regression of logarithms."""
    turns, a, e, far, off = rows.T

    def cost(weights: np.ndarray) -> float:
        told = np.exp(np.interp(np.log(turns), np.log(model_error_estimate.TURNS), weights)) * far
        logs = np.log(off / (told * model_error_estimate.strength(far, a, e)))
        return float(np.maximum(share * logs, (share - 1.0) * logs).mean())

    best = np.log(np.interp(model_error_estimate.TURNS, [0.1, 0.5, 16.0], [2.0, 10.0, 100.0]))
    for _ in range(6):  # a simplex shrinks too soon
        best = minimize(cost, best, method="Nelder-Mead", options={"maxiter": 4000, "adaptive": True}).x
    return np.exp(best)


def unknown(rows: np.ndarray, share: float, craft: int, kind: str) -> float:
    """Return the eccentricity at which a share of missions is within the estimate."""
    trials = np.geomspace(1e-4, 0.02, 60)
    within = [covered(rows, craft, kind, [e] * len(rows))[int(share > 0.5)].mean() for e in trials]
    return float(np.interp(share, within, trials))


def covered(rows: np.ndarray, craft: int, kind: str, eccentricities: Sequence[float | None]) -> np.ndarray:
    """Return which missions are within both estimates (2, M), for known or unknown (None) eccentricities."""
    turns, a, _, far, off = rows.T
    each = zip(far, turns, a, eccentricities, strict=True)
    told = [model_error_estimate.model_error(f, t, x, e, craft, kind) for f, t, x, e in each]
    return off <= np.array(told).T


def main() -> None:
    """Sample, fit and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--missions", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--check", action="store_true", help="print only the shares")
    told = parser.parse_args()
    draws = np.random.default_rng(told.seed)
    every = np.array([row(draws, k) for k in range(told.missions)])
    for kind, first in ((model_error_estimate.COASTS, 0), (model_error_estimate.MOVES, 1)):
        for place, craft in enumerate((1, 8, CRAFT)):
            rows = every[first::2][:, [0, 1, 2, 3 + 2 * place, 4 + 2 * place]]
            if not told.check and craft <= 8:
                for share in (0.5, 0.95):
                    e = unknown(rows, share, craft, kind)
                    table = np.round(fitted(rows, share), 2).tolist()
                    print(f"{kind}, {craft} craft, {share}: {table}, e {e:.4f}")
            for name, e in (("known", rows[:, 2].tolist()), ("unknown", [None] * len(rows))):
                print(
                    f"{kind}, {craft} craft, e {name}: within half and 95 % are, in percent, by turns from",
                    end="",
                )
                within = covered(rows, craft, kind, e)
                for low, high in pairwise(model_error_estimate.TURNS):
                    some = (rows[:, 0] >= low) & (rows[:, 0] < high)
                    if some.any():
                        half, most = 100.0 * within[:, some].mean(axis=1)
                        print(f"  {low:g}: {half:.0f} {most:.0f}", end="")
                print("  all: {:.0f} {:.0f}".format(*(100.0 * within.mean(axis=1))))


if __name__ == "__main__":
    main()
