"""Reference of all keys of a scenario file, from their definitions in closeform.scenario.

python tools/scenario_keys.py > docs/scenario_keys.md
"""

import re
from collections.abc import Iterable, Iterator

from closeform.scenario.formation import Formation
from closeform.scenario.load import File
from closeform.scenario.stages import STAGES
from closeform.scenario.table import Table, tables_in

Row = tuple[str, str, str, str]
INTRODUCTION = """\
# Scenario keys

<!-- made by tools/scenario_keys.py; do not edit -->

Every key of a scenario file, with its values or an example, its default and its meaning. A key without a
default may be left out. In `[craft]` one value applies to all spacecraft; a list gives one for each, in the
order of `name`. [Scenario file](scenario.md) explains how the keys work together, and lists the units.

## Top of the file
"""


def rows(keys: Iterable[Row]) -> Iterator[str]:
    """Yield the lines of a Markdown table of keys."""
    yield from ("| key | value | default | meaning |", "|---|---|---|---|")
    for key, value, default, meaning in keys:
        usual = f"`{default}`" if default not in ("", "required") else default
        yield f"| `{key}` | `{value}` | {usual} | {meaning} |"
    yield ""


def section(heading: str, table: type[Table], keys: Iterable[Row]) -> Iterator[str]:
    """Yield the heading of a table, the first line of its docstring and its keys."""
    keys, shared = list(keys), list(Formation.reference())
    summary = re.sub(r"^Table (\[\w+\]|`\w+`)( of \S+)?: (\S)", lambda m: m[3].upper(), table.__doc__ or "")
    yield from (f"## {heading}", summary.partition("\n")[0], "")
    if issubclass(table, Formation) and table is not Formation:
        keys = [key for key in keys if key not in shared]
        yield from ("Or a [formation](#formations).", "")
    for group in table.alternatives if not issubclass(table, Formation) else ():
        yield from (f"Exactly one of {', '.join(f'`{table.key_of(name)}`' for name in group)} is given.", "")
    if keys:
        yield from rows(keys)


def nested(name: str, table: type[Table], known: set[type[Table]]) -> Iterator[str]:
    """Yield the sections of the tables inside a table that are not `known` yet."""
    for key, field in table.model_fields.items():
        for inner in tables_in(field.annotation):
            if inner not in known:
                known.add(inner)
                heading = f"`{table.key_of(key)}` of {name}"
                yield from section(heading, inner, inner.reference())
                yield from nested(heading, inner, known)


def stages(known: set[type[Table]]) -> Iterator[str]:
    """Yield the sections of [[stage]]: keys that several verbs share, then those of each verb."""
    verbs: dict[Row, list[str]] = {}
    for verb, stage in STAGES.items():
        for row in stage.reference():
            if row[0] != "do":
                verbs.setdefault(row, []).append(verb)
    for group in dict.fromkeys(tuple(found) for found in verbs.values() if len(found) > 1):
        every = len(group) == len(STAGES)
        yield from (f"## [[stage]]: {'every verb' if every else ', '.join(group)}", "")
        kinds = " or ".join(f'"{verb}"' for verb in group)
        do = [("do", kinds, "required", "verb: the kind of stage")] if every else []
        yield from rows(do + [row for row, found in verbs.items() if tuple(found) == group])
    for verb, stage in STAGES.items():
        own = [row for row in stage.reference() if verbs.get(row) == [verb]]
        yield from section(f"[[stage]]: {verb}", stage, own)
        yield from nested(verb, stage, known)


def page() -> str:
    """Return the page of the documentation."""
    known: set[type[Table]] = {
        one for field in Formation.model_fields.values() for one in tables_in(field.annotation)
    }
    tables = {File.key_of(name): [*tables_in(field.annotation)] for name, field in File.model_fields.items()}
    lines = [*rows(row for row in File.reference() if not tables[row[0]])]
    for key, table in ((key, found[0]) for key, found in tables.items() if len(found) == 1):
        lines += [*section(f"[{key}]", table, table.reference()), *nested(f"[{key}]", table, known)]
    lines += stages(known)
    lines += section("Formations", Formation, Formation.reference())
    lines += nested("a formation", Formation, set())
    return "\n".join([INTRODUCTION, *lines])


if __name__ == "__main__":
    print(page(), end="")
