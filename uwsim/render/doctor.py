"""Say what works on this machine, what does not, and the one command that mends it."""

import os
import shutil
import site
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, NamedTuple

from uwsim import provenance
from uwsim.render import llvm, packages, variants

PROBE_TIMEOUT_S = 120.0
PROBED = ("llvm_ad_spectral", "llvm_ad_rgb", "scalar_spectral", "cuda_ad_spectral")
NEEDED = ("llvm_ad_spectral",)
ABSENT = "not installed"

EXTRAS = {
    "learn": ("torch",),
    "cluster": ("distributed", "dask", "dask-jobqueue"),
    "denoise": ("pyoidn",),
    "peers": ("poselib", "PythonicDISORT", "iadpython"),
    "dev": ("pytest", "pytest-timeout", "ruff", "build", "selenium"),
}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")

_PROBE = """
import sys
import mitsuba as mi
mi.set_variant(sys.argv[1])
import drjit as dr
scene = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "path"},
    "sensor": {
        "type": "perspective",
        "to_world": mi.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]),
        "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
    },
    "shape": {"type": "sphere"},
    "light": {"type": "constant"},
})
values = [float(value) for value in mi.render(scene, spp=4).array]
assert all(0.0 < value < 10.0 for value in values), "the image is black or not finite"
print("rendered")
"""


class Row(NamedTuple):
    """One line of the diagnosis."""

    what: str
    value: str
    state: Literal["ok", "missing", "optional"]


@dataclass(frozen=True)
class Diagnosis:
    """What was found. `problems` is empty where images can be rendered.

    `remedy` is one command to type, None where nothing is wrong or no single command is known to help.
    """

    rows: tuple[Row, ...]
    problems: tuple[str, ...]
    remedy: str | None


def diagnose() -> Diagnosis:
    """Look at versions, libLLVM, the variants that really render here, the processor, GPU and extras.

    Takes a few seconds: each variant renders a tiny scene in a process of its own, as a bad libLLVM aborts
    the process that uses it.
    """
    choice = llvm.prepare()
    driver = variants.cuda_driver()
    probes = _probe_all(choice, driver)
    rows = (
        *_version_rows(),
        *_llvm_rows(choice),
        *_variant_rows(probes),
        *_machine_rows(choice, driver),
        *_extra_rows(),
    )
    missing = [f"{row.what}: {row.value}" for row in rows if row.state == "missing"]
    return Diagnosis(rows, tuple(missing), _remedy(rows, choice) if missing else None)


def render_tiny(variant: str, choice: llvm.Choice) -> str | None:
    """Render a tiny scene with Mitsuba's own plugins in a new process; return None or why it failed."""
    with tempfile.TemporaryDirectory() as home:
        environment = os.environ | {
            llvm.VARIABLE: str(choice.path or llvm.BLOCKED),
            # an empty home: kernels that Dr.Jit has cached there would hide a libLLVM that cannot compile
            "HOME": home,
            "PYTHONUSERBASE": site.getuserbase(),
        }
        try:
            answer = subprocess.run(
                [sys.executable, "-c", _PROBE, variant],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=PROBE_TIMEOUT_S,
                env=environment,
            )
        except subprocess.TimeoutExpired:
            return f"no image after {PROBE_TIMEOUT_S:.0f} s"
    if answer.returncode == 0:
        return None
    lines = answer.stderr.strip().splitlines() or ["no message"]
    if answer.returncode < 0:
        errors = [line for line in lines if "ERROR" in line] or lines
        return f"aborted by signal {-answer.returncode}: {errors[0][:160]}"
    return lines[-1][:160]


def _probe_all(choice: llvm.Choice, driver: str | None) -> dict[str, tuple[bool, str]]:
    """Return whether each variant renders here, and a line about it."""
    skipped = {}
    for variant in PROBED:
        if variant.startswith("llvm_") and choice.path is None:
            skipped[variant] = (False, "no usable libLLVM")
        if variant.startswith("cuda_") and driver is None:
            skipped[variant] = (False, "no NVIDIA driver library")
    tried = [variant for variant in PROBED if variant not in skipped]
    with ThreadPoolExecutor(2) as pool:
        failures = dict(zip(tried, pool.map(lambda name: render_tiny(name, choice), tried), strict=True))
    results = {name: (failure is None, failure or "renders") for name, failure in failures.items()}
    return {variant: (skipped | results)[variant] for variant in PROBED}


def _version_rows() -> list[Row]:
    found = provenance.versions()
    rows = [Row(name, version, "ok") for name, version in found.items()]
    rows += [Row(name, ABSENT, "missing") for name in provenance.PACKAGES if name not in found]
    return [*rows, Row("commit", provenance.commit() or "not a git checkout", "optional")]


def _llvm_rows(choice: llvm.Choice) -> list[Row]:
    rows = [Row("libLLVM found", f"{item.version}: {item.path}", "optional") for item in llvm.find()]
    rows += [Row(name, "not on this system", "missing") for name in packages.missing_libraries()]
    if choice.path is None:
        return [Row("libLLVM", choice.reason, "missing"), *rows]
    version = llvm.ask_version(choice.path) or choice.version
    return [Row("libLLVM", f"{version}: {choice.path} ({choice.reason})", "ok"), *rows]


def _variant_rows(probes: dict[str, tuple[bool, str]]) -> list[Row]:
    return [
        Row(variant, line, "ok" if works else "missing" if variant in NEEDED else "optional")
        for variant, (works, line) in probes.items()
    ]


def _machine_rows(choice: llvm.Choice, driver: str | None) -> list[Row]:
    machine = provenance.machine(libllvm=choice.path, llvm_version=choice.version)
    features = " ".join(machine["cpu_features"]) or "not known on this system"
    return [
        Row("processor", f"{machine['cpu'] or 'unknown'} ({machine['architecture']})", "ok"),
        Row("processor features", features, "ok"),
        Row("vector width", str(machine["vector_width"]), "ok"),
        Row("threads", str(provenance.thread_count()), "ok"),
        Row("GPU", _gpu(driver) or "none", "ok" if driver else "optional"),
    ]


def _gpu(driver: str | None) -> str | None:
    """Return the names of the NVIDIA GPUs, or the driver's file name where they cannot be asked for."""
    if driver is None:
        return None
    try:
        answer = subprocess.run(
            ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=30,
        )
    except (OSError, subprocess.TimeoutExpired):
        return driver
    names = "; ".join(answer.stdout.strip().splitlines())
    return names if names and answer.returncode == 0 else driver


def _extra_rows() -> list[Row]:
    rows = []
    for extra, names in EXTRAS.items():
        found = {package: provenance.installed(package) for package in names}
        value = ", ".join(f"{package} {version or ABSENT}" for package, version in found.items())
        rows.append(Row(f"extra {extra}", value, "ok" if all(found.values()) else "optional"))
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    driver = shutil.which("chromedriver")
    browser_value = f"{browser or 'no chromium'}, {driver or 'no chromedriver'}"
    return [*rows, Row("browser (tests)", browser_value, "ok" if browser and driver else "optional")]


def _remedy(rows: tuple[Row, ...], choice: llvm.Choice) -> str | None:
    if llvm.problem(choice):
        return llvm.remedy(choice)
    absent = [row.what for row in rows if row.state == "missing" and row.value == ABSENT]
    if not absent:
        return None
    wanted = [f"'{requirement}'" for requirement in provenance.requirements(absent)]
    return f"{sys.executable} -m pip install {' '.join(wanted)}"
