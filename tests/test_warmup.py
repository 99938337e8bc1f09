"""What is compiled ahead of a first run: the kernels that its stages call, and no others."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from numba import float64

from closeform import compiled
from closeform.given import read
from closeform.lock_file import lock
from closeform.warmup import NEEDS, compile_all, compile_for

EXAMPLES = Path(__file__).parents[1] / "examples"


def needed(name: str, monkeypatch) -> list[str]:
    """The modules that are compiled ahead for an example."""
    monkeypatch.setattr("closeform.warmup.before_first_compilation", begun := [])
    monkeypatch.setattr("closeform.warmup.meanwhile", [])
    found: list[str] = []
    monkeypatch.setattr("closeform.warmup.compile_beside", found.extend)
    compile_for((EXAMPLES / f"{name}.toml").read_text(encoding="utf-8"))
    for begin in begun:
        begin()
    return found


def test_every_module_that_is_compiled_ahead_has_kernels() -> None:
    for _, needs in NEEDS:
        for module in needs.split():
            import_module(f"closeform.{module}")
            assert any(entry.__module__ == f"closeform.{module}" for entry in compiled.ENTRIES), module


@pytest.mark.parametrize(
    ("name", "late"),
    [
        ("swap", {"closeform.conflicts.exclusion", "closeform.planning.turns"}),  # which few runs need
        ("three_sigmas", set()),
        ("slow_encounter", set()),
        ("passive_inspector", set()),
        ("inspector_hold", set()),
        ("flown_swap", set()),
    ],
)
def test_what_a_run_calls_is_compiled_ahead_and_what_it_does_not_call_is_not(
    name, late, monkeypatch, tmp_path
) -> None:
    code = (
        "import sys; from closeform.cli import main; from closeform.compiled import ENTRIES;"
        "main(sys.argv[1:]);"
        "print(*{entry.__module__ for entry in ENTRIES if entry.overloads})"
    )
    command = [sys.executable, "-c", code, "run", str(EXAMPLES / f"{name}.toml"), "--no-viewer"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    called = set(done.stdout.splitlines()[-1].split())
    assert called - {*needed(name, monkeypatch)} == late
    assert {*needed(name, monkeypatch)} - called == set()


def test_check_has_nothing_compiled_that_only_a_run_needs(monkeypatch) -> None:
    begun: list[object] = []
    monkeypatch.setattr("closeform.warmup.before_first_compilation", begun)
    for command, ahead in (("check", 0), ("run", 1)):
        read(EXAMPLES / "cluster.toml", command)
        assert len(begun) == ahead


def test_impulses_and_searches_are_compiled_where_they_are_asked_for(monkeypatch) -> None:
    assert needed("tpf", monkeypatch)[0] == "closeform.search.gather_events"
    assert "closeform.conflicts.entries" in needed("tpf", monkeypatch)
    assert "closeform.motion.steering" not in needed("tpf", monkeypatch)  # nobody is steered to an end
    assert "closeform.conflicts.entries" not in needed("s04", monkeypatch)  # nor are there conflicts
    assert "closeform.planning.joint_dual" in needed("swap_impulses", monkeypatch)
    by_impulses = needed("swap_impulses", monkeypatch)  # of many craft, whose bound is another dual
    assert not {"closeform.planning.dual_bound", "closeform.motion.impulse_arcs"} & {*by_impulses}
    assert "closeform.motion.impulse_arcs" in needed("polar_inspection", monkeypatch)
    assert "closeform.planning.dual_bound" in needed("cubesats", monkeypatch)
    assert "closeform.search.lock_march" in needed("s04_counterexample", monkeypatch)


def test_who_waits_for_a_kernel_compiles_others_meanwhile(monkeypatch, tmp_path) -> None:
    """Another process compiles one and is done as the first other is; the second is left to later."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(compiled, "ENTRIES", entries := [])
    monkeypatch.setattr("closeform.warmup.ENTRIES", entries)

    def made(factor: float):
        return compiled.kernel(float64(float64))(lambda x: factor * x)

    waited, first, second = made(2.0), made(3.0), made(4.0)
    path = waited._cache.path
    path.parent.mkdir(parents=True)
    held = lock(path.with_name(f"{path.name}.lock"), False)

    def ended() -> bool:
        if first.overloads:
            held.close()
        return bool(first.overloads)

    entries[:] = [first, second]
    monkeypatch.setattr(compiled, "_announced", [True])
    monkeypatch.setattr(compiled, "meanwhile", [lambda _: compile_all([__name__], ended)])
    assert waited(21.0) == 42.0
    assert first.overloads
    assert not second.overloads
