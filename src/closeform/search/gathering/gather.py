"""Functions that gather lost craft: one gathering or many, also with burn errors and losses of thrust."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.motion.arc import END, IMPULSE, START, WIDTH
from closeform.motion.joining import linked, stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.search.gathering.burn_errors import BurnErrors
from closeform.search.gathering.craft_state import KNOWN_LOCK, LOCK
from closeform.search.gathering.event_simulation import (
    CORRECTIONS,
    END_LEG,
    END_TIME,
    KNOWN,
    LEFT,
    MISPLACED,
    NEAR_FIELD,
    RESIDUAL,
    RESULT,
    TOTAL,
    UNKNOWN,
)
from closeform.search.gathering.join_rule import LOST
from closeform.search.gathering.problem import (
    CHOICES,
    Burns,
    GatheringProblem,
    Groups,
    ahead,
    gathering_problem,
    groups_by_bearing,
    initial_states,
    random_fixes,
)
from closeform.search.gathering.result import (
    Event,
    EventKind,
    Gathering,
    Gatherings,
    GatherStatus,
    reason_incomplete,
)
from closeform.search.lock_march import in_parts
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors, errors_of_cases
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones

KINDS = tuple(EventKind)  # in the order of the kernel's codes
EACH_CALL = 1024  # gatherings in one call of the kernel
ROOM = 8  # events of each craft for which memory is reserved at first


def gather(
    search: Search,
    positions: ArrayLike,
    velocities: ArrayLike,
    groups: Groups = "alternating",
    *,
    keep_out: OwnZone | Sequence[OwnZone | None] | PairZones | None = None,
    rounds: int = 2,
    burns: Burns = "least",
    max_speed: float | None = None,
    errors: SearchErrors | None = None,
    step: float | None = None,
    seed: int = 0,
    case: int = 0,
) -> Gathering:
    """Simulate a gathering: lost craft search, lock and join until one formation set holds them all.

    The first pair to lock begins the formation set. Craft that join it null their velocity relative to it.
    Knowledge sets coast until they meet it, except for corrections against collisions.

    Parameters
    ----------
    search : Search
        The schedule of all craft.
    positions : array_like of shape (N, 3) [m]
        Positions at the start of the search, in the inertial frame, in deep space.
    velocities : array_like of shape (N, 3) [m/s]
        Velocities in the inertial frame.
    groups : "alternating", "balanced", "bearing" or sequence of "A" or "B", default "alternating"
        A, B, A, ...; the first half A (H03's 3:2); B for the half in front, which hemisphere antennas can
        determine (docs/lost_craft.md); or one for each craft.
    keep_out : Zone, CovarianceZone, Body, sequence of these or None, or PairZones, optional
        One zone for all or one for each craft, as in `screen`, but a Sphere, Ellipsoid or Box. Craft of a
        set that would enter it before the end of the search make a correction.
    rounds : int, default 2
        Maximum number of searches. A burn voids S04's guarantee for the pairs of that craft.
    burns : "least", "first", "second" or "half", default "least"
        Craft of the first pair that burns: the first, the second (the lower index keeps its velocity), both
        by half, or the choice that leaves the fewest craft and among those takes the minimum total delta-v.
    max_speed : float [m/s], optional
        Bound on the relative speeds. Each round then ends with the near-field search: all wait for
        near_field / max_speed, lost craft burn twice `max_speed` against their boresight, and all wait as
        long again.
    errors : SearchErrors, optional
        Search errors of the craft, (N,) or common to all, for the whole gathering. Each craft turns, and
        burns in the near-field search, by its own clock.
    step : float [s], optional
        Detect locks only at multiples of this time, as a processor does (H03: 1 s). Default: at any time.
    seed, case : int, default 0
        Seed and case of the random measurement errors, if the sensor has any.

    Returns
    -------
    Gathering
        The outcome, also if some craft are still lost; see its `status`.

    Raises
    ------
    ValueError
        If there are fewer than two craft, a group is empty, two craft are at the same position, shapes do
        not match, a number is not finite, `keep_out` has another shape or no zone for a pair, `burns`,
        `rounds`, `max_speed` or `step` is out of range, or `errors` do not match or leave no cone.

    Notes
    -----
    Simultaneous locks are processed in the order of the craft in A, then in B. If two choices of burns cost
    the same, the lower index keeps its velocity.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) section IV, the near-field search section III.C; docs/lost_craft.md.
    """
    where, speeds = initial_states(positions, velocities, 2)
    options = keep_out, rounds, burns, max_speed, errors, step, seed, case
    problem = gathering_problem(search, _assigned(groups, where), where.shape[:2], *options)
    results = problem.simulate(where, speeds, list(CHOICES))[2]
    totals = dict(zip(CHOICES, results[0, :, TOTAL].tolist(), strict=True))
    best = [*CHOICES][best_choice(results)[0]] if burns == "least" else burns
    simulated = problem.simulate(where, speeds, [best], room=ROOM * where.shape[1])
    return gathering(problem, where[0], speeds[0], best, totals, *simulated)


def gather_cases(
    search: Search,
    positions: ArrayLike,
    velocities: ArrayLike,
    groups: Groups = "alternating",
    *,
    keep_out: OwnZone | Sequence[OwnZone | None] | PairZones | None = None,
    rounds: int = 2,
    burns: Burns = "least",
    max_speed: float | None = None,
    errors: SearchErrors | None = None,
    step: float | None = None,
    seed: int = 0,
    case: int = 0,
) -> Gatherings:
    """Simulate many gatherings on all cores, as `gather` does, without paths and events.

    Parameters
    ----------
    search : Search
        The schedule of all craft.
    positions : array_like of shape (C, N, 3) [m]
        Positions of each case at the start of the search, in the inertial frame, in deep space.
    velocities : array_like of shape (C, N, 3) [m/s]
        Velocities in the inertial frame.
    groups : "alternating", "balanced", "bearing" or sequence of "A" or "B", default "alternating"
        As in `gather`; "bearing" gives each case its own.
    keep_out : Zone, CovarianceZone, Body, sequence of these or None, or PairZones, optional
        As in `gather`.
    rounds : int, default 2
        As in `gather`.
    burns : "least", "first", "second" or "half", default "least"
        As in `gather`.
    max_speed : float [m/s], optional
        As in `gather`.
    errors : SearchErrors, optional
        Search errors of the craft of each case, (C, N), or (N,) for all cases.
    step : float [s], optional
        As in `gather`.
    seed, case : int, default 0
        Seed of the random measurement errors, and number of the first case.

    Returns
    -------
    Gatherings
        The outcomes as arrays of C cases.

    Raises
    ------
    ValueError
        As `gather`, and if there are no cases. The message names the case of two craft at the same position.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) section IV; docs/lost_craft.md.
    """
    return gather_cases_with_losses(
        *(search, positions, velocities, None),
        groups=groups,
        keep_out=keep_out,
        rounds=rounds,
        burns=burns,
        max_speed=max_speed,
        errors=errors,
        step=step,
        seed=seed,
        case=case,
    )[0]


def gather_with_burn_errors(
    planned: Gathering,
    search: Search,
    positions: ArrayLike,
    velocities: ArrayLike,
    burn_errors: BurnErrors,
    *,
    groups: Groups,
    **arguments: Any,
) -> Gathering:
    """Return the outcome of a gathering as `planned`, with the errors (1, N) of its burns.

    `arguments`: the remaining arguments of the plan. The first pair burns as planned, and `totals` are those
    of the plan, because the errors are not known in advance.
    """
    where, speeds = initial_states(positions, velocities, 2)
    problem = gathering_problem(search, _assigned(groups, where), where.shape[:2], **arguments)
    best, room = planned.burns, ROOM * where.shape[1]
    simulated = problem.simulate(where, speeds, [best], burn_errors=burn_errors, room=room)
    return gathering(problem, where[0], speeds[0], best, planned.totals, *simulated)


def gather_cases_with_losses(
    search: Search,
    positions: ArrayLike,
    velocities: ArrayLike,
    shares: Floats | None,
    *,
    groups: Groups,
    errors: SearchErrors | None,
    seed: int = 0,
    case: int = 0,
    **arguments: Any,
) -> tuple[Gatherings, Floats]:
    """Return gatherings as `gather_cases` does, with losses of thrust, and the times of these (C, N) [s].

    `shares` (C, N): fractions of the duration without failures, nan for a craft that does not fail. Times are
    nan for such craft and after the end of the case.
    """
    where, speeds = initial_states(positions, velocities, 3)
    fixes, shape = random_fixes(search, where.shape[:2], seed, case), where.shape[:2]
    shares = np.full(shape, np.nan) if shares is None else shares

    def outcomes(own: Groups, some: Any) -> tuple[GatheringProblem, Floats, Floats]:
        wrong = errors_of_cases(errors, shape, some)
        problem = gathering_problem(
            search, own, where[some].shape[:2], errors=wrong, fixes=fixes[some], **arguments
        )
        return problem, *_with_losses(problem, where[some], speeds[some], arguments["burns"], shares[some])

    if not (isinstance(groups, str) and groups == "bearing"):
        problem, results, losses = outcomes(groups, slice(None))
        return gatherings(problem, results), losses
    _, which = np.unique(ahead(where), axis=0, return_inverse=True)
    order = np.argsort(which.ravel(), kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(which.ravel()))[:-1])
    found = [outcomes(groups_by_bearing(where[some[0]]), some) for some in parts]
    back = np.argsort(order)
    results, losses = (np.concatenate([one[k] for one in found])[back] for k in (1, 2))
    return gatherings(found[0][0], results), losses


def _with_losses(
    problem: GatheringProblem, where: Floats, speeds: Floats, burns: Burns, shares: Floats
) -> tuple[Floats, Floats]:
    """Return the results of gatherings (C, ...) and the times at which craft (C, N) lose their thrust [s]."""
    results, choices = simulate_best(problem, where, speeds, burns)
    losses = shares * results[:, END_TIME, None]
    (failing,) = np.nonzero(~np.isnan(losses).all(axis=1))

    def part(some: slice) -> None:
        which = failing[some]
        errors = BurnErrors.of_losses(np.nan_to_num(losses[which], nan=inf))
        each = problem.simulate(where[which], speeds[which], list(CHOICES), which, errors)[2]
        results[which] = each[np.arange(len(which)), choices[which]]

    in_parts(part, len(failing), EACH_CALL)
    return results, np.where(losses <= results[:, END_TIME, None], losses, np.nan)


def _assigned(groups: Groups, where: Floats) -> Groups:
    """Return the groups of one gathering at positions (1, N, 3); those by bearings become letters."""
    return groups_by_bearing(where[0]) if isinstance(groups, str) and groups == "bearing" else groups


def simulate_best(
    problem: GatheringProblem, positions: Floats, velocities: Floats, burns: Burns
) -> tuple[Floats, Any]:
    """Return the results (C, ...) of gatherings with their choice of burns, and its index (C,) in CHOICES."""
    choices = list(CHOICES) if burns == "least" else [burns]
    places = [[*CHOICES].index(choice) for choice in choices]

    def part(some: slice) -> tuple[Floats, Any]:
        each = problem.simulate(positions[some], velocities[some], choices, some)[2]
        which = best_choice(each)
        return each[np.arange(len(each)), which], np.take(places, which)

    results, which = zip(*in_parts(part, len(positions), EACH_CALL), strict=True)
    return np.concatenate(results), np.concatenate(which)


def gatherings(problem: GatheringProblem, results: Floats) -> Gatherings:
    """Return the kernel's results of gatherings (C,) as an object."""
    duration, count = results[:, END_TIME], len(problem.groups)
    return Gatherings(
        problem.search,
        duration,
        results[:, END_LEG].astype(np.int64),
        problem.rounds_begun(duration),
        results[:, LEFT].astype(np.int64),
        results[:, TOTAL],
        results[:, CORRECTIONS],
        results[:, NEAR_FIELD],
        results[:, RESULT : RESULT + count],
        results[:, UNKNOWN].astype(np.int64),
        results[:, KNOWN].astype(np.int64),
        results[:, RESULT + count : RESULT + 2 * count].sum(axis=1).astype(np.int64),
        results[:, RESIDUAL],
        results[:, MISPLACED],
    )


def best_choice(results: Floats) -> Any:
    """Return the best of the choices (C,) in results (C, choices, ...): fewest craft left, minimum delta-v.

    Of equal choices, it is the first.
    """
    spent, left = results[..., TOTAL], results[..., LEFT]
    tied = np.abs(spent - spent[:, :1]) <= 1e-12 * spent[:, :1]  # the same burns, added up in another order
    spent = np.where(tied, spent[:, :1], spent)
    return np.argmin(np.where(left == left.min(axis=1, keepdims=True), spent, inf), axis=1)


def gathering(
    problem: GatheringProblem,
    positions: Floats,
    velocities: Floats,
    choice: str,
    totals: dict[str, float],
    events: Floats,
    labels: Any,
    results: Floats,
) -> Gathering:
    """Return the kernel's results of one gathering as an object."""
    duration = float(results[0, 0, END_TIME])
    sets = [np.flatnonzero(labels == k) for k in np.unique(labels[labels != LOST])]
    members = tuple(tuple(map(int, some)) for some in sets)
    lost = tuple(map(int, np.flatnonzero(labels == LOST)))
    done = results[0, 0, LEFT] == 0
    delta_v, failed, estimates = np.split(results[0, 0, RESULT:], [len(positions), 2 * len(positions)])
    adrift = tuple(np.flatnonzero(failed).tolist())
    ended = GatherStatus.ADRIFT if adrift else GatherStatus.GATHERED
    known = events[:, 1] == KNOWN_LOCK
    repeated, events = events[known], events[~known]
    burned = events[events[:, 1] != LOCK]
    begun = int(problem.rounds_begun(duration))
    return Gathering(
        problem.search,
        problem.groups,
        _paths(positions, velocities, burned, duration),
        tuple(_event(problem.search, row) for row in events),
        tuple(_event(problem.search, row) for row in repeated),
        delta_v,
        totals,
        choice,
        members,
        lost,
        duration,
        begun,
        ended if done else GatherStatus.INCOMPLETE,
        reason_incomplete(members, lost, begun, adrift=adrift) or None,
        problem.keep_out,
        errors_of_cases(problem.errors, (1, len(problem.groups)), 0),
        adrift,
        estimates.reshape(-1, 6),
    )


def _event(search: Search, row: Floats) -> Event:
    """Return an event from its row."""
    kind, first, second, leg, case, label = map(int, row[1:7])
    there = search.legs[leg]
    kind = LOCK if kind == KNOWN_LOCK else kind
    return Event(
        float(row[0]), KINDS[kind], first, second, there.phase, there.round, case, label, row[7:].copy()
    )


def _paths(positions: Floats, velocities: Floats, burned: Floats, duration: float) -> Path:
    """Return paths of straight lines with burns as impulses; simultaneous burns are combined."""
    orbit, found = Orbit(0.0), []
    for k, state in enumerate(np.hstack([positions, velocities])):
        own = burned[burned[:, 2] == k]
        times = np.unique(np.concatenate([[0.0], own[:, 0]]))
        arcs = np.zeros((len(times), WIDTH))
        arcs[:, START], arcs[:, END] = times, np.append(times[1:], duration)
        np.add.at(arcs[:, IMPULSE : IMPULSE + 3], np.searchsorted(times, own[:, 0]), own[:, 7:])
        found.append(linked(orbit, arcs, state))
    return stack(found)
