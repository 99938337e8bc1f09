"""Constructions of the source papers themselves, to compare with: S04's search theorem, SP11's gradients."""

from closeform.planning.methods.sauter_palmer import end_gradients
from closeform.search.proofs.theorem import (
    TheoremCase,
    cone_crossings,
    cone_regions,
    regions_searched,
    theorem_case,
)

__all__ = [
    "TheoremCase",
    "cone_crossings",
    "cone_regions",
    "end_gradients",
    "regions_searched",
    "theorem_case",
]
