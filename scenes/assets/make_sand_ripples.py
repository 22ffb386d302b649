"""Make sand_ripples.png: ripples that wander, with grain; seeded. Run in this folder."""

import cv2
import numpy as np

ROWS, COLUMNS = 200, 240


def noise(rng: np.random.Generator, scale: float) -> np.ndarray:
    """Smooth noise with zero mean and unit standard deviation; `scale` in pixels."""
    smooth = cv2.GaussianBlur(rng.standard_normal((ROWS, COLUMNS)), (0, 0), scale)
    return (smooth - smooth.mean()) / smooth.std()


def main() -> None:
    rng = np.random.default_rng(7)
    y = np.mgrid[0:ROWS, 0:COLUMNS][0]
    phase = 2 * np.pi * y / 16 + 1.6 * noise(rng, 18)
    ripples = np.abs(np.sin(phase / 2)) ** 1.3
    relief = ripples + 0.5 * noise(rng, 30) + 0.03 * noise(rng, 0.7)
    relief = (relief - relief.min()) / (relief.max() - relief.min())
    cv2.imwrite("sand_ripples.png", np.rint(relief * 65535).astype(np.uint16))


if __name__ == "__main__":
    main()
