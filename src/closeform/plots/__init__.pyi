"""Every picture, and the module it lives in."""

from closeform.plots.attitudes import in_plane_search as in_plane_search
from closeform.plots.attitudes import manoeuvres as manoeuvres
from closeform.plots.burning import burns as burns
from closeform.plots.clearances import clearance as clearance
from closeform.plots.closest import closest_pairs as closest_pairs
from closeform.plots.collisions import collision as collision
from closeform.plots.cones import complementary_cones as complementary_cones
from closeform.plots.film import animation as animation
from closeform.plots.firings import pulses as pulses
from closeform.plots.fleet import formation_paths as formation_paths
from closeform.plots.flying import formation_animation as formation_animation
from closeform.plots.formation import three_views as three_views
from closeform.plots.hyperbola import lemma_2 as lemma_2
from closeform.plots.lockings import histogram as histogram
from closeform.plots.matrix import ratio_matrix as ratio_matrix
from closeform.plots.nearness import ratios as ratios
from closeform.plots.primers import primer as primer
from closeform.plots.primers import trade as trade
from closeform.plots.sides import two_ways as two_ways
from closeform.plots.sigma_curves import sigmas as sigmas
from closeform.plots.space import before_after as before_after
from closeform.plots.thrusting import formation_thrust as formation_thrust
from closeform.plots.thrusting import thrust as thrust
from closeform.plots.timelines import distances as distances
from closeform.plots.tubes import tube as tube
