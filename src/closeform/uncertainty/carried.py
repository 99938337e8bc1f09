"""Errors carried on: those of a craft at the end of its path, with which the next path begins."""

from __future__ import annotations

import numpy as np

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.uncertainty.columns import burns_of, columns_of
from closeform.uncertainty.covariance import roots_of
from closeform.uncertainty.errors import Errors

MANY = 20  # burns, from which on their columns take longer than their covariance


def carried(errors: Errors, path: Path) -> Errors:
    """The errors of a craft that begins where a path ends: what it has met so far is in its state.

    Burns, impulses and noise on the path have added theirs; what is to come is executed as before.  Roots are
    carried, so that directions keep their digits; the covariance where burns are very many.     # theory (51)
    """
    if len(burns_of(path)) > MANY:
        return errors._with_root(roots_of(errors.covariance(path, path.end)[None])[0])
    columns = columns_of(path, errors)
    root: Floats = np.zeros((6, 0))
    if len(columns):
        root = columns._evaluate_rows(np.full((len(columns), 1), path.end))[:, 0].T
    if errors.noise:
        noise = Errors(noise=errors.noise).covariance(path, path.end)
        root = np.concatenate([root, roots_of(noise[None])[0]], axis=1)
    if not root.size:
        return errors
    return errors._with_root(np.asarray(np.linalg.qr(root.T, mode="r")).T)
