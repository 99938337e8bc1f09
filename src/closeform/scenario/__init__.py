"""Scenario files: TOML read into validated, frozen models. Only this package parses units."""

from closeform.scenario.craft import Craft, KeepOut
from closeform.scenario.formation import Destination, Goal, Target
from closeform.scenario.load import load, parse, text_of
from closeform.scenario.scenario import Scenario
from closeform.scenario.stages import (
    Avoid,
    Coast,
    Gather,
    Joint,
    Lock,
    Reconfigure,
    Regather,
    Scatter,
    StageTable,
    Transfer,
)
from closeform.scenario.table import ScenarioError

__all__ = [
    "Avoid",
    "Coast",
    "Craft",
    "Destination",
    "Gather",
    "Goal",
    "Joint",
    "KeepOut",
    "Lock",
    "Reconfigure",
    "Regather",
    "Scatter",
    "Scenario",
    "ScenarioError",
    "StageTable",
    "Target",
    "Transfer",
    "load",
    "parse",
    "text_of",
]
