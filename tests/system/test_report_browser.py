"""The report in a real browser: no errors, no requests, the slider moves the picture, the tables sort."""

import json

import cv2
import numpy as np
import pytest

from tests.system.chromium import find, needs_browser, synthetic_dataset
from tests.unit import synthetic
from uwsim.bench.report import write_report
from uwsim.bench.run import run

pytestmark = needs_browser


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    dataset = synthetic_dataset(folder / "synthetic")
    results = [run(name, dataset).to_dict() for name in ("restoration", "blur", "pose")]
    write_report(folder / "report.html", dataset=dataset, results=results, environment={"versions": {"a": "1"}})
    return folder / "report.html"


def requested(browser) -> list[str]:
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    sent = [message["params"] for message in messages if message["method"] == "Network.requestWillBeSent"]
    return [params["request"]["url"] for params in sent]


def test_the_page_loads_without_errors_and_asks_for_nothing(opened, page):
    assert opened.title == "uwsim report: synthetic"
    assert opened.get_log("browser") == []
    assert [url for url in requested(opened) if not url.startswith("data:")] == [page.as_uri()]


def test_every_picture_is_shown(opened):
    sizes = opened.execute_script("return [...document.images].map(i => i.complete && i.naturalWidth)")
    assert len(sizes) > 20
    assert all(sizes)


def clip(browser) -> str:
    return browser.execute_script("return getComputedStyle(document.querySelector('.over')).clipPath")


def test_the_slider_moves_the_picture_by_key_and_by_pointer(opened):
    from selenium.webdriver import ActionChains, Keys

    (slider,) = find(opened, ".compare input[type=range]")
    assert find(opened, f"label[for={slider.get_attribute('id')}]")
    before = clip(opened)
    slider.send_keys(Keys.ARROW_RIGHT)
    assert slider.get_attribute("value") == "51"
    assert clip(opened) != before
    slider.send_keys(Keys.HOME)
    assert "100%" in clip(opened)  # all of it without water
    (stack,) = find(opened, ".compare .stack")
    quarter = -stack.size["width"] // 4
    ActionChains(opened).move_to_element_with_offset(stack, quarter, 0).click().perform()
    assert 23 <= int(slider.get_attribute("value")) <= 27


def column(browser, table: int, index: int) -> list[str]:
    script = "return [...document.querySelectorAll('table.sortable')[arguments[0]].tBodies[0].rows]"
    return browser.execute_script(f"{script}.map(r => r.cells[arguments[1]].dataset.value)", table, index)


def test_tables_sort_both_ways_and_say_so(opened):
    tables = find(opened, "table.sortable")
    number = next(i for i, t in enumerate(tables) if "restoration, all cases" in t.get_attribute("textContent"))
    (head,) = [h for h in tables[number].find_elements("css selector", "th") if h.text.startswith("PSNR [")]
    button = head.find_element("css selector", "button")
    before = column(opened, number, 2)
    button.click()
    assert head.get_attribute("aria-sort") == "ascending"
    assert column(opened, number, 2) == sorted(before, key=float)
    button.click()
    assert head.get_attribute("aria-sort") == "descending"
    assert column(opened, number, 2) == sorted(before, key=float, reverse=True)
    (name,) = [h for h in tables[number].find_elements("css selector", "th") if h.text == "algorithm"]
    name.find_element("css selector", "button").click()
    assert head.get_attribute("aria-sort") is None
    assert name.get_attribute("aria-sort") == "ascending"


def test_cells_without_a_number_stay_last(opened):
    script = """
      const table = document.querySelectorAll('table.sortable')[0], row = table.tBodies[0].rows[0];
      row.cells[1].dataset.value = ''; const button = table.querySelectorAll('th button')[1];
      const last = () => [...table.tBodies[0].rows].indexOf(row);
      button.click(); const up = last(); button.click();
      return [up, last(), table.tBodies[0].rows.length - 1];
    """
    up, down, end = opened.execute_script(script)
    assert up == down == end


def test_the_true_axes_lie_on_the_board_of_the_frame(opened):
    """Colours of the browser's own pixels half way along the projected axes. Control: those beside them, 8 px off."""
    (overlay,) = find(opened, "#pose .overlay")
    # the dashes of the estimate, which is nearly right here, would hide them
    opened.execute_script("document.querySelectorAll('#pose .guess').forEach(line => line.remove())")
    shot = cv2.imdecode(np.frombuffer(overlay.screenshot_as_png, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    scale = shot.shape[1] / synthetic.WIDTH_PX
    length_m = 0.4 * np.hypot(2 * synthetic.MARKER_M + synthetic.GAP_M, synthetic.MARKER_M)
    ends = synthetic.project(length_m * np.vstack([np.zeros(3), np.eye(3)]), synthetic.camera_from_board())
    for end, colour in zip(ends[1:], [(0xFF, 0x5D, 0x55), (0x5F, 0xE0, 0x7A), (0x5C, 0xB0, 0xFF)], strict=True):
        x, y = scale * (ends[0] + end) / 2
        assert np.abs(shot[int(y), int(x)].astype(int) - colour).max() < 12
        off = scale * 8
        assert np.abs(shot[int(y - off), int(x - off)].astype(int) - colour).max() > 40


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_narrow_screen_does_not_scroll_sideways(opened, scheme):
    media = [{"name": "prefers-color-scheme", "value": scheme}]
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": media})
    metrics = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    opened.execute_script("document.querySelectorAll('details').forEach(d => d.open = true)")
    assert opened.execute_script("return document.documentElement.scrollWidth") == 390
    ink, paper = opened.execute_script("const s = getComputedStyle(document.body); return [s.color, s.backgroundColor]")
    brightness = [sum(map(int, colour[4:-1].split(","))) for colour in (ink, paper)]
    assert (brightness[0] < brightness[1]) == (scheme == "light")
