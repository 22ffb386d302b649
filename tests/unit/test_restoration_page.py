"""The page of the restoration benchmark: its numbers are those of the records, its printed ones the dissertation's."""

import json
import shutil

import numpy as np
import pytest
import synthetic

from uwsim import commands
from uwsim.bench.definition import read_definition
from uwsim.bench.records import Record, Result, read_result
from uwsim.bench.restoration import STATISTICS, TASK
from uwsim.bench.restoration_page import conclusions, figures, no_reference, page, sheets, tables
from uwsim.bench.restoration_page.printed import printed
from uwsim.bench.restoration_page.study import Shot, Study, joined, shots, study_of
from uwsim.bench.run import load
from uwsim.bench.validity import page as validity_page
from uwsim.dataset import store
from uwsim.metrics import METRICS

WATERS = ("tank_clear", "tank_low", "tank_medium", "tank_high")
GIVEN = {"lamp_model": ("range_m", "rig"), "oracle_wiener": ("backscatter", "noise_std")}
METHODS = (
    "none", "dual_transmission", "dual_transmission_only", "dual_transmission_colour", "dual_transmission_as_printed",
    "lamp_model", "clahe", "agcwd", "oracle_wiener",
)  # fmt: skip
# what each scores, beside what the water takes: lamp_model is the best of those without layers of the truth
SCORES = {
    "psnr": (15, 17, 14, 16, 12, 20, 16, 13, 25), "ssim": (0.5, 0.6, 0.52, 0.55, 0.4, 0.8, 0.58, 0.45, 0.9),
    "tags_found": (40, 60, 45, 50, 30, 80, 70, 20, 95), "oracle_share": (0, 0.2, -0.1, 0.1, -0.3, 0.5, 0.1, -0.2, 1),
    "uiqm_f": (2, 3, 2.2, 2.5, 3.1, 2.4, 2.8, 2.7, 3.3), "uiqm_m": (3, 4, 3.2, 3.5, 4.1, 3.4, 3.8, 3.7, 4.3),
    "uciqe_o": (0.4, 0.5, 0.42, 0.45, 0.51, 0.44, 0.48, 0.47, 0.53), "milliseconds": (0.1, 9, 7, 8, 20, 800, 3, 2, 90),
}  # fmt: skip
SHOWN = ("dual_transmission", "clahe")  # the quick ones
NOISE = {"psnr": 7.5, "uiqm_f": 2.9, "uiqm_m": 3.4, "uciqe_o": 0.66}


def value(metric: str, method: str, scene: int, water: int) -> float:
    """Return a made-up score; other scenes and waters move all methods alike."""
    return SCORES[metric][METHODS.index(method)] * (1 - 0.05 * water + 0.02 * scene)


def made_up(cases: dict[str, tuple[int, int]], changes=None, without=()) -> Result:
    """Return a result of cases {name: (scene, water)}; changes: {(metric, method): factor}."""
    records = [
        Record(
            case, method, GIVEN.get(method, ()), metric,
            value(metric, method, *place) * (changes or {}).get((metric, method), 1), METRICS[metric].unit,
            METRICS[metric].better,
        )
        for case, place in cases.items()
        for method in METHODS
        for metric in SCORES
        if metric not in without
    ]  # fmt: skip
    definition = read_definition("restoration")[1].model_dump(mode="json")
    origin = {
        "definition": definition, "statistics": STATISTICS, "dataset": {"name": "made_up", "seed": 1, "sha256": ""},
        "quick": False,
    }  # fmt: skip
    return Result("restoration", origin, tuple(records))


def made_up_study(changes=None, *, scenes: int = 3, waters=WATERS, without=()) -> Study:
    places = {f"{4 * scene + water:06d}": (scene, water) for scene in range(scenes) for water in range(len(waters))}
    found = tuple(Shot(case, f"scene {scene}", waters[water], 1.0 + water) for case, (scene, water) in places.items())
    return Study(made_up(places, changes, without), found)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Two scenes of a group in four waters, one of another group in two; a frame in motion between."""
    folder = tmp_path_factory.mktemp("data") / "synthetic"
    synthetic.write_dataset(folder, frames=(0, 1, 2))
    frames = [("tank", water) for water in WATERS * 2] + [("charts", water) for water in WATERS[2:]]
    for place in ("000000", "000001"):
        (folder / "frames" / place).rename(folder / place)
    (folder / "frames" / "000002").rename(folder / "frames" / "000350")
    for number, (group, water) in enumerate(frames):
        name = f"{100 * number:06d}"
        shutil.copytree(folder / ("000000" if water in WATERS[:2] else "000001"), folder / "frames" / name)
        path = folder / "frames" / name / "frame.json"
        info = json.loads(path.read_text())
        info |= {"name": name, "group": group}
        info["water"]["name"] = water
        info["water"]["bands"]["attenuation_per_m"][1] += 0.01 * WATERS.index(water)
        path.write_text(json.dumps(info))
    manifest = json.loads((folder / "dataset.json").read_text()) | {"files": store.checksums(folder)}
    store.write_manifest(folder, manifest)
    return store.open(folder)


@pytest.fixture(scope="module")
def result(dataset):
    found = shots(dataset)
    scenes = list(dict.fromkeys(shot.scene for shot in found))
    return made_up({shot.case: (scenes.index(shot.scene), WATERS.index(shot.water)) for shot in found})


@pytest.fixture(scope="module")
def folder(tmp_path_factory, dataset, result):
    made = tmp_path_factory.mktemp("page") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sheets, "SHOWN", SHOWN)
        page.write(made, result=result, dataset=dataset)
    return made


def cells(text: str, start: str) -> list[str]:
    """Return the cells of the first table row that begins with a text."""
    line = next(line for line in text.splitlines() if line.startswith(f"| {start}"))
    return [cell.strip() for cell in line.strip("|").split("|")]


# ---- what the cases are ----


def test_scenes_come_from_group_and_order(dataset):
    found = shots(dataset)
    assert "000350" not in [shot.case for shot in found]  # in motion
    expected = ["tank 1"] * 4 + ["tank 2"] * 4 + ["charts"] * 2
    assert [shot.scene for shot in found] == expected
    study = study_of(made_up({shot.case: (0, 0) for shot in found}), dataset)
    assert study.waters == list(WATERS)
    assert study.case_of("tank 2", "tank_high") == "000700"
    assert study.case_of("charts", "tank_clear") is None


def test_summaries_follow_the_statistic_of_the_benchmark():
    study = made_up_study(scenes=4)
    found = [value("psnr", "clahe", scene, 3) for scene in range(4)]
    assert study.summary("clahe", "psnr", "tank_high") == pytest.approx(np.median(found))
    shares = [value("oracle_share", "clahe", scene, 3) for scene in range(4)]
    assert STATISTICS["oracle_share"] == "mean"
    assert study.summary("clahe", "oracle_share", "tank_high") == pytest.approx(np.mean(shares))
    assert study.best(["clahe", "agcwd"], "milliseconds") == "agcwd"  # less is better
    assert study.best(["clahe", "agcwd"], "psnr") == "clahe"
    assert study.gain("clahe", "psnr", "tank_clear") == pytest.approx(np.mean([1 + 0.02 * scene for scene in range(4)]))


def test_who_is_ours_and_who_is_a_rival():
    study = made_up_study()
    assert study.ours == ["dual_transmission", "lamp_model"]
    assert study.rivals == ["clahe", "agcwd"]
    assert "oracle_wiener" not in study.restorers


# ---- conclusions ----


def test_a_method_of_ours_must_win_in_all_three_at_high_turbidity():
    assert "**Yes, lamp model.**" in conclusions.at_high_turbidity(made_up_study(), "tank_high")
    for metric in conclusions.DECISIVE:
        text = conclusions.at_high_turbidity(made_up_study({(metric, "clahe"): 3.0}), "tank_high")
        assert "**No.**" in text
        assert "(not better)" in text
    # what an oracle or a form of ours scores decides nothing
    others = {("psnr", "oracle_wiener"): 9.0, ("psnr", "dual_transmission_only"): 9.0}
    assert "**Yes" in conclusions.at_high_turbidity(made_up_study(others), "tank_high")


def test_what_is_not_measured_is_not_decided():
    text = conclusions.at_high_turbidity(made_up_study(without=("tags_found",)), "tank_high")
    assert "**Not decided" in text
    text = conclusions.at_high_turbidity(made_up_study(waters=WATERS[:2]), "tank_high")
    assert "not decided" in text


def test_goals_are_held_against_the_numbers():
    study = made_up_study()
    mean = study.mean("dual_transmission", "oracle_share")
    text = conclusions.oracle_shares(study)
    assert f"Dual transmission {mean:.3f}, goal 0.12: met (12 cases" in text
    assert "goal 0.5: not met" in text  # lamp_model: 0.5 less what the water takes
    assert "not met" in conclusions.oracle_shares(made_up_study({("oracle_share", "dual_transmission"): 0.5}))
    assert "3.0 times" in conclusions.time(study)
    assert "at most 6: met" in conclusions.time(study)
    assert "at most 6: not met" in conclusions.time(made_up_study({("milliseconds", "dual_transmission"): 3.0}))
    assert "not measured" in conclusions.time(made_up_study(without=("milliseconds",)))
    study.result.provenance["quick"] = True
    assert "met" not in conclusions.time(study)


def test_rank_correlation_knows_agreement_and_contradiction():
    pairs = {method: place for place, method in enumerate(METHODS)}
    like = {("uiqm_f", m): SCORES["psnr"][place] / SCORES["uiqm_f"][place] for m, place in pairs.items()}
    against = {key: 1 / (factor * SCORES["uiqm_f"][pairs[key[1]]] ** 2) for key, factor in like.items()}
    assert no_reference.rank_correlation(made_up_study(like), "uiqm_f", "tank_low") == pytest.approx(1)
    assert no_reference.rank_correlation(made_up_study(against), "uiqm_f", "tank_low") == pytest.approx(-1)


def test_white_noise_beats_methods_and_is_said_to():
    text = conclusions.no_reference_scores(made_up_study(), NOISE)
    assert "UCIQE (O): white noise 0.660, above 8 of 8 methods" in text
    assert "above 0 of 8" in conclusions.no_reference_scores(made_up_study(), NOISE | {"uciqe_o": 0.0})


# ---- the page ----


def test_the_page_names_its_files_and_all_are_there(folder):
    text = (folder / "README.md").read_text()
    named = {part.partition(")")[0] for part in text.split("](")[1:]}
    assert named == {path.name for path in folder.iterdir() if path.suffix in (".png", ".jpg")}
    assert {"gain_over_raw.png", "oracle_share.png", "no_reference.png", "sheet_1.jpg", "sheet_2.jpg"} == named
    assert all((folder / name).stat().st_size < 400_000 for name in named)
    assert read_result(folder / "restoration.json.gz").records


def test_numbers_of_the_tables_are_those_of_the_records(folder, dataset, result):
    text = (folder / "README.md").read_text()
    study = study_of(result, dataset)
    high = text[text.index("### tank high") :]
    assert cells(high, "clahe")[2] == f"{study.summary('clahe', 'psnr', 'tank_high'):.2f}"
    assert cells(high, "lamp model")[2].startswith("**")
    assert not cells(high, "oracle wiener")[2].startswith("**")
    table = text[text.index("**Table 6.3**") :]
    # image, scene, AGCWD printed and here, MSRCR printed, WGIF printed, Phaseformer printed, Proposed printed and here
    here = [f"{study.value('000700', name, 'psnr'):.2f}" for name in ("agcwd", "dual_transmission")]
    assert cells(table, "2 ") == ["2", "tank 2", "13.84", here[0], "11.04", "17.11", "14.13", "14.70", here[1]]
    assert cells(table, "12 ")[1:4] == ["-", "12.00", "-"]
    assert cells(text[text.index("**Table 3.1**") :], "Phaseformer")[:3] == [
        "Phaseformer: not measured",
        "3.43",
        "3.02",
    ]
    assert "20.53 dB in the text" in text
    assert "- Phaseformer: not measured: a network" in text


def test_the_ablation_has_its_rows(folder):
    text = (folder / "README.md").read_text()
    rows = text[text.index("**Table 3.3**") :]
    for row in ("Ours: dual transmission", "Trans+ad: dual transmission colour", "Transonly: dual transmission only"):
        assert cells(rows, row)[3] != "-"
    assert cells(rows, "Uformer: not measured")[3] == "-"


def test_a_missing_metric_or_water_is_said_and_left_out():
    study = made_up_study(waters=WATERS[:3], without=("oracle_share", "uiqm_m"))
    text = page.text(study, NOISE)
    assert "`oracle_share`" in tables.left_out(study, printed())
    assert "No case in tank high" in text
    assert "oracle_share.png" not in text
    assert "**Table 6.1**" in text
    assert "**Table 6.3**" not in text
    whole = page.text(made_up_study(), NOISE)
    assert "**Table 6.3**" in whole
    assert "No case in" not in whole


def test_pictures_have_the_same_bytes_each_time(folder, dataset, result, tmp_path, monkeypatch):
    monkeypatch.setattr(sheets, "SHOWN", SHOWN)
    study = study_of(result, dataset)
    figures.gain_over_raw(study, tmp_path / "one.png")
    assert (tmp_path / "one.png").read_bytes() == (folder / "gain_over_raw.png").read_bytes()
    methods = sheets.shown_methods(study, read_definition("restoration")[1])
    sheets.write(study, dataset, tmp_path / "one.jpg", scene=sheets.chosen(study)[1], methods=methods[:1])
    assert (tmp_path / "one.jpg").read_bytes() != (folder / "sheet_2.jpg").read_bytes()  # fewer methods
    sheets.write(study, dataset, tmp_path / "two.jpg", scene=sheets.chosen(study)[1], methods=methods)
    assert (tmp_path / "two.jpg").read_bytes() == (folder / "sheet_2.jpg").read_bytes()


def test_one_mechanism_finds_the_page_of_a_benchmark():
    assert commands.page_of("restoration", "restoration", algorithms=["clahe"]) is page
    assert commands.page_of("validity", "validity", algorithms=None) is validity_page
    with pytest.raises(ValueError, match="--out: got another, allowed: .*restoration"):
        commands.page_of("another", "another", algorithms=None)


def test_rows_of_the_ablation_differ_in_what_they_do(dataset):
    variants = read_definition("restoration")[1].variants
    image = dataset.frame("000000").image
    names = ("dual_transmission_only", "dual_transmission_colour", "dual_transmission")
    only, colour, full = (load(TASK, name, variants).module.restore(image) for name in names)
    assert not np.array_equal(only, colour)
    assert not np.array_equal(colour, full)
    again = load(TASK, "dual_transmission", variants).module.restore(image, colour=False, clip_limit=0.0)
    assert np.array_equal(only, again)


def test_lists_are_joined():
    assert [joined(names) for names in ([], ["a"], ["a", "b"], ["a", "b", "c"])] == ["", "a", "a and b", "a, b and c"]
