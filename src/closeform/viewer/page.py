"""HTML page of a scene: its data, the viewer script, and still views as a fallback, in one file."""

import json
import re
from collections.abc import Sequence
from html import escape
from pathlib import Path

from closeform.mission.mission_result import Mission
from closeform.report.page import letters
from closeform.report.picture import Shot
from closeform.storage.result_folder import REPORT, VIEWER, Folder
from closeform.viewer.scene import Scene, scene_of
from closeform.viewer.shown import Shown
from closeform.viewer.stills import stills

HERE = Path(__file__).parent  # `npm run build` in web/ generates the script and its style
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
STILL = (  # added to the style of the interactive page
    "#still{max-width:62rem;margin:0 auto;padding:1rem}"
    "#still svg{width:min(100%,19rem);margin:0 .5rem .5rem 0;border-radius:.4rem;vertical-align:top}"
)
REASON = "The animation requires JavaScript and WebGL, one of which is missing here. Still views follow."
MOST = 1000  # largest number of craft that a browser can animate
ENDS_SCRIPT = re.compile("</(?=script)", re.IGNORECASE)


def write(shown: Shown, folder: Folder, pictures: Sequence[Shot] = (), name: str = VIEWER) -> None:
    """Write the interactive page into a result folder that holds `pictures`."""
    named = [(shot.file.name, shot.caption) for shot in pictures]
    folder.text(name, document(scene_of(shown, named, REPORT)))


def of_mission(mission: Mission) -> str:
    """Return the page of a mission without its pictures."""
    return document(scene_of(Shown.of_mission(mission)))


def document(scene: Scene) -> str:
    """Return a scene as one self-contained HTML document; for more than MOST craft, only its still views."""
    style = (HERE / "viewer.css").read_text(encoding="utf-8")
    count = len(scene.record["craft"])
    crowd = f"{count} craft; more than {MOST} are not animated." if count > MOST else ""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(scene.record['title'])}</title>\n<style>{style}{STILL}</style></head>\n<body>\n"
        f"{still(scene, crowd or REASON)}\n{'' if crowd else in_motion(scene)}</body></html>\n"
    )


def in_motion(scene: Scene) -> str:
    """Return the scene data and the viewer script as HTML."""
    script = ENDS_SCRIPT.sub(r"<\\/", (HERE / "viewer.js").read_text(encoding="utf-8"))
    return (
        f'<div id="viewer"></div>\n<script type="application/json" id="scene">{as_json(scene)}</script>\n'
        f'<script type="text/plain" id="numbers">{scene.numbers}</script>\n<script>{script}</script>\n'
    )


def as_json(scene: Scene) -> str:
    """Return the record as ASCII JSON that cannot end a script element."""
    text = json.dumps(scene.record, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def still(scene: Scene, reason: str) -> str:
    """Return the HTML shown until the script starts: text, still views and links to other pictures."""
    record = scene.record
    tone = "good" if record["ok"] else "bad"
    links = [(REPORT, "report")] if record["report"] else []
    links += [(one["name"], one["title"]) for one in record["pictures"]]
    listed = "".join(f'<li><a href="{escape(name)}">{letters(title)}</a></li>' for name, title in links)
    return (
        f'<main id="still">\n<h1>{letters(record["title"])}</h1>\n<p>{letters(record["opening"])}</p>\n'
        f'<p class="verdict {tone}">{letters(record["verdict"])}</p>\n<p id="still-reason">{reason}</p>\n'
        f"{stills(scene)}\n<ul>{listed}</ul>\n</main>"
    )
