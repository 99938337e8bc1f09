"""Base classes of results: text, a table and a picture in a notebook, and columns."""

from __future__ import annotations

import inspect
import re
from base64 import b64encode
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass
from functools import cache, cached_property
from importlib import import_module
from io import BytesIO
from textwrap import fill, shorten
from typing import Any, ClassVar

import numpy as np

WIDTH = 100  # columns of a line
MOST_ROWS = 10  # of a table in a notebook
FIGURE_DPI = 80  # of the picture in a notebook
FEW = 6  # names or numbers that are listed one by one
ENTRY = re.compile(r"^(\w+(?:, \w+)*) : .*\[([^]]*)\](?:, .*)?$", re.MULTILINE)  # entry of a numpydoc section
UNIT = re.compile(r"\[([^]]*)\]")
OF_DELTA_V = re.compile(r"(.+), (?:or (.+) of delta-v|of delta-v (.+))")  # units by cost
POWER = re.compile(r"\^([23])")
RAISED = str.maketrans({"2": "²", "3": "³"})


class Result:
    """Base class of results; `_told` lists the attributes that are printed, by default all fields.

    Units are taken from the docstrings: from the section Attributes for fields, from brackets for properties.
    """

    _told: ClassVar[tuple[str, ...]] = ()

    def __repr__(self) -> str:
        parts = "; ".join(f"{name} {text}" for name, text in self._facts())
        return fill(f"<{type(self).__name__}: {parts}>", WIDTH, subsequent_indent="  ")

    def _repr_html_(self) -> str:
        rows = [[name, text] for name, text in self._facts()]
        return _table(type(self).__name__, [], rows) + self._figure()

    def _figure(self) -> str:
        """Return the picture of `closeform.plot` as an HTML image; empty if there is nothing to draw."""
        try:
            figure = import_module("closeform").plot(self)  # at run time: pictures are made of results
        except (TypeError, ValueError):  # a kind without a picture, or an empty result
            return ""
        figure.savefig(image := BytesIO(), format="png", dpi=FIGURE_DPI)
        data = b64encode(image.getvalue()).decode()
        return f'<img alt="Picture of the {type(self).__name__}" src="data:image/png;base64,{data}">'

    @property
    def _brief(self) -> str:
        """Text for a result that is part of another."""
        return type(self).__name__

    def _facts(self) -> Iterator[tuple[str, str]]:
        """Yield the names and texts of attributes, without those that are absent or have their default."""
        usual = {one.name: one.default for one in fields(self) if one.repr}  # type: ignore[arg-type]  # subclasses are data
        for name in self._told or usual:
            value = getattr(self, name)
            absent = value is None or (isinstance(value, str | tuple) and not value)
            if not absent and repr(value) != repr(usual.get(name, MISSING)):
                yield name.replace("_", " "), told(value, self._unit(name))

    def _unit(self, name: str) -> str:
        """Return the unit of an attribute; if it depends on the cost, the one of this result."""
        kind: Any = type(self)
        unit = units(kind).get(name, "")
        either = OF_DELTA_V.fullmatch(unit)
        if either is None or (cost := getattr(self, "cost", None)) is None:
            return unit
        return (either[2] or either[3]) if cost == "delta-v" else either[1]


class Rows(Result):
    """Result with rows; `_columns` maps attributes to the names of their columns.

    An attribute with one axis more than the others has a name for each component.
    """

    _columns: ClassVar[dict[str, str]] = {}

    def columns(self) -> dict[str, Any]:
        """Return the rows as columns, from which pandas, polars and pyarrow make a data frame.

        Returns
        -------
        dict of str to array of shape (M,) [s, m, m/s, rad, kg, or no unit, as the names say]
            Columns by name and unit, as in the Parquet files of a run; for a batch the last index
            runs fastest.

        References
        ----------
        docs/results.md.
        """
        held = {keys: np.asarray(getattr(self, name)) for name, keys in self._named.items()}
        axes = min(values.ndim for values in held.values())
        found: dict[str, Any] = {}
        for keys, values in held.items():
            if values.ndim == axes:
                found[keys.split()[0]] = values.reshape(-1)
            else:
                found |= {key: values[..., k].reshape(-1) for k, key in enumerate(keys.split())}
        return found

    @property
    def _named(self) -> dict[str, str]:
        """Names of the columns by attribute."""
        return self._columns

    @property
    def _brief(self) -> str:
        rows = len(next(iter(self.columns().values())))
        return f"{rows} row{'s' * (rows != 1)}"

    def _repr_html_(self) -> str:
        if min(np.ndim(getattr(self, name)) for name in self._named) == 0:
            return super()._repr_html_()  # one pair, or one transfer
        columns = {name: np.asarray(values) for name, values in self.columns().items()}
        shown = [values[:MOST_ROWS].tolist() for values in columns.values()]
        rows = [[told(cell, "") for cell in row] for row in zip(*shown, strict=True)]
        return _table(f"{type(self).__name__}: {self._brief}", list(columns), rows) + self._figure()


def told(value: Any, unit: str) -> str:
    """Return a value as text: a number with its unit, or the count and range of several numbers."""
    value = value.item() if isinstance(value, np.ndarray | np.generic) and value.ndim == 0 else value
    if isinstance(value, Result):
        return value._brief
    if isinstance(value, np.ndarray):
        return _array(value, unit)
    if isinstance(value, float):
        return _with(f"{value:.6g}", unit)
    if isinstance(value, tuple):
        return _several(value)
    if isinstance(value, dict):
        if len(value) <= FEW and all(isinstance(one, str | int | float) for one in value.values()):
            return ", ".join(f"{name} {told(one, unit)}" for name, one in value.items())
        return shorten(", ".join(map(str, value)), WIDTH // 2, placeholder=" ...")
    if is_dataclass(value) and type(value).__str__ is object.__str__:
        return type(value).__name__
    return _with(" ".join(str(value).split()), unit)


def _array(values: Any, unit: str) -> str:
    """Return an array as text."""
    shape = ", ".join(map(str, values.shape)) + "," * (values.ndim == 1)
    if values.dtype.kind == "b":
        return f"{np.count_nonzero(values)} of {values.size}"
    if values.dtype.kind not in "iuf" or ", " in unit:  # components of states have different units
        return f"of shape ({shape})"
    if values.ndim == 1 and len(values) <= FEW:
        return _with("[" + ", ".join(f"{one:.6g}" for one in values.tolist()) + "]", unit)
    known = values[np.isfinite(values)]
    span = _with(f"{known.min():.6g} to {known.max():.6g}", unit) if known.size else "none finite"
    return f"of shape ({shape}), {span}"


def _several(values: tuple[Any, ...]) -> str:
    """Return a tuple as text: a few words or numbers one by one, otherwise their count."""
    if len(values) <= FEW and all(isinstance(one, str | int | float) for one in values):
        return ", ".join(told(one, "") for one in values)
    kinds = {type(one).__name__ for one in values}
    return f"{len(values)} {kinds.pop()}" if len(kinds) == 1 else str(len(values))


def _with(text: str, unit: str) -> str:
    """Return a number with its unit and superscript powers."""
    raised = POWER.sub(lambda found: found[1].translate(RAISED), unit)
    return f"{text} {raised}".rstrip()


@cache
def units(kind: type) -> dict[str, str]:
    """Return the units of a class's attributes by name, from its docstrings."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        for names, unit in ENTRY.findall(inspect.cleandoc(base.__doc__ or "")):
            every, several = names.split(", "), unit.split(", ")
            each = several if len(several) == len(every) else [unit] * len(every)
            found |= zip(every, each, strict=True)
        for name, member in vars(base).items():
            if isinstance(member, property | cached_property) and (unit := UNIT.search(member.__doc__ or "")):
                found[name] = unit[1]
    return found


def _table(caption: str, heads: list[str], rows: list[list[str]]) -> str:
    """Return a table in HTML, with escaped text."""
    from html import escape

    head = "<tr>" + "".join(f"<th>{escape(one)}</th>" for one in heads) + "</tr>" if heads else ""
    body = "".join("<tr>" + "".join(f"<td>{escape(one)}</td>" for one in row) + "</tr>" for row in rows)
    inside = f"<caption>{escape(caption)}</caption><thead>{head}</thead><tbody>{body}</tbody>"
    return f"<table>{inside}</table>"
