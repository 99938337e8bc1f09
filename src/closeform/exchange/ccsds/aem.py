"""The text of an AEM (CCSDS 504.0-B section 4) of a spacecraft's search attitude, and its quaternions.

The version is 1.0, whose keywords state the convention of quaternions.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.ccsds.message_text import head, keyed
from closeform.exchange.export_tracks.track import FileFrame, text_rows

BODY = "SC_BODY_1"
CONVENTION = (
    "quaternions Q1 Q2 Q3 QC, scalar last, turn the axes of REF_FRAME_A into those of REF_FRAME_B",
    "body z is the boresight, body x the sun shade's normal",
    "each segment is one turn about a fixed axis at a constant rate, or a wait",
)


def quaternions(attitudes: Any) -> Floats:
    """Return quaternions (T, 4), scalar last, of matrices (T, 3, 3) whose columns are the body axes.

    They rotate the frame's axes into the body's (504.0-B-2 annex F2), without jumps of sign.
    """
    from scipy.spatial.transform import Rotation

    found = Rotation.from_matrix(attitudes).as_quat()
    signs = np.where((found[1:] * found[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    first = -1.0 if found[0, 3] < 0.0 else 1.0
    signed: Floats = found * first * np.concatenate([[1.0], np.cumprod(signs)])[:, None]
    return signed


def aem(name: str, object_id: str, frame: FileFrame, turns: list[tuple[Floats, Floats]]) -> str:
    """Return an AEM in key-value form from the times (T,) [s] and quaternions (T, 4) of each turn."""
    parts = ["\n".join([*head("AEM", "1.0", (*frame.about, *CONVENTION)), ""])]
    for times, values in turns:
        stamps = frame.stamps(times)
        metadata = {
            "OBJECT_NAME": name,
            "OBJECT_ID": object_id,
            "REF_FRAME_A": frame.name,
            "REF_FRAME_B": BODY,
            "ATTITUDE_DIR": "A2B",
            "TIME_SYSTEM": frame.epoch.system,
            "START_TIME": stamps[0],
            "USEABLE_START_TIME": stamps[0],
            "USEABLE_STOP_TIME": stamps[-1],
            "STOP_TIME": stamps[-1],
            "ATTITUDE_TYPE": "QUATERNION",
            "QUATERNION_TYPE": "LAST",
            "INTERPOLATION_METHOD": "LINEAR",
            "INTERPOLATION_DEGREE": "1",
        }
        parts.append("\n".join(["", "META_START", *keyed(metadata), "META_STOP", "", "DATA_START", ""]))
        parts.append(text_rows(stamps, " ".join(["%s"] + ["%.16f"] * 4), values))
        parts.append("DATA_STOP\n")
    return "".join(parts)
