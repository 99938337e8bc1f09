"""Before NumPy is loaded: small matrices on many BLAS threads take longer, not shorter."""

import os
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# the first call of a kernel may compile it for seconds
hypothesis.settings.register_profile("compiles", deadline=None)
hypothesis.settings.load_profile("compiles")


LONG = (
    "avoidance",
    "campaign",
    "cli",
    "margins",
    "mission_formation",
    "mission_search",
    "plots",
    "reconfigure",
    "reconfigure_cases",
    "reference_methods",
    "shaping",
)
APART = ("site", "basilisk")  # each has a marker of its own
FAULTS = ("attacks", "kernel_cache", "many_craft", "result_folder")


def pytest_configure(config: pytest.Config) -> None:
    """Without files or a selection: all but `-m fault`, commands under attack, and what is APART."""
    if not config.option.markexpr and config.args_source is not config.ArgsSource.ARGS:
        config.option.markexpr = " and ".join(f"not {one}" for one in ("fault", *APART))


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """The browser's tests need an extra of their own: they are looked at by `-m browser` or by name only."""
    asked = "browser" in config.option.markexpr or any("browser" in argument for argument in config.args)
    return True if collection_path.name == "browser" and not asked else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """`-m quick` leaves out the files that take longest; test_docs runs commands and plans."""
    for item in items:
        subject = item.path.stem.removeprefix("test_")
        if subject in FAULTS:
            item.add_marker("fault")
        elif item.path.parent.name == "browser":
            continue
        elif subject in APART:
            item.add_marker(subject)
        elif subject not in LONG:
            item.add_marker("quick")


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """All tests run side by side on all cores; a file or test that is named runs in this process."""
    return 0 if config.args_source is config.ArgsSource.ARGS else None


@pytest.fixture(scope="module")
def unpainted() -> Iterator[None]:
    """For tests of what commands say and leave: their pictures are composed, with all words, but not painted.

    That takes half of the time of a run; pictures that somebody looks at have tests of their own, and so
    has what is made only as they are painted, as numbers along axes.  `.ci/examples` paints all of them.
    """
    from closeform.plots.png import png
    from closeform.result_folder import Folder

    def blank(folder: Folder, name: str, figure: object) -> Path:
        file = folder.path / f"{name}.png"
        file.write_bytes(png([[[255, 255, 255, 255]]]))
        return file

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Folder, "picture", blank)
        yield
