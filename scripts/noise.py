"""Print the Monte-Carlo noise and the size of every frame of a dataset: python scripts/noise.py DATASET"""

import sys

import numpy as np

import uwsim.dataset


def main(folder: str) -> None:
    print("frame   group           standard error / radiance: median, 95th percentile   bytes")
    for frame in uwsim.dataset.open(folder).frames:
        radiance = frame.buffer("radiance")
        relative = frame.buffer("standard_error") / np.maximum(radiance, 1e-12)
        size = sum(file.stat().st_size for file in frame.folder.iterdir())
        median, high = np.percentile(relative, [50, 95])
        print(f"{frame.name}  {frame.info.group:15} {median:6.3f} {high:6.3f}   {size}")


if __name__ == "__main__":
    main(*sys.argv[1:])
