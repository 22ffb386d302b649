"""The choice of libLLVM: names, versions, what is refused, and that the choice reaches the environment."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from uwsim.render import llvm, packages


@pytest.fixture(autouse=True)
def nothing_prepared(monkeypatch):
    """Start without a named library, and leave this process's own choice alone."""
    monkeypatch.setattr(llvm, "_prepared", None)
    monkeypatch.setenv(llvm.VARIABLE, "")


def library(folder: Path, *names: str) -> Path:
    """Make an empty file with the first name, and links to it with the others."""
    folder.mkdir(exist_ok=True)
    (folder / names[0]).touch()
    for name in names[1:]:
        (folder / name).symlink_to(names[0])
    return folder / names[0]


@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("libLLVM-19.so", "19"),
        ("libLLVM.so.19.1", "19.1"),
        ("libLLVM-17.so.1", "17"),
        ("libLLVM-14.0.6.so.1", "14.0.6"),
        ("libLLVM-14.so.1", "14"),
        ("libLLVM.so.20.1.2", "20.1.2"),
        ("libLLVM-18.dylib", "18"),
        ("libLLVM.so", None),
        ("libLLVM.dylib", None),
        ("libLLVMSupport.so.19", None),
        ("libclang-cpp.so.19", None),
        ("LLVMPolly.so", None),
        ("libLLVM-19.so.bak", None),
        ("libLLVM-19.a", None),
    ],
)
def test_version_in_name(name, version):
    assert llvm.version_in_name(name) == version


def test_each_real_file_is_found_once_newest_first(tmp_path):
    old = library(tmp_path / "a", "libLLVM-14.so.1", "libLLVM-14.so", "libLLVM-14.0.6.so.1")
    new = library(tmp_path / "a", "libLLVM.so.19.1", "libLLVM-19.so")
    nine = library(tmp_path / "b", "libLLVM-9.so.1")
    (tmp_path / "b" / "libLLVM-18.so").symlink_to("gone")
    assert llvm.find([tmp_path / "a", tmp_path / "b", tmp_path / "a", tmp_path / "missing"]) == [
        llvm.Candidate(new, "19.1"),
        llvm.Candidate(old, "14"),
        llvm.Candidate(nine, "9"),
    ]


def test_the_newest_wins(tmp_path):
    for name in ("libLLVM-15.so.1", "libLLVM-17.so.1", "libLLVM.so.18.1", "libLLVM.so.19.1"):
        library(tmp_path, name)
    choice = llvm.choose(llvm.find([tmp_path]))
    assert (choice.path, choice.version) == (tmp_path / "libLLVM.so.19.1", "19.1")


def test_minor_versions_are_compared_as_numbers():
    candidates = [llvm.Candidate(Path(name), name) for name in ("19.9", "19.10", "17")]
    assert llvm.choose(candidates).version == "19.10"


def test_too_old_ones_are_refused_and_named(tmp_path):
    library(tmp_path, "libLLVM-14.so.1")
    library(tmp_path, "libLLVM-15.so.1")
    choice = llvm.choose(llvm.find([tmp_path]))
    assert choice.path is None and choice.version is None
    assert "14" in choice.reason and "15" in choice.reason and "\n" not in choice.reason


def test_a_named_library_is_respected(tmp_path, monkeypatch):
    newer = library(tmp_path, "libLLVM.so.20.1")
    named = library(tmp_path, "libLLVM-17.so.1", "my-favourite.so")
    for path in (named, tmp_path / "my-favourite.so"):
        monkeypatch.setenv(llvm.VARIABLE, str(path))
        choice = llvm.choose([llvm.Candidate(newer, "20.1")])
        assert (choice.path, choice.version) == (path, "17")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("libLLVM-15.so.1", "LLVM 15, allowed: 17 or newer"),
        ("libLLVM.so", "not a libLLVM that loads"),
        ("gone.so", "does not exist"),
    ],
)
def test_a_bad_named_library_is_refused_with_the_reason(tmp_path, monkeypatch, name, words):
    if name != "gone.so":
        library(tmp_path, name)
    monkeypatch.setenv(llvm.VARIABLE, str(tmp_path / name))
    choice = llvm.choose([llvm.Candidate(Path("libLLVM.so.19.1"), "19.1")])
    assert choice.path is None
    assert words in choice.reason and name in choice.reason and "\n" not in choice.reason


def test_a_version_that_no_name_tells_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(llvm, "ask_version", lambda path: "18.1.8")
    plain = library(tmp_path, "libLLVM.so")
    assert llvm.find([tmp_path]) == [llvm.Candidate(plain, "18.1.8")]
    monkeypatch.setenv(llvm.VARIABLE, str(plain))
    assert llvm.choose([]).version == "18.1.8"


def test_asking_the_library_agrees_with_its_name():
    usable = llvm.choose()
    if usable.path is None:
        pytest.skip("no usable libLLVM here")
    assert f"{llvm.ask_version(usable.path)}.".startswith(f"{usable.version}.")


def test_asking_something_else_gives_none():
    assert llvm.ask_version(Path(sys.executable)) is None


def test_prepare_names_the_choice_once(tmp_path, monkeypatch):
    path = library(tmp_path, "libLLVM.so.19.1")
    monkeypatch.setattr(llvm, "find", lambda: [llvm.Candidate(path, "19.1")])
    first = llvm.prepare()
    assert os.environ[llvm.VARIABLE] == str(path)
    assert llvm.prepare() is first


def test_without_a_usable_one_every_other_is_kept_away(monkeypatch):
    monkeypatch.setattr(llvm, "find", lambda: [llvm.Candidate(Path("libLLVM-15.so.1"), "15")])
    first = llvm.prepare()
    assert first.path is None
    assert os.environ[llvm.VARIABLE] == llvm.BLOCKED and not Path(llvm.BLOCKED).exists()
    assert llvm.prepare() is first
    monkeypatch.setattr(llvm, "_prepared", None)  # a child process inherits the environment only
    assert llvm.choose().path is None


def test_the_remedy_for_a_bad_name_is_to_unset_it(tmp_path, monkeypatch):
    monkeypatch.setattr(llvm, "find", lambda: [llvm.Candidate(Path("libLLVM.so.19.1"), "19.1")])
    monkeypatch.setenv(llvm.VARIABLE, str(tmp_path / "gone.so"))
    assert llvm.remedy(llvm.choose()) == f"unset {llvm.VARIABLE}"


DEBIAN_12 = {"ID": "debian", "VERSION_ID": "12"}
UBUNTU_24 = {"ID": "ubuntu", "VERSION_ID": "24.04"}
UBUNTU_22 = {"ID": "ubuntu", "VERSION_ID": "22.04"}


@pytest.mark.parametrize(
    ("release", "known", "user", "missing", "command"),
    [
        (DEBIAN_12, {19: "libllvm19", 22: "libllvm22"}, 1000, [], "sudo apt-get install -y libllvm19"),
        (DEBIAN_12, {19: "libllvm19"}, 0, [], "apt-get install -y libllvm19"),
        (DEBIAN_12, {19: "libllvm19"}, 0, ["libatomic.so.1"], "apt-get install -y libllvm19 libatomic1"),
        (UBUNTU_24, {17: "libllvm17t64", 18: "libllvm18"}, 0, [], "apt-get install -y libllvm18"),
        (UBUNTU_24, {}, 0, [], "apt-get update && apt-get install -y libllvm18"),
        (DEBIAN_12, {}, 1, [], "sudo apt-get update && sudo apt-get install -y libllvm19"),
        (UBUNTU_22, {}, 0, [], "conda install -y -c conda-forge libllvm19"),
    ],
)
def test_install_command(monkeypatch, release, known, user, missing, command):
    monkeypatch.delenv("CONDA_PREFIX", raising=False)
    monkeypatch.setattr(packages.os, "geteuid", lambda: user)
    monkeypatch.setattr(packages.shutil, "which", lambda tool: f"/usr/bin/{tool}")
    monkeypatch.setattr(packages.platform, "freedesktop_os_release", lambda: release)
    monkeypatch.setattr(packages, "_apt_versions", lambda: known)
    monkeypatch.setattr(packages, "missing_libraries", lambda: missing)
    assert llvm.install_command() == command


def test_a_library_missing_beside_a_good_libllvm_is_a_problem(monkeypatch):
    good = llvm.Choice(Path("libLLVM.so.19.1"), "19.1", "the newest of 1 found")
    monkeypatch.setattr(packages, "missing_libraries", list)
    assert llvm.problem(good) is None
    monkeypatch.setattr(packages, "missing_libraries", lambda: ["libatomic.so.1"])
    assert "libatomic.so.1" in llvm.problem(good)
    assert "libatomic" in llvm.remedy(good) and "llvm" not in llvm.remedy(good).lower()


def test_the_script_entry_prints_one_line(tmp_path):
    named = library(tmp_path, "libLLVM-15.so.1")
    for path, code in ((named, 1), (library(tmp_path, "libLLVM.so.19.1"), 0)):
        answer = subprocess.run(
            [sys.executable, "-m", "uwsim.render.llvm"],
            env=os.environ | {llvm.VARIABLE: str(path)},
            capture_output=True,
            text=True,
        )
        assert answer.returncode == code and answer.stderr == ""
        assert len(answer.stdout.splitlines()) == 1 and str(path) in answer.stdout
