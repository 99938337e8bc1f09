"""What a reader does with a page of results: plays it, scrubs, clicks, turns, resizes, sends a moment."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread
from numpy.typing import NDArray
from pagereader import EXAMPLES, Reader, fly

pytestmark = pytest.mark.browser
Sides = dict[str, float]


def seen(reader: Reader, view: str) -> NDArray[Any]:
    """Pixels of a view (height, width, 3), from 0 to 1, without its frame."""
    box: Sides = reader.page.locator(f".pane.{view}").bounding_box()
    clip = {"x": box["x"] + 2, "y": box["y"] + 2, "width": box["width"] - 4, "height": box["height"] - 4}
    return imread(io.BytesIO(reader.page.screenshot(clip=clip)))[:, :, :3]


def colours(picture: NDArray[Any]) -> int:
    """How many colours fill more than a few pixels."""
    levels = (picture * 15.0).round().astype(int) @ np.array([256, 16, 1])
    return int((np.bincount(levels.ravel()) > 20).sum())


def near(picture: NDArray[Any], colour: tuple[float, ...], by: float = 0.12) -> int:
    """How many pixels have about a colour."""
    return int((abs(picture - np.array(colour)) < by).all(axis=2).sum())


def labels(reader: Reader) -> list[list[list[float]]]:
    """Boxes (left, top, right, bottom) of the names in each view that is shown."""
    boxes = "app.views.filter(v => v.shown).map(v => app.marks.labels.get(v.key).boxes)"
    return reader.ask(boxes)


def overlaps(boxes: list[list[float]]) -> int:
    found = 0
    for k, (left, top, right, bottom) in enumerate(boxes):
        found += sum(left < c and a < right and top < d and b < bottom for a, b, c, d in boxes[:k])
    return found


@pytest.mark.parametrize("name", EXAMPLES)
def test_plays_every_example(reader: Reader, pages: dict[str, Path], name: str) -> None:
    reader.open(pages[name])
    assert reader.page.locator("#still").is_hidden()
    assert reader.page.locator("#viewer h1").inner_text() == reader.ask("app.scene.title")
    for share in (0.0, 0.3, 0.5, 0.8, 1.0):
        reader.go(share)
        shown = labels(reader)
        assert len(shown) == 3
        assert shown[0]  # somebody is named
        assert [overlaps(boxes) for boxes in shown] == [0, 0, 0]
    box, current = (reader.page.locator(f".events{one}").bounding_box() for one in ("", " [aria-current]"))
    assert box["y"] - 1 <= current["y"] <= box["y"] + box["height"] - current["height"] + 1  # in sight
    assert all(colours(seen(reader, view)) > 5 for view in ("oblique", "top", "close"))
    reader.go(0.2)
    began = reader.ask("app.player.time")
    reader.page.keyboard.press("Space")
    reader.wait(f"app.player.time > {began}")
    reader.page.keyboard.press("Space")
    stopped = reader.ask("app.player.time")
    reader.page.wait_for_timeout(150)
    assert reader.ask("app.player.time") == stopped
    assert reader.ask("app.player.playing") is False


def test_scrubs_and_steps(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["swap"])
    line: Sides = reader.page.locator(".line").bounding_box()
    reader.page.mouse.click(line["x"] + line["width"] / 2, line["y"] + line["height"] - 5)
    middle = reader.ask("(app.player.time - app.scene.start) / (app.scene.end - app.scene.start)")
    assert middle == pytest.approx(0.5, abs=0.01)
    step = reader.ask("app.player.step")
    before = reader.ask("app.player.time")
    reader.page.keyboard.press("ArrowRight")
    reader.page.keyboard.press("Shift+ArrowRight")
    assert reader.ask("app.player.time") == pytest.approx(before + 11 * step)
    reader.page.keyboard.press("End")
    assert reader.ask("app.player.time") == reader.ask("app.scene.end")


def test_events_lead_to_their_moment(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["tpf"])
    event = reader.page.locator(".event.lock").nth(2)
    event.click()
    reader.settle()  # the row is marked with the next frame, which a busy machine draws late
    at = reader.ask("app.scene.events.filter(e => e.kind === 'lock')[2]")
    assert reader.ask("app.player.time") == at["time"]
    assert reader.ask("app.chosen") == at["craft"][0]
    assert (
        event.get_attribute("aria-current") == "true"
        or reader.ask(f"app.scene.events.filter(e => e.time === {at['time']}).length") > 1
    )
    # a mark on the time line does the same
    reader.go(0.0)
    x = reader.ask("app.timeline.x(app.scene.events.filter(e => e.kind === 'lock')[0].time)")
    line: Sides = reader.page.locator(".line").bounding_box()
    reader.page.mouse.click(line["x"] + x, line["y"] + 27)
    assert reader.ask("app.player.time") == reader.ask(
        "app.scene.events.filter(e => e.kind === 'lock')[0].time"
    )


def test_sets_and_locks_of_a_search(reader: Reader, pages: dict[str, Path]) -> None:
    """As H03 tells: after 12 minutes a formation of two, after 16 a set of three besides, then all."""
    reader.open(pages["tpf"])
    told = {0.0: [-1] * 5, 12.5: [0, 0, -1, -1, -1], 16.5: [0, 0, 1, 1, 1]}
    for minutes, held in told.items():
        reader.ask(f"app.player.go({60 * minutes})")
        reader.settle()
        assert reader.ask("app.scene.craft.map((_, k) => app.moment.label(k))") == held
    reader.go(1.0)
    assert reader.ask("app.scene.craft.map((_, k) => app.moment.label(k))") == [0] * 5
    assert [1, 2] in reader.ask("app.moment.locks.now")


def test_follows_a_craft_that_nobody_hides(reader: Reader, pages: dict[str, Path]) -> None:
    """In the middle of the swap all are close: the dot of who is followed is in the close view's middle."""
    reader.open(pages["swap"])
    for craft in (0, 4, 8):
        reader.page.locator("select.follow").select_option(str(craft))
        reader.go(0.5)
        assert reader.ask("app.chosen") == craft
        colour = reader.ask(f"app.palette.craft(app.scene.craft[{craft}].colour)")
        parts = tuple(int(str(colour)[k : k + 2], 16) / 255 for k in (1, 3, 5))
        picture = seen(reader, "close")
        middle = picture[picture.shape[0] // 2 - 8 :, picture.shape[1] // 2 - 8 :][:16, :16]
        assert near(middle, parts, 0.25) > 60
    reader.page.keyboard.press("2")
    assert reader.ask("app.chosen") == 1


def test_turns_zooms_and_goes_home(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["station_ellipsoid"])
    before = seen(reader, "oblique")
    pane: Sides = reader.page.locator(".pane.oblique").bounding_box()
    x, y = pane["x"] + pane["width"] / 2, pane["y"] + pane["height"] / 2
    reader.page.mouse.move(x, y)
    reader.page.mouse.down()
    reader.page.mouse.move(x + 120, y + 40, steps=4)
    reader.page.mouse.up()
    scale = reader.ask("app.views[0].scale")
    reader.page.mouse.wheel(0, -300)
    reader.wait(f"app.views[0].scale < {scale}")
    reader.settle()
    assert abs(seen(reader, "oblique") - before).max() > 0.3
    reader.page.keyboard.press("0")
    reader.settle()
    assert abs(seen(reader, "oblique") - before).max() < 0.05


def test_a_moment_can_be_sent(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["passive_inspector"])
    reader.go(0.4)
    reader.ask("app.follow(0)")
    pane: Sides = reader.page.locator(".pane.top").bounding_box()
    reader.page.mouse.move(pane["x"] + 100, pane["y"] + 100)
    reader.page.mouse.wheel(0, -200)
    reader.wait("location.hash.includes('top=')")
    said = "[app.player.time, app.chosen, app.views[1].scale, ...app.views[1].target]"
    sent, fragment = reader.ask(said), str(reader.ask("location.hash"))
    reader.open(pages["passive_inspector"], fragment)
    assert reader.ask(said) == pytest.approx(sent, rel=1e-4, abs=0.01)


def test_a_foreign_address_is_harmless(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["swap"], "#t=1e99&craft=<b>&oblique=1,2,x&top=1,2,-3,0,0,0&hide=__proto__&one=nobody")
    assert reader.ask("app.player.time") == reader.ask("app.scene.end")


@pytest.mark.parametrize("reader", [{"color_scheme": "dark"}], indirect=True)
def test_dark_and_light(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["swap"])
    dark = seen(reader, "oblique")
    assert np.median(dark) < 0.2
    reader.page.keyboard.press("t")
    reader.settle()
    assert np.median(seen(reader, "oblique")) > 0.9


@pytest.mark.parametrize(
    "reader", [{"viewport": {"width": 390, "height": 844}, "has_touch": True}], indirect=True
)
def test_on_a_phone(reader: Reader, pages: dict[str, Path]) -> None:
    for name in ("station_ellipsoid", "three_sigmas", "tpf"):
        reader.open(pages[name])
        assert reader.ask("document.documentElement.scrollWidth") == 390  # nothing beyond the edge
    reader.go(0.6)
    assert [overlaps(boxes) for boxes in labels(reader)] == [0, 0, 0]
    for button in reader.page.locator(".transport button").all():
        box: Sides = button.bounding_box()
        assert min(box["width"], box["height"]) >= 36  # a finger's
    reader.page.locator(".pane.oblique button").last.tap()
    reader.settle()
    assert reader.ask("app.views.filter(v => v.shown).length") == 1
    reader.page.set_viewport_size({"width": 1920, "height": 1080})
    reader.wait("app.size[0] > 1000")
    assert colours(seen(reader, "oblique")) > 5


@pytest.mark.parametrize("reader", [{"viewport": {"width": 1024, "height": 768}}], indirect=True)
def test_values_over_curves_are_whole_on_a_small_screen(reader: Reader, pages: dict[str, Path]) -> None:
    for name in ("swap", "passive_inspector"):
        reader.open(pages[name])
        for share in (0.0, 0.37, 1.0):
            reader.go(share)
            ends = "[box, box.querySelector('.said').lastChild].map(e => e.getBoundingClientRect().right)"
            strips = reader.ask(f"[...document.querySelectorAll('.strip')].map(box => {ends})")
            assert strips
            assert all(value <= edge for edge, value in strips)


def test_escape_closes_the_help(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["swap"])
    reader.page.keyboard.press("Escape")
    assert reader.page.locator(".keys").is_hidden()
    reader.page.keyboard.press("?")
    assert reader.page.locator(".keys").is_visible()
    reader.page.locator(".layer input").first.focus()
    reader.page.keyboard.press("Escape")
    assert reader.page.locator(".keys").is_hidden()
    assert reader.ask("app.page.help.ariaExpanded") == "false"


def test_folded_tables_are_printed(reader: Reader, pages: dict[str, Path]) -> None:
    report = pages["swap"].with_name("report.html")
    reader.page.goto(report.as_uri())
    table = reader.page.locator("details:not([open]) table").first
    assert not table.is_visible()
    reader.page.emulate_media(media="print")
    assert table.is_visible()


def test_every_control_has_a_name(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["swap"])
    nameless = (
        "[...document.querySelectorAll('button, select, input, [role=slider], [role=img], [tabindex]')]"
        ".filter(e => !(e.ariaLabel || e.textContent.trim() || e.closest('label')?.textContent.trim()))"
        ".length"
    )
    assert reader.ask(nameless) == 0
    reader.page.keyboard.press("Tab")
    outline = "getComputedStyle(document.activeElement).outlineStyle"
    assert reader.ask(outline) == "solid"


def test_a_layer_goes_and_comes(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["station_ellipsoid"])
    zone = reader.page.locator("label.layer", has_text="keep-out zone").locator("input")
    with_zone = seen(reader, "top")
    zone.uncheck()
    reader.settle()
    without = seen(reader, "top")
    assert abs(with_zone - without).max(axis=2).astype(bool).mean() > 0.02
    zone.check()
    reader.settle()
    assert abs(seen(reader, "top") - with_zone).max() < 0.02


def test_faces_stand_where_they_are(reader: Reader, tmp_path: Path) -> None:
    """A box of half-spaces, 80 m along-track and 60 m across: its picture is as large as the scale says."""
    faces = 'half_spaces = "40 40 30 30 20 20 m"'
    normals = "normals = [[0, 1, 0], [0, -1, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]]"
    (tmp_path / "faces.toml").write_text(
        'closeform = 1\ntitle = "Faces"\n[orbit]\naltitude = "500 km"\n[craft]\nname = ["A", "B"]\n'
        'start = [{ palmer = "0 0 0 0 0 0 m" }, { palmer = "0 0 0 200 0 0 m" }]\n'
        f'keep_out = [{{ {faces}, {normals} }}, {{ sphere = "1 m" }}]\n'
        '[[stage]]\ndo = "coast"\nfor = "10 min"\n'
    )
    fly(tmp_path / "faces.toml", tmp_path / "results")
    reader.open(tmp_path / "results" / "viewer.html", "#one=top&hide=grid,names,paths")
    reader.page.keyboard.press("1")
    reader.settle()
    red, green, blue = np.moveaxis(seen(reader, "top"), 2, 0)
    tinted = (red > green + 0.01) & (green > blue + 0.02)
    rows, columns = np.flatnonzero(tinted.any(axis=1)), np.flatnonzero(tinted.any(axis=0))
    scale = reader.ask("app.views[1].scale")
    assert np.ptp(columns) * scale == pytest.approx(80.0, abs=3 * scale)  # a pixel at each edge
    assert np.ptp(rows) * scale == pytest.approx(60.0, abs=3 * scale)


def test_without_webgl(chromium: Any, pages: dict[str, Path]) -> None:
    """Static pictures, and why."""
    page = chromium.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto(pages["swap"].as_uri())
    assert page.locator("#still").is_visible()
    assert "WebGL" in page.locator("#still-reason").inner_text()
    assert page.locator("#still svg").count() >= 1
    assert page.locator("#viewer").is_hidden()
    page.close()


def test_positions_are_those_of_the_paths(reader: Reader, pages: dict[str, Path]) -> None:
    """Between nodes, against the closed form that the run left."""
    import closeform as cf

    reader.open(pages["station_ellipsoid"])
    paths = cf.load(pages["station_ellipsoid"].parent).results[-1].after.paths
    error = reader.ask("app.scene.error")
    for share in np.linspace(0.0, 1.0, 23):
        reader.go(share)
        time = reader.ask("app.player.time")
        shown = np.array(reader.ask("app.moment.positions"))
        assert abs(shown - paths.position(time)).max() <= error + 1e-3  # 1 mm: Float32 at kilometres
