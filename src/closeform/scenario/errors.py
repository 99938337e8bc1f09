"""Error messages of scenario files: one line each, `key: what is wrong; remedy`."""

import re
from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from types import NoneType
from typing import Any, get_args

from pydantic import ValidationError

from closeform.scenario.quantity import shown
from closeform.scenario.table import ALL, EACH, Table

Place = tuple[int | str, ...]


class ScenarioError(ValueError):
    """Invalid scenario; `lines` has one line for each error."""

    def __init__(self, file: str, complaints: Iterable[str]) -> None:
        self.lines = tuple(dict.fromkeys(one_line(f"{file}: {complaint}") for complaint in complaints))
        super().__init__("\n".join(self.lines))


def one_line(text: str) -> str:
    """Return the text with every unprintable character, such as a line break, as an escape."""
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode() for c in text
    )


def dotted(place: Place) -> str:
    """Return a place in the file as text, such as `stage[2].keep_out.sphere`, counted from one."""
    text = ""
    for part in place:
        if part in (ALL, EACH):
            continue
        if isinstance(part, int):
            text += f"[{part + 1}]"
        else:
            key = part if re.fullmatch(r"[A-Za-z0-9_-]+", part) else shown(part)
            text += f".{key}" if text else key
    return text


def key_of(line: str) -> str:
    """Return the key that a line is about, without keys inside its value: `stage[2].to`.

    For draws, the key includes the drawn key: `study.vary."craft.mass"`.
    """
    found = re.match(r'[a-z_]+(?:\[\d+\])?(?:\.[\w-]+)?(?:\."[^"]*")?', line)
    return found[0] if found else line


def meant_by(line: str) -> str | None:
    """Return the known key that a line suggests for an unknown one, or None."""
    found = re.search(r"unknown key; did you mean ([\w-]+)\?$", line)
    return found[1] if found else None


def did_you_mean(word: str, known: Iterable[str], near: Sequence[str] | None = None) -> str:
    """Return the remedy for an unknown word; `near` replaces the similar words among the known ones."""
    choices = list(known)
    found = get_close_matches(word, choices, n=1, cutoff=0.6) if near is None else near
    return f"did you mean {' or '.join(found)}?" if found else f"use one of {', '.join(choices)}"


def alike(key: str, known: Iterable[str], most: int) -> list[str]:
    """Return up to `most` dotted keys whose last part resembles that of `key`, the most similar first."""
    last = {one.rpartition(".")[2]: one for one in known}
    return [last[one] for one in get_close_matches(key.rpartition(".")[2], last, n=most, cutoff=0.7)]


def complaints(error: ValidationError, table: type[Table]) -> Iterator[tuple[Place, str]]:
    """Yield the place and the message of every error that pydantic found in a table."""
    for found in error.errors(include_url=False):
        for line in message(found, table).split("\n"):
            yield found["loc"], line


def message(found: Any, table: type[Table]) -> str:
    """Return one pydantic error as `what is wrong; remedy`."""
    place, kind, value, context = found["loc"], found["type"], found["input"], found.get("ctx", {})
    key = next(reversed(keys_in(place)), "")
    owner = owner_of(table, place)
    keys = owner.examples() if owner is not None else {}
    example = f"{key} = {keys[key]}" if keys.get(key) else "what docs/scenario.md says"
    if kind == "missing":
        return f"missing; add for example {example}"
    if kind == "extra_forbidden":
        inside = [] if owner is None or get_close_matches(key, keys) else alike(key, keys_inside(owner), 1)
        return f"unknown key; {did_you_mean(key, keys, inside or None)}"
    if kind == "value_error":
        return str(context["error"])
    if kind == "literal_error":
        choices = re.findall(r"'([^']*)'", context["expected"])
        if choices and isinstance(value, str):
            return f"{shown(value)} is not known here; {did_you_mean(value, choices)}"
    what = {
        "string_type": "is not a text",
        "float_type": "is not a number",
        "int_type": "is not a whole number",
        "bool_type": "is neither true nor false",
        "tuple_type": "is not a list",
        "dict_type": "is not a table",
        "model_type": "is not a table",
        "finite_number": "is not finite",
        "greater_than": f"is not above {context.get('gt')}",
        "greater_than_equal": f"is below {context.get('ge')}",
        "less_than_equal": f"is above {context.get('le')}",
    }.get(kind, "does not fit")
    return f"{shown(value)} {what}; write for example {example}"


def keys_in(place: Place) -> list[str]:
    """Return the keys of a place, without indices and the marks of a key with two forms."""
    return [part for part in place if isinstance(part, str) and part not in (ALL, EACH)]


def owner_of(table: type[Table], place: Place) -> type[Table] | None:
    """Return the table class that the last key of a place belongs to, or None."""
    owner: type[Table] | None = table
    for key in keys_in(place)[:-1]:
        field = {f.alias or name: f for name, f in owner.model_fields.items()}.get(key) if owner else None
        if field is not None:  # otherwise a key of a free mapping like [study.vary]
            tables = [*tables_in(field.annotation)]
            owner = tables[-1 if EACH in place else 0] if tables else None
    return owner


def keys_inside(table: type[Table]) -> Iterator[str]:
    """Yield the keys of nested tables, such as `elements.altitude`."""
    for name, field in table.model_fields.items():
        for inner in tables_in(field.annotation):
            yield from (f"{table.key_of(name)}.{key}" for key in inner.examples())


def tables_inside(table: type[Table]) -> Iterator[tuple[str, type[Table]]]:
    """Yield each key that holds exactly one kind of table, without a validator, and its class."""
    for name, field in table.model_fields.items():
        kinds = [one for one in get_args(field.annotation) or (field.annotation,) if one is not NoneType]
        if len(kinds) == 1 and kinds == [*tables_in(kinds[0])] and not field.metadata:
            yield table.key_of(name), kinds[0]


def tables_in(annotation: Any) -> Iterator[type[Table]]:
    """Yield the table classes in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for part in get_args(annotation):
        yield from tables_in(part)
