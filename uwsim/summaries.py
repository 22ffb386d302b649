"""What the command line says of frames and datasets, one line each."""

import json


def noise_line(noise) -> str:
    """Return the noise of a rendered frame (frame.json, `noise`) in one line."""
    from uwsim.render import stopping

    radiance = noise.pictures["radiance"]
    asked = "" if noise.region_rule is None else f" (asked: {noise.region_rule:.2%})"
    failed = [name for name, one in noise.pictures.items() if False in (one.pixel_rule_met, one.region_rule_met)]
    verdict = "rules met" if noise.met else f"rules NOT met by {', '.join(failed)}"
    late = " when the time was up" if any(one.ended_by == "time" for one in noise.pictures.values()) else ""
    return (
        f"noise after {radiance.samples_per_pixel} samples per pixel: "
        f"region error {radiance.region_error_p95:.2%}{asked}; {radiance.pixel_share_within:.1%} of pixels "
        f"within {stopping.PIXEL_RATIO:g} of the sensor's noise (asked: {stopping.PIXEL_SHARE:.0%}): {verdict}{late}"
    )


def denoised_line(options) -> str | None:
    """Return what the denoiser did to a frame (frame.json, `options`) in one line, None if nothing was denoised."""
    if options.denoiser is None:
        return None
    layers = [
        f"{layer} {sum(bias.mean) / 3:+.2%} in the mean, {bias.region:.2%} in regions, {bias.pixel:.2%} in pixels"
        for layer, bias in options.bias["radiance"].items()
    ]
    return f"denoised by {options.denoiser}; measured bias: {'; '.join(layers)}"


def noisy_frames_line(dataset) -> str | None:
    """Return in one line how many frames of a dataset do not meet their noise rules, None if all do."""
    noisy = [info.name for info in (frame.info for frame in dataset.frames) if info.noise and not info.noise.met]
    if not noisy:
        return None
    return (
        f"{len(noisy)} of {len(dataset)} frames have more Monte-Carlo noise than their rules allow "
        f"(frame.json, noise): {', '.join(noisy[:3])}{' ...' if len(noisy) > 3 else ''}"
    )


def failed_frames_line(dataset) -> str | None:
    """Return in one line which frames of the recipe could not be made, None if all could."""
    failed = dataset.manifest.get("failed")
    if not failed:
        return None
    name, first = next(iter(failed.items()))
    return (
        f"{dataset.folder}: {len(failed)} of {len(dataset) + len(failed)} frames could not be made (dataset.json, "
        f"failed), such as {name} of seed {first['seed']}: {first['error']}; --resume tries again"
    )


def mixed_processors_line(dataset) -> str | None:
    """Return in one line that frames were made by processors of another kind, None if all are of this one's."""
    lines = (dataset.folder / "run.jsonl").read_text(encoding="utf-8").splitlines()
    mixed = [entry for entry in map(json.loads, lines) if "mixed" in entry]
    if not mixed:
        return None
    return (
        f"{len(mixed)} frames were made by processors of another kind (run.jsonl, mixed), such as that of "
        f"{mixed[0]['worker']}: equal within Monte-Carlo noise, not byte for byte"
    )
