"""Settings of the suite; one BLAS thread, set before NumPy is loaded, is fastest for small matrices."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# the first call of a kernel may compile it for seconds
hypothesis.settings.register_profile("compiles", deadline=None, max_examples=50)
hypothesis.settings.load_profile("compiles")


APART = ("slow", "fault", "site", "basilisk")  # markers of tests with commands of their own


def pytest_configure(config: pytest.Config) -> None:
    """Deselect tests APART unless files or markers are given; compile kernels before workers start."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # begun in the background of a script
        signal.signal(signal.SIGINT, signal.default_int_handler)
    whole = config.args_source is not config.ArgsSource.ARGS
    if whole and not hasattr(config, "workerinput"):  # once, before workers begin
        from closeform._jit import compile_ahead, kernel_modules

        compile_ahead(kernel_modules(), print)
    if not config.option.markexpr and whole:
        config.option.markexpr = " and ".join(f"not {one}" for one in APART)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Collect the browser's tests, which need an extra, only for `-m browser` or by name."""
    asked = "browser" in config.option.markexpr or any("browser" in argument for argument in config.args)
    return True if collection_path.name == "browser" and not asked else None


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """Run all tests in parallel on all cores, but a named file or test in this process."""
    return 0 if config.args_source is config.ArgsSource.ARGS else None


@pytest.fixture(scope="module")
def unpainted() -> Iterator[None]:
    """Compose the pictures of commands, with all texts, but do not render them, which takes half of a run.

    Other tests and `.ci/examples` render pictures.
    """
    from PIL import Image

    from closeform.storage.result_folder import Folder

    def blank(folder: Folder, name: str, figure: object) -> Path:
        file = folder.path / f"{name}.png"
        Image.new("RGB", (1, 1), "white").save(file)
        return file

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Folder, "picture", blank)
        yield


@pytest.fixture(scope="module")
def undrawn() -> Iterator[None]:
    """Leave out pictures, which take most of the time of a command."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("closeform.report.page.drawn", lambda *_: ())
        yield


@pytest.fixture
def ran(tmp_path, monkeypatch, capsys) -> Callable[[str], Any]:
    """Run a scenario from its text, and return its output and results."""
    from runs import run_text

    return lambda text: run_text(text, tmp_path, monkeypatch, capsys)
