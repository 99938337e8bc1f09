"""A formation in a force model, of which some spacecraft drift."""

import numpy as np
from scipy.integrate import solve_ivp

import closeform as cf
from simulated import FIELD, axes_of, textbook

START = np.array([[0, 400, 0, 0, 0, 0], [0, 0, 300, 0, 0, 0], [0, -200, 50, 0, 0, 0.0]])
ENDS = np.array([[0, -300, 200, 0, 0, 0], [0, 50, 0, 0, 0, 0], [100, 0, 0, 0, 0, 0.0]])
SPAN = 3000.0
OWN = cf.Thrusters.rtn(acceleration=0.02, minimum_bit=1e-4, period=30.0)
OFF = 0.01, 0.01


def drifted(start: float, state: np.ndarray, end: float, field: cf.Field = FIELD) -> np.ndarray:
    """Return the position after a drift by DOP853 in J2, in the chief's axes."""
    origin = field.chief_states([start])[0]
    felt = textbook(origin[:3])
    both = np.vstack([origin, cf.elements.inertial_from_relative(origin, state, acceleration=felt)])

    def rates(t, y):
        states = y.reshape(2, 6)
        return np.hstack([states[:, 3:], textbook(states[:, :3])]).ravel()

    both = solve_ivp(rates, (start, end), both.ravel(), "DOP853", rtol=1e-11, atol=1e-6).y[:, -1]
    return axes_of(both[:6]) @ (both[6:9] - both[:3])
