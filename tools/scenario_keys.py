"""Reference of the scenario file in Markdown: each key with values or an example, default (SI) and meaning.

python tools/scenario_keys.py > keys.md
"""

from collections.abc import Iterator

from closeform.scenario.load import TABLES
from closeform.scenario.stages import STAGES
from closeform.scenario.table import Table, tables_in


def lines(name: str, table: type[Table], known: set[type[Table]]) -> Iterator[str]:
    """Yield the keys of a table and of the tables inside it that are not `known` yet."""
    known.add(table)
    yield from (f"## {name}", "", "| key | value | default | meaning |", "|---|---|---|---|")
    yield from (
        f"| `{key}` | `{value}` | {usual} | {help} |" for key, value, usual, help in table.reference()
    )
    yield ""
    for key, field in table.model_fields.items():
        for inner in tables_in(field.annotation):
            if inner not in known:
                yield from lines(f"`{table.key_of(key)}` of {name}", inner, known)


if __name__ == "__main__":
    known: set[type[Table]] = set()
    for key, table in TABLES.items():
        print(*lines(f"[{key}]", table, known), sep="\n")
    for verb, stage in STAGES.items():
        print(*lines(f'[[stage]] with do = "{verb}"', stage, known), sep="\n")
