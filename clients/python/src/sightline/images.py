# SPDX-License-Identifier: Apache-2.0
"""Images of results as numpy arrays."""
from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import errors


@dataclass(frozen=True)
class Image:
    """Raw numbers as the sensor read them out."""

    name: str
    pixels: np.ndarray[Any, Any]  # uint16; rows x columns, or rows x columns x 3 (red, green, blue)

    def _repr_png_(self) -> bytes:
        """For notebooks: 8 bits, the brightest pixel white."""
        pil = _pil()
        largest = max(int(self.pixels.max()), 1) if self.pixels.size else 1
        shown = (self.pixels.astype(np.uint32) * 255 // largest).astype(np.uint8)
        out = io.BytesIO()
        pil.fromarray(shown).save(out, "PNG")
        return out.getvalue()


def decode_image(data: bytes, name: str) -> Image:
    """A PNG or TIFF, grey or RGB, 8 or 16 bits. IncompleteResult if it is something else."""
    if _bits_and_channels(data) == (16, 3):
        # Pillow would keep the upper 8 bits alone.
        return Image(name, _decode_rgb16(data, name))
    try:
        with _pil().open(io.BytesIO(data)) as image:
            if image.mode not in ("L", "RGB") and not image.mode.startswith("I"):
                raise errors.IncompleteResult(f"{name}: images of mode {image.mode} are not read")
            return Image(name, np.asarray(image).astype(np.uint16))
    except (OSError, SyntaxError) as error:
        raise errors.IncompleteResult(f"{name}: is no image: {error}") from None


def _bits_and_channels(data: bytes) -> Any:
    """Of a PNG; None of anything else."""
    if data[:8] != b"\x89PNG\r\n\x1a\n" or len(data) < 26:
        return None
    return data[24], {0: 1, 2: 3}.get(data[25], 0)


def _decode_rgb16(data: bytes, name: str) -> np.ndarray[Any, Any]:
    try:
        import cv2  # type: ignore
    except ImportError:
        raise ImportError(f"{name}: colour images of 16 bits need OpenCV (Debian: "
                          "python3-opencv)") from None
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise errors.IncompleteResult(f"{name}: is no image")
    return np.ascontiguousarray(pixels[..., ::-1])


def _pil() -> Any:
    try:
        from PIL import Image as pil
    except ImportError:
        raise ImportError("images need Pillow (Debian: python3-pil)") from None
    return pil
