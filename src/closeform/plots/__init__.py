"""Pictures of paths, zones and conflicts, and of searches; each function returns a matplotlib Figure.

No global state of matplotlib is used or changed: save a figure with its `savefig`.
"""

from closeform.plots.attitudes import in_plane_search, manoeuvres
from closeform.plots.cones import complementary_cones
from closeform.plots.film import animation
from closeform.plots.formation import three_views
from closeform.plots.hyperbola import lemma_2
from closeform.plots.lockings import histogram
from closeform.plots.nearness import ratios
from closeform.plots.sides import two_ways
from closeform.plots.space import before_after
from closeform.plots.thrusting import thrust
from closeform.plots.timelines import distances

__all__ = [
    "animation",
    "before_after",
    "complementary_cones",
    "distances",
    "histogram",
    "in_plane_search",
    "lemma_2",
    "manoeuvres",
    "ratios",
    "three_views",
    "thrust",
    "two_ways",
]
