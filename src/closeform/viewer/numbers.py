"""Numbers: all rows of a scene as one block of bytes, to which its records point."""

import base64
from typing import Any, Literal

import numpy as np

ALIGNED = 8  # bytes: where a browser may look at floats without copying


class Numbers:
    """The block under way; equal rows are kept once."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._at: dict[tuple[str, bytes], int] = {}

    def block(self, rows: Any, kind: Literal["f4", "f8"] = "f4") -> dict[str, Any]:
        """Keep rows (K,) or (K, C), little-endian, and answer with the `Block` of web/scene.d.ts."""
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
        """The block in base64."""
        return base64.b64encode(b"".join(self._parts)).decode()
