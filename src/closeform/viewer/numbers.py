"""Binary block of all number rows of a scene, to which its records refer."""

import base64
from typing import Any, Literal

import numpy as np

ALIGNED = 8  # bytes: alignment that lets a browser read floats without a copy


class Numbers:
    """Block under construction; equal rows are stored once."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._at: dict[tuple[str, bytes], int] = {}

    def block(self, rows: Any, kind: Literal["f4", "f8"] = "f4") -> dict[str, Any]:
        """Store rows (K,) or (K, C), little-endian, and return the `Block` of web/scene.d.ts."""
        values = np.ascontiguousarray(rows, dtype=f"<{kind}")
        raw = values.tobytes()
        at = self._at.setdefault((kind, raw), self._size)
        if at == self._size and raw:
            padded = raw + bytes(-len(raw) % ALIGNED)
            self._parts.append(padded)
            self._size += len(padded)
        columns = 1 if values.ndim == 1 else values.shape[1]
        return {"at": at, "rows": len(values), "columns": columns, "type": kind}

    @property
    def text(self) -> str:
        """Block in base64."""
        return base64.b64encode(b"".join(self._parts)).decode()
