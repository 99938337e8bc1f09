"""Docstrings of public names: numpydoc sections that agree with signatures.

An entry under Parameters or Attributes is `name : kind`, one under Returns the kind alone.  The kind of a
number ends in its unit in brackets, or says "no unit"; an array has its shape.  Vectors of three or six
components state their frame.
"""

import dataclasses
import doctest
import inspect
import re
from collections.abc import Callable, Iterable
from enum import Enum
from typing import Any, Literal, get_args, get_origin

import numpy as np
import pytest

import closeform as cf
from public_names import CALLABLES, RESULTS, arguments, properties

HEADING = re.compile(r"^(\w[\w ]*)\n(-+)$", re.MULTILINE)
UNIT = re.compile(r"\[[^]]*\b(m|s|rad|kg|N)\b[^]]*\]|\bno unit\b")
SHAPE = re.compile(r"\bof shape \([^)]*\)")
VECTOR = re.compile(r"of shape \([^)]*\b[36],?\)")
FRAME = re.compile(r"\b(frame|elements|axes|coordinates)\b", re.IGNORECASE)
# Names in docstrings that differ from those of annotations.
CALLED = {"ndarray": "array", "NoneType": "None|optional", "Sequence": "sequence", "Callable": "callable"}
CALLED |= {"PathLike": "path-like", "IO": "file", "Iterator": "iterator", "float": "float|array"}
OF_ARRAY_LIKE = {"_SupportsArray", "_NestedSequence", "_Buffer", "dtype"}
OF_ARRAY_LIKE |= {"bool", "int", "float", "complex", "str", "bytes"}


def sections(text: str) -> dict[str, str]:
    """Return the parts of a docstring by heading; the first is "Summary"."""
    parts = HEADING.split(inspect.cleandoc(text))
    assert all(len(title) == len(line) for title, line in zip(parts[1::3], parts[2::3], strict=True))
    return {"Summary": parts[0].strip()} | {
        title: body.strip("\n") for title, body in zip(parts[1::3], parts[3::3], strict=True)
    }


def entries(body: str) -> dict[str, str]:
    """Return the entries of a section: first line and description."""
    found = re.split(r"^(?=\S)", body, flags=re.MULTILINE)[1:]
    return {head: " ".join(rest.split()) for head, _, rest in (one.partition("\n") for one in found)}


def named(body: str) -> dict[str, str]:
    """Return kinds and descriptions by name; `a, b : kind` describes two."""
    found = {}
    for head, words in entries(body).items():
        names, colon, kind = head.partition(" : ")
        assert colon, f"not of the form name : kind: {head}"
        found |= dict.fromkeys(names.split(", "), f"{kind}\n{words}")
    return found


def evaluated(annotation: Any, owner: Any) -> Any:
    """Return an annotation given as text, evaluated in its module."""
    try:
        return eval(annotation, vars(inspect.getmodule(owner))) if isinstance(annotation, str) else annotation
    except NameError:  # imported for type checkers only
        return annotation


def parts(annotation: Any) -> set[str]:
    """Return the names of all types in an annotation."""
    if isinstance(annotation, str):
        return {"NoneType" if name == "None" else name for name in annotation.split(" | ")}
    if annotation in (Any, ...) or getattr(annotation, "__name__", "") == "Self":
        return set()
    if get_origin(annotation) is Literal:
        return {f'"{word}"' for word in get_args(annotation)}
    if get_origin(annotation) is Callable:
        return {"Callable"}
    inner = set().union(*map(parts, get_args(annotation)))
    if "_SupportsArray" in inner:
        return inner - OF_ARRAY_LIKE | {"array_like"}
    origin = get_origin(annotation) or annotation
    name = getattr(origin, "__name__", str(origin))
    if name == "ndarray":
        return {name}
    if name == "Path" and origin.__module__.startswith("pathlib"):
        return {"PathLike"}
    return inner if name in ("Union", "UnionType") else inner | {name}


def check_kind(name: str, annotation: Any, entry: str) -> None:
    """Check an entry against its annotation."""
    kind, _, words = entry.partition("\n")
    for part in parts(annotation):
        said = "|".join(re.escape(word) for word in CALLED.get(part, part).split("|"))
        assert re.search(rf"(?<!\w)({said})(s|es)?(?!\w)", kind), f"{name}: {kind!r} says nothing of {part}"
    whole = re.sub(r"array(_like)? of (int|bool|str)s?", "", kind)
    if re.search(r"\b(float|array|array_like)\b", whole):
        assert UNIT.search(kind), f"{name}: {kind!r} names no unit, and does not say that there is none"
    if re.search(r"\barray(_like)?\b", kind):
        assert SHAPE.search(kind), f"{name}: {kind!r} names no shape"
    if VECTOR.search(kind) and not re.search(r"array(_like)? of (int|bool)", kind):
        assert FRAME.search(entry), f"{name}: {kind!r} names no frame"
    assert words, f"{name}: says nothing about it"


def check_all(listed: str, expected: dict[str, Any]) -> None:
    """Check that a section has exactly the given names in order."""
    found = named(listed)
    assert list(found) == list(expected)
    for name, annotation in expected.items():
        check_kind(name, annotation, found[name])


def each(check: Callable[..., None], cases: Iterable[tuple[Any, ...]]) -> None:
    """Run a check on every name and report all failures."""
    failed = []
    for case in cases:
        try:
            check(*case)
        except (AssertionError, KeyError, ValueError) as error:
            failed.append(f"{case[0]}: {type(error).__name__} {str(error).splitlines()[:1]}")
    assert not failed, "\n".join(failed)


PUBLIC = {
    name: value
    for name, value in CALLABLES.items()
    if not (inspect.isclass(value) and issubclass(value, Enum))
}


@pytest.mark.parametrize("name", [name for name in PUBLIC if "Examples" in sections(PUBLIC[name].__doc__)])
def test_examples_run(name: str) -> None:
    """Examples run with `cf` and `np` and print what they state."""
    examples = doctest.DocTestFinder(recurse=False).find(PUBLIC[name], name, globs={"cf": cf, "np": np})
    assert [doctest.DocTestRunner().run(one).failed for one in examples] == [0]


def check_parameters_are_those_of_the_signature(name: str) -> None:
    """Check parameters; those of a result are its fields, under Attributes."""
    value, found = PUBLIC[name], sections(PUBLIC[name].__doc__)
    if inspect.isclass(value) and name in RESULTS:
        fields = [field for field in dataclasses.fields(value) if not field.name.startswith("_")]
        assert "Parameters" not in found
        check_all(found["Attributes"], {field.name: evaluated(field.type, value) for field in fields})
        return
    given = inspect.signature(value).parameters
    expected = {one: evaluated(given[one].annotation, value) for one in arguments(value)}
    assert ("Parameters" in found) == bool(expected)
    if expected:
        check_all(found["Parameters"], expected)
        for one, entry in named(found["Parameters"]).items():
            default = given[one].default is not inspect.Parameter.empty
            assert default == bool(re.search(r"\boptional\b|\bdefault\b", entry.partition("\n")[0])), one


def check_returns(name: str) -> None:
    value, found = PUBLIC[name], sections(PUBLIC[name].__doc__)
    if inspect.isclass(value):
        assert "Returns" not in found
        return
    annotation = evaluated(inspect.signature(value).return_annotation, value)
    assert ("Returns" in found) == (annotation is not None)
    if annotation is not None:
        heads = entries(found["Returns"])
        if get_origin(annotation) is tuple and len(heads) > 1:  # each with a name
            for (one, entry), kind in zip(named(found["Returns"]).items(), get_args(annotation), strict=True):
                check_kind(one, kind, entry)
        else:
            (head,) = heads
            check_kind("Returns", annotation, f"{head}\n{heads[head]}")


def getter(value: Any) -> Any:
    """Return the function of a property."""
    return value.fget if isinstance(value, property) else value.func


def check_property(name: str, value: Any) -> None:
    """Check that a property states unit and shape."""
    text = value.__doc__ or ""
    annotation = evaluated(inspect.signature(getter(value)).return_annotation, getter(value))
    if {"float", "ndarray"} & parts(annotation) or annotation is Any:
        assert UNIT.search(text)
    if "ndarray" in parts(annotation) or annotation is Any:
        assert re.search(r"\([^)]*,[^)]*\)|\bshape\b", text)


def test_parameters_are_those_of_the_signature() -> None:
    each(check_parameters_are_those_of_the_signature, [(name,) for name in PUBLIC])


def test_returns_are_those_of_the_signature() -> None:
    each(check_returns, [(name,) for name in PUBLIC])


def test_properties_name_unit_and_shape() -> None:
    each(check_property, properties())
