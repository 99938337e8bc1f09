"""Command `simulate`: simulation of a run in the high-fidelity model of its scenario."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from cyclopts import Parameter

from closeform.cli.inputs import UsageError, quantity
from closeform.cli.screen import left

if TYPE_CHECKING:
    from closeform.dynamics.control.feedback import Feedback
    from closeform.report.page import CommandReport
    from closeform.scenario.quantity import Parts

RESULTS, FLIGHTS = "-results", "-flights"  # suffixes of folder names


def simulate(
    directory: Path,
    /,
    *,
    every: str | None = None,
    horizon: str | None = None,
    navigation: str | None = None,
    thrust_error: str | None = None,
    execution: str | None = None,
    control: Literal["track", "replan", "open"] = "track",
    seeds: int = 100,
    out: Path | None = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Simulate the plans of a run many times in the force model of its scenario, with all errors.

    Parameters
    ----------
    directory
        Result folder of a run whose [orbit] has a field.
    every
        Interval between measurements: "60 s". Default: that of the scenario.
    horizon
        Time in which feedback removes a deviation: "10 min".
    navigation
        Standard deviations of the measured position and velocity on each axis: "10 cm, 0.3 mm/s".
    thrust_error
        Largest error of thrust in size and direction, constant over a simulation: "1 %, 1 deg".
    execution
        Standard deviations of the size and the direction of each burn and impulse: "1 %, 0.5 deg".
    control
        track: feedback to the plan; replan: plan the remainder again; open: commanded thrust, no feedback.
    seeds
        Number of simulations.
    out
        Folder for the results. Default: NAME-flights in the current folder.
    overwrite
        Replace finished results.
    """
    from closeform.results.load import LoadedRun, load
    from closeform.scenario.checks import not_anew
    from closeform.storage.publishing import check_free
    from closeform.storage.result_folder import SUMMARY

    given = {"every": every, "horizon": horizon, "navigation": navigation}
    given |= {"thrust-error": thrust_error, "execution": execution}
    asked = Options.of(given)
    if seeds < 1:
        raise UsageError(f"--seeds: {seeds} is below 1; give for example --seeds 100")
    place = out or Path(f"{directory.resolve().name.removesuffix(RESULTS)}{FLIGHTS}")
    check_free(place, overwrite)
    run = load(directory)
    if not isinstance(run, LoadedRun):
        raise UsageError(f"{directory}: holds a study; give the folder of a run")
    if run.scenario.field is None:
        remedy = "add field, with epoch and chief, to [orbit], and run it again"
        raise UsageError(f"{directory}: its scenario has no field; {remedy}")
    if not run.executed:
        raise UsageError(
            f"{directory}: no stage was executed, {run.stopped}; change the scenario, and run it again"
        )
    for why, without in not_anew(run.scenario) if control == "replan" else ():
        raise UsageError(f"--control: {why} in {directory}; use --control track, or a run with {without}")
    from closeform.dynamics.infeasible import Infeasible
    from closeform.mission.simulation import SimulatedRun, usually_led
    from closeform.report.page import Command

    settings = asked.instead_of(run.scenario.truth.flight, usually_led(run, control))
    options = {**given, "control": None if control == "track" else control, "seeds": seeds}
    command = Command("simulate", [directory], options, [directory / SUMMARY], out)

    def report() -> "CommandReport":
        from closeform.report.simulation import simulation_report

        try:
            return simulation_report(SimulatedRun.of(run, control, settings, seeds), command)
        except Infeasible as error:
            raise UsageError(f"{directory}: cannot be simulated: {error}") from None
        except ValueError as error:
            raise UsageError(f"{directory}: {error}") from None

    return left(report, place, overwrite)


class Options(NamedTuple):
    """Options that replace values of the scenario; None for an option that is not given.

    Times are in s, `navigation` is in m and m/s, and thrust and execution errors are fractions and rad.
    """

    every: float | None
    horizon: float | None
    navigation: tuple[float, ...] | None
    thrust_error: tuple[float, ...] | None
    execution: tuple[float, ...] | None

    @classmethod
    def of(cls, given: dict[str, str | None]) -> "Options":
        """Read the options from their texts, by option name."""
        from closeform.scenario.orbit import as_navigation, as_thrust_error
        from closeform.scenario.quantity import TIME

        return cls(
            quantity("every", TIME, given["every"]),
            quantity("horizon", TIME, given["horizon"]),
            parts("navigation", as_navigation, given["navigation"]),
            parts("thrust-error", as_thrust_error, given["thrust-error"]),
            parts("execution", as_thrust_error, given["execution"]),
        )

    def instead_of(self, settings: dict[str, Any], usual: "Feedback") -> dict[str, Any]:
        """Return the arguments of `simulate`: from the options, else from the scenario, else the default."""
        times = {key: value for key in ("every", "horizon") if (value := getattr(self, key)) is not None}
        found = dict(settings)
        if times:
            try:
                found["feedback"] = replace(settings["feedback"] or usual, **times)
            except ValueError as error:
                raise UsageError(f"--{error}") from None
        if self.navigation is not None:
            position, velocity = self.navigation
            found["navigation"] = replace(settings["navigation"], position=position, velocity=velocity)
        if self.thrust_error is not None:
            found["thrust_error"] = self.thrust_error
        if self.execution is not None:
            from closeform.uncertainty.errors import Uncertainty  # kernels that only this needs

            size, turn = self.execution
            states = [
                one and one.state for one in settings["errors"] or [None] * len(settings["thrust_error"])
            ]
            found["errors"] = [Uncertainty(state, size, turn, (0.0, size, 0.0, turn)) for state in states]
        return found


def parts(option: str, read: "Parts", text: str | None) -> tuple[float, ...] | None:
    """Return the quantities, separated by commas, that an option states; None without a text."""
    if text is None:
        return None
    try:
        return read(text)
    except ValueError as error:
        raise UsageError(f"--{option}: {error}") from None
