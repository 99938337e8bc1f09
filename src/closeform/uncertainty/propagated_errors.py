"""Errors carried on: those of a craft at the end of its path, with which the next path begins."""

from __future__ import annotations

from closeform.motion.path import Path
from closeform.uncertainty.errors import Uncertainty
from closeform.uncertainty.spread import spread_to_ends


def carried(errors: Uncertainty, path: Path) -> Uncertainty:
    """The errors of a craft that begins where a path ends: what it has met so far is in its state.

    Burns, impulses and noise on the path have added theirs; what is to come is executed as before.  Roots are
    carried, so that directions keep their digits.                                            # theory (51)
    """
    _, roots = spread_to_ends(path, [errors])
    return errors._with_root(roots[0])
