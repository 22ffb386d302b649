"""Lay frames of a dataset side by side for a page: python scripts/montage.py DATASET OUT.png FRAME [FRAME ...]

One row per frame: the camera's picture, the water-free twin, the backscatter (four times brighter), the range.
"""

import sys
from pathlib import Path

import numpy as np

import uwsim.dataset
from uwsim.bench.task import sensor_keywords
from uwsim.camera.sensor import expose_without_noise
from uwsim.images import write_png

BACKSCATTER_GAIN = 4.0


def row(frame) -> np.ndarray:
    constants = sensor_keywords(frame)
    range_m = frame.buffer("range")
    near, far = range_m[np.isfinite(range_m)].min(), range_m[np.isfinite(range_m)].max()
    shade = np.where(np.isfinite(range_m), 1 - 0.85 * (range_m - near) / max(far - near, 1e-6), 0)
    pictures = [
        frame.image,
        expose_without_noise(frame.buffer("water_free"), **constants),
        expose_without_noise(BACKSCATTER_GAIN * frame.buffer("backscatter"), **constants),
        np.repeat(np.rint(255 * shade).astype(np.uint8)[..., None], 3, axis=2),
    ]
    return np.hstack(pictures)


def main(folder: str, out: str, *names: str) -> None:
    dataset = uwsim.dataset.open(folder)
    write_png(Path(out), np.vstack([row(dataset.frame(name)) for name in names]))


if __name__ == "__main__":
    main(*sys.argv[1:])
