"""The files that a scenario names: found beside it, read once, their contents known by a digest."""

import hashlib
from pathlib import Path

from closeform.exchange.ephemeris import Ephemeris
from closeform.exchange.oem import read_oem

DOUBTFUL = 1.0  # m: by how much a state may be off that is interpolated


class Inputs:
    """Files by the names that a scenario gives them, which count from its `folder`.

    `digests`: SHA-256 of each; `notes`: which states were interpolated, and how far they may be off.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.digests: dict[str, str] = {}
        self.notes: list[str] = []
        self._ephemerides: dict[str, Ephemeris] = {}

    def read(self, name: str) -> Path:
        """Where a file is, whose contents are noted.  Raises ValueError if it cannot be read."""
        place = self.folder / name
        if name not in self.digests:
            try:
                self.digests[name] = hashlib.sha256(place.read_bytes()).hexdigest()
            except OSError as error:
                raise ValueError(
                    f"{place}: {(error.strerror or 'cannot be read').lower()}; check the path"
                ) from None
        return place

    def ephemeris(self, name: str) -> Ephemeris:
        """What an OEM holds.  Raises ValueError, with file and line, for what is none."""
        if name not in self._ephemerides:
            self._ephemerides[name] = read_oem(self.read(name))
        return self._ephemerides[name]

    def interpolated(self, name: str, error: float) -> None:
        """Note that the state at the epoch lies between those of a file, by estimate so far off [m]."""
        if error > DOUBTFUL:
            raise ValueError(
                f"{name}: at the epoch a state between its own may be off by {error:.3g} m; "
                "give states closer together, or the epoch of one"
            )
        if error > 0.0:
            self.notes.append(
                f"{name}: state at the epoch interpolated, off by up to {error:.2g} m, by estimate"
            )
