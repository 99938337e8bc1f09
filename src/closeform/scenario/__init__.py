"""Scenario files: TOML read into validated, frozen models. Only this package parses units."""

from closeform.scenario.craft import Craft
from closeform.scenario.errors import ScenarioError
from closeform.scenario.formation import Destination, Goal, Target
from closeform.scenario.keep_out import KeepOut
from closeform.scenario.load import load, parse, text_of
from closeform.scenario.scenario import Scenario
from closeform.scenario.stage_table import StageTable
from closeform.scenario.stages import (
    Avoid,
    Coast,
    Gather,
    Joint,
    Lock,
    Reconfigure,
    Regather,
    Scatter,
    Transfer,
)

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
