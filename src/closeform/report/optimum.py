"""How good a plan is, for one craft or for many: proven, or how far above the bound, and for which zones."""

from collections.abc import Iterator
from typing import Any

from closeform.planning.plan import Avoidance, Plan
from closeform.report.table import counted

UNITS = {"energy": "m²/s³", "delta-v": "m/s"}
TOUCHING = 1.0 + 1e-6  # a margin up to this is for rounding only


def best(found: Avoidance | Plan) -> str:
    """Whether it is the best there is."""
    return (
        f"proven the least {found.cost} for these ends and times"
        if found.proven
        else f"best of {counted(found.tried, 'candidate')}"
    )


def bounds(found: Avoidance | Plan) -> Iterator[str]:
    """What a better plan could save at most, and whether it was made for larger zones."""
    share = f"{100 * found.gap:.3f} % " if found.lower_bound > 0.0 else ""
    above, unit = f"{share}above the lower bound of", UNITS[found.cost]
    yield f"{found.cost.capitalize()} {above} {found.lower_bound:.6g} {unit}"
    if found.margin > TOUCHING:
        yield f"Planned for zones {100 * (found.margin - 1.0):.2g} % larger: none was clear closer to them"


def figures(found: Avoidance | Plan) -> dict[str, Any]:
    """The same for `summary.json`."""
    return {
        "ok": found.ok,
        "status": str(found.status),
        "reason": found.reason,
        "cost": found.cost,
        "lower_bound_m2_s3": found.lower_bound if found.cost == "energy" else None,
        "lower_bound_m_s": found.lower_bound if found.cost == "delta-v" else None,
        "gap": found.gap,
        "proven": found.proven,
        "margin": found.margin,
        "tried": found.tried,
    }
