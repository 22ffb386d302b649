"""The doctor's rows, problems and remedy, with the rendering of each variant replaced by its outcome."""

from pathlib import Path

import pytest

from uwsim import provenance
from uwsim.render import doctor, llvm, variants

GOOD = llvm.Choice(Path("/somewhere/libLLVM.so.19.1"), "19.1", "the newest of 1 found")
NONE = llvm.Choice(None, None, "no libLLVM >= 17 on this machine")


def diagnose(monkeypatch, choice, outcome=None):
    monkeypatch.setattr(llvm, "prepare", lambda: choice)
    monkeypatch.setattr(llvm, "find", lambda: [llvm.Candidate(Path("/somewhere/libLLVM-15.so.1"), "15")])
    monkeypatch.setattr(llvm, "ask_version", lambda path: "19.1.7")
    monkeypatch.setattr(llvm, "install_command", lambda: "apt-get install -y libllvm19")
    monkeypatch.setattr(variants, "cuda_driver", lambda: None)
    monkeypatch.setattr(doctor, "render_tiny", lambda variant, choice: (outcome or {}).get(variant))
    found = doctor.diagnose()
    return {row.what: row for row in found.rows}, found


def test_a_good_machine_has_no_problem_and_no_remedy(monkeypatch):
    rows, found = diagnose(monkeypatch, GOOD)
    assert found.problems == () and found.remedy is None
    assert rows["llvm_ad_spectral"] == ("llvm_ad_spectral", "renders", "ok")
    assert rows["libLLVM"].value.startswith("19.1.7: /somewhere/libLLVM.so.19.1")
    assert rows["cuda_ad_spectral"].state == "optional"
    assert {row.state for row in found.rows} <= {"ok", "missing", "optional"}


def test_without_llvm_the_one_command_is_named(monkeypatch):
    rows, found = diagnose(monkeypatch, NONE)
    assert rows["libLLVM"].state == rows["llvm_ad_spectral"].state == "missing"
    assert rows["scalar_spectral"].state == "ok"
    assert found.remedy == "apt-get install -y libllvm19"
    assert any("no libLLVM >= 17" in problem for problem in found.problems)


def test_a_variant_that_aborts_is_a_problem(monkeypatch):
    rows, found = diagnose(monkeypatch, GOOD, {"llvm_ad_spectral": "aborted by signal 6: LLVM ERROR"})
    assert rows["llvm_ad_spectral"].state == "missing"
    assert found.problems == ("llvm_ad_spectral: aborted by signal 6: LLVM ERROR",)


def test_a_missing_package_is_named_with_its_range(monkeypatch):
    versions = provenance.versions()
    del versions["mitsuba"]
    monkeypatch.setattr(provenance, "versions", lambda: versions)
    _, found = diagnose(monkeypatch, GOOD)
    assert found.problems == ("mitsuba: not installed",)
    assert "-m pip install 'mitsuba" in found.remedy and "<3.10" in found.remedy


@pytest.mark.parametrize("variant", [None, "llvm_ad_rgb"])
def test_rendering_without_llvm_is_refused_in_one_line(monkeypatch, variant):
    monkeypatch.setattr(llvm, "prepare", lambda: NONE)
    monkeypatch.setattr(llvm, "install_command", lambda: "apt-get install -y libllvm19")
    with pytest.raises(ValueError, match="no libLLVM >= 17 .*; type: apt-get install -y libllvm19") as caught:
        variants.use(variant)
    assert "\n" not in str(caught.value)


def test_cuda_without_a_driver_is_refused(monkeypatch):
    monkeypatch.setattr(variants, "cuda_driver", lambda: None)
    with pytest.raises(ValueError, match="no NVIDIA driver"):
        variants.use("cuda_ad_spectral")
