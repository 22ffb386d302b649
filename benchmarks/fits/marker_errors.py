"""How far detected points are off in their own standard deviations, spheres and corners of AprilTags apart.

The factor on the stated standard deviations with which their 90 % ellipses hold 90 % of the points, over all waters and
by water: 1 where covariances are right. `POINTS_OVER_MODEL_STD` (uwsim/pose/spheres.py) and `CORNERS_OVER_MODEL_STD`
(uwsim/pose/edges.py) were 1.5 and 2.5 here before they were applied. Spheres further than a radius off are left out.

    uwsim generate pose_tuning --out DIR
    python benchmarks/fits/marker_errors.py --dataset DIR
"""

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np

from uwsim import dataset
from uwsim.bench.pose import bodies_in_view
from uwsim.bench.pose_views import View

SHARE = 0.9


def distances(folder: Path) -> dict[tuple[str, str], list[float]]:
    """Return {(kind of mark, water): distances from the truth [standard deviations]}."""
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    for frame in dataset.open(folder).frames:
        for body in bodies_in_view(frame.info):
            view = View(frame=frame, body=body)
            points = view.detected
            off = points.image_px - points.true_px
            squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(points.covariance_px2), off)
            kind = "spheres" if view.spheres else "corners"
            found[kind, frame.info.water.name] += np.sqrt(squares[np.isfinite(squares)]).tolist()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--dataset", type=Path, required=True, help="a folder of the recipe pose_tuning")
    found = distances(parser.parse_args().dataset)
    for kind in sorted({kind for kind, _ in found}):
        parts = {water: values for (one, water), values in found.items() if one == kind}
        parts["all"] = [value for values in parts.values() for value in values]
        for water, values in parts.items():
            # in two dimensions the distance that holds a share s has the square -2 ln(1 - s)
            factor = np.quantile(values, SHARE) / np.sqrt(-2 * np.log(1 - SHARE))
            half = np.median(values) / np.sqrt(-2 * np.log(0.5))
            print(f"{kind:8} {water:12} {len(values):4} points: factor {factor:.2f} at 90 %, {half:.2f} at 50 %")


if __name__ == "__main__":
    main()
