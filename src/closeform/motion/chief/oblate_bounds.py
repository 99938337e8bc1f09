"""Proven bounds on the error of the table of an oblate chief between the nodes of its windows.

The chief and its variations are polynomials of u, as Picard's iteration makes them, with I the interpolant of
degree 29, t' = dt/du, the gravity g and its gradient G at r:

    v = v_0 + integral of I(g t'),    r = r_0 + integral of I(v t')
    V = V_0 + integral of I(G R t'),  R = R_0 + integral of I(V t')                            # theory (102)

Their defects are the interpolation errors of g t', v t', G R t' and V t'.  These are explicit functions of
the polynomials, so they are bounded without any theory of the motion.  In the Bernstein ellipse of sum of
half-axes rho, |T_k| <= (rho^k + rho^-k) / 2 bounds r, v, R and V by their coefficients, and r . r and the
momentum from below; these bound g and G, and (98) gives the remainders.  The least over several rho is taken.

Errors grow in the norm max(w |r|, |v|), w^2 = max |G|, at most by exp(w times the window's duration), by
Gronwall's inequality.  The frame, and the integrals of `table`, are explicit functions of the same
polynomials.  Each window begins exactly in its first state; roundings are those of `table.build`.

Norms are Euclidean; those of matrices are bounded by the root of the sum of squares.
"""

import numpy as np

from closeform.arrays import Floats
from closeform.motion.chief.bernstein import chebyshev_at, chebyshev_of, integral_of, nodes
from closeform.motion.chief.table import CHECKS, LEBESGUE

ELLIPSES = np.concatenate([[1.0], np.geomspace(1.6, 5.0, 16)])  # sums of half-axes; the first is the window
DEGREES = np.arange(CHECKS + 2)
LARGEST = 0.5 * (ELLIPSES[:, None] ** DEGREES + ELLIPSES[:, None] ** -DEGREES)  # of T_k
SHARE = 4.0 * ELLIPSES**-CHECKS / np.where(ELLIPSES > 1.0, ELLIPSES - 1.0, np.nan)  # theory (98)
LOW = CHECKS // 2  # degree of the parts of polynomials whose products are again of degree 29


def integrals_of(rates: Floats, start: Floats) -> Floats:
    """Return coefficients (K, 31, ...) of `start` plus the integral of rates (K, 30, ...) at the nodes."""
    found = np.tensordot(integral_of(CHECKS), rates, (1, 1)).swapaxes(0, 1)
    found[:, 0] += start
    return np.asarray(found)


def largest(coefficients: Floats) -> Floats:
    """Return bounds (K, P) of the norm of polynomials (K, terms, ...) in each ellipse."""
    norms = np.sqrt((coefficients**2).sum(axis=tuple(range(2, coefficients.ndim))))
    return np.asarray(norms @ LARGEST[:, : norms.shape[1]].T)


def remainder(bounds: Floats) -> Floats:
    """Return the remainder (K,) of an interpolant of a function with these bounds (K, P) in the ellipses."""
    found = np.nan_to_num(SHARE * bounds, nan=np.inf, posinf=np.inf)
    return np.asarray(found.min(axis=1))


def halves(coefficients: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the low part of polynomials (K, 31, 3) at the nodes, and bounds (K, P) of it and of the rest."""
    low, high = coefficients.copy(), coefficients.copy()
    low[:, LOW + 1 :], high[:, : LOW + 1] = 0.0, 0.0
    return chebyshev_at(LOW, nodes(CHECKS)) @ low[:, : LOW + 1], largest(low), largest(high)


def around_mean(values: Floats, rest: Floats) -> tuple[Floats, Floats]:
    """Return the means (K, 1) of polynomials, and bounds (K, P) of their distance from these.

    They have these values (K, 30, C) at the nodes, plus at most `rest` (K, P).
    """
    found = np.tensordot(chebyshev_of(CHECKS), values, (1, 1)).swapaxes(0, 1)
    mean = np.sqrt((found[:, 0] ** 2).sum(axis=-1))[:, None]
    found[:, 0] = 0.0
    return mean, largest(found) + rest


def remainders(
    chief: Floats,
    starts: Floats,
    gradients: Floats,
    pulls: Floats,
    flow: Floats,
    skew: Floats,
    paces: tuple[Floats, Floats, Floats],
    body: tuple[float, float],
    left: tuple[float, float],
    found: Floats,
) -> tuple[Floats, Floats]:
    """Return bounds (K, 15) of the errors of interpolants of position, and (K, 9) of `returns`.

    At the nodes of all windows: states of the chief (K, 30, 6), which begin at `starts` (K, 6), `gradients`
    (K, 30, 3, 3) and `pulls` (K, 30, 3) of gravity, inertial matrices `flow` (K, 30, 6, 6), W (K, 3, 3) at
    the starts, and the table's matrices `found` (K, 30, 6, 6).  `paces`: dt/du at the nodes (K, 30), at most
    (K,), and in each ellipse (K, P).  `body`: strength and bulge.  `left`: the change of the chief, relative
    to its distance, and of `flow` in the last of Picard's iterations.
    """
    at_nodes, most, tall = paces
    strength, bulge = body
    passed, eye = at_nodes[..., None], np.eye(3)
    v = integrals_of(pulls * passed, starts[:, 3:])
    r = integrals_of(chief[..., 3:] * passed, starts[:, :3])
    moved = integrals_of((gradients @ flow[:, :, :3]) * passed[..., None], np.hstack([0.0 * eye, eye]))
    placed = integrals_of(flow[:, :, 3:] * passed[..., None], np.hstack([eye, 0.0 * eye]))
    # the chief in each ellipse: its distance and momentum from above and below
    far, fast = largest(r), largest(v)
    places, low_r, high_r = halves(r)
    speeds, low_v, high_v = halves(v)
    mean, swing = around_mean((places**2).sum(axis=-1)[..., None], (2.0 * low_r + high_r) * high_r)
    square = mean - swing
    mean, swing = around_mean(np.cross(places, speeds), far * high_v + high_r * low_v)
    turning, momentum = mean + swing, mean**2 - (2.0 * mean + swing) * swing
    valid = (square > 0.0) & (momentum > 0.0)
    square, momentum = np.where(valid, square, np.nan), np.where(valid, momentum, np.nan)
    stretch, part, force = far**2 / square, 1.5 * bulge / square, strength * square**-1.5
    pull = force * far * (1.0 + part * (3.0 + 5.0 * stretch))
    gradient = force * (1.0 + part * (3.0 + 5.0 * stretch) + stretch * (3.0 + part * (25.0 + 35.0 * stretch)))
    # in the window itself: |G| is 2 of a point mass, and its rate by r is 6 / r
    near, bulged = np.sqrt(square[:, 0]), part[:, 0]
    sharp = force[:, 0] * (2.0 + 70.0 * bulged)
    w = np.sqrt(sharp)
    growth, lost = np.exp(w * most), LEBESGUE * sharp * most * (1.0 + w * most)
    # the chief, and the variations (K, 2) by its state at the start
    off = remainder(fast * tall) + (remainder(pull * tall) + lost * left[0] * far[:, 0]) / w
    off *= growth
    twist = force[:, 0] / near * (6.0 + 200.0 * bulged) * off * most
    reach = np.stack([largest(placed[..., :3]), largest(placed[..., 3:])])  # (2, K, P)
    led = np.array([remainder(largest(moved[..., k : k + 3]) * tall) for k in (0, 3)])
    bent = np.array([remainder(gradient * one * tall) for one in reach])
    bent += twist * reach[..., 0] + lost * left[1]
    wrong = growth * (led + bent / w)
    # in the frame, which turns by the chief's error as well
    tilted = off / near + (far[:, 0] * w + fast[:, 0]) * off / np.sqrt(momentum[:, 0])
    outward, above = far / np.sqrt(square), turning / np.sqrt(momentum)
    axes = np.sqrt(outward**2 + above**2 + (outward * above) ** 2)
    spin = 0.5 * np.sqrt(0.5 * (skew**2).sum(axis=(1, 2)))
    wrong += tilted * reach[..., 0]
    wrong[0] += spin * wrong[1]
    reach[0] += spin[:, None] * reach[1]
    states = np.array([remainder(axes * one) for one in reach]) + wrong
    # integrals of Phi^-1 B (E Phi, 1): Phi^-1 B = (-Phi_rv, Phi_rr + Phi_rv W^T)^T by the symplectic form
    inverse = np.zeros((len(skew), 6, 6))
    inverse[:, :3, 3:], inverse[:, 3:, :3], inverse[:, 3:, 3:] = -eye, eye, skew
    back = np.linalg.inv(found)[..., 3:]
    missed = np.sqrt(((back - inverse[:, None] @ np.swapaxes(found[:, :, :3], 2, 3)) ** 2).sum(axis=(2, 3)))
    unit = np.ones((1, *reach.shape[1:]))
    sensed, unsure = np.concatenate([reach, unit]), np.concatenate([states, 0.0 * unit[..., 0]])  # (3, K)
    solved = np.hypot(reach[1], reach[0] + 2.0 * spin[:, None] * reach[1])
    doubt = np.hypot(states[1], states[0] + 2.0 * spin * states[1]) + LEBESGUE * missed.max(axis=1)
    frame = np.concatenate([np.broadcast_to(axes, reach.shape), unit])
    returns = np.array([remainder(axes * solved * tall * one) for one in sensed * frame])
    returns += most * (doubt * sensed[..., 0] + solved[:, 0] * unsure)
    rates = (back * passed[..., None]) @ np.concatenate(
        [found[:, :, :3], np.broadcast_to(eye, (*found.shape[:2], 3, 3))], axis=-1
    )
    gathered = integrals_of(rates, np.zeros((6, 9)))
    answers = np.empty((3, len(skew)))
    for k in range(3):
        top, bottom = (largest(gathered[:, :, rows, 3 * k : 3 * k + 3]) for rows in (slice(3), slice(3, 6)))
        answers[k] = remainder(axes * (reach[0] * top + reach[1] * bottom))
        answers[k] += states[0] * top[:, 0] + states[1] * bottom[:, 0] + np.hypot(*reach[..., 0]) * returns[k]
    return np.repeat(np.concatenate([states, answers]), 3, axis=0).T, np.repeat(returns, 3, axis=0).T
