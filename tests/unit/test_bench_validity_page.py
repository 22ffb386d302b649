"""The page of the validity study: its numbers are those of the records, and it is made of what lies in its folder."""

import dataclasses
import math

import numpy as np
import pytest
import synthetic_validity
from test_bench_validity import MODEL, TOML

from uwsim.bench.records import read_result
from uwsim.bench.run import run
from uwsim.bench.validity import experiment, figures, page
from uwsim.bench.validity.study import Study, title
from uwsim.files import read_json


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return synthetic_validity.write_dataset(tmp_path_factory.mktemp("data") / "synthetic")


def scored(folder, dataset, name: str, text: str):
    (folder / "exact.py").write_text(MODEL)
    (folder / f"{name}.toml").write_text(text)
    return run(str(folder / f"{name}.toml"), dataset)


def with_conditions(result, changes: dict[str, dict]):
    """Return a result whose cases were like something else: a grid of the three frames."""
    conditions = {case: found | changes[case] for case, found in result.provenance["conditions"].items()}
    return dataclasses.replace(result, provenance=result.provenance | {"conditions": conditions})


@pytest.fixture(scope="module")
def folder(tmp_path_factory, dataset):
    made = tmp_path_factory.mktemp("page")
    model = str(made / "exact.py")
    text = TOML.partition("[variants")[0].replace('"fitted", "wrong", "bare"', '"exact", "exact_fitted"')
    text += (
        f'[variants]\nexact = {{ algorithm = "{model}" }}\nexact_fitted = {{ algorithm = "{model}", fitted = true }}\n'
    )
    page.write(made / "out", result=scored(made, dataset, "validity", text), dataset=dataset)
    chart = "".join(
        f'{name} = {{ algorithm = "{model}", keywords = {{ c_per_m = {c} }} }}\n'
        for model_name, c in (("multistage", 1.9), ("jaffe_mcglamery", 1.0))
        for base in (model_name, f"{model_name}_as_printed")
        for name in (base, f"{base}_without_forward")
    )
    names = [line.partition(" = ")[0] for line in chart.splitlines()]
    text = TOML.partition("[variants")[0].replace('"fitted", "wrong", "bare"', ", ".join(f'"{name}"' for name in names))
    result = scored(made, dataset, "validity_chart", f"{text}[variants]\n{chart}")
    page.write(made / "out", result=result, dataset=dataset)
    return made / "out"


def test_the_page_names_its_figures_and_all_are_there(folder):
    text = (folder / "README.md").read_text()
    named = {part.partition(")")[0] for part in text.split("](")[1:]}
    assert named == {path.name for path in folder.glob("*.png")}
    assert {path.name for path in folder.glob("*.json.gz")} == {"validity.json.gz", "validity_chart.json.gz"}
    assert len(named) >= 10


def test_the_page_is_made_of_the_results_that_lie_there(folder, tmp_path):
    assert page.text(folder) == (folder / "README.md").read_text()
    (tmp_path / "validity.json.gz").write_bytes((folder / "validity.json.gz").read_bytes())
    alone = page.text(tmp_path)
    assert "The grid" in alone
    assert "Table 2.1" not in alone


def test_numbers_of_the_tables_are_those_of_the_records(folder):
    study = Study(read_result(folder / "validity_chart.json.gz"))
    cases = experiment.turbid_cases(study)
    assert cases == {"moderate": "000001", "high": "000002"}
    text = (folder / "README.md").read_text()
    line = next(line for line in text.splitlines() if line.startswith("| JM, original"))
    mse, psnr = (study.value("000001", "jaffe_mcglamery", metric) for metric in ("mse", "psnr"))
    assert [cell.strip() for cell in line.split("|")][2:4] == ["0.07", f"{mse / 255**2:.4f}"]
    assert f"| 11.16 | {psnr:.2f} |" in line
    # the truth has a veil, which neither stand-in has: the brighter one of Jaffe and McGlamery is nearer
    assert "*Multistage better than Jaffe-McGlamery* does not hold here" in text
    assert "*Forward scattering negligible* holds" in text  # there is none in these frames


def test_printed_mse_and_psnr_agree_with_each_other():
    """Each PSNR is that of an MSE of pictures from 0 to 1, which is printed cut off, not rounded, to two digits."""
    for _, rows in experiment.PRINTED.values():
        for mse, psnr in rows:
            assert math.floor(100 * 10 ** (-psnr / 10)) == round(100 * mse)


def test_steps_join_what_is_nearly_the_same(folder):
    study = Study(read_result(folder / "validity.json.gz"))
    depths = {"000000": 1.0, "000001": 1.1, "000002": 4.0}
    changed = Study(with_conditions(study.result, {case: {"optical_depth": depth} for case, depth in depths.items()}))
    assert changed.steps("optical_depth") == [(pytest.approx(1.05), ["000000", "000001"]), (4.0, ["000002"])]
    assert changed.nearest(optical_depth=3.0) == "000002"


def test_errors_that_noise_hides_are_no_proof_of_validity(folder):
    study = Study(read_result(folder / "validity.json.gz"))
    model = study.models[-1]  # fitted: right
    assert study.share_within(model, 5.0) == 100
    noisy = {case: {"resolution_percent": 20.0} for case in study.cases}
    assert Study(with_conditions(study.result, noisy)).share_within(model, 5.0) == 0


def test_shares_of_light_sum_to_one(folder):
    content = read_json(folder / "validity.json.gz")
    for condition in content["provenance"]["conditions"].values():
        assert sum(figures.shares_of(condition).values()) == pytest.approx(1, abs=1e-3)


def test_titles():
    assert title("jaffe_mcglamery_fitted") == "Jaffe-McGlamery fitted"
    assert title("multistage") == "multistage"
    assert title("beer_lambert") == "Beer-Lambert"


def test_figures_have_the_same_bytes_each_time(folder, tmp_path):
    study = Study(read_result(folder / "validity.json.gz"))
    figures.error_over_depth(study, tmp_path / "one.png")
    assert (tmp_path / "one.png").read_bytes() == (folder / "error_over_optical_depth.png").read_bytes()


@pytest.mark.parametrize(("name", "algorithms"), [("pose", None), ("validity", ["simplified"]), ("my.toml", None)])
def test_only_whole_runs_of_the_study_have_a_page(name, algorithms):
    with pytest.raises(ValueError, match="--out: got .* allowed: validity and validity_chart"):
        page.check(name, algorithms=algorithms)


def test_one_turbidity_is_no_experiment(folder):
    study = Study(read_result(folder / "validity_chart.json.gz"))
    conditions = {"000000": study.conditions["000000"]}
    alone = dataclasses.replace(study.result, provenance=study.result.provenance | {"conditions": conditions})
    with pytest.raises(ValueError, match="two or more turbidities"):
        experiment.section(Study(alone))
    assert np.isnan(Study(alone).value("000000", "nobody"))
