"""Input files that a scenario names: located, read once and identified by a digest."""

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from closeform.exchange.epochs import Epoch
from closeform.scenario.quantity import shown

if TYPE_CHECKING:
    from closeform.exchange.ephemerides.ephemeris import Ephemeris
    from closeform.exchange.formats.states_csv import StateRows

DOUBTFUL = 1.0  # m: largest accepted error of an interpolated state


class Inputs:
    """Files by the names in a scenario, relative to its `folder`.

    Copies in a result folder take precedence. `contents` holds the bytes of each file. `notes` lists the
    interpolated states and their estimated errors.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.contents: dict[str, bytes] = {}
        self.notes: list[str] = []
        self._segments: dict[str, tuple[Ephemeris, ...]] = {}
        self._states: dict[str, StateRows] = {}

    def read(self, name: str) -> Path:
        """Return the path of a file and store its contents; raise ValueError if it cannot be read."""
        try:
            place = self.folder / copy_of(name)
            if not place.exists():
                place = self.folder / name
            if name not in self.contents:
                self.contents[name] = place.read_bytes()
        except OSError as error:
            reason = (error.strerror or "cannot be read").lower()
            raise ValueError(f"{self.folder / name}: {reason}; check the path") from None
        except ValueError:  # a null byte
            raise ValueError(f"{shown(name)}: not a file name; check the path") from None
        return place

    @property
    def digests(self) -> dict[str, str]:
        """SHA-256 of each file by its name."""
        return {name: hashlib.sha256(held).hexdigest() for name, held in self.contents.items()}

    @property
    def copies(self) -> dict[str, bytes]:
        """Contents of each file by its place in a result folder."""
        return {copy_of(name): held for name, held in self.contents.items()}

    def segments(self, name: str) -> "tuple[Ephemeris, ...]":
        """Return all segments of an OEM; raise ValueError, with file and line, if it cannot be read."""
        from closeform.exchange.ccsds.oem import read_oem_segments  # most scenarios do not need it

        if name not in self._segments:
            self._segments[name] = read_oem_segments(self.read(name))
        return self._segments[name]

    def ephemeris(self, name: str, epoch: Epoch) -> "Ephemeris":
        """Return the segment of an OEM at an epoch; of two that meet there, the second.

        Raises ValueError, with file and line, for an invalid file, or if none of several segments covers the
        epoch.
        """
        from closeform.exchange.ephemerides.ephemeris import SAME_EPOCH

        segments = self.segments(name)
        since = [Epoch(one.epoch, one.time_system).until(epoch) for one in segments]
        there = [
            one
            for one, time in zip(segments, since, strict=True)
            if -SAME_EPOCH <= time <= one.times[-1] + SAME_EPOCH
        ]
        if not there and len(segments) > 1:
            what = f"none of its {len(segments)} segments has states at {epoch}"
            raise ValueError(f"{name}: {what}; give an epoch within one")
        return there[-1] if there else segments[0]

    def states(self, name: str) -> "StateRows":
        """Return the rows of a file of states; raise ValueError, with file and line, for an invalid file."""
        from closeform.exchange.ccsds.entries import within
        from closeform.exchange.formats.states_csv import state_rows

        if name not in self._states:
            place = self.read(name)
            with within(place):
                self._states[name] = state_rows(place, timed=False)
        return self._states[name]

    def interpolated(self, name: str, error: float) -> None:
        """Note that the state at the epoch is interpolated, with its estimated error [m].

        Raises ValueError for a large error.
        """
        if error > DOUBTFUL:
            raise ValueError(
                f"{name}: the state interpolated at the epoch may have an error of {error:.3g} m; "
                "give states closer together, or the epoch of one of them"
            )
        if error > 0.0:
            self.notes.append(
                f"{name}: state at the epoch is interpolated, with an estimated error of up to {error:.2g} m"
            )


def copy_of(name: str) -> str:
    """Return the place of a file's copy in a result folder, unique for each name with its folder."""
    return f"inputs/{hashlib.sha256(name.encode()).hexdigest()[:8]}-{Path(name).name}"
