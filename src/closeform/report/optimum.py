"""Optimality of a plan: the proof or the gap to the lower bound, and the shadow prices of clearance."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from closeform.planning.plan import UNITS, Avoidance, Contact, Plan
from closeform.report.table import PAIR, Column, Table, counted
from closeform.scenario.stages import Clearing

KEYS = {  # keys of the slopes of a cost, per metre and per scale factor of a zone
    "energy": ("per_metre_m_s3", "per_factor_m2_s3"),
    "delta-v": ("per_metre_1_s", "per_factor_m_s"),
}
NOTHING = 1e-9  # m/s: rounding error of a plan without burns
SAME = 1e-6  # share of the cost: a bound that does not improve on free paths
WIDE = 1e-3  # a gap that `prove` may reduce
NO_ZONES, DUAL = "without zones in the way", "by duality"
TOUCHING = 1.0 + 2e-5  # a clearance ratio up to this covers rounding only


def best(found: Avoidance | Plan, fired: bool, limited: bool) -> str:
    """Return how optimal the plan is; `fired` by thrusters, or `limited` in thrust, which costs more."""
    if not found.proven:
        return f"best of {counted(found.tried, 'candidate')}"
    whose = "for these ends and times"
    if found.cost == "delta-v" and (fired or limited):
        whose = "of these thrusters" if fired else f"within the limit, {whose}"
    told = f"proven minimum {found.cost} {whose}"
    return f"{told}: natural motion arrives" if float(found.delta_v) < NOTHING else told


def bounds(found: Avoidance | Plan, whose: str, free: float, stage: Clearing, fired: bool) -> Iterator[str]:
    """Yield the optimality gap, and whether the plan was made for larger zones.

    `whose`: the owner of the cost; `free`: the cost without zones, in the unit of the stage's cost;
    `fired`: executed by thrusters, for which a plan of minimum delta-v is made.
    """
    share = f"at most {100 * found.gap:.3f} %, " if found.lower_bound > 0.0 else ""
    bound = f"{share}lower bound {found.lower_bound:.6g} {UNITS[found.cost]}"
    bound += " for these thrusters" * (fired and found.cost == "delta-v")
    told = f"Optimality gap{whose}: {bound}"
    if found.proven:
        yield told
    else:
        nothing = abs(found.lower_bound - free) <= SAME * found.spent
        yield f"{told}, {NO_ZONES if nothing else DUAL}"
        closer = found.gap > WIDE and stage.prove is None and stage.unprovable is None
        if closer:
            yield 'Set prove = "10 s" in the stage to tighten the gap'
    if found.clearance_ratio > TOUCHING:
        larger = 100.0 * (found.clearance_ratio - 1.0)
        yield f"Planned for zones {larger:.2g} % larger: none was clear closer to them"


def padded(found: Avoidance | Plan) -> str:
    """Return "padded " if a plan was made for zones with a margin, else an empty text."""
    return "padded " if np.max(found.padding) > 0.0 else ""


def meets(found: Avoidance | Plan) -> str:
    """Return the verb for contacts of a plan: "touches", or "is held off" if failures are considered."""
    return "is held off" if any(adrift(at) for at in found.contacts) else "touches"


def adrift(at: Contact) -> str:
    """Return the time of thrust loss of a contact in words; empty for a contact without a loss."""
    return f" (thrust lost at {at.failed_at:.1f} s)" if at.failed_at == at.failed_at else ""


def clearance(found: Avoidance | Plan, names: Sequence[str], order: Sequence[str]) -> Iterator[str]:
    """Yield the shadow price of clearance, and the pair with the largest share of it."""
    if not found.prices:
        return
    share = f" ({100.0 * found.price / found.spent:+.3g} %)" if found.spent > 0.0 else ""
    (one, other), dearest, _ = prices(found, names, order).rows[0]
    most = f", {100.0 * dearest / found.price:.3g} % of it {one} - {other}" if len(found.prices) > 1 else ""
    price = f"{found.price:.4g} {UNITS[found.cost]}{share}{most}"
    yield f"Shadow price: one metre more clearance costs about {price}"
    if found.sigmas:
        more = sum(one.per_sigma for one in found.prices)
        yield f"Planned clear at {found.sigmas:g} sigma; one more costs about {more:.4g} {UNITS[found.cost]}"


def prices(found: Avoidance | Plan, names: Sequence[str], order: Sequence[str]) -> Table:
    """Return the shadow prices by pair; the plan indexes `names`, and `order` sorts the names of a pair."""
    unit, (metre, factor) = UNITS[found.cost], KEYS[found.cost]
    columns = (
        PAIR,
        Column(f"a metre more [{unit}]", metre, "{:#.4g}".format),
        Column(f"a zone 1 % larger [{unit}]", factor, "{:#.4g}".format, 0.01),
    )
    rows = [
        (
            tuple(sorted((names[one.first], names[one.second]), key=order.index)),
            one.per_metre,
            one.per_factor,
        )
        for one in found.prices
    ]
    return Table("Shadow prices of clearance", columns, rows, folded=True)


def figures(found: Avoidance | Plan, names: Sequence[str], order: Sequence[str]) -> dict[str, Any]:
    """Return the optimality of a plan for `summary.json`."""
    return {
        "ok": found.ok,
        "status": str(found.status),
        "reason": found.reason,
        "cost": found.cost,
        "lower_bound_m2_s3": found.lower_bound if found.cost == "energy" else None,
        "lower_bound_m_s": found.lower_bound if found.cost == "delta-v" else None,
        "gap": found.gap,
        "proven": found.proven,
        "clearance_ratio": found.clearance_ratio,
        "tried": found.tried,
        "clearance": prices(found, names, order).records if found.priced else None,
        f"clearance_{KEYS[found.cost][0]}": found.price if found.priced else None,
    }
