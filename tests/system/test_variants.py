"""Variants in processes of their own: which libLLVM gets loaded, what renders, what is refused."""

import os
import subprocess
import sys

import pytest

from uwsim.render import doctor, llvm

STATE = "from uwsim.render import llvm, variants\n"
LOADED = "print([path.name for path in llvm.loaded()])\n"


def run(code: str, **environment: str) -> list[str]:
    """Run code in a new process that must end well, with nothing on stderr; return the lines it prints."""
    answer = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert answer.returncode == 0 and answer.stderr == "", answer.stderr
    return answer.stdout.splitlines()


def test_the_default_renders_spectrally_with_the_chosen_libllvm():
    choice = llvm.prepare()
    lines = run(STATE + "print(variants.use())\nprint(variants.use())\n" + LOADED)
    assert lines == ["llvm_ad_spectral"] * 2 + [str([choice.path.resolve().name])]


def test_without_llvm_geometry_works_rendering_is_refused_and_nothing_is_loaded(tmp_path):
    code = STATE + (
        "print(variants.use(geometry=True))\n"
        "import mitsuba as mi\n"
        "scene = mi.load_dict({'type': 'scene', 'shape': {'type': 'sphere'}})\n"
        "print(scene.ray_test(mi.Ray3f([0, 0, 5], [0, 0, -1])))\n"
        "try:\n    variants.use()\nexcept ValueError as error:\n    print(error)\n"
    )
    lines = run(code + LOADED, DRJIT_LIBLLVM_PATH=str(tmp_path / "libLLVM-15.so.1"))
    assert lines[:2] == ["scalar_spectral", "True"] and lines[3] == "[]"
    assert "libLLVM-15.so.1, which does not exist; type: unset" in lines[2]


def test_mitsuba_imported_too_early_with_another_libllvm_is_refused():
    code = (
        "import os, mitsuba\n"
        "os.environ['DRJIT_LIBLLVM_PATH'] = ''\n" + STATE + "try:\n    variants.use()\n"
        "except ValueError as error:\n    print(error)\n"
    )
    others = [found for found in llvm.find() if found.path != llvm.prepare().path]
    if not others:
        pytest.skip("only one libLLVM here")
    (line,) = run(code, DRJIT_LIBLLVM_PATH=str(others[0].path))
    assert others[0].path.name in line and "call that first" in line


def test_plugins_follow_the_variant():
    code = STATE + (
        "import mitsuba as mi\nfrom uwsim.render import plugins\nimport pkgutil, sys\n"
        "variants.use('scalar_rgb')\n"
        "found = pkgutil.walk_packages(plugins.__path__, plugins.__name__ + '.')\n"
        "names = [info.name for info in found if not info.ispkg]\n"
        "assert not set(names) & set(sys.modules)\n"
        "for variant in ('llvm_ad_spectral', 'llvm_ad_rgb', 'llvm_ad_spectral'):\n"
        "    variants.use(variant)\n"
        "    kinds = [v for n in names for v in vars(sys.modules[n]).values() if isinstance(v, type)]\n"
        "    own = [k for k in kinds if k.__module__ in names and issubclass(k, mi.Object)]\n"
        "    print(len(own) >= len(names))\n"
    )
    assert run(code) == ["True"] * 3


def test_the_doctor_finds_that_this_machine_renders():
    found = doctor.diagnose()
    assert found.problems == () and found.remedy is None


def test_an_old_libllvm_is_seen_to_abort():
    old = [found for found in llvm.find() if int(found.version.split(".")[0]) < llvm.MINIMUM]
    if not old:
        pytest.skip("no libLLVM below 17 here")
    line = doctor.render_tiny("llvm_ad_rgb", llvm.Choice(old[0].path, old[0].version, "planted"))
    assert line is not None and "LLVM ERROR" in line
