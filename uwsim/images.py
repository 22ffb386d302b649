"""Image files and the sRGB transfer curve. Images are (H, W, 3) in R, G, B order."""

from pathlib import Path

import numpy as np

from uwsim.files import no_stderr, write_atomically


def srgb_encode(linear: np.ndarray) -> np.ndarray:
    """Encode linear light in [0, 1] by the sRGB curve (IEC 61966-2-1); input is clipped to [0, 1]."""
    linear = np.clip(linear, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def srgb_decode(encoded: np.ndarray) -> np.ndarray:
    """Decode sRGB values in [0, 1] to linear light (IEC 61966-2-1)."""
    encoded = np.asarray(encoded)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def srgb_uint8_from_linear(linear: np.ndarray) -> np.ndarray:
    """Return linear light in [0, 1] as 8-bit sRGB, rounded."""
    return np.rint(255.0 * srgb_encode(linear)).astype(np.uint8)


def linear_from_srgb_uint8(image: np.ndarray) -> np.ndarray:
    """Return 8-bit sRGB as linear float32 in [0, 1]."""
    return srgb_decode(np.arange(256) / 255.0).astype(np.float32)[image]


def check_srgb_uint8(image: np.ndarray, *, where: str) -> None:
    """Raise ValueError unless `image` is (H, W, 3) uint8."""
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        got = f"{image.dtype} {image.shape}" if isinstance(image, np.ndarray) else type(image).__name__
        raise ValueError(f"{where}: got {got}, allowed: uint8 (H, W, 3)")


def decode(path: Path, flags: int) -> np.ndarray | None:
    """Decode an image file by OpenCV's flags; None if it is no image or truncated."""
    import cv2

    data = np.frombuffer(Path(path).read_bytes(), np.uint8)
    try:
        with no_stderr():
            return cv2.imdecode(data, flags) if data.size else None
    except cv2.error:
        return None


def read_srgb(path: Path) -> np.ndarray:
    """Read an 8-bit colour image file as (H, W, 3) uint8, R, G, B, turned as its EXIF orientation says.

    Raises ValueError (one line) if the file is missing, empty, no image, grey, 16-bit or has an alpha channel.
    """
    import cv2

    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path}: no such image file")
    if path.stat().st_size == 0:
        raise ValueError(f"{path}: the image file is empty (0 bytes)")
    image = decode(path, cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ValueError(f"{path}: not an image that can be read (allowed: PNG, JPEG, TIFF, BMP, WebP)")
    if image.dtype != np.uint8:
        raise ValueError(f"{path}: got {8 * image.itemsize}-bit samples, allowed: 8-bit sRGB")
    if image.ndim != 3 or image.shape[2] != 3:
        channels = 1 if image.ndim == 2 else image.shape[2]
        raise ValueError(f"{path}: got {channels} channel(s), allowed: 3 (R, G, B)")
    # unchanged, OpenCV leaves a picture as the camera was held
    return np.ascontiguousarray(decode(path, cv2.IMREAD_COLOR)[..., ::-1])


def read_uint16(path: Path) -> np.ndarray:
    """Read a 16-bit PNG as uint16, (H, W), or (H, W, 3) in R, G, B order; ValueError (one line) if it is none."""
    import cv2

    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path}: no such image file")
    image = decode(path, cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype != np.uint16 or (image.ndim == 3 and image.shape[2] != 3):
        raise ValueError(f"{path}: not a 16-bit PNG of 1 or 3 channels that can be read")
    return image if image.ndim == 2 else np.ascontiguousarray(image[..., ::-1])


def write_png(path: Path, image: np.ndarray) -> None:
    """Write an (H, W, 3) or (H, W) uint8 or uint16 image as PNG, atomically."""
    import cv2

    if image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"PNG {path}: got {image.dtype}, allowed: uint8 or uint16")
    ok, data = cv2.imencode(".png", image[..., ::-1] if image.ndim == 3 else image)
    if not ok:
        raise ValueError(f"PNG {path}: could not be encoded, shape {image.shape}")
    write_atomically(path, lambda temporary: temporary.write_bytes(data.tobytes()))
