"""Write docs/gallery.md from the examples.

Run from the repository: python tools/gallery.py [--pictures [NAME ...]]
With --pictures, run the examples (some minutes) and draw their pictures anew.
"""

import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from textwrap import fill

from PIL import Image

from closeform.cli.app import main as closeform
from closeform.cli.example_files import studied, text, title

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "gallery.md"
PICTURES = ROOT / "docs" / "images" / "gallery"
WIDTH = 1100  # width of a picture [px]
COLUMNS = 150  # of the page's text
NO_BREAK = "\N{NO-BREAK SPACE}"

# Sections with their examples, and the picture of the result folder that stands for each example.
EXAMPLES = {
    "Search for lost spacecraft": {
        "tpf": "view-4",
        "find_then_fly": "paths",
        "s04": "histogram",
        "s04_counterexample": "manoeuvres",
        "h03": "histogram",
        "robustness": "histogram",
        "pointing_sweep": "sweep",
        "swarm": "view-6",
    },
    "Avoid conflicts": {
        "cluster": "before-after",
        "sp11": "distances",
        "inspector": "stage-2-paths",
        "polar_inspection": "overview",
        "three_sigmas": "tube",
        "slow_encounter": "collision",
    },
    "Move a formation": {
        "swap": "paths",
        "swap_deep_space": "paths",
        "f6_scatter": "stage-2-paths",
    },
    "Eccentric and perturbed orbits": {
        "eccentric_chief": "overview",
        "j2_chief": "stage-1-paths",
    },
    "Minimise delta-v, use real thrusters": {
        "safety_ellipse": "primer",
        "docking": "before-after",
        "swap_impulses": "paths",
        "cubesats": "pulses",
    },
    "Simulate in a high-fidelity model": {
        "simulated_swap": "paths",
        "simulated_cases": "simulated-ratios",
    },
    "Passive safety": {
        "inspector_hold": "drift",
        "passive_inspector": "drift",
        "station_ellipsoid": "drift",
        "station_sphere": "drift",
    },
}

HEAD = """# Gallery

Each scenario in `examples/` has a picture and a command. The command writes a folder with a report, pictures
and tables. `closeform new NAME` copies an example as the start of a [scenario](scenario.md).
"""
TAIL = """
## Simulate a run

Simulate the plan of `simulated_swap` a hundred times, with errors ([mission review](mission_review.md)):

```sh
closeform simulate simulated_swap-results
```

## Ephemerides and messages

`examples/grace` has three hours of GRACE, `slow_encounter.cdm` a conjunction ([more](ephemerides.md)):

```sh
closeform screen examples/grace/GRACE-A.oem examples/grace/GRACE-B.oem --ellipsoid "20 40 20 m"
closeform encounter examples/slow_encounter.cdm
```

## Notebooks

[Will they collide?](notebooks/collide.md), [Will they find each other?](notebooks/find.md) and
[How do they move safely and cheaply?](notebooks/move.md) show the Python interface and its output.
"""


def command_of(name: str) -> list[str]:
    """Return the command and the file of an example."""
    return ["study" if studied(name) else "run", f"examples/{name}.toml"]


def entry(name: str) -> str:
    """Return the section of an example: title, picture, and first comment with the command."""
    comment = []
    for line in text(name).splitlines():
        if not line.startswith("# "):
            break
        comment.append(line.removeprefix("# "))
    command = " ".join(["closeform", *command_of(name)])
    unbroken = command.replace(" ", NO_BREAK)
    about = fill(f"{' '.join(comment)} `{unbroken}`", COLUMNS, break_on_hyphens=False).replace(NO_BREAK, " ")
    return f"### {title(name)}\n![{title(name)}](images/gallery/{name}.png)\n\n{about}"


def page() -> str:
    """Return the text of docs/gallery.md."""
    parts = [HEAD]
    for section, names in EXAMPLES.items():
        parts.append(f"## {section}\n")
        parts += [entry(name) + "\n" for name in names]
    return "\n".join(parts) + TAIL


def draw(name: str, stem: str, folder: Path) -> None:
    """Run an example and keep its picture of that stem, at reduced size and with fewer colours."""
    out = folder / name
    with suppress(SystemExit):  # status 1 is a valid result: lost spacecraft or a conflict
        closeform([*command_of(name), "--out", str(out)])
    found = sorted(out.glob(f"*{stem}*.png"))
    assert found, f"{name}: no {stem} among {sorted(file.name for file in out.glob('*.png'))}"
    picture = Image.open(found[0]).convert("RGB")
    picture.thumbnail((WIDTH, WIDTH))
    picture.quantize(128).save(PICTURES / f"{name}.png", optimize=True)


def main() -> None:
    """Draw the pictures on request, then write the page."""
    pictures, *names = sys.argv[1:] or [""]
    if pictures == "--pictures":
        stems = {name: stem for section in EXAMPLES.values() for name, stem in section.items()}
        with tempfile.TemporaryDirectory() as folder:
            for name in names or stems:
                draw(name, stems[name], Path(folder))
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
