"""Methods on real photographs: what the folder holds, which tags are verified, how rankings agree, what is refused."""

import itertools
import json
import math

import cv2
import numpy as np
import pytest

from uwsim import cli
from uwsim.bench.photos import calibration, folder, layout, tags
from uwsim.bench.photos.agreement import rank_agreement, simulated_scores
from uwsim.bench.photos.run import run
from uwsim.bench.records import Record, Result, markdown, read_result
from uwsim.files import sha256
from uwsim.images import write_png

# one pixel of the picture per mm
SCALE, SIDE_M = 1000.0, 0.06
PLACES = {0: (0.1, 0.1), 1: (0.3, 0.1), 2: (0.1, 0.25), 5: (0.3, 0.25)}
HEIGHT_PX, WIDTH_PX = 360, 420
# the picture's y runs down, the plane's up
SEEN = np.array([[SCALE, 0, 0], [0, -SCALE, HEIGHT_PX], [0, 0, 1.0]])
VIEW = np.array([[0.8, 0.1, 30], [-0.06, 0.85, 40], [2e-4, 1e-4, 1.0]])


def floor(right_deg=0.0, places=PLACES, **more) -> dict:
    return {
        "description": "a floor", "source": "this test", "videos": ["floor*.avi"], "every_nth_frame": 3,
        "family": "DICT_APRILTAG_16h5", "side_m": SIDE_M, "right_deg": right_deg,
        "tags": [{"id": key, "position_m": list(place)} for key, place in places.items()],
    } | more  # fmt: skip


def picture(places=PLACES, quarter_turns=0, view=VIEW) -> np.ndarray:
    """Return tags on a white floor, each turned, seen by a homography."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_16h5)
    flat, side = np.full((HEIGHT_PX, WIDTH_PX), 230, np.uint8), round(SIDE_M * SCALE)
    for key, (x, y) in places.items():
        left, top = round(x * SCALE - side / 2), round(HEIGHT_PX - y * SCALE - side / 2)
        marker = np.rot90(cv2.aruco.generateImageMarker(dictionary, key, side), quarter_turns)
        flat[top : top + side, left : left + side] = np.maximum(marker, 20)
    seen = cv2.warpPerspective(flat, view, (WIDTH_PX, HEIGHT_PX), flags=cv2.INTER_AREA, borderValue=230)
    return np.repeat(seen[..., None], 3, axis=2)


def a_layout(**more) -> layout.Layout:
    return layout.validated(layout.Layout, floor(**more), where="floor")


class TestTags:
    @pytest.mark.parametrize("quarter_turns", range(4))
    def test_all_are_verified_and_lie_where_the_plane_has_them(self, quarter_turns):
        shown = a_layout(right_deg=90.0 * quarter_turns)
        found = tags.verified_tags(picture(quarter_turns=quarter_turns), shown)
        assert set(found.verified) == set(PLACES)
        assert found.rejected == 0
        assert found.homography_error_px < 0.4
        for key, corners in found.verified.items():
            true = cv2.perspectiveTransform(shown.corners_m()[key][None], VIEW @ SEEN)[0]
            # pixel centres of the flat picture lie half a pixel aside
            assert np.abs(corners - true).max() < 1.5

    def test_a_layout_turned_the_wrong_way_verifies_nothing(self):
        """Control of the test above: corners in another order are no view of the plane."""
        found = tags.verified_tags(picture(), a_layout(right_deg=90.0))
        assert found.verified == {}
        assert found.rejected == len(PLACES)
        assert math.isnan(found.homography_error_px)

    def test_a_tag_in_another_place_is_rejected_and_the_others_stay(self):
        moved = PLACES | {5: (0.3 + SIDE_M, 0.25)}
        found = tags.verified_tags(picture(moved), a_layout())
        assert set(found.verified) == {0, 1, 2}
        assert found.rejected == 1

    def test_one_tag_is_no_evidence(self):
        assert tags.verified_tags(picture({0: PLACES[0]}), a_layout()).verified == {}
        assert set(tags.verified_tags(picture({0: PLACES[0], 1: PLACES[1]}), a_layout()).verified) == {0, 1}

    def test_the_right_one_of_two_with_the_same_id_counts(self):
        twice = picture()
        other = picture({5: (0.2, 0.175)})
        twice[other < 128] = other[other < 128]
        detected = [key for key, _ in tags.detected(twice, "DICT_APRILTAG_16h5")]
        assert sorted(detected) == [0, 1, 2, 5, 5]
        found = tags.verified_tags(twice, a_layout())
        assert set(found.verified) == set(PLACES)
        assert found.rejected == 1

    def test_growing_finds_the_largest_set_of_all(self):
        """Noisy corners, some wrong: as many as the search through all subsets finds."""
        rng, compared = np.random.default_rng(0), 0
        corners = a_layout(places={k: (0.2 * (k % 3), 0.2 * (k // 3)) for k in range(7)}).corners_m()
        plane = np.array(list(corners.values()))
        for _ in range(10):
            seen = cv2.perspectiveTransform(plane.reshape(1, -1, 2), VIEW @ SEEN).reshape(-1, 4, 2)
            seen = seen + rng.normal(0, 1.3, seen.shape)
            seen[rng.integers(0, 7, 2)] += rng.normal(0, 15, (1, 1, 2))
            grown = tags._largest_set(range(7), plane, seen)
            sizes = [
                size for size in range(2, 8) for some in itertools.combinations(range(7), size)
                if tags._agree(list(some), range(7), plane, seen)
            ]  # fmt: skip
            assert len(grown) == max(sizes)
            compared += max(sizes) < 7
        assert compared > 3

    def test_a_rigid_pose_fits_a_view_of_the_camera_and_no_other(self):
        K = np.array([[500.0, 0, 210], [0, 500.0, 180], [0, 0, 1]])
        turn = cv2.Rodrigues(np.array([np.pi - 0.2, 0.1, 0.05]))[0]
        camera = K @ np.column_stack([turn[:, 0], turn[:, 1], [-0.2, 0.17, 0.6]])
        seen = tags.verified_tags(
            picture(view=camera @ np.linalg.inv(SEEN)), a_layout(intrinsics_px=[500, 500, 210, 180])
        )
        assert len(seen.verified) == 4
        assert seen.pose_error_px < 0.6
        wrong = tags.verified_tags(
            picture(view=camera @ np.linalg.inv(SEEN)), a_layout(intrinsics_px=[900, 500, 210, 180])
        )
        assert wrong.pose_error_px > 2
        assert wrong.homography_error_px == seen.homography_error_px


class TestLayout:
    def test_the_tank_is_as_published(self):
        (path,) = layout.shipped_layouts()
        tank = layout.read_layout(path)
        corners = tank.corners_m()
        assert len(corners) == 9
        assert corners[14].mean(axis=0) == pytest.approx([1.545, 2.065])
        # OpenCV's first corner: to the right and below, seen from above
        assert corners[14][0] == pytest.approx([1.545 + 0.1555 / 2, 2.065 - 0.1555 / 2])
        assert tank.K()[1, 2] == 226.3186

    @pytest.mark.parametrize(
        ("change", "parts"),
        [
            ({"family": "DICT_TAG"}, ["family", "'DICT_TAG'", "DICT_APRILTAG_16h5"]),
            ({"side_m": 0.0}, ["side_m", "> 0"]),
            ({"side_m": "1"}, ["side_m", "'1'", "number"]),
            ({"side_m": 0.18}, ["tags", "0.15 m apart", "0.18"]),
            ({"tags": [{"id": 30, "position_m": [0, 0]}, {"id": 1, "position_m": [1, 0]}]}, ["tags", "30", "below 30"]),
            ({"tags": [{"id": 1, "position_m": [0, 0]}, {"id": 1, "position_m": [1, 0]}]}, ["tags", "1 twice"]),
            ({"tags": [{"id": 1, "position_m": [0, 0]}]}, ["tags", "at least 2"]),
            ({"every_nth_frame": 0}, ["every_nth_frame", ">= 1"]),
            ({"intrinsics_px": [1.0, 1.0, 0.0]}, ["intrinsics_px"]),
            ({"colour": 1}, ["colour", "unknown"]),
        ],
    )
    def test_a_broken_one_is_refused_in_one_line(self, tmp_path, change, parts):
        path = write_layout(tmp_path / "mine.toml", **change)
        with pytest.raises(ValueError) as caught:
            layout.read_layout(path)
        assert "\n" not in str(caught.value)
        assert all(part in str(caught.value) for part in ["mine.toml", *parts]), str(caught.value)

    def test_a_users_own_goes_before_one_that_is_shipped(self, tmp_path):
        one, other = a_layout(), a_layout(side_m=0.05)
        video = tmp_path / "floor_1.avi"
        assert layout.layout_of(video, {"mine": one}, {"theirs": other}) == "mine"
        assert layout.layout_of(video, {}, {"theirs": other}) == "theirs"
        assert layout.layout_of(tmp_path / "wall.avi", {"mine": one}, {"theirs": other}) is None
        with pytest.raises(ValueError, match="mine and other"):
            layout.layout_of(video, {"mine": one, "other": other}, {})


class TestAgreement:
    REAL = {name: float(value) for value, name in enumerate("abcdefgh")}

    def test_equal_and_opposite_rankings(self):
        same = rank_agreement({name: value**3 for name, value in self.REAL.items()}, self.REAL)
        assert (same.spearman, same.kendall) == pytest.approx((1, 1))
        assert same.spearman_p == same.kendall_p < 0.001
        opposite = rank_agreement({name: -value for name, value in self.REAL.items()}, self.REAL)
        assert (opposite.spearman, opposite.kendall) == pytest.approx((-1, -1))
        assert opposite.spearman_p == opposite.kendall_p == 1

    def test_it_is_that_of_scipy_with_ties_and_over_common_methods(self):
        from scipy.stats import kendalltau, spearmanr

        rng = np.random.default_rng(1)
        first, second = (dict(zip("abcdefghij", rng.integers(0, 5, 10).tolist(), strict=True)) for _ in range(2))
        found = rank_agreement(first | {"y": 1}, {"z": 3} | second)
        pair = list(first.values()), list(second.values())
        assert found.methods == tuple("abcdefghij")
        assert found.spearman == pytest.approx(spearmanr(*pair).statistic)
        assert found.kendall == pytest.approx(kendalltau(*pair).statistic)
        assert found == rank_agreement(first, second)

    def test_the_interval_holds_the_value_and_is_wide_where_little_is_known(self):
        swapped = self.REAL | {"a": self.REAL["b"], "b": self.REAL["a"]}
        found = rank_agreement(swapped, self.REAL)
        low, high = found.kendall_interval
        assert found.kendall == pytest.approx(1 - 2 / 28)
        assert low <= found.kendall <= high
        assert high - low > 0.1
        assert found.kendall_p < 0.01
        # control: rankings that have nothing to do with each other
        mixed = dict(zip("abcdefgh", (4, 1, 6, 3, 7, 0, 5, 2), strict=True))
        none = rank_agreement(mixed, self.REAL)
        assert none.kendall_interval[0] < 0 < none.kendall_interval[1]
        assert none.kendall_p > 0.2

    def test_a_p_is_the_share_of_all_orders(self):
        found = rank_agreement({"a": 1, "b": 2, "c": 3}, {"a": 5, "b": 6, "c": 7})
        assert found.spearman_p == pytest.approx(1 / 6, abs=0.02)

    def test_what_cannot_be_ranked(self):
        with pytest.raises(ValueError, match="2 methods in common, allowed: at least 3"):
            rank_agreement({"a": 1, "b": 2, "c": 3}, {"a": 1, "b": 2})
        with pytest.raises(ValueError, match="finite"):
            rank_agreement(self.REAL | {"a": math.nan}, self.REAL)
        flat = rank_agreement(dict.fromkeys(self.REAL, 1.0), self.REAL)
        assert (flat.spearman, flat.kendall_interval, flat.kendall_p) == (None, None, None)

    def test_the_harder_water_is_taken(self):
        rows = [
            Record(case, name, (), "tags_found", value, "%", "higher")
            for case, scale in (("000001", 1), ("all", 10), ("tank_high", 100))
            for name, value in (("none", 1.0 * scale), ("he", None))
        ]
        assert simulated_scores(Result("restoration", {}, tuple(rows))) == ("tank_high", {"none": 100.0})
        assert simulated_scores(Result("restoration", {}, tuple(rows[:4]))) == ("all", {"none": 10.0})
        with pytest.raises(ValueError, match="tags_found"):
            simulated_scores(Result("restoration", {}, tuple(rows[:2])))


def write_layout(path, **change):
    def text(value):
        if isinstance(value, dict):
            return "{" + ", ".join(f"{key} = {text(one)}" for key, one in value.items()) + "}"
        return json.dumps(value)

    def line(value):
        return f"[{', '.join(text(one) for one in value)}]" if isinstance(value, list) else text(value)

    path.write_text("".join(f"{key} = {line(value)}\n" for key, value in (floor() | change).items()))
    return path


def write_video(path, frames):
    # Motion JPEG, which OpenCV writes without other libraries
    writer = cv2.VideoWriter(
        str(path), cv2.CAP_OPENCV_MJPEG, cv2.VideoWriter_fourcc(*"MJPG"), 10, (WIDTH_PX, HEIGHT_PX)
    )
    assert writer.isOpened()
    for frame in frames:
        writer.write(frame[..., ::-1])
    writer.release()


def smooth(seed, height=24, width=32) -> np.ndarray:
    coarse = np.random.default_rng(seed).random((4, 5, 3))
    return (40 + 160 * cv2.resize(coarse, (width, height)).clip(0, 1)).astype(np.uint8)


@pytest.fixture
def photos(tmp_path):
    """A folder of two pictures, one with a pseudo-reference, and a video of 7 frames, the last ones with one tag."""
    made = tmp_path / "photos"
    (made / "more").mkdir(parents=True)
    write_png(made / "a.png", smooth(0))
    write_png(made / "a_ref.png", smooth(1))
    write_png(made / "more/b.PNG", smooth(2))
    (made / "notes.txt").write_text("not a picture")
    (made / ".hidden.png").write_text("not a picture either")
    full, empty = picture(), picture({0: PLACES[0]})
    write_video(made / "floor_1.avi", [full] * 4 + [empty] * 3)
    write_layout(made / "floor.toml")
    return made


def summary(result, case, algorithm):
    return {r.metric: r.value for r in result.records if (r.case, r.algorithm) == (case, algorithm)}


class TestRun:
    def test_known_scores(self, photos, tmp_path):
        result = run("restoration", photos, algorithms=["he"], out=tmp_path / "sheets")
        assert result.provenance["summaries"] == ["photograph", "pair", "floor"]
        assert {r.algorithm for r in result.records} == {"none", "he"}
        assert {r.case for r in result.records} == {
            "a.png", "more/b.PNG", "floor_1.avi/000000", "floor_1.avi/000003", "floor_1.avi/000006", "photograph",
            "pair", "floor",
        }  # fmt: skip
        raw, truth = smooth(0).astype(float), smooth(1).astype(float)
        pair = summary(result, "pair", "none")
        assert pair["psnr_pseudo"] == pytest.approx(10 * np.log10(255**2 / np.mean((raw - truth) ** 2)))
        assert set(pair) == {"psnr_pseudo", "ssim_pseudo"}
        tank = summary(result, "floor", "none")
        assert tank["tags_verified"] == pytest.approx((4 + 4 + 0) / 3)
        assert tank["frames_with_two_tags_percent"] == pytest.approx(200 / 3)
        assert tank["tags_rejected"] == pytest.approx(1 / 3)
        assert tank["homography_error_px"] < 0.5
        assert "pose_error_px" not in tank
        assert summary(result, "floor_1.avi/000006", "none")["homography_error_px"] is None
        assert sorted(path.name for path in (tmp_path / "sheets").iterdir()) == ["floor_01.png", "photographs_01.png"]

    def test_the_result_says_what_it_is_of_and_reads_back(self, photos, tmp_path):
        result = run("restoration", photos, algorithms=["he"])
        (video,) = result.provenance["videos"]
        assert video["sha256"] == sha256(photos / "floor_1.avi")
        assert (video["frames"], video["every_nth_frame"], video["scored_frames"]) == (7, 3, 3)
        names = {one["name"]: one for one in result.provenance["photographs"]}
        assert names["a.png"]["pseudo_reference_sha256"] == sha256(photos / "a_ref.png")
        assert result.provenance["layouts"]["floor"]["side_m"] == SIDE_M
        result.write(tmp_path / "result.json")
        assert read_result(tmp_path / "result.json").records == result.records
        text = markdown(result)
        for part in ("psnr pseudo [dB] ↑", "tags verified ↑", "white noise 256 x 256", "none (do-nothing)", "ranks"):
            assert part in text, part

    def test_every_frame_on_request(self, photos):
        result = run("restoration", photos, algorithms=["he"], every=1)
        assert summary(result, "floor", "none")["tags_verified"] == pytest.approx(4 * 4 / 7)

    def test_all_methods_without_needs_take_part_and_no_other(self, photos):
        for path in photos.rglob("*.png"):
            path.unlink()
        (photos / "floor_1.avi").unlink()
        result = run("restoration", photos)
        methods = {r.algorithm for r in result.records}
        assert {"none", "he", "dual_transmission", "msrcr"} <= methods
        assert not methods & {"oracle_wiener", "oracle_inverse", "sea_thru", "lamp_model"}

    def test_a_video_that_no_layout_describes_is_named(self, photos):
        (photos / "floor_1.avi").rename(photos / "wall.avi")
        result = run("restoration", photos, algorithms=["he"])
        assert "wall.avi: left out, no layout describes it" in result.provenance["cameras"]
        assert result.provenance["summaries"] == ["photograph", "pair"]

    def test_a_simulated_ranking_stands_beside_the_real_one(self, photos, tmp_path):
        rows = [
            Record("all", n, (), "tags_found", v, "%", "higher") for n, v in (("none", 1.0), ("he", 3.0), ("dcp", 2.0))
        ]
        Result("restoration", {}, tuple(rows)).write(tmp_path / "simulated.json")
        result = run("restoration", photos, algorithms=["he", "dcp"], simulated=tmp_path / "simulated.json")
        found = result.provenance["findings"]
        assert [row[0] for row in found["tags_floor"]["rows"]] == ["none", "he", "dcp"]
        assert [row[0] for row in found["sim_to_real_floor"]["rows"]] == ["Spearman's rho", "Kendall's tau"]
        assert result.provenance["simulated"]["sha256"] == sha256(tmp_path / "simulated.json")
        assert "Does simulation rank 3 methods as floor does?" in markdown(result)
        with pytest.raises(ValueError, match="has 2 of the methods"):
            run("restoration", photos, algorithms=["he"], simulated=tmp_path / "simulated.json")


class TestCalibration:
    def test_a_file_is_known_by_its_checksum_and_differences_show(self, tmp_path):
        write_png(tmp_path / "a.png", smooth(3, 64, 64))
        shipped = calibration.read_calibration()
        assert calibration.compared([tmp_path / "a.png"], shipped) == []
        scores = calibration.as_published(smooth(3, 64, 64), shipped) | {"uiqm_m": 9.0}
        known = calibration.Known(name="mine", origin="here", sha256=sha256(tmp_path / "a.png"), **scores)
        rows = calibration.compared([tmp_path / "a.png"], shipped.model_copy(update={"photographs": (known,)}))
        assert [row["metric"] for row in rows] == ["uiqm_f", "uiqm_f_native", "uiqm_m", "uciqe_o"]
        differing = [row["metric"] for row in rows if abs(row["measured"] - row["known"]) > shipped.tolerance]
        assert differing == ["uiqm_m"]


class TestRefused:
    @pytest.mark.parametrize(
        ("prepare", "parts"),
        [
            (lambda f: [path.unlink() for path in f.rglob("*.*") if path.is_file()], ["nothing to score"]),
            (lambda f: (f / "c.jpg").write_bytes(b"\xff\xd8 broken"), ["c.jpg", "not an image"]),
            (lambda f: (f / "floor_2.mp4").write_bytes(b"broken"), ["floor_2.mp4", "not a video"]),
            (lambda f: write_layout(f / "floor.toml", family="DICT_TAG"), ["floor.toml", "family", "DICT_TAG"]),
            (lambda f: (f / "c.toml").write_text("a = 1"), ["c.toml", "not a layout"]),
            (lambda f: write_layout(f / "c.toml"), ["floor_1.avi", "c and floor"]),
            (lambda f: write_png(f / "a_ref.png", smooth(0, 20, 32)), ["a_ref.png", "32 x 20", "32 x 24"]),
            (lambda f: (f / "a.png").unlink(), ["a_ref.png", "of no picture"]),
            (lambda f: write_png(f / "c.png", smooth(0, 9, 32)), ["c.png", "32 x 9", "10 px"]),
        ],
    )  # fmt: skip
    def test_folders(self, photos, prepare, parts):
        prepare(photos)
        with pytest.raises(ValueError) as caught:
            folder.read_folder(photos)
        assert "\n" not in str(caught.value)
        assert all(part in str(caught.value) for part in parts), str(caught.value)

    @pytest.mark.parametrize(
        ("words", "parts"),
        [
            (["pose", "--photos", "photos"], ["pose", "restoration"]),
            (["restoration", "--photos", "nothing"], ["nothing", "no such folder"]),
            (["restoration", "--photos", "photos", "--dataset", "data"], ["--dataset", "without --photos"]),
            (["restoration", "--photos", "photos", "--quick", "--workers", "2"], ["--quick, --workers"]),
            (["restoration", "--every", "1"], ["--every", "with --photos"]),
            (["restoration", "--photos", "photos", "--every", "0"], ["--every", "1"]),
            (["restoration", "--photos", "photos", "--out", "photos/sheets"], ["--out", "another folder"]),
            (["restoration", "--photos", "photos", "--algorithm", "sea_thru"], ["sea_thru", "range_m"]),
            (["restoration", "--photos", "photos", "--algorithm", "magic"], ["'magic'", "clahe"]),
            (["restoration", "--photos", "photos", "--simulated", "no.json"], ["no.json", "no such file"]),
        ],
    )
    def test_command_lines(self, photos, monkeypatch, capsys, words, parts):
        monkeypatch.chdir(photos.parent)
        monkeypatch.setattr("sys.argv", ["uwsim", "bench", *words])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        line = capsys.readouterr().err
        assert stopped.value.code == 2
        assert line.count("\n") == 1
        assert all(part in line for part in parts), line

    def test_a_video_alone_needs_a_simulated_result_with_tags(self, photos, tmp_path):
        Result("restoration", {}, ()).write(tmp_path / "empty.json")
        with pytest.raises(ValueError, match="no tags_found"):
            run("restoration", photos, algorithms=["he"], simulated=tmp_path / "empty.json")
        (photos / "floor_1.avi").unlink()
        with pytest.raises(ValueError, match="no video of tags"):
            run("restoration", photos, algorithms=["he"], simulated=tmp_path / "empty.json")
