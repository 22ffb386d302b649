"""How far detected points are off in their own standard deviations, spheres and corners of AprilTags apart.

    python benchmarks/fits/marker_errors.py DATASET [--json FILE]

DATASET: a folder made by `uwsim generate pose_tuning`. Prints the factor on the stated standard deviations with which
their 90 % ellipses hold 90 % of the points, over all waters and by water, and the same for 50 %: 1 where covariances
are right. `POINTS_OVER_MODEL_STD` (uwsim/pose/spheres.py) and `CORNERS_OVER_MODEL_STD` (uwsim/pose/edges.py) are in the
stated ones already; `constant` is what they would be after this set, their value times the factor over all waters.
Spheres further than a radius off are left out.
"""

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np

_HALF, _MOST = 0.5, 0.9


def distances(folder: Path) -> dict[tuple[str, str], list[float]]:
    """Return {(kind of mark, water): distances from the truth [standard deviations]}."""
    from uwsim.bench.pose import bodies_in_view
    from uwsim.bench.pose_views import View
    from uwsim.dataset import store

    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    for frame in store.open(folder).frames:
        for body in bodies_in_view(frame.info):
            view = View(frame=frame, body=body)
            squares = view.detected.squares
            kind = "spheres" if view.spheres else "corners"
            found[kind, frame.info.water.name] += np.sqrt(squares[np.isfinite(squares)]).tolist()
    return found


def factors(found: dict[tuple[str, str], list[float]]) -> list[dict]:
    """Return {kind, water, points, constant, factor_50, factor_90} of each kind and water, and of all waters."""
    from uwsim.pose.edges import CORNERS_OVER_MODEL_STD
    from uwsim.pose.spheres import POINTS_OVER_MODEL_STD

    parts = {key: found[key] for key in sorted(found)}
    for kind in sorted({kind for kind, _ in found}):
        parts[kind, "all"] = [value for (one, _), values in found.items() if one == kind for value in values]
    constants = {"spheres": POINTS_OVER_MODEL_STD, "corners": CORNERS_OVER_MODEL_STD}
    return [
        {"kind": kind, "water": water, "points": len(values), "constant": constants[kind] * _factor(values, _MOST)}
        | {f"factor_{100 * share:.0f}": _factor(values, share) for share in (_HALF, _MOST)}
        for (kind, water), values in parts.items()
    ]


def _factor(values: list[float], share: float) -> float:
    # in two dimensions the distance that holds a share s of normal errors has the square -2 ln(1 - s)
    return float(np.quantile(values, share) / np.sqrt(-2 * np.log(1 - share)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("dataset", type=Path, help="folder made by `uwsim generate pose_tuning`")
    parser.add_argument("--json", type=Path, help="file for the factors")
    arguments = parser.parse_args()
    rows = factors(distances(arguments.dataset))
    if arguments.json:
        from uwsim.files import write_json

        write_json(arguments.json, {"factors": rows})
    for row in rows:
        print(
            "{kind:8} {water:12} {points:4} points: {factor_90:.2f} at 90 %, {factor_50:.2f} at 50 %; "
            "constant {constant:.2f}".format(**row)
        )


if __name__ == "__main__":
    main()
