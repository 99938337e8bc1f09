"""Tables of chiefs whose transition matrix is integrated or supplied by the user: J2, and any other dynamics.

The error of the polynomials is measured at 30 Chebyshev nodes of each window.  Between these it is bounded
as in `table`, by a remainder.  Of a J2 chief the remainder is proven (`oblate_bounds`).  Of a supplied
matrix, of which only values are known, it is *estimated*: twenty times the largest of the last Chebyshev
coefficients of degree 29, which decrease geometrically for analytic motion.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closeform.arrays import Floats
from closeform.motion.chief.bernstein import DEGREE, chebyshev_at, chebyshev_of, integral_to, nodes
from closeform.motion.chief.clock import angles_at
from closeform.motion.chief.oblate_bounds import ELLIPSES, remainders
from closeform.motion.chief.table import CHECKS, COLUMNS, Table, build
from closeform.motion.chief.yamanaka_ankersen import KeplerChief, joints_of

WANTED = (
    1e-11  # bound of the error of a column, relative to its largest entry, that sets the number of windows
)
LAST, ESTIMATED = 6, 20.0  # coefficients at the end of a series, and the factor from these to what follows
ROUNDS, CONVERGED = 40, 2e-15  # Picard's iterations of a window; a radian converges in twelve
FEWEST, MOST = 13, 512  # windows of a revolution at first, and of a period at most


def tails_of(values: Floats) -> Floats:
    """Return the estimated remainders (K, 6) of positions in matrices (K, CHECKS + 1, 6, 6) at the nodes."""
    series = np.tensordot(chebyshev_of(CHECKS)[-LAST:], values[:, :, :3], (1, 1))
    return np.asarray(ESTIMATED * np.abs(series).max(axis=(0, 2)))


def table_with(
    clock: Floats, joints: Floats, inner: Floats, ends: Floats, tails: tuple[Floats, Floats]
) -> Table:
    """Return the table of matrices at the nodes (K, CHECKS + 1, 6, 6) and at the ends (K, 6, 6)."""
    low = chebyshev_at(CHECKS, nodes(DEGREE)) @ chebyshev_of(CHECKS)
    first = np.tensordot(low, inner, (1, 1)).swapaxes(0, 1)
    values = np.concatenate([first, ends[:, None], inner], axis=1)
    return build(clock, joints, 0.0, lambda u: (values, np.abs(values).max(axis=1)), *tails)


def estimated(clock: Floats, joints: Floats, inner: Floats, ends: Floats) -> tuple[Floats, Floats]:
    """Return estimates of the remainders of a table (K, 15), and of its `returns` (K, 9)."""
    tails = np.zeros((len(inner), COLUMNS))
    tails[:, :6] = tails_of(inner)
    reach = (np.diff(joints) * (1.0 + clock[1]))[:, None]
    tails[:, 6:] = (
        reach * tails[:, :6].max(axis=1, keepdims=True) * np.abs(inner).max(axis=(1, 2, 3))[:, None]
    )
    return tails, tails[:, 6:] * np.abs(np.linalg.inv(ends)).max(axis=(1, 2))[:, None]


def accurate(table: Table, wanted: float) -> bool:
    """Return True if no error of a table exceeds `wanted` relative to its column."""
    size = np.maximum(1.0, np.abs(table.rows[:, :, :3]).max(axis=(2, 3)))
    return bool((table.errors / size).max() <= wanted)


@dataclass(frozen=True)
class OblateChief:
    """Chief about an oblate body: its state at time 0 is given in a frame whose third axis is the pole.

    `state` (6,) [m, m/s], `mu` [m^3/s^2], `j2` and `radius` [m] of the body, `span` of times [s] from 0
    onward, and the chief on the ellipse that osculates at time 0, whose clock the table has.
    """

    state: tuple[float, ...]
    mu: float
    j2: float
    radius: float
    span: tuple[float, float]
    osculating: KeplerChief

    def __str__(self) -> str:
        return f"a J2-perturbed chief (e = {self.osculating.eccentricity:.3g})"

    @property
    def period(self) -> float:
        """Duration of one revolution of the osculating ellipse [s]."""
        return self.osculating.period

    @cached_property
    def table(self) -> Table:
        """Table over the span."""
        e, count = self.osculating.eccentricity, max(len(self.osculating.table.joints), FEWEST)
        clock = self.osculating.table.clock
        first, last = angles_at(clock, np.array(self.span))
        end = min(last, first + 2.0 * np.pi)  # a revolution shows how many windows are needed
        while True:
            made = self._with(clock, joints_of(e, count, first, end))
            if not (accurate(made, WANTED) or count > MOST):
                count += 1 + count // 8
            elif end == last:
                return made
            else:
                end = last

    def _with(self, clock: Floats, joints: Floats) -> Table:
        """Return the table with given joints."""
        unit = np.array([1.0] * 3 + [clock[0]] * 3)  # lengths in m, times in 1/n
        strength, bulge = self.mu / clock[0] ** 2, self.j2 * self.radius**2
        points = (*nodes(CHECKS), 1.0)
        integrals = integral_to(CHECKS, points)
        lengths = np.diff(joints)
        passed = lengths[:, None] * (
            1.0 - clock[1] * np.cos(joints[:-1, None] + lengths[:, None] * nodes(CHECKS))
        )
        chief = np.empty((len(lengths), len(points), 6))
        state = np.array(self.state) / unit
        changed = 0.0
        for k in range(len(lengths)):
            chief[k], change = _window(state, integrals * passed[k], strength, bulge)
            state, changed = chief[k, -1], max(changed, change)
        gradients = gradient(chief[:, :-1, :3], strength, bulge)
        flow, left = _variations(gradients, integrals * passed[:, None, :])
        to_frame, _ = frames(chief, strength, bulge)
        starts = np.concatenate([np.array(self.state)[None] / unit, chief[:-1, -1]])
        begin = frames(starts[:, None], strength, bulge)[1]
        values = to_frame @ flow @ begin
        motion = chief[:, :-1], starts, gradients, gravity(chief[:, :-1, :3], strength, bulge), flow[:, :-1]
        tails = remainders(
            *motion,
            _skew(starts, strength, bulge),
            _paces(clock[1], joints, passed),
            (strength, bulge),
            (changed, left),
            values[:, :-1],
        )
        return table_with(clock, joints, values[:, :-1], values[:, -1], tails)


def _skew(starts: Floats, strength: float, bulge: float) -> Floats:
    """Return W (K, 3, 3), twice the cross product with the frame's rate, in states (K, 6)."""
    there, _ = frames(starts, strength, bulge)
    return np.asarray(-2.0 * there[:, 3:, :3] @ np.swapaxes(there[:, :3, :3], 1, 2))


def _paces(e: float, joints: Floats, passed: Floats) -> tuple[Floats, Floats, Floats]:
    """Return dt/du of windows: at the nodes (K, 30), at most (K,), and in each ellipse (K, P)."""
    lengths, turns = np.diff(joints), np.floor((joints - np.pi) / (2.0 * np.pi))
    ends = np.cos(joints)
    slow = np.where(np.diff(turns) > 0.0, -1.0, np.minimum(ends[1:], ends[:-1]))
    tall = 0.25 * lengths[:, None] * (ELLIPSES - 1.0 / ELLIPSES)
    return passed, lengths * (1.0 - e * slow), lengths[:, None] * (1.0 + e * np.cosh(tall))


def _variations(gradients: Floats, integrals: Floats) -> tuple[Floats, float]:
    """Return inertial transition matrices (K, Q + 1, 6, 6) at the points of all windows.

    Picard's iteration, with gradients of gravity (K, Q, 3, 3) and `integrals` (K, Q + 1, Q) over time; also
    returns the last change of a position.
    """
    count, points = integrals.shape[:2]
    flow = np.broadcast_to(np.eye(6), (count, points, 6, 6)).copy()
    converged = False  # one more round then leaves rounding alone
    for _ in range(ROUNDS):
        before = flow[:, :, :3].copy()
        rates = gradients @ flow[:, :-1, :3]
        flow[:, :, 3:] = (integrals @ rates.reshape(count, -1, 18)).reshape(count, points, 3, 6)
        flow[:, :, 3:, 3:] += np.eye(3)
        flow[:, :, :3] = (integrals @ flow[:, :-1, 3:].reshape(count, -1, 18)).reshape(count, points, 3, 6)
        flow[:, :, :3, :3] += np.eye(3)
        left = float(np.abs(flow[:, :, :3] - before).max())
        if converged:
            break
        converged = left <= CONVERGED
    return flow, left


def _window(state: Floats, integrals: Floats, strength: float, bulge: float) -> tuple[Floats, float]:
    """Return the chief's states (Q + 1, 6) at the points of a window, by Picard's iteration.

    Also returns the last change of a coordinate, relative to the largest.
    """
    out = np.tile(state, (len(integrals), 1))
    converged = False
    for _ in range(ROUNDS):
        before = out[:, :3].copy()
        out[:, 3:] = state[3:] + integrals @ gravity(out[:-1, :3], strength, bulge)
        out[:, :3] = state[:3] + integrals @ out[:-1, 3:]
        left = float(np.abs(out[:, :3] - before).max() / np.abs(state[:3]).max())
        if converged:
            break
        converged = left <= CONVERGED
    return out, left


def gravity(places: Floats, strength: float, bulge: float) -> Floats:
    """Return the acceleration (..., 3) of a point mass and J2, `bulge` being J2 times the radius squared."""
    square = (places * places).sum(axis=-1, keepdims=True)
    height = places[..., 2:] ** 2 / square
    part = 1.5 * bulge / square
    out = -strength * places * square**-1.5 * (1.0 + part * (1.0 - 5.0 * height))
    out[..., 2:] -= strength * places[..., 2:] * square**-1.5 * 2.0 * part
    return np.asarray(out)


def gradient(places: Floats, strength: float, bulge: float) -> Floats:
    """Return the gradient (..., 3, 3) of `gravity`."""
    square = (places * places).sum(axis=-1)[..., None, None]
    z = places[..., 2][..., None, None]
    pole = np.array([0.0, 0.0, 1.0])
    outer = places[..., :, None] * places[..., None, :]
    mixed = pole[:, None] * places[..., None, :] + places[..., :, None] * pole
    height, part, unit = z * z / square, 1.5 * bulge / square, np.eye(3)
    # of -s r q^(-3/2) (1 + c/q - 5 c z^2/q^2) - 2 s c z e_z q^(-5/2), with q = r^2 and c = 3/2 bulge
    force = unit * (1.0 + part * (1.0 - 5.0 * height)) + np.diag(pole) * 2.0 * part
    force = force - outer / square * (3.0 + part * (5.0 - 35.0 * height)) - 10.0 * part * z / square * mixed
    return np.asarray(-strength * square**-1.5 * force)


def frames(chief: Floats, strength: float, bulge: float) -> tuple[Floats, Floats]:
    """Return the matrices (..., 6, 6) from inertial differences to the chief's turning frame, and back."""
    place, speed = chief[..., :3], chief[..., 3:]
    momentum = np.cross(place, speed)
    r, h = (np.linalg.norm(v, axis=-1)[..., None] for v in (place, momentum))
    x, z = place / r, momentum / h
    axes = np.stack([x, np.cross(z, x), z], axis=-2)
    across = (gravity(place, strength, bulge) * z).sum(axis=-1, keepdims=True)
    turn, spin = (r * across / h)[..., 0], (h / (r * r))[..., 0]  # about x and z, in the frame
    cross = np.zeros((*turn.shape, 3, 3))
    cross[..., 0, 1], cross[..., 1, 0] = -spin, spin
    cross[..., 1, 2], cross[..., 2, 1] = -turn, turn
    there, back = np.zeros((*turn.shape, 6, 6)), np.zeros((*turn.shape, 6, 6))
    inverse = np.swapaxes(axes, -1, -2)
    there[..., :3, :3] = there[..., 3:, 3:] = axes
    there[..., 3:, :3] = -cross @ axes
    back[..., :3, :3] = back[..., 3:, 3:] = inverse
    back[..., 3:, :3] = inverse @ cross
    return there, back


@dataclass(frozen=True, eq=False)
class GivenChief:
    """Chief whose transition matrix is supplied: `transition(start, times)` returns (T, 6, 6) in SI.

    It is accurate to `error`, relative to its largest entry, over `span` [s]; `period` [s] is a time scale.
    """

    transition: Callable[[float, Floats], Floats]
    period: float
    span: tuple[float, float]
    error: float

    def __str__(self) -> str:
        return "an orbit of a supplied transition matrix"

    @cached_property
    def table(self) -> Table:
        """Table over the span."""
        clock = np.array([2.0 * np.pi / self.period, 0.0, 0.0])
        first, last = clock[0] * np.array(self.span)
        count = max(1, int(np.ceil(8.0 * (last - first) / (2.0 * np.pi))))
        while True:
            joints = np.linspace(first, last, count + 1)
            points = np.append(nodes(CHECKS), 1.0)
            values = np.array(
                [
                    self._values(clock[0], a, a + points * (b - a))
                    for a, b in zip(joints, joints[1:], strict=False)
                ]
            )
            given = clock, joints, values[:, :-1], values[:, -1]
            made = table_with(*given, estimated(*given))
            if accurate(made, max(WANTED, 20.0 * self.error)) or count > MOST * (last - first) / (
                2.0 * np.pi
            ):
                break
            count *= 2
        if not accurate(made, max(1e-8, 100.0 * self.error)):
            raise ValueError(
                "transition: is not smooth to its stated error between times of the span; state a larger "
                "`error`, or supply a smooth matrix"
            )
        self._check(values)
        size = self.error * np.abs(made.rows[:, :, :3]).max(axis=(2, 3))
        return made._replace(errors=made.errors + size)

    def _values(self, rate: float, begin: float, angles: Floats) -> Floats:
        """Return the matrices from one angle to others, times in 1/n."""
        unit = np.array([1.0] * 3 + [rate] * 3)
        given = np.asarray(self.transition(begin / rate, angles / rate), dtype=float)
        if given.shape != (len(angles), 6, 6) or not np.isfinite(given).all():
            raise ValueError(
                f"transition: must return finite matrices of shape ({len(angles)}, 6, 6) for as many times, "
                f"got shape {given.shape}"
            )
        return np.asarray(given * unit / unit[:, None])

    def _check(self, values: Floats) -> None:
        """Raise ValueError unless matrices (K, Q, 6, 6) are symplectic, as in any gravity field.

        In a turning frame the momentum is v + w x r, so the form is [[W, 1], [-1, 0]] with a skew W that may
        change with time.  The block of velocities gives it, and the mixed block must then be the unit matrix.
        """
        last = values[:, -1]
        a, b, c, d = last[:, :3, :3], last[:, :3, 3:], last[:, 3:, :3], last[:, 3:, 3:]
        inverse = np.linalg.inv(b)
        skew = d @ inverse
        skew = np.swapaxes(skew, 1, 2) - skew
        back = np.swapaxes(a, 1, 2)
        mixed = back @ skew @ b + back @ d - np.swapaxes(c, 1, 2) @ b
        off = np.abs(mixed - np.eye(3)).max()
        allowed = (1e-9 + 10.0 * self.error) * np.abs(last).max() ** 2 * np.abs(inverse).max()
        if off > allowed:
            raise ValueError(
                f"transition: is not symplectic: it deviates by {off:.2g}, and {allowed:.2g} is allowed, "
                "so optimal thrust cannot be derived from it; supply motion in a gravity field, without drag"
            )
