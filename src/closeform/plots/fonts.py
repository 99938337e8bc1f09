"""Text without math parsing, in fonts that contain the required characters."""

from collections.abc import Sequence
from functools import cache
from unicodedata import bidirectional

from matplotlib.font_manager import FontProperties, findfont, fontManager, get_font
from matplotlib.text import Text

from closeform.plots.inputs import texts

LONG = 13  # maximum number of characters of a name
LEFT_TO_RIGHT = "\u200e"  # zero-width mark
WIDE, CJK = "MW@%…", 0x2E80  # characters about as wide as high, and the code point from which all are


def short_names(names: Sequence[str] | None, count: int, what: str = "craft") -> list[str]:
    """Return short labels of spacecraft: their names, shortened in the middle, or their indices.

    A name with characters that no installed font contains becomes its position in the list, such as "#3".
    """
    if names is None:
        return [str(k) for k in range(count)]
    names = texts("names", names, count, what)
    half = LONG // 2
    short = [name if len(name) <= LONG else f"{name[:half]}…{name[-half:]}" for name in names]
    return [upright(name) if None not in fonts(name) else f"#{k}" for k, name in enumerate(short, 1)]


def upright(name: str) -> str:
    """Append a left-to-right mark to a right-to-left name, so that digits after it keep their order."""
    return name + LEFT_TO_RIGHT if any(bidirectional(one) in ("R", "AL") for one in name) else name


def inches(text: str, size: float) -> float:
    """Return the approximate width [inches] of a text at a font size [points]."""
    return sum(1.05 if one in WIDE or ord(one) > CJK else 0.66 for one in text) * size / 72.0


def fonts(text: str) -> tuple[str | None, ...]:
    """Return the font families that a text needs besides the default; None for a character without a font."""
    if text.isascii():
        return ()
    usual = get_font(findfont(FontProperties()))
    return tuple(dict.fromkeys(font_of(one) for one in text if not usual.get_char_index(ord(one))))


@cache
def font_of(letter: str) -> str | None:
    """Return an installed scalable font family that contains a character, or None."""
    for entry in fontManager.ttflist:
        if entry.name.startswith("Last Resort") or "color" in entry.name.lower():
            continue  # placeholder glyphs and colour bitmaps
        font = get_font(entry.fname)
        if font.scalable and font.get_char_index(ord(letter)):
            return entry.name
    return None


def plain(text: Text, *names: str) -> Text:
    """Disable math parsing of a text and set fonts for it and for `names` that it may show later."""
    text.set_parse_math(False)
    if more := [family for family in fonts(text.get_text() + "".join(names)) if family is not None]:
        text.set_fontfamily(["sans-serif", *dict.fromkeys(more)])
    return text
