"""Damaged files: random damage of texts, and errors in one line that begins with the file."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import strategies as st


def spoilt(text: str, data: st.DataObject, letters: str, first: int = 0) -> str:
    """Return a text with up to three parts, from position `first` on, replaced by random ones."""
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(first, len(text)))
        stop = min(len(text), start + data.draw(st.integers(0, 40)))
        text = text[:start] + data.draw(st.text(alphabet=letters, max_size=8)) + text[stop:]
    return text


def read_or_refused(read: Callable[[Path], Any], file: Path) -> Any:
    """Return what a reader finds, or None if it refuses the file in one line that begins with its name."""
    try:
        return read(file)
    except ValueError as error:
        line = str(error)
    assert line.startswith(f"{file}: ")
    assert "\n" not in line
    return None


def assert_refused(read: Callable[[Path], Any], file: Path, expected: str) -> None:
    """Check that a reader refuses a file in one line that begins with its name, and says what is expected."""
    with pytest.raises(ValueError, match=expected) as caught:
        read(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert "\n" not in str(caught.value)
