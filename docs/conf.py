"""The documentation site, from the pages as they stand: `sphinx-build -W --keep-going docs build/site`.

Pages read the same on GitHub: tables of contents are given here, formulas stand in ```math blocks.
"""

import re
import sys
from importlib.metadata import version as version_of
from importlib.util import find_spec
from pathlib import Path

from docutils import nodes
from numpydoc.xref import DEFAULT_LINKS
from sphinx.application import Sphinx

import closeform as cf

# To users these are modules of the package; their code has other homes.
sys.modules["closeform.targets"] = cf.targets
sys.modules["closeform.elements"] = cf.elements
sys.modules["closeform.requirements"] = cf.requirements

project = "closeform"
author = "the authors of closeform"
copyright = author
release = version = version_of("closeform")

# The pages below each page, in their order.
CONTENTS = {
    "index": "tutorial guide gallery reference background",
    "guide": (
        "conflicts ephemerides epochs passive_safety uncertainty avoidance formation targets eccentric_chief "
        "fuel field mission_review studies lost_craft search_robustness export motion elements results "
        "notebooks/find notebooks/collide notebooks/move pictures viewer on_board"
    ),
    "reference": "scenario scenario_keys command-line api messages glossary",
    "background": "models theory papers benchmarks peers",
}

# One file that draws formulas as SVG, and asks no network for anything.
MATHJAX = Path(str(find_spec("sphinx-mathjax-offline").origin)).parent / "static" / "mathjax" / "tex-svg.js"

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
]
exclude_patterns = ["_build"]
templates_path = ["_templates"]
default_role = "code"

myst_enable_extensions = ["dollarmath"]
myst_dmath_allow_space = False
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4

autosummary_generate = True
autodoc_typehints = "none"  # sections say more than annotations
numpydoc_show_class_members = False  # members stand on the page of their class
# Kinds of parameters lead to the classes that they name.
numpydoc_xref_param_type = True
DEFAULT_LINKS.clear()  # to the pages of Python and NumPy, which would need a network
numpydoc_xref_ignore = "all"
numpydoc_xref_aliases = {name: f"closeform.{name}" for name in cf._HOMES if name[0].isupper()}
# All that numpydoc checks, but: more than a summary, examples and cross references where nothing asks for
# them (ES, EX, SA), verbs first (SS05: a summary says what comes back), and what tests/test_docstrings.py
# holds better (PR01, PR02: results have attributes; YD01).
numpydoc_validation_checks = {"all", "ES01", "EX01", "SA01", "SS05", "PR01", "PR02", "YD01"}

html_theme = "pydata_sphinx_theme"
html_title = "closeform"
html_static_path = ["_static", str(MATHJAX)]
mathjax_path = MATHJAX.name
html_css_files = ["closeform.css"]
html_show_sourcelink = False
html_sidebars = {page: [] for page in ("index", "tutorial", "gallery")}  # nothing is below them
toc_object_entries_show_parents = "hide"
html_show_copyright = False
html_context = {"default_mode": "auto"}
html_theme_options = {
    "logo": {"text": "closeform"},
    "navbar_align": "left",
    "navbar_persistent": [],
    "navbar_end": ["search-field", "theme-switcher"],
    "show_toc_level": 2,
    "navigation_depth": 2,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": [],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}

DOCS = Path(__file__).parent
# Pages of names that are no longer public, left by an earlier build.
public = set(re.findall(r"^   (\w+)$", (DOCS / "api.md").read_text(encoding="utf-8"), re.MULTILINE))
for page in (DOCS / "api").glob("*.rst"):
    if page.stem.rpartition(".")[2] not in public:
        page.unlink()

TAG = re.compile(r"\\tag\{(\w+)\}")
CITED = re.compile(r"(\(\d\d?[ab]?\))")
NUMBERS = {tag: f"equation-{tag}" for tag in TAG.findall((DOCS / "theory.md").read_text(encoding="utf-8"))}


def append_contents(app: Sphinx, page: str, source: list[str]) -> None:
    """A page's table of contents, which GitHub would show as code."""
    if page in CONTENTS:
        below = "\n".join(CONTENTS[page].split())
        source[0] += f"\n```{{toctree}}\n:hidden:\n\n{below}\n```\n"


def number_formulas(app: Sphinx, doctree: nodes.document) -> None:
    """Formulas as they are written, with their own numbers, which can be linked to."""
    std = app.env.domains.standard_domain
    for block in doctree.findall(nodes.math_block):
        formula = block.astext()
        block["no-wrap"] = True
        block.children = [nodes.Text(rf"\[{formula}\]")]
        for tag in TAG.findall(formula):
            block["ids"].append(NUMBERS[tag])
            std.anonlabels[NUMBERS[tag]] = (app.env.docname, NUMBERS[tag])


def link_formulas(app: Sphinx, doctree: nodes.document) -> None:
    """A number in brackets in the text of the theory leads to its formula."""
    if app.env.docname != "theory":
        return
    prose = nodes.paragraph | nodes.strong
    for text in [one for one in doctree.findall(nodes.Text) if isinstance(one.parent, prose)]:
        linked = [
            nodes.reference("", part, refid=NUMBERS[part[1:-1]])
            if part[1:-1] in NUMBERS
            else nodes.Text(part)
            for part in CITED.split(text.astext())
        ]
        if len(linked) > 1:
            text.parent.replace(text, linked)


def link_pages(app: Sphinx, what: str, name: str, owner: object, options: object, lines: list[str]) -> None:
    """`docs/fuel.md` and `docs/theory.md (13)` of docstrings lead there; |u| and *args are no markup."""
    for k, line in enumerate(lines):
        code = re.split(r"(`[^`]*`)", line)
        code[::2] = [re.sub(r"([|*])", r"\\\1", text) for text in code[::2]]
        cited = re.sub(
            r"docs/theory\.md \((\w+)\)",
            lambda found: f":ref:`theory ({found[1]}) <{NUMBERS[found[1]]}>`",
            "".join(code),
        )
        lines[k] = re.sub(r"docs/([\w-]+)\.md", r":doc:`\1 </\1>`", cited)


def setup(app: Sphinx) -> None:
    app.connect("source-read", append_contents)
    app.connect("doctree-read", link_formulas)
    app.connect("doctree-read", number_formulas)
    app.connect("autodoc-process-docstring", link_pages, priority=400)  # before numpydoc
