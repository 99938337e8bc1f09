"""Scenario files: TOML as validated, frozen models. The only place where units are parsed."""

from closeform.scenario.craft import Craft, KeepOut, Target
from closeform.scenario.errors import ScenarioError
from closeform.scenario.load import load, parse
from closeform.scenario.scenario import Scenario
from closeform.scenario.stages import Avoid, Coast, Gather, Lock, StageTable

__all__ = [
    "Avoid",
    "Coast",
    "Craft",
    "Gather",
    "KeepOut",
    "Lock",
    "Scenario",
    "ScenarioError",
    "StageTable",
    "Target",
    "load",
    "parse",
]
