"""Every public name is documented, shown in the docs and quick to import."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
from enum import Enum
from pathlib import Path

import pytest

import closeform as cf
from public_names import CALLABLES, properties

PACKAGE = Path(cf.__file__).parent
PAGES = sorted((Path(__file__).parents[1] / "docs").glob("*.md"))


def test_the_whole_surface_is_seen() -> None:
    seen = {"avoid", "Orbit.circular", "Path.state", "Zone.norm", "plots.distances", "targets.line"}
    assert seen <= set(CALLABLES)


ENUMERATIONS = [value for value in CALLABLES.values() if inspect.isclass(value) and issubclass(value, Enum)]


def test_enumeration_members_are_documented() -> None:
    """One line of the list for each, in their order."""
    for enumeration in ENUMERATIONS:
        listed = re.findall(r"^    - `(\w+)`: \w.+[.;:,\w]$", enumeration.__doc__ or "", re.MULTILINE)
        assert listed == [member.name for member in enumeration]


def test_properties_have_docstrings() -> None:
    assert [name for name, value in properties() if not (value.__doc__ or "").strip()] == []


def shown() -> set[str]:
    """What the Python blocks of the docs use of the package: cf.NAME, cf.plots.NAME, .method."""
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    tree = ast.parse("\n".join(re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)))
    return {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}


def test_every_public_name_is_shown_in_the_docs() -> None:
    names = {*cf._HOMES, *(name.rpartition(".")[2] for name in [*CALLABLES, *dict(properties())])}
    assert names - shown() == set()


def test_reference_lists_every_public_name() -> None:
    """docs/api.md lists each name once, under the module that it is reached by."""
    text = (Path(__file__).parents[1] / "docs" / "api.md").read_text(encoding="utf-8")
    listed = []
    for module, names in re.findall(r"currentmodule:: (\S+)\n.*?:nosignatures:\n\n(.*?)```", text, re.DOTALL):
        listed += [f"{module}.{name}".removeprefix("closeform.") for name in names.split()]
    public = {*cf._HOMES, *(f"{name}.{one}" for name in cf._MODULES for one in getattr(cf, name).__all__)}
    assert sorted(listed) == sorted(public)


def test_stub_agrees_with_the_package() -> None:
    """`__init__.pyi`, which editors and type checkers read, has the names of `__init__.py`."""
    stub = ast.parse((PACKAGE / "__init__.pyi").read_text())
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    stated = {(alias.asname, node.module) for node in imports for alias in node.names}
    homes = {(name, f"closeform.{module}") for name, module in cf._HOMES.items()}
    modules = {(name, f"closeform.{path}".rpartition(".")[0]) for name, path in cf._MODULES.items()}
    assert stated == homes | modules


def test_public_names_are_in_their_modules() -> None:
    for name, module in cf._HOMES.items():
        assert getattr(cf, name) is getattr(importlib.import_module(f"closeform.{module}"), name)
    assert {*cf._HOMES, *cf._MODULES} == {name for name in dir(cf) if not name.startswith("__")}
    with pytest.raises(AttributeError, match="has no attribute 'colide'"):
        _ = cf.colide


def test_import_loads_nothing_heavy() -> None:
    heavy = ("numpy", "numba", "scipy", "matplotlib", "pydantic", "astropy", "pandas", "pyarrow")
    code = f"import sys, closeform; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
