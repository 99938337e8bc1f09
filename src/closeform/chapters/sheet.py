"""What a chapter is made of: words and small tables of texts."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Sheet:
    """A small table; `more` is for the report only, not for the terminal; `texts` are columns of words."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    more: bool = False
    texts: tuple[int, ...] = (0,)


@dataclass(frozen=True)
class Chapter:
    """A stage in words and tables."""

    title: str
    lines: tuple[str, ...] = ()
    sheets: tuple[Sheet, ...] = ()
    closing: tuple[str, ...] = ()


def minutes(time: float) -> str:
    """A time [s] as min:s, rounded to a second."""
    whole = round(time)
    return f"{whole // 60}:{whole % 60:02d}"


def counted(number: int, one: str, many: str = "") -> str:
    """A number of things."""
    return f"{number} {one if number == 1 else many or one + 's'}"
