"""Command `study`: Monte Carlo study of a scenario, local or on a cluster, new or continued."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from threading import Timer
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from closeform.cli.console import complain, kept, print_report, progress, say, stderr, stdout, working
from closeform.cli.inputs import BAD_INPUT, UsageError, read

if TYPE_CHECKING:
    from closeform.campaign.cases import Cases
    from closeform.campaign.chunks import Runner
    from closeform.report.study import StudyReport
    from closeform.scenario import Scenario


def study(
    scenario: Path,
    /,
    *,
    cases: int | None = None,
    seed: int | None = None,
    out: Path | None = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
    scheduler: str | None = None,
    no_pages: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Run a Monte Carlo study: many cases of a scenario, each with its own samples.

    Parameters
    ----------
    scenario
        TOML file with a [study] table.
    cases
        Number of cases, instead of that in the file.
    seed
        Seed of the samples, instead of that in the file.
    out
        Folder for the results. Default: NAME-study in the current folder.
    overwrite
        Replace finished results.
    scheduler
        Dask scheduler whose workers run the cases: an address such as tcp://HOST:8786, or the file it writes.
    no_pages
        Omit the animated pages of single cases.
    """
    from closeform.storage.publishing import check_free, folder, settle
    from closeform.storage.result_folder import CASES, FolderError, finished, written

    place = out if out is not None else Path(f"{scenario.stem}-study")
    settle(place)
    again = finished(place) and not overwrite
    if not again:
        check_free(place, overwrite, study=True)
    loaded = read(scenario, "study")
    if loaded is None:
        return BAD_INPUT
    from closeform.campaign import requested
    from closeform.campaign.chunks import ChunkError, Stored
    from closeform.mission.verdict import MET, NOT_MET
    from closeform.scenario import ScenarioError

    notes = stderr()
    try:
        kind, count = requested(loaded, cases, seed)
        if again and (status := finished_before(place, kind, count)) is not None:
            return status
        with runner_of(scheduler) as runner, folder(place, overwrite, study=True) as under_way:
            chunks = Stored(kind, count, under_way.path / CASES, under_way.manifest)
            with written(place):
                complain(*(f"{place}: {what}, and is evaluated again" for what in chunks.begin(overwrite)))
                if chunks.whole:
                    complain(f"{place}: continuing, {chunks.done} of {count} cases are complete")
                beside = Timer(0.1, import_module, ["scipy.special"])  # loaded early for the report
                beside.daemon = True
                beside.start()
                with progress(notes, count) as tell:
                    campaign = chunks.complete(runner, tell)
            report = report_of(campaign, loaded)
            under_way.known.update(chunks.digests)
            from closeform.viewer import replays

            with working(notes, "writing results") as show, written(place):
                pages = replays.begin(campaign, under_way, not no_pages)
                report.write(under_way, *pages, out, show)
    except ScenarioError as error:
        complain(*error.lines)
        return BAD_INPUT
    except FolderError:
        raise
    except ChunkError as error:
        raise FolderError(f"{place}: {error}") from None
    except ValueError as error:  # --cases or --seed
        raise UsageError(f"--{error}") from None
    with kept(place):
        print_report(report, place)
    return MET if campaign.ok else NOT_MET


def report_of(campaign: Any, scenario: "Scenario") -> "StudyReport":
    """Return the report of a campaign, by its kind; only the module of that kind is loaded."""
    if scenario.points:
        from closeform.report.mission_study import sweep_report

        return sweep_report(campaign)
    if scenario.study is not None and scenario.study.draws == "errors":
        from closeform.report.mission_study import errors_report

        return errors_report(campaign)
    if not scenario.searches_alone:
        from closeform.report.mission_study import missions_report

        return missions_report(campaign)
    from closeform.report.study import searches_report

    return searches_report(campaign)


def finished_before(place: Path, cases: "Cases", count: int) -> int | None:
    """Return the exit status of a finished study after printing its verdict; None for another study."""
    from closeform.report import page
    from closeform.storage.result_folder import summary_of, versions

    done, inputs = summary_of(place), page.inputs(cases.scenario)
    asked = {"kind": "study", "seed": cases.seed, "cases": count, "versions": versions()}
    if {**done, **asked} != done or sorted(done.get("inputs", {}).values()) != sorted(inputs.values()):
        return None
    complain(f"{place}: holds the results of this study already; add --overwrite to repeat it")
    say(stdout(), f"{done['verdict']}; results in {place}")
    return int(done["status"])


@contextmanager
def runner_of(scheduler: str | None) -> "Iterator[Runner]":
    """Yield the runner of chunks of cases: this machine, or the workers of a Dask scheduler."""
    if scheduler is None:
        from closeform.campaign.chunks import local

        yield local
        return
    from closeform.campaign.cluster import Cluster

    with Cluster(scheduler) as cluster:
        yield cluster
