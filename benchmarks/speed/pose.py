"""Microseconds per problem of every pose solver on a batch, beside a Python loop over OpenCV's SQPnP in one run.

    python benchmarks/speed/pose.py [--quick] [--only SOLVER ...] [--points N] [--layout NAME] [--json -]

10,000 octahedra of 0.1 m edge in the dissertation's box, 2 px of noise at 1300 px, one thread; `--points` takes random
points instead. The reference is the plain loop that a user writes, `cv2.solvePnP` with SOLVEPNP_SQPNP, one problem at a
time, without any check of what comes back; the solvers' times include the check of the input, cost, status and
information matrix. Times are CPU microseconds of the process, medians of rounds that alternate between all solvers;
`times_sqpnp_loop` is the median of the ratios within a round. `wall_microseconds` are those on the wall.
"""

import argparse
import sys
from functools import partial

import document
import side_by_side

FULL, QUICK = 10_000, 500
FOCAL_PX, NOISE_PX, EDGE_M = 1300.0, 2.0, 0.1
REFERENCE = "sqpnp_loop"
# slow ones are timed on a part of the problems: their time per problem does not depend on the number
SLOW_SHARE = {"dls": 0.2, "opnp": 0.2, "lhm": 0.5}
VARIANTS = {
    "best": {
        "best, RPnP never": {"extra": "never"},
        "best": {},
        "best, RPnP always": {"extra": "always"},
    }
}


def problems(layout: str, points: int | None, count: int):
    """Return (points_m, points) of the batch."""
    import numpy as np

    from uwsim.pose import problems as made

    rng = np.random.default_rng(0)
    if points is not None:
        placed = made.random_points(points=points, count=count, rng=rng)
    else:
        placed = made.in_box(made.layout(layout, edge_m=EDGE_M), count=count, rng=rng)
    return placed.points_m, made.images(placed, focal_px=FOCAL_PX, noise_px=NOISE_PX, rng=rng)


def sqpnp_loop(points_m, points) -> None:
    """Solve one problem after the other by `cv2.solvePnP`."""
    import cv2
    import numpy as np

    camera = np.eye(3)
    for target, image in zip(points_m, points, strict=True):
        cv2.solvePnP(target, image, camera, None, flags=cv2.SOLVEPNP_SQPNP)


def calls_of(points_m, points, only: list[str] | None) -> dict:
    """Return {solver: (call without arguments, number of problems)} of all that can do them, the reference first."""
    from uwsim.bench import runner
    from uwsim.discovery import discover
    from uwsim.pose import solvers

    # what can be called with points alone
    found = {name: module for name, module in discover(solvers).items() if not module.NEEDS}
    if unknown := set(only or found) - set(found):
        raise ValueError(f"--only: got {', '.join(sorted(unknown))}, allowed: {', '.join(found)}")
    calls = {REFERENCE: (partial(sqpnp_loop, points_m, points), len(points))}
    for name in only or found:
        module = found[name]
        if missing := runner.prepare(module):
            print(f"{name:28s} not installed: {', '.join(missing)}", file=sys.stderr)
            continue
        if points.shape[1] < module.MINIMUM_POINTS:
            print(f"{name:28s} needs {module.MINIMUM_POINTS} points", file=sys.stderr)
            continue
        count = max(int(SLOW_SHARE.get(name, 1) * len(points)), 1)
        for variant, options in VARIANTS.get(name, {name: {}}).items():
            calls[variant] = (partial(module.solve, points_m[:count], points[:count], **options), count)
    return calls


def main() -> int:
    """Measure, print a table, write tidy records."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few problems, two rounds: shows that it runs")
    parser.add_argument("--only", nargs="+", metavar="SOLVER", help="these solvers, and the reference")
    parser.add_argument("--layout", default="bi6", help="markers of the target (bi6, py5, st4, pl4)")
    parser.add_argument("--points", type=int, help="this many random points instead of a layout")
    parser.add_argument("--json", help="where to write the records; - for standard output")
    arguments = parser.parse_args()
    import cv2

    cv2.setNumThreads(1)
    try:
        batch = problems(arguments.layout, arguments.points, QUICK if arguments.quick else FULL)
        calls = calls_of(*batch, arguments.only)
    except ValueError as error:
        parser.error(str(error))
    taken = side_by_side.timed(calls, reference=REFERENCE, turns=2 if arguments.quick else 8)
    layout = f"random{arguments.points}" if arguments.points else arguments.layout
    records = []
    for name, times in taken.items():
        values = {
            "cpu_microseconds": 1e6 * times.cpu_s, "wall_microseconds": 1e6 * times.wall_s,
            "times_sqpnp_loop": times.times_reference,
        }  # fmt: skip
        print(
            f"{name:28s} {values['cpu_microseconds']:8.1f} us = {values['times_sqpnp_loop']:6.2f} x the SQPnP loop "
            f"(wall {values['wall_microseconds']:.1f} us)",
            file=sys.stderr, flush=True,
        )  # fmt: skip
        records += [
            {
                "benchmark": "speed/pose", "metric": metric, "algorithm": name, "layout": layout,
                "points": int(batch[1].shape[1]), "problems": calls[name][1], "value": value,
            }
            for metric, value in values.items()
        ]  # fmt: skip
    document.write(records, quick=arguments.quick, where=arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
