"""Result folder of every report: its pictures, its page and its figures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from closeform.report import page, reproduction
from closeform.report.drawing import drawn
from closeform.report.page import Head
from closeform.report.picture import Progress, Shot
from closeform.report.section import Section
from closeform.storage.result_folder import REPORT, VIEWER, Folder

Viewer = Callable[[Folder, Sequence[Shot]], None]  # writes an animated page next to the pictures

Pages = Callable[[Progress], object]  # writes the pages of cases


def nothing(progress: Progress) -> None:
    """Write no page."""


def leave(
    folder: Folder,
    head: Head,
    chapters: Sequence[Section],
    repeated: Callable[[Sequence[str]], Section],
    figures: Mapping[str, Any],
    progress: Progress = lambda text: None,
    viewer: Viewer | None = None,
    pages: Pages = nothing,
) -> None:
    """Draw all pictures, then write the page and, last, the summary; all other files already exist.

    `repeated` returns the last section from the files next to the page; `viewer` writes an animated page
    next to the pictures; `pages` writes those of cases.
    """
    pictures = [picture for told in chapters for picture in told.pictures]
    shots = drawn(pictures, folder, progress)
    if viewer is not None:
        progress(f"writing {VIEWER}")
        viewer(folder, shots)
    pages(progress)
    files = reproduction.beside(folder)
    whole = [*chapters, repeated(files)]
    folder.text(REPORT, page.document(replace(head, links=reproduction.links(files)), whole, shots))
    folder.summary(figures)
