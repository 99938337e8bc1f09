"""Letters: names are text as it is and no formula, in fonts that have what they are written in."""

from collections.abc import Sequence
from functools import cache
from unicodedata import bidirectional

from matplotlib.font_manager import FontProperties, findfont, fontManager, get_font
from matplotlib.text import Text

from closeform.plots.inputs import texts

LONG = 13  # characters of a name
LEFT_TO_RIGHT = "\u200e"  # a mark without width
WIDE, CJK = "MW@%…", 0x2E80  # letters about as wide as high, and those from which on they are


def short_names(names: Sequence[str] | None, count: int, what: str = "craft") -> list[str]:
    """What craft are called: their names, in the middle cut short where long, or their indices.

    A name with letters that no font of this machine has becomes its place in the row, such as "#3".
    """
    if names is None:
        return [str(k) for k in range(count)]
    names = texts("names", names, count, what)
    half = LONG // 2
    short = [name if len(name) <= LONG else f"{name[:half]}…{name[-half:]}" for name in names]
    return [upright(name) if None not in fonts(name) else f"#{k}" for k, name in enumerate(short, 1)]


def upright(name: str) -> str:
    """A name that does not draw numbers after it into its own direction, if it reads from right to left."""
    return name + LEFT_TO_RIGHT if any(bidirectional(one) in ("R", "AL") for one in name) else name


def inches(text: str, size: float) -> float:
    """About how wide a text is in letters of a `size` in points."""
    return sum(1.05 if one in WIDE or ord(one) > CJK else 0.66 for one in text) * size / 72.0


def fonts(text: str) -> tuple[str | None, ...]:
    """The families beside the usual one that a text needs; None among them where no font has a letter."""
    if text.isascii():
        return ()
    usual = get_font(findfont(FontProperties()))
    return tuple(dict.fromkeys(font_of(one) for one in text if not usual.get_char_index(ord(one))))


@cache
def font_of(letter: str) -> str | None:
    """A family of this machine that has a letter and can be drawn at any size."""
    for entry in fontManager.ttflist:
        if entry.name.startswith("Last Resort") or "color" in entry.name.lower():
            continue  # boxes for what is missing, and letters that are pictures
        font = get_font(entry.fname)
        if font.scalable and font.get_char_index(ord(letter)):
            return entry.name
    return None


def plain(text: Text, *names: str) -> Text:
    """A text, and what it may come to hold of `names`, as letters: `$` and `_` are no formula."""
    text.set_parse_math(False)
    if more := [family for family in fonts(text.get_text() + "".join(names)) if family is not None]:
        text.set_fontfamily(["sans-serif", *dict.fromkeys(more)])
    return text
