"""Refuse images whose buffers do not fit into memory, before anything is rendered."""

from pathlib import Path

_BYTES_PER_GB = 1e9
# 750 measured for a whole frame at rest (1024 x 768), 1070 with orders: sums of quantities and their squares in double
# precision, truth pictures, what is made on the way; motion and a checkpoint keep the sums of up to three pictures.
FRAME_BYTES_PER_PIXEL = 1400
# 720 measured more at rest (1024 x 768), 2140 in all in motion: the denoiser's own pictures and those it smooths
DENOISE_BYTES_PER_PIXEL = 800
LAUNCH_BYTES = 600_000_000  # the compiler, its kernels and the largest launch
# control groups of version 2 and 1: folder, limit, use, what of it can be given back
_CGROUPS = (
    (Path("/sys/fs/cgroup"), "memory.max", "memory.current", "inactive_file"),
    (
        Path("/sys/fs/cgroup/memory"),
        "memory.limit_in_bytes",
        "memory.usage_in_bytes",
        "total_inactive_file",
    ),
)


def require_memory(*, width_px: int, height_px: int, workers: int = 1, denoise: bool = False) -> None:
    """Raise ValueError with the estimate unless a frame of this size fits into the memory available.

    workers: processes that each have one. denoise: the frame is denoised (`render.smooth`). Does nothing where the
    system does not say how much memory there is.
    """
    bytes_per_pixel = FRAME_BYTES_PER_PIXEL + (DENOISE_BYTES_PER_PIXEL if denoise else 0)
    needed = workers * (width_px * height_px * bytes_per_pixel + LAUNCH_BYTES)
    available = available_bytes()
    if available is not None and needed > available:
        by = f" in {workers} processes" if workers > 1 else ""
        raise ValueError(
            f"image size: {width_px} x {height_px} pixels{by} need about {needed / _BYTES_PER_GB:.1f} GB of memory, "
            f"allowed: the {available / _BYTES_PER_GB:.1f} GB available here"
        )


def available_bytes() -> int | None:
    """Return the memory that this process can still have, in bytes; None where the system does not say."""
    found = [value for value in (_machine_bytes(), _group_bytes()) if value is not None]
    return min(found, default=None)


def _machine_bytes() -> int | None:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    values = dict(line.split(":", 1) for line in lines)
    return int(values["MemAvailable"].split()[0]) * 1024 if "MemAvailable" in values else None


def _group_bytes() -> int | None:
    """What the control group (a container, a cluster's job) leaves; cached files do not count as used."""
    for folder, limit, used, cached in _CGROUPS:
        try:
            text = (folder / limit).read_text(encoding="ascii").strip()
            held = int((folder / used).read_text(encoding="ascii"))
            lines = (folder / "memory.stat").read_text(encoding="ascii").splitlines()
        except OSError:
            continue
        if text != "max":
            return int(text) - held + int(dict(line.split() for line in lines).get(cached, 0))
    return None
