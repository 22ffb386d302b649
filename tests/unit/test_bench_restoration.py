"""What a restored picture is scored by: charts, tags, shares of the oracle's gain, and the summaries of it all."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
import synthetic
from scipy import ndimage
from scipy.special import erf

from uwsim.bench import restoration
from uwsim.bench.markers import whole_markers
from uwsim.bench.records import markdown, result_from_dict, summary_names
from uwsim.bench.restoration import relations
from uwsim.bench.restoration.scores import all_scores, chart_scores, tag_scores
from uwsim.bench.restoration.targets import Targets
from uwsim.bench.run import run
from uwsim.images import srgb_uint8_from_linear
from uwsim.metrics import METRICS

EDGE_SIGMA_PX = 0.8
BEST = {
    "psnr": math.inf, "mse": 0, "ssim": 1, "psnr_gain": math.inf, "ssim_gain": 1, "colour_difference": 0,
    "colour_difference_gain": 0, "mtf50_ratio": 1, "usaf_transfer": 1, "tags_found": 100, "sift_matches": 100,
    "orb_matches": 100,
}  # fmt: skip


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return synthetic.write_dataset(tmp_path_factory.mktemp("data") / "synthetic")


@pytest.fixture(scope="module")
def board(dataset):
    """The frame with two markers as a case."""
    return restoration.case(dataset, "000003")


def chart_targets(*kinds) -> Targets:
    """Return a frame 240 x 160 with a ColorChecker (1), a slanted edge (2) and a USAF-like chart (3) on grey."""
    albedo, instance = np.full((160, 240, 3), 0.3), np.zeros((160, 240), np.uint32)
    instance[8:76, 8:100], albedo[8:76, 8:100] = 1, 0.04
    for number, value in enumerate(np.random.default_rng(4).uniform(0.1, 0.8, (12, 3))):
        row, column = 12 + number // 4 * 22, 12 + number % 4 * 22
        albedo[row : row + 18, column : column + 18] = value
    y, x = np.mgrid[:160, :240]
    slant = math.radians(6)
    distance_px = (x - 180) * math.cos(slant) + (y - 50) * math.sin(slant)
    instance[20:80, 150:210] = 2
    albedo = np.where((instance == 2)[..., None], np.where(distance_px > 0, 0.7, 0.05)[..., None], albedo)
    instance[90:156, 20:220], albedo[90:156, 20:220] = 3, 0.8
    for width, start in ((8, 30), (4, 90), (2, 130), (3, 160)):
        for bar in range(3):
            albedo[100:146, start + 2 * width * bar : start + 2 * width * bar + width] = 0.08
    names = ("colorchecker", "slanted_edge", "usaf_1951")
    bodies = [SimpleNamespace(kind=kind, instance=n) for n, kind in enumerate(names, 1) if kind in kinds]
    buffers = {"albedo": albedo, "instance": instance}
    frame = SimpleNamespace(info=SimpleNamespace(bodies=bodies, markers=()), buffer=buffers.__getitem__)
    light = ndimage.gaussian_filter(albedo, (EDGE_SIGMA_PX, EDGE_SIGMA_PX, 0))
    blurred = 0.05 + 0.65 * 0.5 * (1 + erf(distance_px / EDGE_SIGMA_PX / math.sqrt(2)))
    middle = ndimage.binary_erosion(instance == 2, iterations=3)
    light = 0.9 * np.where(middle[..., None], blurred[..., None], light)
    return Targets(frame, srgb_uint8_from_linear(light))


CHARTS = ("colorchecker", "slanted_edge", "usaf_1951")


def seen_through(picture, *, gain=1.0, veil=0.0, blur_px=0.0):
    from uwsim.images import linear_from_srgb_uint8

    linear = linear_from_srgb_uint8(picture)
    return srgb_uint8_from_linear(gain * ndimage.gaussian_filter(linear, (blur_px, blur_px, 0)) + veil)


def test_the_truth_itself_has_the_best_scores(board):
    """Control: the stored picture has not."""
    targets = chart_targets(*CHARTS)
    found = all_scores(targets, targets.twin)
    # bars that repeat exactly have features that cannot be told apart
    best = {key: value for key, value in BEST.items() if key not in ("tags_found", "sift_matches", "orb_matches")}
    assert {key: found[key] for key in best} == pytest.approx(best, abs=1e-12)
    assert math.isnan(found["tags_found"])
    found, stored = all_scores(board.targets, board.truth), all_scores(board.targets, board.image)
    for key in ("psnr", "ssim", "psnr_gain", "ssim_gain", "tags_found", "sift_matches", "orb_matches"):
        assert found[key] == pytest.approx(BEST[key])
        assert stored[key] < BEST[key] or key == "tags_found"
    assert set(found) | {"milliseconds", *relations.SHARES} == set(restoration.TASK.statistics)
    assert set(restoration.TASK.statistics) <= set(METRICS)


def test_half_the_light_leaves_the_scores_after_the_gain():
    """Control: a veil does not."""
    targets = chart_targets(*CHARTS)
    half = all_scores(targets, seen_through(targets.twin, gain=0.5))
    assert half["psnr_gain"] > 40 > 25 > half["psnr"]
    assert half["ssim_gain"] > 0.995
    assert half["colour_difference_gain"] < 0.5 < 5 < half["colour_difference"]
    assert half["mtf50_ratio"] == pytest.approx(1, abs=0.02)
    assert half["usaf_transfer"] == pytest.approx(1, abs=0.01)
    veiled = all_scores(targets, seen_through(targets.twin, gain=0.5, veil=0.2))
    assert veiled["psnr_gain"] < 20
    assert veiled["colour_difference_gain"] > 5
    assert veiled["usaf_transfer"] < 0.7


def test_blur_lowers_the_frequency_as_the_closed_form_says():
    """Expected: Gaussians of 0.8 and 2 px in a row are one of their root of squares. Control: not of the second."""
    targets = chart_targets("slanted_edge")
    blurred = chart_scores(targets, seen_through(targets.twin, blur_px=2.0))
    ((_, true),) = targets.edges
    half = math.sqrt(math.log(2) / 2) / math.pi
    assert true == pytest.approx(half / EDGE_SIGMA_PX, rel=0.02)
    assert blurred["mtf50_ratio"] == pytest.approx(EDGE_SIGMA_PX / math.hypot(EDGE_SIGMA_PX, 2), rel=0.02)
    assert blurred["mtf50_ratio"] != pytest.approx(EDGE_SIGMA_PX / 2, rel=0.02)


@pytest.mark.parametrize("kind", CHARTS)
def test_without_a_chart_its_scores_are_none(kind):
    keys = {
        "colorchecker": ("colour_difference", "colour_difference_gain"), "slanted_edge": ("mtf50_ratio",),
        "usaf_1951": ("usaf_transfer",),
    }  # fmt: skip
    targets = chart_targets(*(other for other in CHARTS if other != kind))
    found = all_scores(targets, targets.twin)
    assert {key for key in sum(keys.values(), ()) if math.isnan(found[key])} == set(keys[kind])


class TestTags:
    def test_tags_of_the_truth_are_found_in_their_place(self, board):
        """Control: grey has none, and no error to speak of."""
        found = tag_scores(board.targets, board.truth)
        assert found["tags_found"] == 100
        assert found["corner_error_px"] < 0.5
        assert found["tag_pose_error_percent"] < 1
        none = tag_scores(board.targets, np.full_like(board.truth, 90))
        assert none["tags_found"] == 0
        assert math.isnan(none["corner_error_px"])
        assert math.isnan(none["tag_pose_error_percent"])

    def test_a_tag_in_another_place_is_not_found(self, board):
        """Expected: 2 px off is found with an error of 2 px, 5 px off is not, though it is detected."""
        near, far = (np.roll(board.truth, shift, axis=1) for shift in (2, 5))
        assert tag_scores(board.targets, near)["tags_found"] == 100
        assert tag_scores(board.targets, near)["corner_error_px"] == pytest.approx(2, abs=0.2)
        assert tag_scores(board.targets, far)["tags_found"] == 0

    def test_a_wrong_id_is_not_found(self, board):
        """Setup: the two markers' ids change places in the truth."""
        info = board.targets.frame.info
        first, second = info.markers
        swapped = (first.model_copy(update={"id": second.id}), second.model_copy(update={"id": first.id}))
        frame = dataclasses.replace(board.targets.frame, info=info.model_copy(update={"markers": swapped}))
        assert tag_scores(Targets(frame, board.truth), board.truth)["tags_found"] == 0

    def test_a_tag_with_a_hidden_corner_does_not_count(self, board):
        info = board.targets.frame.info
        first, second = info.markers
        hidden = first.model_copy(update={"visible": (True, True, False, True)})
        assert whole_markers(info.model_copy(update={"markers": (hidden, second)})) == [second]

    def test_frames_without_tags(self, dataset):
        case = restoration.case(dataset, "000000")
        assert all(math.isnan(value) for value in tag_scores(case.targets, case.truth).values())


def test_targets_are_looked_for_once(board, monkeypatch):
    """Control: another case looks again."""
    _ = board.targets.sift, board.targets.patches
    monkeypatch.setattr("uwsim.metrics.features.features", lambda *_: pytest.fail("again"))
    assert len(board.targets.sift.points_px) > 0
    with pytest.raises(pytest.fail.Exception):
        _ = Targets(board.targets.frame, board.truth).sift


class TestShares:
    RAW, ORACLE = {"psnr": 12.0, "psnr_gain": 13.0}, {"psnr": 20.0, "psnr_gain": 18.0}

    def shares(self, oracle, **scores):
        found = relations.relate({"raw": self.RAW, "mine": scores, "best": oracle}, "raw", "best")
        return {name: one["oracle_share"] for name, one in found.items()}, found["mine"]["oracle_share_gain"]

    def test_a_share_is_of_the_oracles_gain(self):
        """Expected: nothing for the raw picture, all for the oracle; 5 dB of gain are too little to share."""
        shares, after_gain = self.shares(self.ORACLE, psnr=14.0, psnr_gain=15.0)
        assert shares == {"raw": 0, "mine": 0.25, "best": 1}
        assert math.isnan(after_gain)

    def test_worse_than_nothing_is_below_zero(self):
        assert self.shares(self.ORACLE, psnr=10.0, psnr_gain=0.0)[0]["mine"] == -0.25

    @pytest.mark.parametrize("gain_db", [5.9, -3.0, math.inf])
    def test_without_a_gain_there_is_no_share(self, gain_db):
        shares, _ = self.shares({"psnr": 12 + gain_db, "psnr_gain": 13.0}, psnr=14.0, psnr_gain=15.0)
        assert all(math.isnan(share) for share in shares.values())

    def test_an_oracle_that_is_not_installed_shares_nothing(self):
        found = relations.relate({"raw": self.RAW, "mine": self.ORACLE}, "raw", "best")
        assert math.isnan(found["mine"]["oracle_share"])

    def test_the_result_has_it_per_frame_and_as_mean(self, dataset):
        result = run("restoration", dataset, algorithms=["clahe"])
        found = {(r.case, r.algorithm, r.metric): r.value for r in result.records}
        shares = []
        for case in ("000000", "000001", "000003"):
            raw, mine, best = (found[case, name, "psnr"] for name in ("none", "clahe", "oracle_wiener"))
            if best - raw >= 6:
                shares.append((mine - raw) / (best - raw))
                assert found[case, "clahe", "oracle_share"] == pytest.approx(shares[-1])
            else:
                assert found[case, "clahe", "oracle_share"] is None
        assert shares
        assert found["all", "clahe", "oracle_share"] == pytest.approx(np.mean(shares))

    def test_without_an_oracle_there_is_no_such_column(self, dataset, tmp_path):
        path = tmp_path / "plain.toml"
        path.write_text(
            'task = "restoration"\ndescription = "x"\ndataset = "x"\nalgorithms = ["none", "clahe"]\n'
            'do_nothing = "none"\nquick_cases = 1\n'
        )
        result = run(str(path), dataset)
        assert not {record.metric for record in result.records} & set(relations.SHARES)
        assert "oracle" not in markdown(result)
        assert "oracle_share" not in result.provenance["statistics"]


class TestFindings:
    def test_ranks_that_agree_and_disagree(self):
        """Control: one pair of methods that changes places is no longer 1."""
        scores = [
            {"a": value, "b": value**3, "c": -value, "d": place}
            for value, place in zip(range(5), (0, 1, 3, 2, 4), strict=True)
        ]
        assert relations.rank_correlation(scores, "a", "b") == pytest.approx(1)
        assert relations.rank_correlation(scores, "a", "c") == pytest.approx(-1)
        assert relations.rank_correlation(scores, "a", "d") == pytest.approx(0.9)
        assert relations.rank_correlation(scores[:2], "a", "b") is None
        assert relations.rank_correlation([{"a": 1, "b": value} for value in range(5)], "a", "b") is None
        best = [*scores, {"a": math.inf, "b": 999}]
        assert relations.rank_correlation(best, "a", "b") == pytest.approx(1)

    def test_means_of_methods_and_all_pictures_are_told_apart(self, dataset):
        """Setup: in each case the ranks agree, between cases they do not; of the means they agree."""

        def one(value, truth):
            return {"uciqe_o": value, "uiqm_f": value, "uiqm_m": -value, "psnr": truth, "ssim": truth}

        scores = {
            "000000": {name: one(n, n + 10) for n, name in enumerate("abc")},
            "000001": {name: one(n + 10, n) for n, name in enumerate("abc")},
        }
        rows = relations.findings(dataset, scores)["rank_correlations"]["rows"]
        assert rows[0] == ["uciqe_o", pytest.approx(1), pytest.approx(rows[0][2]), pytest.approx(1), rows[0][2]]
        assert rows[0][2] < 0
        assert rows[2][1] == pytest.approx(-1)

    def test_white_noise_is_in_the_result_and_below_the_table(self, dataset):
        """Expected: the values of 256 x 256 noise to their printed digits, and as a row at the dataset's size."""
        noise = relations.no_reference_scores(relations.white_noise(256, 256))
        assert noise == pytest.approx({"uciqe_o": 0.662, "uiqm_f": 2.910, "uiqm_m": 3.421}, abs=1e-3)
        result = run("restoration", dataset, algorithms=["clahe"], quick=True)
        text = markdown(result)
        assert "| white noise 128 x 96 |" in text
        assert "over the means of 3 methods, and over 9 pictures" in text
        assert text.index("Rank correlation") > text.index("further scores")
        assert result_from_dict(result.to_dict()) == result


def test_summaries_are_by_water_where_there_are_several():
    waters = {"0": "clear", "1": "high", "2": "clear", "3": "high", "4": "low"}

    def frame(name):
        return SimpleNamespace(info=SimpleNamespace(water=SimpleNamespace(name=waters[name])))

    several = restoration.summaries(SimpleNamespace(frame=frame), list(waters))
    assert several == {"all": list(waters), "clear": ["0", "2"], "high": ["1", "3"]}  # low: the frame itself
    assert list(several)[0] == "all"
    assert restoration.summaries(SimpleNamespace(frame=frame), ["0", "2"]) == {"all": ["0", "2"]}


def test_each_water_has_its_table_and_the_further_scores_one(dataset, monkeypatch):
    """Setup: the frames' waters under two names. Control: without, there is one table less each."""
    parts = {"all": ["000000", "000003"], "clear": ["000000"], "high": ["000003"]}
    task = dataclasses.replace(restoration.TASK, summaries=lambda dataset, cases: parts)
    monkeypatch.setitem(__import__("uwsim.bench.run", fromlist=["TASKS"]).TASKS, "restoration", task)
    result = run("restoration", dataset, algorithms=["clahe"], quick=True)
    assert summary_names(result) == ["all", "clear", "high"]
    found = {(r.case, r.metric): r.value for r in result.records if r.algorithm == "clahe"}
    assert found["clear", "ssim"] == found["000000", "ssim"]
    assert found["all", "ssim"] == pytest.approx((found["000000", "ssim"] + found["000003", "ssim"]) / 2)
    text = markdown(result)
    assert text.count("PSNR [dB]") == 3
    assert text.count("UIQM (F)") == text.count("MSE") == 1
    assert "restoration, high cases" in text
    monkeypatch.undo()
    assert markdown(run("restoration", dataset, algorithms=["clahe"], quick=True)).count("PSNR [dB]") == 1
