"""What the restoration benchmark says, in sentences made of its numbers: they cannot disagree with the tables."""

import math

from uwsim.bench.records import markdown_table
from uwsim.bench.restoration_page import no_reference
from uwsim.bench.restoration_page.study import Study, joined
from uwsim.bench.restoration_page.tables import NONE, shown
from uwsim.bench.study import title

SHARE_GOALS = {"dual_transmission": 0.12, "lamp_model": 0.5}
TIME_GOAL = ("dual_transmission", "clahe", 6.0)
"""Method, what its time is held against, and at most how many times that."""
DECISIVE = ("psnr", "ssim", "tags_found")


def text(study: Study, *, high: str, noise: dict[str, float]) -> str:
    """Return the conclusions; high: the water of high turbidity, noise: what white noise scores."""
    parts = [best_by_water(study), at_high_turbidity(study, high), oracle_shares(study), time(study), formulas(study)]
    parts.append(no_reference_scores(study, noise))
    return "\n\n".join(part for part in parts if part)


def capital(method: str) -> str:
    """Return a method's name as the first words of a sentence."""
    return title(method)[0].upper() + title(method)[1:]


def best_by_water(study: Study) -> str:
    """Return the table of the best methods per water, by PSNR."""
    alone = [name for name in study.restorers if not study.given[name]]
    groups = {"from the picture alone": alone, "of all without layers of the truth": study.restorers}
    head = ["water", "as it is", *(f"best {words}" for words in groups), "oracle"]
    rows = []
    for water in study.waters:
        cells = [title(water), _scores(study, study.raw, water)]
        for names in groups.values():
            best = study.best(names, "psnr", water)
            cells.append(NONE if best is None else f"{title(best)}, {_scores(study, best, water)}")
        cells.append(NONE if study.oracle is None else _scores(study, study.oracle, water))
        rows.append(cells)
    return "Best method in each water, by PSNR [dB] and with its SSIM:\n\n" + markdown_table(head, rows, texts=1)


def _scores(study: Study, method: str, water: str) -> str:
    return " / ".join(shown(study.summary(method, metric, water), metric) for metric in ("psnr", "ssim"))


def at_high_turbidity(study: Study, water: str) -> str:
    """Return whether one of our methods beats every rival in PSNR, SSIM and tags found in a water."""
    if water not in study.waters or not study.ours or not study.rivals:
        return f"Ours against all rivals at high turbidity: not decided; no case of it in {title(water)}, or no rival."
    sentences, winners, open_ = [], [], False
    for own in study.ours:
        found = {metric: compared(study, own, metric, water) for metric in DECISIVE}
        words = joined([f"{title(metric)} {sentence}" for metric, (sentence, _) in found.items()])
        given = ", given " + joined(list(study.given[own])) if study.given[own] else ", given the picture alone"
        sentences.append(f"{capital(own)}{given}: {words}.")
        verdicts = [wins for _, wins in found.values()]
        winners += [own] if all(verdicts) else []
        open_ = open_ or (None in verdicts and False not in verdicts)
    if winners:
        verdict = f"yes, {joined([title(name) for name in winners])}"
    else:
        verdict = "not decided, as not all was measured" if open_ else "no"
    return (
        "Does one of our methods without layers of the truth beat every rival in PSNR, SSIM and tags at high "
        f"turbidity ({title(water)})? **{verdict[0].upper()}{verdict[1:]}.** {' '.join(sentences)}"
    )


def compared(study: Study, own: str, metric: str, water: str) -> tuple[str, bool | None]:
    """Return ("15.20 against 14.10 of the best rival, msrcr", whether ours is better; None if not measured)."""
    rival, mine = study.best(study.rivals, metric, water), study.summary(own, metric, water)
    if rival is None or math.isnan(mine):
        return "was not measured", None
    other = study.summary(rival, metric, water)
    wins = mine > other if study.of_metric[metric].better == "higher" else mine < other
    words = f"{shown(mine, metric)} against {shown(other, metric)} of the best rival, {title(rival)}"
    return f"{words} ({'better' if wins else 'as good' if mine == other else 'not better'})", wins


def oracle_shares(study: Study) -> str:
    """Return the mean shares of the oracle's gain against their goals, and by water."""
    sentences = []
    for method, goal in SHARE_GOALS.items():
        mean = study.mean(method, "oracle_share")
        if math.isnan(mean):
            sentences.append(f"{capital(method)}: not measured (goal {goal:g}).")
            continue
        count = sum(not math.isnan(study.value(shot.case, method, "oracle_share")) for shot in study.cases)
        by_water = [(water, study.mean(method, "oracle_share", water)) for water in study.waters]
        each = ", ".join(f"{title(water)} {value:.3f}" for water, value in by_water if not math.isnan(value))
        met = "met" if mean >= goal else "not met"
        sentences.append(
            f"{capital(method)} {mean:.3f}, goal {goal:g}: {met} ({count} {'case' if count == 1 else 'cases'}; {each})."
        )
    return f"Mean share of the oracle's gain in PSNR, over the cases that have one. {' '.join(sentences)}"


def time(study: Study) -> str:
    """Return a method's time over that of another, against the goal."""
    method, other, goal = TIME_GOAL
    taken, base = (study.summary(name, "milliseconds") for name in (method, other))
    if math.isnan(taken) or math.isnan(base):
        return f"Time of {title(method)} over that of {title(other)}: not measured (goal: at most {goal:g})."
    ratio = taken / base
    words = f"{capital(method)} takes {shown(taken)} ms, {ratio:.1f} times as long as {title(other)} ({shown(base)} ms)"
    if study.result.provenance["quick"]:
        return f"{words} on the small pictures of a quick run; the goal, at most {goal:g}, is for 640 x 480."
    return f"{words}; goal at most {goal:g}: {'met' if ratio <= goal else 'not met'}."


def formulas(study: Study) -> str:
    """Return what the corrected formulas gain over the picture as it is, and what those as printed do."""
    names = [name for name in ("dual_transmission", "dual_transmission_as_printed") if name in study.methods]
    gains = [f"{title(name)} {study.gain(name, 'psnr'):+.2f} dB" for name in names]
    return f"Mean gain in PSNR over the picture as it is, all waters: {joined(gains)}." if len(names) == 2 else ""


def no_reference_scores(study: Study, noise: dict[str, float]) -> str:
    """Return how the no-reference metrics rank the methods, and whom white noise beats."""
    sentences = []
    for metric in (name for name in no_reference.METRICS if name in study.of_metric):
        means = [study.mean(name, metric) for name in (study.raw, *study.restorers)]
        scores = [mean for mean in means if not math.isnan(mean)]
        beaten = sum(noise[metric] > score for score in scores)
        ranks = [(water, no_reference.rank_correlation(study, metric, water)) for water in study.waters]
        each = ", ".join(f"{title(water)} {rank:+.2f}" for water, rank in ranks if not math.isnan(rank))
        words = f"rank correlation with PSNR over the methods: {each}" if each else "too few methods for a rank"
        sentences.append(
            f"- {title(metric)}: white noise {noise[metric]:.3f}, above {beaten} of {len(scores)} methods; {words}."
        )
    warning = (
        "UIQM and UCIQE are no goals: a picture of white noise scores as below, and higher is not nearer to the truth."
    )
    return f"{warning}\n\n" + "\n".join(sentences) if sentences else ""
