"""Replays: notable cases of a study, each with a page of its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from closeform.campaign import Campaign, GatherCampaign, case_of
from closeform.report.page import Pages, nothing
from closeform.report.picture import Progress
from closeform.scenario import Scenario
from closeform.storage.result_folder import REPORT, Folder

if TYPE_CHECKING:
    from closeform.campaign.mission_cases import MissionCampaign
    from closeform.mission.mission_result import Mission

PLANNED = "planned.html"
MOST = 2  # largest number of cases with an unmet requirement, of each kind


class Replay(NamedTuple):
    """Page in a study's folder: its `file`, its title, and the reason for its selection."""

    file: str
    title: str
    why: str


def begin(campaign: Any, folder: Folder, asked: bool = True) -> tuple[tuple[Replay, ...], Pages]:
    """Return the pages of notable cases, and the function that writes them into a folder.

    A study of errors has one page, of the mission as planned. There are none for a sweep or unless `asked`.
    """
    scenario = campaign.scenario
    if scenario.points or not (asked and scenario.study.pages):
        return (), nothing
    pages: dict[int | None, Replay] = {}
    if scenario.study.draws == "errors":
        pages[None] = Replay(PLANNED, "the mission as planned", "without errors")
    else:
        reasons: dict[int, list[str]] = {}
        for case, why in worst(campaign) if isinstance(campaign, Campaign) else missions(campaign):
            reasons.setdefault(case, []).append(why)
        for case, every in reasons.items():
            pages[case] = Replay(f"case-{case}.html", f"case {case}", "; ".join(every))

    def write(progress: Progress) -> None:
        for number, (case, page) in enumerate(pages.items(), 1):
            progress(f"page {number} of {len(pages)}: {page.title}")
            write_mission(mission_of(campaign, case), page.file, folder)

    return tuple(pages.values()), write


def mission_of(campaign: Any, case: int | None) -> Mission:
    """Return the mission of a case, evaluated again, or for None the mission as planned."""
    if case is None:
        planned: Mission = campaign.mission
        return planned
    from closeform.mission.mission import plan_mission  # a study without pages does not need its kernels

    return plan_mission(case_of(with_seed(campaign.scenario, campaign.seed), case))


def write_mission(mission: Mission, name: str, folder: Folder) -> None:
    """Write the page of a mission into a folder, with a link to the study's report."""
    from closeform.report.run import RunReport
    from closeform.viewer.page import document
    from closeform.viewer.scene import scene_of
    from closeform.viewer.shown import Shown

    flights = RunReport(mission).flights
    shown = Shown.of_mission(mission) if flights is None else Shown.of_simulations(flights)
    folder.text(name, document(scene_of(shown, report=REPORT)))


def with_seed(scenario: Scenario, seed: int) -> Scenario:
    """Return the scenario with the seed of its sampled cases."""
    assert scenario.study is not None
    return replace(scenario, study=scenario.study.model_copy(update={"seed": seed}))


def worst(campaign: Campaign) -> Iterator[tuple[int, str]]:
    """Yield cases and the reasons to view them: unmet requirements, longest duration, highest cost."""
    for what, met in campaign.tally.met.items():
        for case in met.unmet[:MOST]:
            yield case, f"not {campaign.requirement_label(what)}"
    if "time [s]" in campaign.spreads:
        time, case = campaign.spreads["time [s]"].worst[0]
        yield case, f"{campaign.done} last, at {time:.1f} s"
    if isinstance(campaign, GatherCampaign):
        yield from extremes(campaign)


def missions(campaign: MissionCampaign) -> Iterator[tuple[int, str]]:
    """Yield missions with unmet requirements, the highest delta-v and the closest approach, with reasons."""
    from closeform.campaign.mission_cases import STOPPED, UNMET, WORDS  # searches do not need its planners

    for status in (UNMET, STOPPED):
        for case in campaign.tally.met[status].unmet[:MOST]:
            yield case, WORDS[status]
    if spreads := campaign.spreads:
        cost, case = next(iter(spreads.values())).worst[0]  # as simulated, if available
        yield case, f"highest delta-v, {cost:.4g} m/s"
    near, where = campaign.nearest, ""
    if campaign.flights is not None:
        near, where = campaign.flights.nearest, " in simulation"
    if near is not None:
        yield near[1], f"closest approach{where}, {near[0]:.4g} x zone"


def extremes(campaign: GatherCampaign) -> Iterator[tuple[int, str]]:
    """Yield the gatherings with the highest delta-v and with the most pairs within a keep-out zone."""
    if most := campaign.least(lambda part: -part["delta_v_m_s"]):
        yield most[1], f"highest delta-v, {-most[0]:.4g} m/s"
    most = campaign.least(lambda part: -1.0 * (part["met_unknown"] + part["met_known"]))
    if most and most[0]:
        yield most[1], f"most pairs within their keep-out zone, {-most[0]:.0f}"
