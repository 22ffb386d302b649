"""What stands beside the scores on photographs: white noise, other people's numbers, the ranking of simulation."""

from collections.abc import Iterable
from dataclasses import dataclass

from uwsim.bench.photos.agreement import LEAST_METHODS, Agreement, rank_agreement, simulated_scores
from uwsim.bench.photos.calibration import compared, read_calibration
from uwsim.bench.photos.folder import Content
from uwsim.bench.records import Record, Result
from uwsim.bench.restoration.relations import noise_scores, noise_table

_NOISE_PX = 256


@dataclass(frozen=True)
class Rival:
    """Verified tags of a result on simulated pictures, {method: value}, and of which of its summaries."""

    summary: str
    scores: dict[str, float]


def simulated_tags(result: Result, content: Content, methods: Iterable[str]) -> Rival:
    """Return the verified tags of a simulated result.

    ValueError if it has none, or none of enough of the methods, or if there is no video to compare.
    """
    if not content.videos:
        raise ValueError("--simulated: got no video of tags to compare with, allowed: with one that a layout describes")
    rival = Rival(*simulated_scores(result))
    if (count := len(set(methods) & set(rival.scores))) < LEAST_METHODS:
        raise ValueError(f"--simulated: has {count} of the methods of this run, allowed: at least {LEAST_METHODS}")
    return rival


def findings(content: Content, records: Iterable[Record], rival: Rival | None) -> dict[str, dict]:
    """Return the tables `white_noise`, `calibration`, and of each layout the comparison with `rival`, as there are."""
    found = {}
    if content.photographs:
        found["white_noise"] = noise_table(noise_scores([(_NOISE_PX, _NOISE_PX)]))
    if table := _calibration(content):
        found["calibration"] = table
    if rival is not None:
        tags = [record for record in records if record.metric == "tags_verified" and record.value is not None]
        for layout in content.layouts:
            real = {record.algorithm: record.value for record in tags if record.case == layout}
            found |= _sim_to_real(layout, rival, rank_agreement(rival.scores, real))
    return found


def _calibration(content: Content) -> dict | None:
    calibration = read_calibration()
    pictures = [one.path for one in content.photographs]
    pictures += [one.reference for one in content.photographs if one.reference is not None]
    rows = [
        [f"{row['name']}, {row['metric']}", row["known"], row["measured"], row["measured"] - row["known"]]
        for row in compared(pictures, calibration)
    ]
    if not rows:
        return None
    worst = max(abs(row[-1]) for row in rows)
    verdict = "all" if worst <= calibration.tolerance else "NOT all"
    return {
        "caption": f"Scores without a reference beside those of other code: {verdict} within "
        f"{calibration.tolerance:g}, largest difference {worst:.5f}",
        "head": ["photograph and score", "known", "measured", "difference"],
        "rows": rows,
    }


def _sim_to_real(layout: str, rival: Rival, agreement: Agreement) -> dict[str, dict]:
    """Return the tables `tags_LAYOUT` (method by method) and `sim_to_real_LAYOUT` (how the rankings agree)."""
    pairs = zip(agreement.methods, agreement.simulated, agreement.real, strict=True)
    nothing = (None, None)
    coefficients = [
        ["Spearman's rho", agreement.spearman, *(agreement.spearman_interval or nothing), agreement.spearman_p],
        ["Kendall's tau", agreement.kendall, *(agreement.kendall_interval or nothing), agreement.kendall_p],
    ]
    return {
        f"tags_{layout}": {
            "caption": f"Verified tags, simulated ({rival.summary}) and real ({layout})",
            "head": ["method", "simulated [%]", "real, per frame"],
            "rows": [list(pair) for pair in pairs],
        },
        f"sim_to_real_{layout}": {
            "caption": f"Does simulation rank {len(agreement.methods)} methods as {layout} does? 95 % by bootstrap "
            "over methods; p: share of random rankings that agree as much",
            "head": ["coefficient", "value", "95 % from", "to", "p"],
            "rows": coefficients,
        },
    }
