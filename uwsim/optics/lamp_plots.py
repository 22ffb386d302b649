"""Figure of a lamp's field in air and behind a flat window: printed, corrected and exact."""

import numpy as np

from uwsim.optics import lamp_as_printed, lamp_in_air, window_field
from uwsim.optics.beam_profile import Beam
from uwsim.optics.window import FlatWindow


def lamp_field_figure(
    beam: Beam,
    window: FlatWindow,
    *,
    distance_m: float = 1.0,
    attenuation_per_m: float = 0.0,
    calibration: str = "bare",
):
    """Return a matplotlib figure: irradiance on the axis against distance, and off it at one distance.

    The right panel is relative to the axis of each curve, so that it shows the shape alone; its printed curve is
    without attenuation, with which eq. 2.27 is infinite.
    Raises ValueError for a tilted beam (the closed forms have none).
    """
    if beam.tilt_rad:
        raise ValueError(f"lamp figure: got tilt_rad {beam.tilt_rad:g}, allowed: 0")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.2), layout="constrained")
    along, across = figure.subplots(1, 2)
    _draw_axis(along, beam, window, attenuation_per_m=attenuation_per_m, calibration=calibration)
    _draw_profile(across, beam, window, distance_m=distance_m, attenuation_per_m=attenuation_per_m)
    figure.suptitle(
        f"Lamp behind a flat window: air gap {window.air_gap_m * 1e3:g} mm, glass {window.thickness_m * 1e3:g} mm, "
        f"c = {attenuation_per_m:g} /m"
    )
    return figure


def _reference(beam: Beam, window: FlatWindow) -> float:
    """Return E_a(O'), the irradiance on the axis in air at the window."""
    on_axis = float(beam.intensity(np.array([0.0, 0.0, 1.0])))
    return float(lamp_in_air.axis_irradiance(axis_intensity_w_per_sr=on_axis, axial_distance_m=window.air_gap_m))


def _draw_axis(axes, beam: Beam, window: FlatWindow, *, attenuation_per_m: float, calibration: str) -> None:
    distances = np.geomspace(0.05, 5.0, 200)
    reference = _reference(beam, window)
    closed = {"window_irradiance_w_per_m2": reference, "window": window, "distance_m": distances}
    exact = window_field.exact_field(
        beam,
        window,
        lateral_m=np.zeros((len(distances), 2)),
        depth_m=distances,
        attenuation_per_m=attenuation_per_m,
        calibration=calibration,
    ).irradiance_w_per_m2
    corrected = window_field.axis_irradiance(**closed, attenuation_per_m=attenuation_per_m, calibration=calibration)
    printed = lamp_as_printed.axis_irradiance_2_28(**closed, attenuation_per_m=attenuation_per_m)
    air = lamp_in_air.axis_irradiance_from_reference(
        reference_irradiance_w_per_m2=reference, reference_distance_m=window.air_gap_m, distance_m=distances
    )
    axes.loglog(distances, exact, "k-", label="water, exact")
    axes.loglog(distances, corrected, "C0--", label="water, corrected 2.28")
    axes.loglog(distances, printed, "C3:", label="water, 2.28 as printed")
    axes.loglog(distances, air, "C7-.", label="air, 2.14")
    axes.set(xlabel="distance from the window [m]", ylabel="irradiance on the axis [W/m$^2$]")
    axes.legend()


def _draw_profile(axes, beam: Beam, window: FlatWindow, *, distance_m: float, attenuation_per_m: float) -> None:
    # stops short of the critical angle, where tangents run away
    angles = np.linspace(0, 0.995 * window.critical_angle_rad, 200)
    air_angles = window.air_angle_rad(angles)
    radius = window.exit_radius_m(air_angles) + distance_m * np.tan(angles)
    lateral = np.stack([radius, np.zeros_like(radius)], axis=-1)
    points = {"lateral_m": lateral, "depth_m": distance_m, "attenuation_per_m": attenuation_per_m}
    exact = window_field.exact_field(beam, window, **points).irradiance_w_per_m2
    virtual = window_field.virtual_source_field(beam, window, **points).irradiance_w_per_m2
    closed = {
        "window_irradiance_w_per_m2": _reference(beam, window),
        "profile": beam.profile,
        "window": window,
        "distance_m": distance_m,
        "water_angle_rad": angles,
    }
    corrected = window_field.closed_form_irradiance(**closed, attenuation_per_m=attenuation_per_m)
    printed = lamp_as_printed.irradiance_2_27(**closed)
    in_air = np.linspace(0, np.pi / 2, 200, endpoint=False)
    air = lamp_in_air.off_axis_irradiance(axis_irradiance_w_per_m2=1.0, profile=beam.profile, angle_rad=in_air)
    for angle, curve, style, label in (
        (angles, exact, "k-", "water, exact"),
        (angles, virtual, "C2--", "water, virtual source"),
        (angles, corrected, "C0--", "water, corrected 2.27"),
        (angles, printed, "C3:", "water, 2.27 as printed, c = 0"),
        (in_air, air, "C7-.", "air, 2.15"),
    ):
        axes.plot(np.degrees(angle), curve / curve[0], style, label=label)
    axes.set(
        xlabel="angle of the ray in its medium [deg]", ylabel=f"irradiance at {distance_m:g} m / axis", ylim=(0, 1)
    )
    axes.legend()
