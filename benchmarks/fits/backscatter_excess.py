"""How much backscatter the Jaffe-McGlamery model lacks: its excess over rendered frames, and the law fitted to it.

    python benchmarks/fits/backscatter_excess.py DATASET [--json FILE]

DATASET: a folder made by `uwsim generate validity`. Of each frame with Petzold's phase function: s, the rendered
backscatter over the model's (`uwsim.restoration.lamp_view`), both means over the bodies seen. Fitted to ln(s - 1) in
the green band: a power law of scattering b, lamp distance d and median range R with free exponents; then its constant
with the exponents 1, 3/4, 1/4, with which it has no dimension. Prints both, and what is left in s.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

EXPONENTS = (1.0, 0.75, 0.25)
GREEN = 1


def excesses(folder: Path) -> list[dict]:
    """Return {frame, scattering_per_m, distance_m, range_m, excess (3 bands)} of every frame that counts."""
    from uwsim.bench.restoration.inputs import makers
    from uwsim.dataset import store
    from uwsim.restoration import lamp_view

    found = []
    for frame in store.open(folder).frames:
        phase = frame.info.water.model_dump()["phase_function"]
        if phase["type"] != "mixture" or phase["terms"][0]["type"] != "table":
            continue
        rig = makers(frame)["rig"]()
        view = lamp_view.white_view(frame.buffer("range"), rig)
        seen = view.has_body
        model, rendered = lamp_view.modelled_backscatter(view), frame.buffer("backscatter")
        found.append(
            {
                "frame": frame.name,
                "scattering_per_m": float(frame.info.water.bands.scattering_per_m[GREEN]),
                "distance_m": float(np.mean([np.linalg.norm(lamp["position_m"]) for lamp in rig["lamps"]])),
                "range_m": float(np.median(view.range_m[seen])),
                "excess": (rendered[seen].mean(axis=0) / model[seen].mean(axis=0) - 1).tolist(),
            }
        )
    return found


def fitted(rows: list[dict]) -> dict:
    """Return the free law, the constant of the law without dimension, and the rms of s and of ln(s - 1) of each."""
    names = ("scattering_per_m", "distance_m", "range_m")
    logs = np.log([[row[name] for name in names] for row in rows])
    excess = np.array([row["excess"][GREEN] for row in rows])
    free = np.linalg.lstsq(np.column_stack([np.ones(len(rows)), logs]), np.log(excess), rcond=None)[0]
    constant = float(np.exp(np.mean(np.log(excess) - logs @ EXPONENTS)))
    laws = {
        "free": (float(np.exp(free[0])), [float(value) for value in free[1:]]),
        "without dimension": (constant, list(EXPONENTS)),
    }
    return {name: _law(excess, logs, *law) for name, law in laws.items()} | {"frames": len(rows)}


def _law(excess: np.ndarray, logs: np.ndarray, constant: float, exponents: list[float]) -> dict:
    predicted = constant * np.exp(logs @ exponents)
    return {
        "constant": constant, "exponents": exponents, "rms": float(np.sqrt(np.mean((predicted - excess) ** 2))),
        "largest": float(np.abs(predicted - excess).max()),
        "rms_log": float(np.sqrt(np.mean(np.log(predicted / excess) ** 2))),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("dataset", type=Path, help="folder made by `uwsim generate validity`")
    parser.add_argument("--json", type=Path, help="file for the frames and the laws")
    arguments = parser.parse_args()
    rows = excesses(arguments.dataset)
    laws = fitted(rows)
    if arguments.json:
        from uwsim.files import write_json

        write_json(arguments.json, {"laws": laws, "frames": rows})
    for name in ("free", "without dimension"):
        law = laws[name]
        powers = " ".join(f"{symbol}^{power:.3f}" for symbol, power in zip("bdR", law["exponents"], strict=True))
        sys.stdout.write(
            f"{name}: s - 1 = {law['constant']:.4f} {powers}; rms {law['rms']:.4f}, largest {law['largest']:.4f}, "
            f"of the logarithm {law['rms_log']:.3f}\n"
        )


if __name__ == "__main__":
    main()
