"""The search of lost craft for each other: sensor, schedule, locks, and the gathering."""

from closeform.search.gather import gather, gather_cases
from closeform.search.gathering import Event, EventKind, Gathering, Gatherings, GatherStatus, Stay
from closeform.search.locks import Locks, lock_times
from closeform.search.margins import LockMargins, lock_margins
from closeform.search.schedule import Leg, Search
from closeform.search.sensor import Sensor
from closeform.search.theorem import (
    TheoremCase,
    cone_crossings,
    cone_regions,
    regions_searched,
    theorem_case,
)

__all__ = [
    "Event",
    "EventKind",
    "GatherStatus",
    "Gathering",
    "Gatherings",
    "Leg",
    "LockMargins",
    "Locks",
    "Search",
    "Sensor",
    "Stay",
    "TheoremCase",
    "cone_crossings",
    "cone_regions",
    "gather",
    "gather_cases",
    "lock_margins",
    "lock_times",
    "regions_searched",
    "theorem_case",
]
