"""Pictures of paths, zones and conflicts; each function returns a matplotlib Figure.

No global state of matplotlib is used or changed: save a figure with its `savefig`.
"""

from closeform.plots.nearness import ratios
from closeform.plots.sides import two_ways
from closeform.plots.space import before_after
from closeform.plots.thrusting import thrust
from closeform.plots.timelines import distances

__all__ = ["before_after", "distances", "ratios", "thrust", "two_ways"]
