"""The report: one file that stands alone, with alt texts, the same bytes for the same arguments."""

import re
from html.parser import HTMLParser

import numpy as np
import pytest
import synthetic

from uwsim.bench import blur, restoration
from uwsim.bench.blur.estimates import Refusal
from uwsim.bench.page import markup, pictures
from uwsim.bench.page.kernel import kernel_drawing
from uwsim.bench.page.plots import optical_thickness
from uwsim.bench.report import write_report
from uwsim.bench.run import run
from uwsim.bench.task import through_camera
from uwsim.dataset.info import Blur

ENVIRONMENT = {"versions": {"numpy": "2"}, "machine": {"cpu": "<one & only>", "features": ["a", "b"]}}
VOID = {"meta", "link", "img", "input", "br", "path", "rect", "circle", "use"}


class Page(HTMLParser):
    """Collects what the page refers to and checks that tags close in order."""

    def __init__(self, text: str):
        super().__init__()
        self.links, self.images, self.ids, self.text, self.open = [], [], [], "", []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.links += [v for k, v in attributes.items() if k in ("src", "href", "xlink:href", "data", "poster")]
        self.images += [attributes] if tag == "img" else []
        self.ids += [attributes["id"]] if "id" in attributes else []
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return synthetic.write_dataset(tmp_path_factory.mktemp("data") / "synthetic")


@pytest.fixture(scope="module")
def results(dataset):
    return [run(name, dataset).to_dict() for name in ("restoration", "blur", "pose")]


def report(folder, dataset, results, **more) -> str:
    path = folder / "report.html"
    write_report(path, dataset=dataset, results=results, environment=ENVIRONMENT, **more)
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def full(tmp_path_factory, dataset, results) -> str:
    folder = tmp_path_factory.mktemp("report")
    text = report(folder, dataset, results)
    assert [path.name for path in folder.iterdir()] == ["report.html"]
    return text


def test_the_page_stands_alone(full):
    page = Page(full)
    inside = [link for link in page.links if link.startswith("#")]
    assert all(link.startswith(("data:", "#")) for link in page.links)
    assert {link[1:] for link in inside} <= set(page.ids)
    assert len(page.ids) == len(set(page.ids))
    assert "@import" not in full
    assert not re.search(r"url\((?!#)", full)
    assert "default-src 'none'" in full


def test_every_picture_has_an_alt_text_and_a_size(full):
    page = Page(full)
    assert len(page.images) > 20
    assert all(image.get("alt") and image.get("width") and image.get("height") for image in page.images)


def test_the_page_shows_what_was_asked(full):
    text = Page(full).text
    for word in (
        "With and without water",
        "Transmission",
        "Monte-Carlo standard error",
        "Normals",
        "Backscatter",
    ):
        assert word in text
    for word in ("clahe", "oracle_inverse", "cepstrum_minimum", "opencv_sqpnp", "do-nothing", "oracle"):
        assert word in text
    assert "uwsim bench pose" in text
    assert "uwsim generate synthetic --out out/synthetic" in text
    assert "<one & only>" in text  # escaped in the source


def test_the_bytes_depend_on_the_arguments_alone(tmp_path, dataset, results, full):
    assert report(tmp_path, dataset, results) == full


def test_without_moving_or_marker_frames_the_sections_say_so(tmp_path):
    small = synthetic.write_dataset(tmp_path / "small", (0,))
    text = report(tmp_path, small, [run("restoration", small).to_dict()])
    assert "no frame in motion" in text
    assert "no frame with a visible marker" in text
    assert "Restorations of one frame" in text


def scores_of(text: str, title: str) -> tuple[float, float]:
    """Return PSNR and SSIM in the caption of the picture of the blur section with this title."""
    inside = text.partition('<section id="blur"')[2].partition("</section>")[0]
    caption = inside.partition(f"<figcaption><b>{title}</b>")[2].partition("</figcaption>")[0]
    return tuple(map(float, re.search(r"PSNR ([\d.]+) dB, SSIM ([\d.]+)", caption).groups()))


def test_the_blurred_frame_is_deblurred_with_the_estimated_kernel(full, dataset):
    """Expected: nearer to the sharp twin than as stored, by the numbers of the page; both kernels are drawn."""
    before, after = scores_of(full, "as stored"), scores_of(full, "deblurred")
    assert after[0] > before[0] + 1 and after[1] > before[1]
    frame = dataset.frame("000002")
    sharp = through_camera(frame, "sharp")
    assert before[0] == pytest.approx(restoration.picture_scores(sharp, frame.image)["psnr"], abs=0.006)
    drawing = full.partition("<b>true and estimated kernel</b>")[0].rpartition("<svg")[2]
    (half,) = {float(x) for x in re.findall(r"L(\S+) \S+?\" style=\"stroke:currentColor", drawing)}
    assert half == pytest.approx(4 * np.cos(np.radians(synthetic.BLUR_ANGLE_DEG)), rel=1e-3)
    (found,) = {float(x) for x in re.findall(r"L(\S+) \S+?\" style=\"stroke:var", drawing)}
    assert found == pytest.approx(half, abs=0.3)


@pytest.mark.parametrize(
    ("verdict", "words", "shown"),
    [
        ("no blur", "whittle sees no blur in this frame: it is left as it is", False),
        ("not uniform", "not uniform; the frame is too small for tiles", True),
        (None, "whittle has no answer to this frame, so it is not deblurred: too dark", False),
    ],
)
def test_the_page_says_what_the_estimator_says(tmp_path, dataset, results, monkeypatch, verdict, words, shown):
    """Setup: the estimator's word replaced. Control: the page of the words that it has says none of these."""
    estimated = blur.estimated

    def replaced(module, name, given, case):
        found, elapsed_ms = estimated(module, name, given, case)
        if name == "whittle":
            found = Refusal("too dark") if verdict is None else found._replace(verdict=verdict)
        return found, elapsed_ms

    only = [result for result in results if result["benchmark"] == "blur"]
    assert words not in Page(report(tmp_path, dataset, only)).text
    monkeypatch.setattr(blur, "estimated", replaced)
    text = report(tmp_path, dataset, only)
    assert words in Page(text).text
    assert ("<b>deblurred</b>" in text) == shown


def test_with_moving_frames_only(tmp_path):
    small = synthetic.write_dataset(tmp_path / "small", (2,))
    text = report(tmp_path, small, [run("blur", small).to_dict()])
    assert "With and without water" in text
    assert "Restorations" not in text


def test_without_results_and_without_method_images(tmp_path, dataset, results):
    assert "No benchmark was run" in report(tmp_path, dataset, [])
    text = report(tmp_path, dataset, results, method_images=False)
    assert "Restorations of one frame" not in text
    assert "cepstrum_minimum" in text  # in the table


def test_a_users_method_stands_in_the_tables(tmp_path, dataset):
    (tmp_path / "mine.py").write_text("def restore(image):\n    return image.copy()\n")
    result = run("restoration", dataset, algorithms=[str(tmp_path / "mine.py")]).to_dict()
    (tmp_path / "out").mkdir()
    assert "mine" in report(tmp_path / "out", dataset, [result])


def test_what_is_no_result_is_refused(tmp_path, dataset):
    with pytest.raises(ValueError, match="not a benchmark result"):
        report(tmp_path, dataset, [{"records": []}])
    assert list(tmp_path.iterdir()) == []


def test_false_colour_is_grey_where_there_is_nothing():
    image = pictures.false_colour(np.array([[0.0, 1.0, np.inf, np.nan]]), 0, 1)
    assert image[0, 2].tolist() == image[0, 3].tolist() == list(pictures.EMPTY)
    assert image[0, 0].tolist() == [68, 1, 84]  # viridis at 0
    assert image[0, 1].tolist() == [253, 231, 36]  # viridis at 1


def test_limits_of_empty_and_flat_maps_are_usable():
    assert pictures.limits(np.full((2, 2), np.inf)) == (0.0, 1.0)
    assert pictures.limits(np.full((2, 2), 3.0)) == (3.0, 4.0)


def test_the_kernel_drawing_has_y_up():
    true = Blur(length_px=10, angle_deg=90, spread_px=0, uniform=True)
    drawing = kernel_drawing(true, {"a": (8.0, 0.0), "b": (np.nan, 0.0)}, {"a": "red", "b": "blue"})
    start, end = re.search(r'd="M(\S+ \S+?)L(\S+ \S+?)" style="stroke:currentColor', drawing).groups()
    assert float(start.split()[1]) == pytest.approx(5)  # 90 deg points up, where y is negative in a drawing
    assert float(end.split()[1]) == pytest.approx(-5)
    assert "blue" not in drawing


def test_large_pictures_are_made_smaller():
    uri = markup.data_uri(np.zeros((2000, 3000, 3), np.uint8))
    assert uri.startswith("data:image/jpeg;base64,")
    assert len(uri) < 40_000


def test_optical_thickness_is_attenuation_times_range(dataset):
    frame = dataset.frame("000000")
    expected = np.median(frame.buffer("range")) * synthetic.ATTENUATIONS_PER_M[0][1]
    assert optical_thickness(frame) == pytest.approx(expected, rel=1e-6)
