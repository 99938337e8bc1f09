"""Failures of planned thrust, integrated independently."""

import numpy as np
from scipy.linalg import expm

import closeform as cf
from bridge import hill
from ring_transfers import RADIUS

ORBIT = cf.Orbit.circular(500e3)
EVERY = 20.0  # s, between samples of a drift: below 1e-3 of the zone


MATRIX = hill(ORBIT.mean_motion)


def fired(path):
    """Return times (J,) and impulses (J, 3)."""
    return np.array([time for time, _ in path.impulses]), np.array([push for _, push in path.impulses])


def failed_states(initial, path, lost, shares):
    """Return states (K, 6) at loss of thrust; an impulse at that instant is executed by a share."""
    times, pushes = fired(path)
    states = np.empty((len(lost), 6))
    for k, (end, share) in enumerate(zip(lost, shares, strict=True)):
        states[k] = expm(MATRIX * (end - path.start)) @ initial
        for time, push in zip(times, pushes, strict=True):
            part = share if time == end else float(time < end)
            states[k] += part * expm(MATRIX * max(end - time, 0.0))[:, 3:] @ push
    return states


def least_ratio(states, lost, until, center=lambda time: np.zeros(3)):
    """Return the least distance of drifts from states (K, 6), in zone radii, at samples."""
    times = np.arange(0.0, until, EVERY)
    powers = np.array([expm(MATRIX * time)[:3] for time in times])
    epoch = np.array([expm(-MATRIX * at) @ state for at, state in zip(lost, states, strict=True)])
    places = np.einsum("tij,kj->kti", powers, epoch) - np.array([center(time) for time in times])
    distances = np.linalg.norm(places, axis=2)
    return float(np.where(times >= lost[:, None], distances, np.inf).min()) / RADIUS
