"""Example scenarios of the package: their names, titles and contents."""

from pathlib import Path

HERE = Path(__file__).parents[1]


def folder() -> Path:
    """Return the folder of the examples: inside an installed package, or next to `src` in a clone."""
    packed = HERE / "examples"
    return packed if packed.is_dir() else HERE.parents[1] / "examples"


def names() -> list[str]:
    """Return the names of the examples in alphabetical order."""
    return sorted({file.stem for file in folder().glob("*.toml")})


def text(name: str) -> str:
    """Return the text of an example."""
    return (folder() / f"{name}.toml").read_text(encoding="utf-8")


def title(name: str) -> str:
    """Return the title of an example."""
    import tomllib

    return str(tomllib.loads(text(name))["title"])


def studied(name: str) -> bool:
    """Return True if an example is made for `closeform study`."""
    import tomllib

    return "study" in tomllib.loads(text(name))
