"""Replays: the cases of a study that are worth looking at, each flown again with a page of its own."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from closeform.campaign import Campaign, GatherCampaign, case_of
from closeform.campaign.error_cases import ErrorCampaign
from closeform.campaign.mission_cases import STOPPED, UNMET, WORDS, MissionCampaign
from closeform.mission import fly
from closeform.mission_result import Mission
from closeform.report.run import RunReport
from closeform.result_folder import REPORT, Folder
from closeform.scenario import Scenario
from closeform.viewer.page import document
from closeform.viewer.scene import scene_of
from closeform.viewer.shown import Shown

PLANNED = "planned.html"
MOST = 2  # cases in which something is not met, at most, of each kind


class Replay(NamedTuple):
    """A page in a study's folder: its `file`, what it shows, and why that."""

    file: str
    title: str
    why: str


def leave(campaign: Campaign | ErrorCampaign | MissionCampaign, folder: Folder) -> tuple[Replay, ...]:
    """Write a page of each case worth looking at into a folder; of errors, of the mission as planned."""
    if campaign.scenario.points:
        return ()
    if isinstance(campaign, ErrorCampaign):
        write(campaign.mission, folder, PLANNED)
        return (Replay(PLANNED, "the mission as planned", "without errors"),)
    reasons: dict[int, list[str]] = {}
    for case, why in missions(campaign) if isinstance(campaign, MissionCampaign) else worst(campaign):
        reasons.setdefault(case, []).append(why)
    seeded = with_seed(campaign.scenario, campaign.seed)
    found = tuple(
        Replay(f"case-{case}.html", f"case {case}", "; ".join(why)) for case, why in reasons.items()
    )
    for case, replay in zip(reasons, found, strict=True):
        write(fly(case_of(seeded, case)), folder, replay.file)
    return found


def write(mission: Mission, folder: Folder, name: str) -> None:
    """One page, with a way back to the study's report."""
    flights = RunReport(mission).flights
    shown = Shown.of_mission(mission) if flights is None else Shown.of_flight(flights)
    folder.text(name, document(scene_of(shown, report=REPORT)))


def with_seed(scenario: Scenario, seed: int) -> Scenario:
    """The scenario with the seed that its cases were drawn with."""
    assert scenario.study is not None
    return replace(scenario, study=scenario.study.model_copy(update={"seed": seed}))


def worst(campaign: Campaign) -> Iterator[tuple[int, str]]:
    """Cases, and why they are worth looking at: what is not met, what took longest, cost and came nearest."""
    for what, met in campaign.tally.met.items():
        for case in met.unmet[:MOST]:
            yield case, f"not {campaign.told(what)}"
    if "time [s]" in campaign.spreads:
        time, case = campaign.spreads["time [s]"].worst[0]
        yield case, f"{campaign.done} last, at {time:.1f} s"
    if isinstance(campaign, GatherCampaign):
        yield from extremes(campaign)


def missions(campaign: MissionCampaign) -> Iterator[tuple[int, str]]:
    """Missions in which something is not met, that cost most, and in which two came nearest."""
    for status in (UNMET, STOPPED):
        for case in campaign.endings.first[status][:MOST]:
            yield case, WORDS[status]
    if spreads := campaign.spreads:
        cost, case = next(iter(spreads.values())).worst[0]  # as flown, where that is done
        yield case, f"most delta-v, {cost:.4g} m/s"
    near, where = campaign.nearest, ""
    if campaign.flights is not None:
        near, where = campaign.flights.nearest, " in flight"
    if near is not None:
        yield near[1], f"two came nearest{where}, {near[0]:.4g} times their zone"


def extremes(campaign: GatherCampaign) -> Iterator[tuple[int, str]]:
    """The gatherings that cost most, and in which most craft came within a keep-out zone."""
    cost, dearest = campaign.most(lambda one: one.also["delta_v_m_s"])
    pairs, nearest = campaign.most(lambda one: one.also["met_unknown"] + one.also["met_known"])
    yield dearest, f"most delta-v, {cost:.4g} m/s"
    if pairs:
        yield nearest, f"most pairs within their keep-out zone, {pairs:.0f}"
