"""Versions, commit and machine: what is written beside every result."""

import shutil
import subprocess

import pytest

import uwsim
from uwsim import provenance


def git(folder, *arguments):
    identity = ("-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "commit.gpgsign=false")
    subprocess.run(["git", *identity, *arguments], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    if not shutil.which("git"):
        pytest.skip("git is not installed")
    (tmp_path / "uwsim").mkdir()
    (tmp_path / "uwsim" / "a.py").write_text("x = 1\n")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "one")
    monkeypatch.setattr(provenance, "ROOT", tmp_path)
    return tmp_path


def test_versions_name_what_is_installed():
    versions = provenance.versions()
    assert versions["uwsim"] == uwsim.__version__
    assert {"python", "mitsuba", "drjit", "numpy"} <= set(versions)
    assert all(isinstance(version, str) and version for version in versions.values())


def test_requirements_carry_the_range_that_uwsim_asks_for():
    mitsuba, unknown = provenance.requirements(["mitsuba", "no-such-package"])
    assert mitsuba.startswith("mitsuba") and "<3.10" in mitsuba
    assert unknown == "no-such-package"


def test_a_clean_commit_has_forty_digits(checkout):
    assert len(provenance.commit()) == 40
    (checkout / "notes.txt").write_text("beside the program\n")
    assert not provenance.commit().endswith("-dirty")


@pytest.mark.parametrize("file", ["a.py", "new.py"])
def test_a_changed_or_new_file_makes_it_dirty(checkout, file):
    (checkout / "uwsim" / file).write_text("x = 2\n")
    assert provenance.commit().endswith("-dirty")


def test_a_folder_inside_another_checkout_has_no_commit(checkout, monkeypatch):
    monkeypatch.setattr(provenance, "ROOT", checkout / "uwsim")
    assert provenance.commit() is None


def test_no_checkout_has_no_commit(tmp_path, monkeypatch):
    monkeypatch.setattr(provenance, "ROOT", tmp_path)
    assert provenance.commit() is None


def test_machine_keeps_the_file_name_only(tmp_path):
    machine = provenance.machine(libllvm=tmp_path / "libLLVM.so.19.1", llvm_version="19.1.7")
    assert machine["libllvm"] == {"version": "19.1.7", "file": "libLLVM.so.19.1"}
    assert set(machine["cpu_features"]) <= set(provenance.FEATURES)
    assert provenance.machine()["libllvm"] is None


@pytest.mark.parametrize(
    ("features", "width"), [([], 4), (["avx"], 8), (["avx", "avx2"], 8), (["avx", "avx512f", "avx512vl"], 16)]
)
def test_vector_width(features, width):
    assert provenance.vector_width(features) == width
