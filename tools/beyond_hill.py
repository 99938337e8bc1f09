"""Print the table of motion models in docs/field.md: deviation of coasts from the high-fidelity model.

    python tools/beyond_hill.py

Each case is a chief at 500 km and a spacecraft at some hundred metres that coasts in J2. The table holds the
median of the maximum deviation, in metres per kilometre of distance and orbit. Initial states are osculating
states, as navigation provides them. "Fitted" initial states are those with the best fit afterwards.
"""

import numpy as np
from scipy.linalg import expm

import closeform as cf
from closeform.dynamics.force_model.field import EARTH_ZONALS, GRAVITY_RADIUS

CASES = 12  # cases per eccentricity and number of orbits
EPOCH = "2026-11-22T12:00:00"
MODELS = (
    "Hill",
    "Hill, fitted",
    "Schweighart-Sedwick",
    "Schweighart-Sedwick, fitted",
    "Yamanaka-Ankersen",
    "transition in the high-fidelity model",
)


def schweighart_sedwick(radius: float, inclination: float, latitude: float, times: np.ndarray) -> np.ndarray:
    """Return transition matrices (T, 6, 6) with the mean effect of J2, for small inclination differences.

    In the plane x'' = (5 c^2 - 2) n^2 x + 2 n c y', y'' = -2 n c x'. Both orbital planes precess, and their
    rates differ with the inclination: the cross-track amplitude grows with time.
    """
    n, flat = np.sqrt(cf.elements.EARTH_MU / radius**3), EARTH_ZONALS[0] * (GRAVITY_RADIUS / radius) ** 2
    c = np.sqrt(1.0 + 0.375 * flat * (1.0 + 3.0 * np.cos(2.0 * inclination)))
    rates = np.zeros((4, 4))
    rates[0, 2] = rates[1, 3] = 1.0
    rates[2, 0], rates[2, 3], rates[3, 2] = (5.0 * c * c - 2.0) * n * n, 2.0 * n * c, -2.0 * n * c
    pace = n * c + 1.5 * n * flat * np.cos(inclination) ** 2
    apart = 1.5 * n * flat * np.sin(inclination) ** 2  # rate of the node per radian of inclination

    def across(t: float) -> np.ndarray:
        sin, cos = np.sin(latitude + pace * t), np.cos(latitude + pace * t)
        return np.array(
            [
                [sin - apart * t * cos, -cos],
                [pace * (cos + apart * t * sin) - apart * cos, pace * sin],
            ]
        )

    out, first = np.zeros((len(times), 6, 6)), np.linalg.inv(across(0.0))
    for k, t in enumerate(times):
        out[k][np.ix_([0, 1, 3, 4], [0, 1, 3, 4])] = expm(rates * t)
        out[k][np.ix_([2, 5], [2, 5])] = across(t) @ first
    return out


def fitted(matrices: np.ndarray, flown: np.ndarray) -> np.ndarray:
    """Return the initial state (6,) of a model with the best fit to simulated positions (T, 3)."""
    scale = np.repeat([1.0, 1e-3], 3)
    return scale * np.linalg.lstsq(matrices[:, :3].reshape(-1, 6) * scale, flown.ravel(), rcond=None)[0]


def deviations(seed: int, eccentricity: float, turns: int) -> list[float]:
    """Return the deviation of each model, in metres per kilometre and orbit."""
    draws = np.random.default_rng([seed, turns])
    latitude, perigee = draws.uniform(0.0, 2.0 * np.pi, 2)
    tilt = np.radians((51.6, 97.4)[seed % 2])
    shape = eccentricity * np.cos(perigee), eccentricity * np.sin(perigee)
    chief = cf.Chief.from_elements(EPOCH, [6.878e6, latitude, *shape, tilt, 0.3])
    orbit, field = chief.orbit, cf.Field(chief)
    start = draws.normal(size=6) * 200.0 * np.repeat([1.0, orbit.mean_motion], 3)
    start[4] = -2.0 * orbit.mean_motion * start[0]
    times = np.linspace(0.0, turns * orbit.period, 60 * turns + 1)
    flown = field.coast(start, times[-1]).position(times)
    hill = orbit.transition(times)
    mean = np.linalg.norm(field.chief_states(times)[:, :3], axis=1).mean()
    averaged = schweighart_sedwick(float(mean), tilt, latitude, times)
    predicted = [
        hill @ start,
        hill @ fitted(hill, flown),
        averaged @ start,
        averaged @ fitted(averaged, flown),
        cf.Orbit.from_elements(chief.elements).transition(times) @ start,
        field.transition(times) @ start,
    ]
    far = np.linalg.norm(flown, axis=1).max() * turns / 1e3
    return [float(np.linalg.norm(one[:, :3] - flown, axis=1).max() / far) for one in predicted]


def main() -> None:
    columns = [(e, turns) for e in (0.0, 0.001, 0.01) for turns in (1, 10)]
    medians = [
        np.median([deviations(seed, e, turns) for seed in range(CASES)], axis=0) for e, turns in columns
    ]
    heads = [f"e = {e:g}, {turns} orbit{'s' * (turns > 1)}" for e, turns in columns]
    print("| model | " + " | ".join(heads) + " |\n|---|" + "---:|" * len(heads))
    for name, row in zip(MODELS, np.array(medians).T, strict=True):
        print(f"| {name} | " + " | ".join(f"{value:.2g}" for value in row) + " |")


if __name__ == "__main__":
    main()
