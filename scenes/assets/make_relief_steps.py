"""Make relief_steps.png: twelve terraces of different heights, on one a ball, on one a ramp. Run in this folder."""

import cv2
import numpy as np

TERRACE = 32  # samples along a side
HEIGHTS = np.array([[0.0, 0.6, 0.2, 0.8], [1.0, 0.3, 0.7, 0.1], [0.4, 0.9, 0.0, 0.5]])
BALL, RAMP = (1, 1), (2, 2)  # row and column of the terrace
BALL_HEIGHT = 0.5


def main() -> None:
    relief = np.kron(HEIGHTS, np.ones((TERRACE, TERRACE)))
    across = (np.arange(TERRACE) + 0.5) / TERRACE
    x, y = np.meshgrid(2 * across - 1, 2 * across - 1)
    inside = {place: tuple(slice(TERRACE * i, TERRACE * (i + 1)) for i in place) for place in (BALL, RAMP)}
    relief[inside[BALL]] += BALL_HEIGHT * np.sqrt(np.maximum(0.81 - x**2 - y**2, 0)) / 0.9
    relief[inside[RAMP]] += across * 0.8
    cv2.imwrite("relief_steps.png", np.rint(relief / relief.max() * 65535).astype(np.uint16))


if __name__ == "__main__":
    main()
