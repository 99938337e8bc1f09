"""Replays: the cases of a study that are worth looking at, each flown again with a page of its own."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from closeform.campaign import Campaign, GatherCampaign, case_of
from closeform.campaign.error_cases import ErrorCampaign
from closeform.mission import fly
from closeform.mission_result import Mission
from closeform.result_folder import REPORT, VIEWER, Folder
from closeform.scenario import Scenario
from closeform.viewer.page import document
from closeform.viewer.scene import scene_of

UNMET = 2  # cases in which something is not met, at most, of each kind


class Replay(NamedTuple):
    """A page in a study's folder: its `file`, which `case` it shows, and why that one."""

    file: str
    case: int | None
    why: str


def leave(campaign: Campaign | ErrorCampaign, folder: Folder) -> tuple[Replay, ...]:
    """Write a page of each case worth looking at into a folder; of errors, of the mission as planned."""
    if isinstance(campaign, ErrorCampaign):
        write(campaign.mission, folder, VIEWER)
        return (Replay(VIEWER, None, "as planned, without errors"),)
    found: dict[int, str] = {}
    for case, why in worst(campaign):
        found[case] = f"{found[case]}; {why}" if case in found else why
    seeded = with_seed(campaign.scenario, campaign.seed)
    for case in found:
        write(fly(case_of(seeded, case)), folder, page_of(case))
    return tuple(Replay(page_of(case), case, why) for case, why in found.items())


def page_of(case: int) -> str:
    """The file that shows a case."""
    return f"case-{case}.html"


def write(mission: Mission, folder: Folder, name: str) -> None:
    """One page, with a way back to the study's report."""
    folder.text(name, document(mission, scene_of(mission, report=REPORT)))


def with_seed(scenario: Scenario, seed: int) -> Scenario:
    """The scenario with the seed that its cases were drawn with."""
    assert scenario.study is not None
    return replace(scenario, study=scenario.study.model_copy(update={"seed": seed}))


def worst(campaign: Campaign) -> Iterator[tuple[int, str]]:
    """Cases, and why they are worth looking at: what is not met, what took longest, cost and came nearest."""
    for what, met in campaign.met.items():
        for case in np.flatnonzero(~met)[:UNMET].tolist():
            yield case, f"not {what}"
    if (campaign.leg >= 0).any():
        yield int(np.nanargmax(campaign.time)), f"{campaign.done} last, at {np.nanmax(campaign.time):.1f} s"
    if isinstance(campaign, GatherCampaign):
        yield from extremes(campaign)


def extremes(campaign: GatherCampaign) -> Iterator[tuple[int, str]]:
    """The gatherings that cost most, and in which most craft came within a keep-out zone."""
    cost: Any = campaign.delta_v
    yield int(np.argmax(cost)), f"most delta-v, {cost.max():.4g} m/s"
    met: Any = campaign.met_unknown + campaign.met_known
    if met.any():
        yield int(np.argmax(met)), f"most pairs within their keep-out zone, {met.max()}"
