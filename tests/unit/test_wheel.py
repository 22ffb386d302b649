"""The wheel holds the data that the program reads, and works from another folder."""

import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent

pytestmark = pytest.mark.slow


def run(*command: str | Path, **options) -> str:
    answer = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=500, **options)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    return answer.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "build", "--wheel", "--outdir", folder, ROOT)
    (path,) = folder.glob("*.whl")
    return path


def data_files(folder: str, pattern: str) -> set[str]:
    """Return the files below a folder of the source tree that match, as paths from the top of the tree."""
    return {path.relative_to(ROOT).as_posix() for path in (ROOT / folder).rglob(pattern)}


def test_the_wheel_holds_what_the_program_reads(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    shipped = data_files("scenes", "*.toml") | data_files("benchmarks", "*.toml")
    tables = {name for name in data_files("uwsim", "*") if (ROOT / name).is_file() and "__pycache__" not in name}
    assert {f"uwsim/shipped/{name}" for name in shipped} <= names
    assert tables <= names
    assert "uwsim/dataset/FORMAT.md" in names
    for what in ("uwsim/shipped/scenes/", "uwsim/shipped/benchmarks/", "uwsim/optics/water_types/"):
        assert any(name.startswith(what) and name.endswith(".toml") for name in names), what
    assert not [name for name in names if name.startswith(("tests/", "results/")) or "__pycache__" in name]


def test_the_installed_wheel_runs_from_another_folder(wheel, tmp_path):
    environment = tmp_path / "venv"
    run(sys.executable, "-m", "venv", "--without-pip", environment)
    site = Path(run(environment / "bin/python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip())
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
    run(*pip, "--python", environment / "bin/python", "install", "--no-deps", "--no-index", wheel)
    # this environment's dependencies, behind the wheel; path files are not followed twice: no editable uwsim
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    where = run(environment / "bin/python", "-c", "import uwsim; print(uwsim.__file__)", cwd=elsewhere, env=clean)
    assert Path(where.strip()).is_relative_to(site)
    assert "Usage" in run(environment / "bin/uwsim", "--help", cwd=elsewhere, env=clean)
    listing = "from uwsim.files import shipped; print(sum(1 for _ in shipped('benchmarks').glob('*.toml')))"
    assert int(run(environment / "bin/python", "-c", listing, cwd=elsewhere, env=clean)) > 0
