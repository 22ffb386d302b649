"""The demonstration's pages: the report links to the gallery, and pages are shown where there is a display."""

import sys

import pytest
import synthetic

from uwsim import demonstration
from uwsim.bench.report import write_report


def test_the_report_links_to_the_gallery(tmp_path):
    dataset = synthetic.write_dataset(tmp_path / "data")
    for gallery, found in ((None, False), ("gallery/index.html", True)):
        write_report(tmp_path / "a.html", dataset=dataset, results=[], environment={}, gallery=gallery)
        assert ('href="gallery/index.html"' in (tmp_path / "a.html").read_text()) == found


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="displays are named by the environment on Linux")
@pytest.mark.parametrize("name", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_a_page_is_shown_where_there_is_a_display(tmp_path, monkeypatch, name):
    opened = []
    monkeypatch.setattr(demonstration.webbrowser, "open", lambda address: opened.append(address) or True)
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    page = tmp_path / "report.html"
    assert not demonstration.show(page) and opened == []
    monkeypatch.setenv(name, ":0")
    assert demonstration.show(page) and opened == [page.as_uri()]
