"""CPU times by that of a plain Python loop over OpenCV's SQPnP, as `benchmarks/speed/pose.py` measures them."""

import math
from pathlib import Path

from uwsim.bench.judged import Goal, shown
from uwsim.files import read_json

COMMAND = "python benchmarks/speed/pose.py --json results/speed/pose.json"
FILE = Path("speed", "pose.json")
"""Beside the page's folder: `results/speed/pose.json` for the page in `results/pnp`."""
_NAMES = {"best_without_rpnp": "best, RPnP never", "best_with_rpnp": "best, RPnP always"}
"""Names there of what has another one here."""


def times_by_loop(folder: Path) -> dict[str, float]:
    """Return {solver, as named there: median ratio to the loop} of the file beside a page's folder; empty without one,
    or if it is of a quick run. ValueError for a file that is none of these.
    """
    path = Path(folder).resolve().parent / FILE
    if not path.is_file():
        return {}
    content = read_json(path)
    try:
        if content["quick"]:
            return {}
        return {
            one["algorithm"]: float(one["value"]) for one in content["records"] if one["metric"] == "times_sqpnp_loop"
        }
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: got no records of `{COMMAND}` ({error!r}), allowed: what that writes") from None


def goals(limits: dict[str, float], times: dict[str, float]) -> list[Goal]:
    """Return the goal of each solver, {name: most}, against the loop; none without times."""
    found = []
    for method, limit in limits.items() if times else ():
        ratio = times.get(_NAMES.get(method, method), math.nan)
        words = f"of a plain loop over OpenCV's SQPnP, n = 6 (`{FILE.as_posix()}`)"
        met = None if math.isnan(ratio) else ratio <= limit
        found.append(Goal(f"{method}: CPU time by problem <= {limit:g} {words}", shown(ratio, 3), met))
    return found


def note(times: dict[str, float]) -> str:
    """Return what the two kinds of speed goals are measured against."""
    own = times.get("opencv_sqpnp", math.nan)
    longer = "" if math.isnan(own) else f", {own:.2f} times as long"
    where = (
        "its ratios are in `results/speed/pose.json` and in the lines that name the file"
        if times
        else "its result belongs in `speed/` beside this page's folder"
    )
    return (
        "Speed: the goals were asked against a Python loop over OpenCV's SQPnP. `opencv_sqpnp`, timed here, is that "
        f"loop with the check of input and poses, cost, status and information besides{longer}: an easier goal. The "
        "plain loop, `cv2.solvePnP` and nothing else, is timed in turn with the solvers by "
        f"`{COMMAND}`; {where}."
    )
