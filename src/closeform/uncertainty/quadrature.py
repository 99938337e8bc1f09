"""Adaptive integrals over pieces of an axis, with an error estimate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from closeform.arrays import Floats

# 7-point Gauss and 15-point Kronrod rules (Piessens and others, QUADPACK, 1983)
_PLACES = (
    *(0.991455371120812639206854697526, 0.949107912342758524526189684048, 0.864864423359769072789712788641),
    *(0.741531185599394439863864773281, 0.586087235467691130294144691693, 0.405845151377397166906606412077),
    *(0.207784955007898467600689403773, 0.0),
)
_WEIGHTS = (
    *(0.022935322010529224963732008059, 0.063092092629978553290700663189, 0.104790010322250183839876322542),
    *(0.140653259715525918745189590510, 0.169004726639267902826583426599, 0.190350578064785409913256402421),
    *(0.204432940075298892414161999235, 0.209482141084727828012999174892),
)
PLACES = np.array([*(-p for p in _PLACES[:-1]), *_PLACES[::-1]])
WEIGHTS = np.array([*_WEIGHTS[:-1], *_WEIGHTS[::-1]])
LESS = np.zeros(15)
LESS[1::2] = np.polynomial.legendre.leggauss(7)[1]
ROUNDS = 48
ROUGH = 3.0  # times the tolerance: a piece with a smaller relative error is not divided
MOST = 4000  # maximum number of pieces


@dataclass(frozen=True, eq=False)
class Integral:
    """Integral of a non-negative function, and its error.

    `times` and `values` (K,) are the final samples of the integrand; `parts` are values times weights, whose
    sum is the integral.
    """

    value: float
    error: float
    times: Floats
    values: Floats
    parts: Floats


def integral(function: Callable[[Floats], Floats], edges: Floats, tolerance: float) -> Integral:
    """Integrate from the first edge to the last, to a relative tolerance, by halving pieces."""
    low, high = np.array(edges[:-1]), np.array(edges[1:])
    done = _rule(function, low, high)
    for _ in range(ROUNDS):
        *_, sums, errors = done
        allowed = tolerance * sums.sum()
        if not errors.sum() > allowed or len(sums) > MOST:
            break
        # divide the worst pieces, so that the others together are within half of the allowed error
        order = np.argsort(errors)
        wide = (high - low > 1e-13 * (np.abs(high) + np.abs(low))) & (errors > ROUGH * tolerance * sums)
        worst = np.zeros(len(sums), dtype=bool)
        worst[order[np.cumsum(errors[order]) > 0.5 * allowed]] = True
        worst &= wide
        if not worst.any():
            break
        middle = 0.5 * (low[worst] + high[worst])
        new = np.concatenate([low[worst], middle]), np.concatenate([middle, high[worst]])
        halves = _rule(function, *new)
        low, high = np.concatenate([low[~worst], new[0]]), np.concatenate([high[~worst], new[1]])
        done = tuple(np.concatenate([a[~worst], b]) for a, b in zip(done, halves, strict=True))
    times, values, sums, errors = done
    order = np.argsort(low)
    parts = values * WEIGHTS * (0.5 * (high - low))[:, None]
    return Integral(
        float(sums.sum()),
        float(errors.sum()),
        times[order].ravel(),
        values[order].ravel(),
        parts[order].ravel(),
    )


def _rule(function: Callable[[Floats], Floats], low: Floats, high: Floats) -> tuple[Floats, ...]:
    """Return nodes and values (P, 15), sums (P,) and errors (P,) of pieces, as QUADPACK's qk15."""
    half = 0.5 * (high - low)
    times = 0.5 * (low + high)[:, None] + half[:, None] * PLACES
    values = function(times.ravel()).reshape(times.shape)
    sums = half * (values @ WEIGHTS)
    gap = half * np.abs(values @ (WEIGHTS - LESS))
    mean = (values @ WEIGHTS) / 2.0
    swing = half * (np.abs(values - mean[:, None]) @ WEIGHTS)
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = np.where(swing > 0.0, swing * np.minimum(1.0, (200.0 * gap / swing) ** 1.5), gap)
    return times, values, sums, errors
