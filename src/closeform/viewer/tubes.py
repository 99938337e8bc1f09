"""Uncertainty tubes along the executed paths, at a number of sigmas."""

from typing import Any

import numpy as np

from closeform.viewer.numbers import Numbers
from closeform.viewer.shown import Shown

USUAL = 3.0  # sigmas of a tube by default
SAMPLES, ALL_SAMPLES, FEWEST = 96, 4800, 24  # times: most of one craft, of all; fewest
UPPER = np.triu_indices(3)


def tubes(shown: Shown, numbers: Numbers) -> list[dict[str, Any]]:
    """Return every `Tube` of web/scene.d.ts."""
    found = []
    for result in shown.results:
        if result.uncertain is None:
            continue
        many = result.stage.sigmas or USUAL
        count = int(np.clip(ALL_SAMPLES / len(result.after.names), FEWEST, SAMPLES))
        times = np.linspace(result.start, result.end, count + 1)
        for craft, errors in enumerate(result.uncertain.errors):
            if errors is None:
                continue
            spread = many**2 * errors.covariance(result.after.paths[craft], times)[:, :3, :3]
            rows = np.column_stack([times - result.start, spread[:, *UPPER]])
            found.append(
                {"craft": craft, "stage": result.number, "sigmas": float(many), "rows": numbers.block(rows)}
            )
    return found
