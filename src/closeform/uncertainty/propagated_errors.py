"""Propagation of a craft's uncertainty to the end of its path, where the next path begins."""

from __future__ import annotations

from closeform.motion.path import Path
from closeform.uncertainty.errors import Uncertainty
from closeform.uncertainty.spread import spread_to_ends


def carried(errors: Uncertainty, path: Path) -> Uncertainty:
    """Return the uncertainty at the end of a path, whose state covariance includes all errors up to there.

    They include the errors of burns, impulses and noise up to that time; execution errors of later burns are
    unchanged. Roots are propagated, so that directions keep their digits.  # theory (51)
    """
    _, roots = spread_to_ends(path, [errors])
    return errors._with_root(roots[0])
