"""Validity: how near a formation model comes to a rendered frame, and where.

An algorithm is a file of `uwsim/formation/models` (or a user's own) with `layers(view, **inputs)`; what NEEDS may list:
  water_free, radiance, standard_error, direct, forward_scatter, backscatter    (H, W, 3) buffers of the frame
Scores: of the picture in 8 bits as the frame's camera stores it without noise (`psnr`, `mse`), and in radiance, in
percent (`uwsim.metrics.radiance`): of the picture, the truth's Monte-Carlo noise taken off, in pixels or, where that
noise is large, in blocks of them (`uwsim.bench.validity.grain`); of a layer in the means over 8 x 8 regions.
`contrast_error`: of the contrast transfer in the groups of a USAF chart.
"""

from collections.abc import Mapping
from functools import partial
from types import ModuleType

import numpy as np

import uwsim.formation.models
from uwsim.bench import runner
from uwsim.bench.task import Case, Task
from uwsim.bench.validity.fit import fit
from uwsim.bench.validity.truth import Truth, usable
from uwsim.dataset.frame import Frame
from uwsim.dataset.store import Dataset
from uwsim.metrics import LAYERS, contrast, radiance
from uwsim.metrics import image as image_metrics

INPUTS = ("water_free", "radiance", "standard_error", *LAYERS)
STATISTICS = {
    "relative_radiance_error": "median", "psnr": "median", "mse": "median",
    **{f"{layer}_error": "median" for layer in LAYERS}, "contrast_error": "median", "milliseconds": "median",
}  # fmt: skip
DETAILS = tuple(f"{layer}_{metric}" for layer in LAYERS for metric in ("psnr", "mse"))


def case_names(dataset: Dataset) -> list[str]:
    """Return the still frames lit by lamps alone; ValueError if there are none."""
    names = [frame.name for frame in dataset.frames if usable(frame) is None]
    if not names:
        raise ValueError(f"{dataset.folder}: validity needs a still frame with a lamp, the dataset has none")
    return names


def case(dataset: Dataset, name: str) -> Case:
    frame = dataset.frame(name)
    return Case(name=name, image=frame.image, makers=makers(frame), truth=Truth(frame))


def makers(frame: Frame) -> runner.Makers:
    return {name: partial(frame.buffer, name) for name in INPUTS}


def score(module: ModuleType, name: str, given: tuple[str, ...], case: Case) -> dict[str, float | str]:
    truth: Truth = case.truth
    layers, elapsed_ms, note = formed(module, name, given, case)
    light = sum(layers.values())
    scores = {
        "relative_radiance_error": truth.grain.relative_error(
            truth.radiance, light, standard_error=truth.standard_error
        ),
        **_picture_scores(truth, truth.radiance, light, ""),
        "contrast_error": _contrast_error(truth, light),
        "milliseconds": elapsed_ms,
        "note": note,
    }
    for layer in LAYERS:
        true, found = truth.layers[layer], layers.get(layer, np.zeros_like(truth.radiance))
        buried = truth.below_sensor_noise and layer != "backscatter"
        scores[f"{layer}_error"] = float("nan") if buried else radiance.region_error(true, found)
        scores |= _picture_scores(truth, true, found, f"{layer}_")
    return scores


def _picture_scores(truth: Truth, true: np.ndarray, found: np.ndarray, prefix: str) -> dict[str, float]:
    pictures = truth.picture(true), truth.picture(found)
    return {f"{prefix}psnr": image_metrics.psnr(*pictures), f"{prefix}mse": image_metrics.mse(*pictures)}


def _contrast_error(truth: Truth, light: np.ndarray) -> float:
    if not truth.chart_groups or truth.below_sensor_noise or light.sum() <= 0:
        return float("nan")
    return contrast.transfer_error(truth.transfer(truth.radiance, noisy=True), truth.transfer(light))


def formed(
    module: ModuleType, name: str, given: tuple[str, ...], case: Case
) -> tuple[dict[str, np.ndarray], float, str]:  # fmt: skip
    """Return (a model's layers of a case, float (H, W, 3); milliseconds of the call; what it was fitted to, or "").

    Raises ValueError in one line if the model fails or returns something else than layers.
    """
    where = f"validity: {name}: case {case.name}"
    function, view = runner.entry(module, name, "layers"), case.truth.view
    inputs, note = runner.permitted(given, case.makers), ""
    if getattr(module, "FITTED", False):
        grain = case.truth.grain
        found, _ = runner.timed(
            fit, partial(function, **inputs), _bounds(module, name), view=view, target=grain.of(case.truth.radiance),
            compose=lambda output: grain.of(sum(_checked(output, shape=None, where=where).values())), where=where,
        )  # fmt: skip
        inputs |= found.parameters
        note = f"{found.text or 'own parameters'} ({found.calls} calls)"
    output, elapsed_ms = runner.timed(function, view, where=where, **inputs)
    return _checked(output, shape=(*view.shape, 3), where=where), elapsed_ms, note


def _bounds(module: ModuleType, name: str) -> Mapping[str, tuple]:
    found = getattr(module, "PARAMETERS", None)
    if not isinstance(found, Mapping) or not found:
        raise ValueError(f"{name}: PARAMETERS is {found!r}, allowed for a fit: a table of name: (low, high)")
    return found


def _checked(output: object, *, shape: tuple | None, where: str) -> dict[str, np.ndarray]:
    """Return the layers; ValueError unless they are finite arrays of the frame's shape, and `radiance` their sum."""
    if not isinstance(output, Mapping) or not set(LAYERS) & set(output) or set(output) - {*LAYERS, "radiance"}:
        got = sorted(output) if isinstance(output, Mapping) else type(output).__name__
        raise ValueError(f"{where}: returned {got}, allowed: a table of {', '.join(LAYERS)} and radiance")
    layers = {name: np.asarray(output[name]) for name in LAYERS if name in output}
    for name, layer in layers.items():
        if (shape is not None and layer.shape != shape) or not np.all(np.isfinite(layer)):
            raise ValueError(f"{where}: {name} is {layer.shape}, allowed: finite, {shape}")
    total = sum(layers.values())
    if "radiance" in output and not np.allclose(output["radiance"], total, rtol=1e-3, atol=1e-3 * np.abs(total).max()):
        raise ValueError(f"{where}: radiance differs from the sum of the layers, allowed: their sum")
    return layers


def conditions(dataset: Dataset, cases: list[str]) -> dict[str, dict]:
    """Return what each case was like: water, range, lamp, shares of the layers, noise of the truth."""
    return {name: Truth(dataset.frame(name)).conditions for name in cases}


def _grains(found: dict[str, dict]) -> str:
    largest = max(one["grain_px"] for one in found.values())
    return "pixels" if largest == 1 else f"pixels or in blocks of up to {largest} px,"


def notes(dataset: Dataset, cases: list[str]) -> list[str]:
    """Return in sentences how noisy the truth is, and which cases lie below the sensor's noise."""
    found = conditions(dataset, cases)
    noise = [one["monte_carlo_noise_percent"] for one in found.values()]
    smallest = [one["resolution_percent"] for one in found.values()]
    texts = [
        f"truth: rendered, compared in {_grains(found)} whose Monte-Carlo noise is {np.median(noise):.2g} % of the "
        f"picture (median; at most {max(noise):.2g} %) and taken off the image error; errors below "
        f"{np.median(smallest):.2g} % (median; at most {max(smallest):.2g} %) cannot be told from it"
    ]
    if buried := [name for name, one in found.items() if one["below_sensor_noise"]]:
        texts.append(
            f"below sensor noise, so without errors of direct and forward-scattered light: {len(buried)} of "
            f"{len(found)} cases ({', '.join(buried[:6])}{' ...' if len(buried) > 6 else ''})"
        )
    return texts


TASK = Task(
    name="validity",
    package=uwsim.formation.models,
    function="layers",
    inputs=INPUTS,
    statistics=STATISTICS,
    case_names=case_names,
    case=case,
    score=score,
    notes=notes,
    details=DETAILS,
    conditions=conditions,
)
