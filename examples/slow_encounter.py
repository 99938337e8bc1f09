"""Compute the collision probability of two satellites that drift past each other at 1 cm/s.

    python examples/slow_encounter.py

The states and covariances are those of a conjunction data message. The two-dimensional integral assumes a
straight passage with a constant covariance, and finds less than half of the probability. A Monte Carlo
study decides: it samples five thousand pairs of states from both covariances and propagates them in
two-body motion.
"""

import numpy as np
from scipy.integrate import solve_ivp

import closeform as cf

RADIUS = 12.0  # m, combined hard-body radius
PAIRS, TIMES = 5000, 500

r = 7.0e6
v = np.sqrt(cf.elements.EARTH_MU / r)
primary = np.array([r, 0, 0, 0, v * np.cos(1.7), v * np.sin(1.7)])
passing = np.array([0.01, -0.02, -0.01])  # m/s: radial, along-track, cross-track
offset = np.array([15.0, 20.0, 12.0])  # m
offset -= passing * (offset @ passing) / (passing @ passing)  # closest approach at the epoch
secondary = cf.elements.inertial_from_relative(primary, [*offset, *passing])
covariance = np.diag([8.0, 60.0, 5.0, 0.06, 0.008, 0.005]) ** 2  # R, T, N of each object: m and m/s

encounter = cf.Encounter.of(primary, secondary, covariance, covariance)
inputs = encounter.path, encounter.other, cf.Sphere(RADIUS), encounter.errors, encounter.other_errors
exact = cf.collision_probability(*inputs)
short = cf.collision_probability(*inputs, method="short-encounter")


def gravity(_, states):
    """Return the time derivatives of states (6, N), flattened."""
    position, velocity = states.reshape(2, 3, -1)
    pull = -cf.elements.EARTH_MU * position / np.linalg.norm(position, axis=0) ** 3
    return np.concatenate([velocity, pull]).ravel()


def propagated(states, duration):
    """Return positions (TIMES, 3, N) of states (N, 6) over a duration, forward or backward."""
    times = np.linspace(0.0, duration, TIMES)
    run = solve_ivp(gravity, (0.0, duration), states.T.ravel(), t_eval=times, rtol=1e-11, atol=1e-6)
    return run.y.T.reshape(TIMES, 2, 3, -1)[:, 0]


random = np.random.default_rng(1)
sampled = []
for state in (primary, secondary):
    radial = state[:3] / np.linalg.norm(state[:3])
    normal = np.cross(state[:3], state[3:]) / np.linalg.norm(np.cross(state[:3], state[3:]))
    axes = np.kron(np.eye(2), [radial, np.cross(normal, radial), normal])
    errors = random.standard_normal((PAIRS, 6)) * np.sqrt(np.diag(covariance))
    sampled.append(state + errors @ axes)
near = np.zeros(PAIRS, dtype=bool)
for duration in (encounter.path.start, encounter.path.end):
    apart = propagated(sampled[0], duration) - propagated(sampled[1], duration)
    near |= (np.linalg.norm(apart, axis=1) <= RADIUS).any(axis=0)
share, error = near.mean(), near.std() / np.sqrt(PAIRS)

print(
    f"{encounter.distance:.1f} m apart, {encounter.speed * 1e3:.0f} mm/s, {encounter.path.end:.0f} s each way"
)
print(f"exact in the linear model   {exact.value:.4f}  [{exact.low:.4f}, {exact.high:.4f}]")
print(f"short-encounter formula     {short.value:.4f}")
print(f"Monte Carlo, {PAIRS} pairs     {share:.4f}  +- {1.96 * error:.4f}")
assert short.value < 0.5 * exact.value
assert abs(exact.value - share) < 4.0 * error
