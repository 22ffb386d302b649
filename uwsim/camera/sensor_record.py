"""The sensor as a frame's description keeps it, and back."""

import numpy as np

from uwsim.camera import vignetting
from uwsim.camera.sensor import Constants

_NUMBERS = (
    "electrons_per_radiance", "full_well_e", "white_balance", "read_noise_e", "dark_e", "prnu", "dsnu_e",
    "pattern_seed", "gain", "adc_bits", "black_level_dn", "mosaic", "demosaic",
)  # fmt: skip


def record(constants: dict) -> dict:
    """Return sensor keywords as plain numbers, with the system gain K and without the vignetting map."""
    numbers = {key: np.asarray(constants[key]).tolist() for key in _NUMBERS}
    return numbers | {"gain_dn_per_e": Constants(**constants).gain_dn_per_e}


def constants(recorded: dict, *, K: np.ndarray, width_px: int, height_px: int) -> dict:
    """Return the keywords of `camera.sensor` from the `sensor` entry of a frame.json (as a dictionary)."""
    found = {key: recorded[key] for key in _NUMBERS}
    for key in ("electrons_per_radiance", "white_balance"):
        found[key] = np.array(found[key])
    fall = recorded["vignetting"]
    if fall is not None:
        fall = vignetting.relative_illumination(
            K, width_px=width_px, height_px=height_px, cos4=fall["cos4"], polynomial=fall["polynomial"]
        )
    return found | {"relative_illumination": fall}
