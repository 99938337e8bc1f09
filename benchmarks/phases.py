"""Run the command line with its arguments, and print the times of the main thread by phase [s] as JSON."""

import json
import threading
from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from time import perf_counter
from typing import Any

BEGIN = perf_counter()
spent: dict[str, float] = {}
inside: list[float] = [0.0]  # times of nested phases, innermost last


def timed(owner: Any, name: str, phase: str) -> None:
    """Count the own time of a function, without nested phases, as `phase`."""
    function: Callable[..., Any] = getattr(owner, name)

    def call(*arguments: Any, **named: Any) -> Any:
        if threading.current_thread() is not threading.main_thread():
            return function(*arguments, **named)
        begin = perf_counter()
        inside.append(0.0)
        try:
            return function(*arguments, **named)
        finally:
            took = perf_counter() - begin
            spent[phase] = spent.get(phase, 0.0) + took - inside.pop()
            inside[-1] += took

    setattr(owner, name, call)


def main() -> None:
    import closeform.__main__
    import closeform.cli.app

    make_haste = closeform.cli.app.make_haste

    def then_watch(tokens: list[str]) -> None:
        make_haste(tokens)
        import closeform._jit
        import closeform.mission.mission
        import closeform.report.page
        import closeform.report.picture
        import closeform.report.run

        timed(closeform._jit.Kernel, "__call__", "kernels")
        timed(closeform.mission.mission, "plan_mission", "planning")
        timed(closeform.report.page, "drawn", "pictures")
        timed(closeform.report.picture.Film, "draw", "animation")
        timed(closeform.report.run.RunReport, "write", "tables, page")

    closeform.cli.app.make_haste = then_watch
    with redirect_stdout(StringIO()):
        closeform.__main__.main()  # with its fast exit
    spent["imports"] = perf_counter() - BEGIN - sum(spent.values())
    print(json.dumps(spent))


if __name__ == "__main__":
    main()
