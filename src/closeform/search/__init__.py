"""The search of lost craft for each other: sensor, schedule, locks, and the gathering."""

from closeform.search.gather import gather, gather_cases
from closeform.search.gathering import Event, EventKind, Gathering, Gatherings, GatherStatus, Stay
from closeform.search.locks import Locks, lock_times
from closeform.search.schedule import Leg, Search
from closeform.search.sensor import Sensor

__all__ = [
    "Event",
    "EventKind",
    "GatherStatus",
    "Gathering",
    "Gatherings",
    "Leg",
    "Locks",
    "Search",
    "Sensor",
    "Stay",
    "gather",
    "gather_cases",
    "lock_times",
]
