"""Replays: the cases of a study that are worth looking at, each flown again with a page of its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from closeform.campaign import Campaign, GatherCampaign, case_of
from closeform.report.drawing import begun
from closeform.report.picture import Progress, Shot
from closeform.report.results import Pages, nothing
from closeform.result_folder import REPORT, Folder
from closeform.scenario import Scenario

if TYPE_CHECKING:
    from closeform.campaign.mission_cases import MissionCampaign
    from closeform.mission_result import Mission

PLANNED = "planned.html"
MOST = 2  # cases in which something is not met, at most, of each kind


class Replay(NamedTuple):
    """A page in a study's folder: its `file`, what it shows, and why that."""

    file: str
    title: str
    why: str


@dataclass(frozen=True)
class Page:
    """The page of a mission, or of a scenario that is flown for it, with a way back to the study's report."""

    name: str
    of: Mission | Scenario

    def leave(self, folder: Folder, progress: Progress) -> Shot:
        """Write it into a folder."""
        from closeform.mission import fly  # in the process that draws, so that this one need not
        from closeform.report.run import RunReport
        from closeform.viewer.page import document
        from closeform.viewer.scene import scene_of
        from closeform.viewer.shown import Shown

        mission = fly(self.of) if isinstance(self.of, Scenario) else self.of
        flights = RunReport(mission).flights
        shown = Shown.of_mission(mission) if flights is None else Shown.of_flight(flights)
        folder.text(self.name, document(scene_of(shown, report=REPORT)))
        return Shot(folder.path / self.name, mission.scenario.title, "")


def begin(campaign: Any, folder: Folder) -> tuple[tuple[Replay, ...], Pages]:
    """Begin a page of each case worth looking at in a folder; of errors, of the mission as planned.

    What they are, and what finishes them.
    """
    scenario = campaign.scenario
    if scenario.points:
        return (), nothing
    if scenario.study.draws == "errors":
        planned = Replay(PLANNED, "the mission as planned", "without errors")
        return (planned,), begun([Page(PLANNED, campaign.mission)], folder)
    reasons: dict[int, list[str]] = {}
    for case, why in worst(campaign) if isinstance(campaign, Campaign) else missions(campaign):
        reasons.setdefault(case, []).append(why)
    seeded = with_seed(scenario, campaign.seed)
    found = tuple(
        Replay(f"case-{case}.html", f"case {case}", "; ".join(why)) for case, why in reasons.items()
    )
    pages = [Page(one.file, case_of(seeded, case)) for case, one in zip(reasons, found, strict=True)]
    return found, begun(pages, folder)


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
    from closeform.campaign.mission_cases import STOPPED, UNMET, WORDS  # whose plans searches can spare

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
