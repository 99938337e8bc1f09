"""The scene of a viewer page, read by an HTML parser and decoded according to its schema."""

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np

CONTRACT = (Path(__file__).parents[1] / "web" / "scene.d.ts").read_text(encoding="utf-8")


class Parts(HTMLParser):
    """The text of each script by its id, all other text, and all that a browser would load or open."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.scripts: dict[str | None, str] = {}
        self.text: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.within: list[tuple[str, str | None]] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag in ("script", "style"):
            self.within.append((tag, dict(attrs).get("id")))

    def handle_endtag(self, tag: str) -> None:
        if tag in ("script", "style"):
            self.within.pop()

    def handle_data(self, data: str) -> None:
        if not self.within:
            self.text.append(data)
        elif self.within[-1][0] == "script":
            name = self.within[-1][1]
            self.scripts[name] = self.scripts.get(name, "") + data


class Seen:
    """A scene as the page has it."""

    def __init__(self, record: dict[str, Any], numbers: str) -> None:
        self.record, self.bytes = record, base64.b64decode(numbers, validate=True)

    @classmethod
    def of(cls, page: str) -> "Seen":
        parts = Parts(page)
        return cls(json.loads(parts.scripts["scene"]), parts.scripts["numbers"])

    def rows(self, block: dict[str, Any]) -> np.ndarray:
        """A Block as an array: (rows,) of one column, else (rows, columns)."""
        assert block["at"] % 8 == 0
        count = block["rows"] * block["columns"]
        flat = np.frombuffer(self.bytes, f"<{block['type']}", count, block["at"])
        return flat if block["columns"] == 1 else flat.reshape(block["rows"], block["columns"])

    def state(self, track: dict[str, Any], time: float) -> np.ndarray:
        """Return the position (3,) by SciPy's cubic Hermite spline, away from impulses."""
        from scipy.interpolate import CubicHermiteSpline

        times, states = self.rows(track["times"]), self.rows(track["states"]).astype(float)
        k = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2))
        while times[k + 1] == times[k]:
            k -= 1
        two = slice(k, k + 2)
        return CubicHermiteSpline(times[two], states[two, :3], states[two, 3:])(time)


def fields(name: str) -> dict[str, str]:
    """The fields of an interface of the contract, and their types."""
    body = re.search(rf"^export interface {name} {{\n(.*?)^}}", CONTRACT, re.DOTALL | re.MULTILINE)
    assert body, name
    plain = re.sub(r"/\*\*.*?\*/", "", body[1], flags=re.DOTALL)
    return {key: kind.strip() for key, kind in re.findall(r"^  (\w+): (.*);$", plain, re.MULTILINE)} | {
        key: f"{{{kind}}}"
        for key, kind in re.findall(r"^  (\w+): {\n(.*?)^  };$", plain, re.DOTALL | re.MULTILINE)
    }


INTERFACES = re.findall(r"^export interface (\w+)", CONTRACT, re.MULTILINE)


def fits(value: Any, kind: str) -> bool:
    """Whether a value of JSON is of a type of the contract."""
    kind = kind.strip()
    if len(choices := split(kind, "|")) > 1:
        return any(fits(value, choice) for choice in choices)
    if kind.endswith("[]"):
        inner = kind[:-2].strip()
        inner = inner[1:-1] if inner.startswith("(") else inner
        return isinstance(value, list) and all(fits(one, inner) for one in value)
    if kind.startswith("["):
        kinds = split(kind[1:-1], ",")
        return isinstance(value, list) and len(value) == len(kinds) and all(map(fits, value, kinds))
    if kind.startswith("{"):
        inside = [one.partition(":") for one in split(kind[1:-1], ";") if one.strip()]
        wanted = {key.strip(): inner for key, _, inner in inside}
        return is_record(value, wanted)
    if kind in INTERFACES:
        return is_record(value, fields(kind))
    if kind == "Pairs":
        return fits(value, "{ kind: number[]; table: number[][]; moves: boolean[] } | null")
    simple: dict[str, Any] = {
        "string": str,
        "boolean": bool,
        "null": type(None),
        "number": (int, float),
        "Index": int,
        "Vector": None,
    }
    if kind == "Vector":
        return fits(value, "[number, number, number]")
    if kind in simple:
        return isinstance(value, simple[kind]) and (kind == "boolean" or not isinstance(value, bool))
    return json.dumps(value) == kind  # a literal


def is_record(value: Any, wanted: dict[str, str]) -> bool:
    if not isinstance(value, dict):
        return False
    assert value.keys() == wanted.keys(), sorted(value.keys() ^ wanted.keys())
    for key, kind in wanted.items():
        assert fits(value[key], kind), (key, kind, value[key])
    return True


def split(kind: str, at: str) -> list[str]:
    """A type cut at a sign that is in no bracket."""
    parts, depth = [""], 0
    for letter in kind:
        depth += (letter in "[{(") - (letter in "]})")
        if letter == at and not depth:
            parts.append("")
        else:
            parts[-1] += letter
    return [part for part in parts if part.strip()]


def assert_linked(folder: Path, name: str = "report.html") -> None:
    """A page that loads nothing from anywhere, and whose links lead into itself or to a file beside it."""
    page = (folder / name).read_text(encoding="utf-8")
    marks = re.findall(r' id="([^"]*)"', page)
    assert len(marks) == len(set(marks))
    sources = re.findall(r'src="([^"]{0,40})', page)
    assert all(re.match(r"data:image/(png|gif);base64,", source) for source in sources)
    links = re.findall(r'href="([^"]*)"', page)
    assert links
    for link in links:
        assert link[1:] in marks if link.startswith("#") else (folder / link).exists(), link
    assert "http" not in re.sub(r"data:[^\"]*", "", page)
