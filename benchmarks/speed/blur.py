"""Milliseconds of the maximum-likelihood blur estimator, beside the same fit written out in NumPy, in one run.

    python benchmarks/speed/blur.py [--quick] [--json -]

Frames: Gaussian textures f^-2.8 of 256x256, blurred by the exact transfer function, cut out of larger ones, with noise
and 8 bit. Both get the same frames on one thread, in turn; times are CPU milliseconds of the process, medians over the
frames; the first call, which makes what a size of frame needs, is left out and stands as `first_milliseconds`. The
estimator's time holds the verdict, which the fit written out (`blur_literal.py`) does not give. `largest_difference_px`
is between the displacements of both. Fails, but for --quick, where the estimator takes more than a third.
"""

import argparse
import statistics
import sys
import time

import blur_literal
import document
import numpy as np

SIDE_PX, BORDER_PX = 256, 48
# length [px], angle [deg], noise
CASES = [(2, 30, 0.005), (4, 105, 0.01), (8, 60, 0.0), (15, 150, 0.02), (20, 0, 0.01)]
MOST_OF_LITERAL = 1 / 3


def frame(length_px: float, angle_deg: float, noise_std: float) -> np.ndarray:
    """Return a grey frame (256, 256) float32."""
    from uwsim.motion_blur.kernels import blur

    rng = np.random.default_rng([int(length_px), int(angle_deg)])
    side = SIDE_PX + 2 * BORDER_PX
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.fftfreq(side)[None, :])
    frequency[0, 0] = 1
    picture = np.fft.ifft2(np.fft.fft2(rng.standard_normal((side, side))) / frequency**1.4).real
    picture = blur(0.5 + 0.13 * picture / picture.std(), length_px=length_px, angle_deg=angle_deg)
    inner = picture[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    noisy = inner + noise_std * rng.standard_normal(inner.shape)
    return (np.rint(255 * np.clip(noisy, 0, 1)) / 255).astype(np.float32)


def timed(function, *arguments) -> tuple[object, float]:
    """Return the answer of a call and its CPU milliseconds."""
    start = time.process_time()
    answer = function(*arguments)
    return answer, 1000 * (time.process_time() - start)


def displacement(length_px: float, angle_deg: float) -> np.ndarray:
    angle = np.radians(angle_deg)
    return length_px * np.array([np.cos(angle), np.sin(angle)])


def main() -> int:
    """Measure, print a line, write tidy records."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two frames: shows that it runs")
    parser.add_argument("--json", help="where to write the records; - for standard output")
    arguments = parser.parse_args()
    from uwsim.motion_blur.estimators import whittle

    cases = CASES[:2] if arguments.quick else CASES
    frames = [frame(*case) for case in cases]
    _, first_ms = timed(whittle.estimate, frames[0])
    ours, literal, differences = [], [], []
    for image in frames:
        found, milliseconds = timed(whittle.estimate, image)
        ours.append(milliseconds)
        written_out, milliseconds = timed(blur_literal.estimate, image.astype(float))
        literal.append(milliseconds)
        one, other = displacement(*found[:2]), displacement(*written_out)
        differences.append(min(np.hypot(*(one - sign * other)) for sign in (1, -1)))
    values = {
        "milliseconds": statistics.median(ours),
        "first_milliseconds": first_ms,
        "written_out_milliseconds": statistics.median(literal),
        "speed_up": statistics.median(b / a for a, b in zip(ours, literal, strict=True)),
        "largest_difference_px": float(max(differences)),
    }
    size = {"width_px": SIDE_PX, "height_px": SIDE_PX}
    records = [
        {"benchmark": "speed/blur", "metric": metric, "algorithm": "whittle", **size, "value": value}
        for metric, value in values.items()
    ]
    print(
        f"whittle {values['milliseconds']:.0f} ms (first {first_ms:.0f} ms); written out "
        f"{values['written_out_milliseconds']:.0f} ms: {values['speed_up']:.1f} x, differs by at most "
        f"{values['largest_difference_px']:.2g} px",
        file=sys.stderr,
    )
    document.write(records, quick=arguments.quick, where=arguments.json)
    return 0 if arguments.quick or values["speed_up"] >= 1 / MOST_OF_LITERAL else 1


if __name__ == "__main__":
    sys.exit(main())
