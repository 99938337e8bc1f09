"""The examples that come along: their names, their titles, and what stands in them."""

from pathlib import Path

HERE = Path(__file__).parents[1]


def folder() -> Path:
    """Where they are: inside the package as it is installed, in a clone beside `src`."""
    packed = HERE / "examples"
    return packed if packed.is_dir() else HERE.parents[1] / "examples"


def names() -> list[str]:
    """Scenarios to start from, in order."""
    return sorted({file.stem for file in folder().glob("*.toml")})


def text(name: str) -> str:
    """What stands in one."""
    return (folder() / f"{name}.toml").read_text(encoding="utf-8")


def title(name: str) -> str:
    """What one shows, in a line."""
    import tomllib

    return str(tomllib.loads(text(name))["title"])


def studied(name: str) -> bool:
    """Whether it is made for `closeform study`."""
    import tomllib

    return "study" in tomllib.loads(text(name))
