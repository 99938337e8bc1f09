"""Base class of the tables of a scenario file, types that they share, and error messages."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from math import inf
from typing import Annotated, Any, ClassVar, Literal, Self, get_args, get_origin

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)
from pydantic.fields import FieldInfo

from closeform.scenario.quantity import (
    ANGLE,
    BALLISTIC,
    DURATION,
    LENGTH,
    MASS,
    RATE,
    SHARE,
    SPEED,
    TIME,
    Duration,
    Either,
    Parts,
    Proving,
    Reader,
    shown,
    unit_of,
)

Groups = tuple[tuple[str, ...], ...]
UNKNOWN_VERB = "unknown_verb"  # type of the error of a stage whose `do` is missing or unknown


def setting(
    example: str,
    help: str,
    default: Any = None,
    *,
    needs: str = "",
    only_with: str = "",
    only_if: Mapping[str, tuple[Any, ...]] | None = None,
    excludes: str = "",
    **checks: Any,
) -> Any:
    """Return the description of a key, from which its checks, messages and reference derive.

    `example` is a value as written in a file and `help` one line. A key with the default `...` is required.
    The key `needs` another field, is allowed `only_with` one of several fields and `only_if` a field has one
    of some values, and `excludes` others. `checks` are those of pydantic, such as `ge` and `alias`.
    """
    usual = {"default_factory": default} if callable(default) else {"default": default}
    rules: Any = {"needs": needs, "only_with": only_with.split(), "excludes": excludes.split()}
    rules["only_if"] = dict(only_if or {})
    return Field(examples=[example], description=help, json_schema_extra=rules, **usual, **checks)


class Table(BaseModel):
    """Frozen table that rejects unknown keys.

    `alternatives`: groups of fields, of each of which exactly one is given.
    """

    alternatives: ClassVar[Groups] = ()
    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_by_alias=True
    )

    @classmethod
    def examples(cls) -> dict[str, str]:
        """Return every key of the table as written in the file, with an example of its value."""
        return {
            cls.key_of(name): str(field.examples[0]) if field.examples else ""
            for name, field in cls.model_fields.items()
        }

    @classmethod
    def reference(cls) -> Iterator[tuple[str, str, str, str]]:
        """Yield each key of the table: its name, values or an example, its default and its meaning."""
        for name, field in cls.model_fields.items():
            is_list = get_origin(field.annotation) is tuple
            parts = () if is_list else (field.annotation, *get_args(field.annotation))
            words = [word for part in parts for word in choices(part)]
            example = " or ".join(words) or (field.examples or [""])[0]
            default = "required" if field.is_required() else default_text(field)
            meaning = "; ".join([field.description or "", *cls.rules_of(name)])
            yield cls.key_of(name), example, default, meaning

    @classmethod
    def rules_of(cls, name: str) -> Iterator[str]:
        """Yield each rule of a field as words of the reference."""
        rules: Any = cls.model_fields[name].json_schema_extra or {}
        words = {"needs": rules.get("needs", "").split(), "with": rules.get("only_with", [])}
        words["not with"] = rules.get("excludes", [])
        for rule, others in words.items():
            if others:
                yield f"{rule} {' or '.join(f'`{cls.key_of(other)}`' for other in others)}"
        for other, values in rules.get("only_if", {}).items():
            yield f"with {cls.key_of(other)} = {' or '.join(map(json.dumps, values))}"

    @classmethod
    def missing(cls, key: str) -> str:
        """Return the message for a missing key, with its remedy."""
        example = cls.examples().get(key)
        return (
            f"missing; add for example {key} = {example}" if example else "missing; see docs/scenario_keys.md"
        )

    @classmethod
    def key_of(cls, name: str) -> str:
        """Return the key in the file for a field name."""
        return cls.model_fields[name].alias or name

    @model_validator(mode="after")
    def fits(self) -> Self:
        """Raise ValueError, with one line per inconsistency among the keys."""
        if flaws := self.all_flaws():
            raise ValueError("\n".join(flaws))
        return self

    def all_flaws(self) -> list[str]:
        """Return one line per inconsistency among the keys, as `what is wrong; remedy`."""
        found = [flaw for group in self.alternatives for flaw in self.one_of(group)]
        for name, field in type(self).model_fields.items():
            rules: Any = field.json_schema_extra or {}
            found += self.unmet(name, rules.get("needs", ""), rules.get("only_with", []))
            found += self.excluded(name, rules.get("excludes", []), rules.get("only_if", {}))
        return list(dict.fromkeys(found or self.flaws()))

    def flaws(self) -> Iterator[str]:
        """Yield one line per inconsistency of keys that agree with their descriptions."""
        return iter(())

    def unmet(self, name: str, needed: str = "", partners: Sequence[str] = ()) -> Iterator[str]:
        """Yield a flaw of a given key without the key that it needs, or without any of its partners."""
        key, other = self.key_of(name), needed and self.key_of(needed)
        if needed and getattr(self, name) is not None and getattr(self, needed) is None:
            yield f"{key} needs {other}; add for example {other} = {self.examples()[other]}"
        given = name in self.model_fields_set and getattr(self, name) is not None
        if partners and given and not any(getattr(self, one) for one in partners):
            keys = " or ".join(map(self.key_of, partners))
            yield f"{key} requires {keys}; add one, or remove {key}"

    def excluded(
        self, name: str, others: Sequence[str], only_if: Mapping[str, tuple[Any, ...]]
    ) -> Iterator[str]:
        """Yield a flaw for each key that a given key excludes, and for each whose value it does not allow."""
        if name not in self.model_fields_set or not getattr(self, name):
            return
        key = self.key_of(name)
        for other in others:
            if other in self.model_fields_set and getattr(self, other):
                yield f"{key} and {self.key_of(other)} exclude each other; keep one"
        for other, values in only_if.items():
            if getattr(self, other) not in values:
                either = " or ".join(map(json.dumps, values))
                yield f"{key} requires {self.key_of(other)} = {either}; change or remove one of them"

    def one_of(self, names: Sequence[str]) -> Iterator[str]:
        """Yield a flaw unless exactly one of the keys is given."""
        keys = {name: self.key_of(name) for name in names}
        given = [key for name, key in keys.items() if getattr(self, name) is not None]
        if len(given) > 1:
            yield f"{' and '.join(given)} exclude each other; keep one"
        if not given:
            first = f"{keys[names[0]]} = {self.examples()[keys[names[0]]]}"
            yield f"needs one of {', '.join(keys.values())}; add for example {first}"


def notes_of(field: FieldInfo) -> Iterator[Any]:
    """Yield the annotations of a key; those of `X | None` stand with X."""
    yield from field.metadata
    for part in get_args(field.annotation):
        yield from getattr(part, "__metadata__", ())


def default_text(field: FieldInfo) -> str:
    """Return the default of a key as a file writes it, in the units of its example; "" for none."""
    default = field.get_default(call_default_factory=True)
    quantity = re.fullmatch(r'"(?:[-+.\de]+ )+([^"]+)"', (field.examples or [""])[0])
    scale = unit_of(quantity[1])[0] if quantity else 0.0
    if quantity and scale and isinstance(default, float | tuple):
        numbers = default if isinstance(default, tuple) else (default,)
        return f'"{" ".join(f"{number / scale:g}" for number in numbers)} {quantity[1]}"'
    if isinstance(default, tuple) and default and isinstance(default[0], str):
        return json.dumps(default)
    return json.dumps(default) if isinstance(default, str | int | float) else ""


def choices(annotation: Any) -> list[str]:
    """Return the values of a Literal as a file writes them; true and false of a truth value."""
    if annotation is bool:
        return ["true", "false"]
    return [json.dumps(one) for one in get_args(annotation)] if get_origin(annotation) is Literal else []


def as_name(value: Any) -> str:
    """Return a valid name: printable, without surrounding space, at most 24 characters."""
    if not isinstance(value, str):
        raise ValueError(f'{shown(value)} is not a name; write for example "F1"')
    if not value.isprintable() or value != value.strip() or not 1 <= len(value) <= 24:
        raise ValueError(
            f"{shown(value)} is not a name; use 1 to 24 printable characters without space around them"
        )
    return value


def as_proving(value: Any) -> Proving:
    """Return the end of a proof from a time, a gap in percent, or both."""
    parts = [part.strip() for part in value.split(",")] if isinstance(value, str) else []
    gaps = [part for part in parts if part.endswith(("%", "ppm"))]
    times = [part for part in parts if part not in gaps]
    if not parts or max(len(gaps), len(times)) > 1 or any("orbit" in part for part in times):
        remedy = 'write for example "10 s", "1 %" or "10 s, 1 %"'
        raise ValueError(f"{shown(value)} is not a time or gap; {remedy}")
    given = {"seconds": Reader(TIME, least="positive").numbers(times[0])[0]} if times else {}
    if gaps:
        given["gap"] = Reader(SHARE, least="positive").numbers(gaps[0])[0]
    return Proving(**given)


as_inertial = Parts(
    (Reader(LENGTH, 3), Reader(SPEED, 3)),
    "a position, a comma and a velocity",
    '"6928 0 0 km, 0 -1 7.5 km/s"',
)
Name = Annotated[str, BeforeValidator(as_name)]
Names = Annotated[tuple[Name, ...], Field(strict=False, min_length=1)]
FileName = Annotated[str, Field(min_length=1)]
Vector = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
Length = Annotated[float, Reader(LENGTH, least="positive")]
Lengths = Annotated[Vector, Reader(LENGTH, 3, "positive")]
Position = Annotated[Vector, Reader(LENGTH, 3)]
Velocity = Annotated[Vector, Reader(SPEED, 3)]
Inertial = Annotated[Six, as_inertial]
Angle = Annotated[float, Reader(ANGLE)]
Turn = Annotated[float, Reader(ANGLE, least="positive")]
Rate = Annotated[float, Reader(RATE, least="positive")]
Mass = Annotated[float, Reader(MASS, least="positive")]
Seconds = Annotated[float, Reader(TIME, least="positive")]
Speed = Annotated[float, Reader(SPEED, least="positive")]
Ballistic = Annotated[float, Reader(BALLISTIC, least="zero")]
Delay = Annotated[float, Reader(TIME, least="zero")]
Deviation = Annotated[float, Reader(LENGTH, least="zero")]
SpeedDeviation = Annotated[float, Reader(SPEED, least="zero")]
AngleDeviation = Annotated[float, Reader(ANGLE, least="zero")]
Span = Annotated[Duration, Reader(DURATION, least="positive")]
Margin = Annotated[float | Literal["auto"], Either("auto", "auto", Reader(LENGTH, least="zero"))]
Drift = Annotated[Duration, Either("forever", Duration(seconds=inf), Reader(DURATION, least="zero"))]
Proof = Annotated[Proving, BeforeValidator(as_proving)]
Share = Annotated[float, Reader(SHARE, least="zero")]


Place = tuple[int | str, ...]


class ScenarioError(ValueError):
    """Invalid scenario; `lines` has one line for each error."""

    def __init__(self, file: str, complaints: Iterable[str]) -> None:
        found = tuple(complaints)
        self.lines = tuple(dict.fromkeys(one_line(f"{file}: {complaint}") for complaint in found))
        super().__init__(file, found)  # which a copy in another process is made of

    def __str__(self) -> str:
        return "\n".join(self.lines)


def one_line(text: str) -> str:
    """Return the text with every unprintable character, such as a line break, as an escape."""
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode() for c in text
    )


def dotted(place: Place) -> str:
    """Return a place in the file as text, such as `stage[2].keep_out.sphere`, counted from one."""
    text = ""
    for part in place:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        elif is_tag(part):
            continue
        else:
            key = part if re.fullmatch(r"[A-Za-z0-9_-]+", part) else shown(part)
            text += f".{key}" if text else key
    return text


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
        place, value = found["loc"], found["input"]
        if found["type"] == "too_short" and value:
            continue  # pydantic does not count invalid items, which have errors of their own
        if found["type"] == UNKNOWN_VERB and isinstance(value, dict):
            place = *place, "do"
        for line in message(found, table).split("\n"):
            yield place, line


def message(found: Any, table: type[Table]) -> str:
    """Return one pydantic error as `what is wrong; remedy`."""
    place, kind, value, context = found["loc"], found["type"], found["input"], found.get("ctx", {})
    key = next(reversed(keys_in(place)), "")
    owner = owner_of(table, place)
    keys = owner.examples() if owner is not None else {}
    example = f"{key} = {keys[key]}" if keys.get(key) else "what docs/scenario_keys.md says"
    if kind == "missing" and owner is not None:
        return owner.missing(key)
    if kind == "extra_forbidden":
        inside = [] if owner is None or get_close_matches(key, keys) else alike(key, keys_inside(owner), 1)
        return f"unknown key; {did_you_mean(key, keys, inside or None)}"
    if kind == "value_error":
        return str(context["error"])
    if kind == UNKNOWN_VERB and isinstance(value, dict):
        if "do" not in value:
            return f'missing; add for example do = "{context["verbs"][0]}"'
        return f"{shown(value['do'])} is not known here; {did_you_mean(str(value['do']), context['verbs'])}"
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
        UNKNOWN_VERB: "is not a table",
        "model_type": "is not a table",
        "finite_number": "is not finite",
        "greater_than": f"is not above {context.get('gt')}",
        "greater_than_equal": f"is below {context.get('ge')}",
        "less_than_equal": f"is above {context.get('le')}",
    }.get(kind, "does not fit")
    return f"{shown(value)} {what}; write for example {example}"


def keys_in(place: Place) -> list[str]:
    """Return the keys of a place, without indices and tags."""
    return [part for part in place if isinstance(part, str) and not is_tag(part)]


def tag(kind: str) -> str:
    """Return the mark in a place of one of several kinds of table, by the name of its class."""
    return f"<{kind}>"


def is_tag(part: str) -> bool:
    """Return True for a `tag`."""
    return part.startswith("<") and part.endswith(">")


def owner_of(table: type[Table], place: Place) -> type[Table] | None:
    """Return the table class that the last key of a place belongs to, or None."""
    owner: type[Table] | None = table
    keys = keys_in(place)
    tags = [part for part in place if isinstance(part, str) and is_tag(part)]
    for key in keys[:-1]:
        field = {f.alias or name: f for name, f in owner.model_fields.items()}.get(key) if owner else None
        if field is not None:  # otherwise a key of a free mapping like [study.vary]
            tables = [*tables_in(field.annotation)]
            owner = next((one for one in tables if tag(one.__name__) in tags), tables[0] if tables else None)
    return owner


def keys_inside(table: type[Table]) -> Iterator[str]:
    """Yield the keys of nested tables, such as `elements.altitude`."""
    for name, field in table.model_fields.items():
        for inner in tables_in(field.annotation):
            yield from (f"{table.key_of(name)}.{key}" for key in inner.examples())


def tables_in(annotation: Any) -> Iterator[type[Table]]:
    """Yield the table classes in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for part in get_args(annotation):
        yield from tables_in(part)
