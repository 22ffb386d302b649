"""Lamps, daylight and water from the entries of a frame.json (`uwsim/dataset/FORMAT.md`), as plain dictionaries."""

import numpy as np

from uwsim.formation.light import CosinePower, Daylight, Lamp
from uwsim.optics import beam_profile, natural_light
from uwsim.optics.beam_profile import Profile
from uwsim.optics.ies import Photometry
from uwsim.optics.lamp import lambertian_order
from uwsim.optics.phase import PhaseMixture
from uwsim.optics.phase_functions.fournier_forand import FournierForand
from uwsim.optics.phase_functions.henyey_greenstein import HenyeyGreenstein
from uwsim.optics.phase_functions.mixture import Mixture, PhaseFunction
from uwsim.optics.phase_functions.petzold import Tabulated
from uwsim.optics.phase_functions.rayleigh import Rayleigh
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import Water
from uwsim.optics.window import DomeWindow, FlatWindow


def water(record: dict) -> Water:
    """Return the water of a frame's `water` entry; ValueError for another wavelength grid or phase function."""
    wavelengths = np.asarray(record["wavelengths_nm"], float)
    if wavelengths.shape != WAVELENGTHS_NM.shape or not np.allclose(wavelengths, WAVELENGTHS_NM):
        raise ValueError(f"water.wavelengths_nm has {len(wavelengths)} nodes, allowed: 400 to 700 nm in steps of 5")
    return Water(
        name=record["name"],
        absorption=np.asarray(record["absorption_per_m"], float),
        scattering=np.asarray(record["scattering_per_m"], float),
        phase=phase(record["phase_function"]),
    )


def phase(record: dict) -> PhaseMixture:
    """Return the phase function that `optics.phase.describe` put into a record."""
    weights = np.asarray(record["weights"], float)
    if record["type"] == "hg_mixture":
        return PhaseMixture(tuple(HenyeyGreenstein(float(g)) for g in record["g"]), weights)
    if record["type"] == "mixture":
        return PhaseMixture(tuple(_term(term) for term in record["terms"]), weights)
    raise ValueError(f"water.phase_function.type: got {record['type']!r}, allowed: 'hg_mixture', 'mixture'")


def _term(record: dict) -> PhaseFunction:
    match record["type"]:
        case "hg":
            return HenyeyGreenstein(record["g"])
        case "rayleigh":
            return Rayleigh(record["depolarisation"])
        case "fournier_forand":
            return FournierForand(n=record["n"], mu=record["mu"])
        case "table":
            angles = np.radians(np.asarray(record["angles_deg"], float))
            angles[-1] = np.pi
            return Tabulated(angles, np.asarray(record["values"], float))
        case "mixture":
            return Mixture(tuple(_term(term) for term in record["terms"]), tuple(record["weights"]))
    raise ValueError(f"water.phase_function term: got {record['type']!r}, allowed: those of FORMAT.md")


def daylight(record: dict | None) -> Daylight | None:
    """Return the daylight below the surface of a frame's `daylight` entry; None for none.

    Source: Fresnel and Snell at a flat surface (`optics.natural_light`); `sun_irradiance` is normal to the refracted
    rays, E T / mu, E the irradiance of a horizontal plane in the air.
    """
    if record is None:
        return None
    n_water = record["refractive_index"]
    zenith, azimuth = np.radians(record["sun_zenith_deg"]), np.radians(record["sun_azimuth_deg"])
    across = np.sin(zenith) / n_water * np.array([np.cos(azimuth), np.sin(azimuth)])
    cosine = float(np.sqrt(1 - across @ across))
    sky = natural_light.cardioidal_sky if record["sky"] == "cardioidal" else np.ones_like
    passed = float(natural_light.surface_transmittance(zenith, n_water=n_water))
    diffuse = natural_light.sky_transmittance(n_water=n_water, sky=sky)
    spectrum = np.asarray(record["relative_spectrum_per_nm"], float)
    return Daylight(
        towards_sun=np.array([*across, cosine]),
        sun_irradiance=record["sun_irradiance_w_per_m2"] * passed / cosine * spectrum,
        sky_irradiance=record["sky_irradiance_w_per_m2"] * diffuse * spectrum,
    )


def leds(record: dict) -> list[Lamp]:
    """Return the LEDs of an entry of a frame's `lamps`, one or as many as its array has; they share its intensity."""
    world_from_lamp = _world_from_lamp(record)
    poses = [world_from_lamp] if record.get("world_from_leds") is None else np.asarray(record["world_from_leds"], float)
    each = record["radiant_intensity_w_per_sr"] / len(poses) * np.asarray(record["relative_spectrum_per_nm"], float)
    window, profile = _window(record.get("window")), _profile(record)
    lamp_from_world = np.linalg.inv(world_from_lamp)
    return [
        Lamp(
            name=record["name"] if len(poses) == 1 else f"{record['name']}[{index}]",
            spectrum=each,
            world_from_lamp=world_from_lamp,
            profile=profile,
            lamp_from_led=lamp_from_world @ pose,
            window=window,
            calibration="bare" if window is None else record["window"]["calibration"],
        )
        for index, pose in enumerate(poses)
    ]


def _world_from_lamp(record: dict) -> np.ndarray:
    if record.get("world_from_lamp") is not None:
        return np.asarray(record["world_from_lamp"], float)
    # frames of before lamps had an azimuth: any x will do
    z = np.asarray(record["direction"], float)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), record["position_m"]
    return pose


def _profile(record: dict) -> Profile:
    if record.get("beam_table") is not None:
        azimuths, angles = (np.asarray(record[key], float) for key in ("beam_azimuths_deg", "beam_angles_deg"))
        photometry = Photometry(angles, azimuths, np.asarray(record["beam_table"], float), {}, None)
        return lambda angle_rad, azimuth_rad: photometry.intensity(np.degrees(angle_rad), np.degrees(azimuth_rad))
    if record.get("beam_values") is not None:
        return beam_profile.from_table(
            angles_deg=np.asarray(record["beam_angles_deg"]), values=np.asarray(record["beam_values"])
        )
    return CosinePower(lambertian_order(half_angle_deg=record["half_angle_deg"]))


def _window(record: dict | None) -> FlatWindow | DomeWindow | None:
    if record is None:
        return None
    shared = {key: record[key] for key in ("thickness_m", "n_glass", "n_water", "glass_absorption_per_m")}
    if record["kind"] == "flat":
        return FlatWindow(air_gap_m=record["air_gap_m"], radius_m=record["radius_m"], **shared)
    return DomeWindow(
        inner_radius_m=record["inner_radius_m"],
        half_aperture_rad=float(np.radians(record["half_aperture_deg"])),
        **shared,
    )
