"""Print the Monte-Carlo noise and the size of every frame of a dataset: python scripts/noise.py DATASET"""

import sys

import numpy as np

import uwsim.dataset


def main(folder: str) -> None:
    print("frame   group           standard error / radiance: median, 95th percentile   regions  pixels  rules   bytes")
    for frame in uwsim.dataset.open(folder).frames:
        radiance = frame.buffer("radiance")
        relative = frame.buffer("standard_error") / np.maximum(radiance, 1e-12)
        size = sum(file.stat().st_size for file in frame.folder.iterdir())
        median, high = np.percentile(relative, [50, 95])
        noise = frame.info.noise
        one = noise.pictures["radiance"]
        stated = f"{one.region_error_p95:7.2%} {one.pixel_share_within:7.0%}  {'met' if noise.met else 'not met'}"
        print(f"{frame.name}  {frame.info.group:15} {median:6.3f} {high:6.3f} {'':34} {stated}   {size}")


if __name__ == "__main__":
    main(*sys.argv[1:])
