"""Makes docs/errors.md from the table of bad inputs that the tests run (tests/bad_input.py)."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from bad_input import CALLS, GOOD, LOST, MISUSES, PYTHON, SCENARIOS, SEARCHES, WARNED, Bad  # noqa: E402

HEAD = """\
# Errors

<!-- Made by tools/errors_page.py from tests/bad_input.py; do not edit. -->

Bad input gives one line for each thing that is wrong, on standard error: the file, the key, what
is wrong; the remedy. The exit status is 2, and nothing is written or overwritten. `[2]` after a
key counts from one: `stage[2]` is the second `[[stage]]`, `craft.position[2]` belongs to the
second craft.

## Scenario files

Every row changes one piece of this file, `cluster.toml`, which is good:
"""

LOST_HEAD = """\
## Searches and studies

Every row changes one piece of this file, `lost.toml`, which is good:
"""

PYTHON_HEAD = """\
## Calls from Python

A call that cannot be obeyed raises `ValueError` with one line: the argument, what is wrong; the remedy. Each
stands after these lines:

"""

WARNED_HEAD = """\
## Warnings

What may be meant, and mostly is not, is taken with a warning. After the same lines:
"""


def page() -> str:
    """The whole page."""
    parts = [HEAD, "```toml\n" + GOOD + "```\n", *map(section, SCENARIOS)]
    parts += [LOST_HEAD, "```toml\n" + LOST + "```\n", *map(section, SEARCHES)]
    parts.append("## Command lines\n")
    for misuse in MISUSES:
        parts.append(
            f"### {title(misuse.what)}\n\n```console\n$ closeform {misuse.arguments}\n"
            f"{misuse.message}\n```\n\nStatus {misuse.status}.\n"
        )
    parts.append(PYTHON_HEAD + "```python\n" + PYTHON + "```\n")
    for call in CALLS:
        parts.append(f"### {title(call.what)}\n\n```text\n>>> {call.code}\nValueError: {call.message}\n```\n")
    parts.append(WARNED_HEAD)
    for call in WARNED:
        parts.append(
            f"### {title(call.what)}\n\n```text\n>>> {call.code}\nUserWarning: {call.message}\n```\n"
        )
    return "\n".join(parts)


def section(bad: Bad) -> str:
    """One bad scenario."""
    lines = "\n".join(f"{bad.file}: {line}" for line in bad.message.split("\n"))
    return f"### {title(bad.what)}\n\n{changed(bad)}\n```text\n{lines}\n```\n\nStatus {bad.status}.\n"


def title(what: str) -> str:
    """A heading."""
    return what[0].upper() + what[1:]


def changed(bad: Bad) -> str:
    """What differs from the good file."""
    if not bad.old:
        return f"```toml\n{bad.new.strip()}\n```\n"
    if not bad.new:
        return f"```toml\n{bad.old.strip()}\n```\n\nis left out.\n"
    return f"```toml\n{bad.new.strip()}\n```\n"


if __name__ == "__main__":
    (ROOT / "docs" / "errors.md").write_text(page(), encoding="utf-8")
