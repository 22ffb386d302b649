"""The maximum-likelihood blur fit written out: every start by itself, on single frequencies, in float64.

The same model, prior, taper, leakage and loss as `uwsim.motion_blur.whittle`, as its formulas say it; 24 starts of 8
steps each on a quarter of the frequencies without leakage, then all starts that are not worse than the best by 80 nats
on all frequencies. No verdict.
"""

import numpy as np

STARTS_PX, ANGLES_DEG = (2.2, 3.6, 6.0), range(0, 180, 30)
COARSE_STEPS, STEPS, WORSE_NATS = 8, 20, 80.0
CLIP, REACH, TAPER_SHARE, LONGEST_PX = 8.0, 8, 0.25, 40.0


def estimate(grey: np.ndarray) -> tuple[float, float]:
    """Return (length_px, angle_deg) of a grey picture (H, W)."""
    from uwsim.motion_blur.whittle import model

    grey = grey / grey.std()
    window = np.outer(*(tukey(side) for side in grey.shape))
    centred = grey - (window * grey).sum() / window.sum()
    power = np.abs(np.fft.fft2(window * centred)) ** 2 / (window**2).sum()
    v, u = np.meshgrid(*(np.fft.fftfreq(side) for side in grey.shape), indexing="ij")
    lowest = 3 / min(grey.shape)
    chosen = ((v > 0) | ((v == 0) & (u > 0))) & (np.hypot(u, v) >= lowest)
    quarter = chosen & (np.random.default_rng(0).random(grey.shape) < 0.25)
    terms = terms_of(u, v, lowest)
    prior = model.prior()
    coarse = [
        fit(start, power, u, v, terms, quarter, None, prior, COARSE_STEPS)
        for start in starts(power, u, v, quarter, terms, prior)
    ]
    best_loss = min(loss for _, loss in coarse)
    fine = [
        fit(parameters, power, u, v, terms, chosen, grey.shape, prior, STEPS)
        for parameters, loss in coarse
        if loss < best_loss + WORSE_NATS
    ]
    right, up = min(fine, key=lambda found: found[1])[0][:2]
    return float(np.hypot(right, up)), float(np.degrees(np.arctan2(up, right))) % 180


def tukey(side: int) -> np.ndarray:
    """Return the cosine taper, periodic."""
    position = np.arange(side)
    edge = TAPER_SHARE * side / 2
    nearest = np.minimum(position, side - position)
    return np.where(nearest < edge, 0.5 * (1 - np.cos(np.pi * nearest / edge)), 1.0)


def terms_of(u: np.ndarray, v: np.ndarray, lowest: float) -> np.ndarray:
    """Return the 14 terms of ln S, (14, H, W)."""
    r = np.maximum(np.hypot(u, v), lowest)
    x, phi, roll_off = np.log(r / 0.1), np.arctan2(-v, u), -((r / 0.5) ** 2)
    terms = [np.ones_like(r), -x, x**2, roll_off]
    for m in (2, 4):
        terms += [np.cos(m * phi), np.sin(m * phi), x * np.cos(m * phi), x * np.sin(m * phi)]
    return np.array([*terms, roll_off * np.cos(2 * phi), roll_off * np.sin(2 * phi)])


def starts(power, u, v, chosen, terms, prior) -> list[np.ndarray]:
    """Return the parameters of 24 starts: a ring of displacements, and the deepest points of the cepstrum."""
    cepstrum = np.fft.ifft2(np.log(power + 1e-12 * power.mean())).real
    rows, columns = (np.rint(f * side) for f, side in zip((v, u), power.shape, strict=True))
    distance = np.hypot(rows, columns)
    half = ((rows < 0) | ((rows == 0) & (columns > 0))) & (distance >= 1.5) & (distance <= LONGEST_PX)
    for shift in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        half &= cepstrum <= np.roll(cepstrum, shift, (0, 1))
    deepest = np.argsort(np.where(half, cepstrum, np.inf).ravel())[:6]
    displacements = [(columns.ravel()[i], -rows.ravel()[i]) for i in deepest]
    for length in STARTS_PX:
        displacements += [(length * np.cos(a), length * np.sin(a)) for a in np.radians(ANGLES_DEG)]
    corners = power[chosen & (np.hypot(u, v) > 0.6)]
    low = chosen & (np.hypot(u, v) < 0.1)
    result = []
    for displacement in displacements:
        parameters = prior[0].copy()
        parameters[:2] = displacement
        parameters[2] = np.log(max(np.quantile(corners, 0.25) / 0.2877, 1e-12))
        along = displacement[0] * u[low] - displacement[1] * v[low]
        expected = np.sinc(along) ** 2 * np.exp(np.tensordot(parameters[5:], terms[:, low], 1)) + 1e-12
        parameters[5] = np.log(max(np.median(power[low] / expected), 1e-12))
        result.append(parameters)
    return result


def leak(density: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return the density convolved with that of the taper, one axis after the other."""
    for axis, side in enumerate(shape):
        kernel = np.abs(np.fft.fft(tukey(side))) ** 2
        kernel = {shift: kernel[shift] for shift in range(-REACH, REACH + 1)}
        total = sum(kernel.values())
        density = sum(value / total * np.roll(density, shift, axis) for shift, value in kernel.items())
    return density


def fit(parameters, power, u, v, terms, chosen, shape, prior, steps) -> tuple[np.ndarray, float]:
    """Return (parameters, loss) after damped Fisher steps; with leakage where a shape is given."""
    mean, precision = prior
    if shape is None:
        power, u, v, terms, chosen = power[chosen], u[chosen], v[chosen], terms[:, chosen], np.ones(chosen.sum(), bool)

    def evaluate(p):
        density, slopes = model_of(p, u, v, terms, shape)
        ratio = power[chosen] / density[chosen]
        clipped = np.minimum(ratio, CLIP)
        loss = np.log(density[chosen]) + clipped + CLIP * np.log(np.maximum(ratio, CLIP) / CLIP)
        jacobian = slopes[:, chosen] / density[chosen]
        gradient = jacobian @ (clipped - 1) - precision * (p - mean)
        return loss.sum() + 0.5 * precision @ (p - mean) ** 2, gradient, jacobian @ jacobian.T + np.diag(precision)

    loss, gradient, curvature = evaluate(parameters)
    damping = 1e-3
    for _ in range(steps):
        step = np.linalg.solve(curvature + np.diag(damping * np.diag(curvature) + 1e-9), gradient)
        step *= min(1.0, 1.5 / max(np.hypot(*step[:2]), 1e-12))
        trial = parameters + step
        trial[:2] *= min(1.0, LONGEST_PX / max(np.hypot(*trial[:2]), 1e-12))
        trial[2:5] = np.clip(trial[2:5], (-28, -12, -12), (8, -0.1, 8))
        trial_loss, trial_gradient, trial_curvature = evaluate(trial)
        gain = loss - trial_loss
        if gain > 0:
            parameters, loss, gradient, curvature = trial, trial_loss, trial_gradient, trial_curvature
            damping = max(damping / 10, 1e-6)
        else:
            damping *= 10
        if abs(gain) < 0.005 or damping > 1e6:
            break
    return parameters, loss


def model_of(p, u, v, terms, shape):
    """Return the density and its derivatives by the 19 parameters."""
    noise, static, fill = np.exp(p[2:5])
    q = p[0] * u - p[1] * v
    angle = np.pi * np.where(np.abs(q) < 1e-3, 1e-3, q)
    sinc, ramp = np.sin(angle) / angle, 1 / (1 + angle**2)
    slope = 2 * np.pi * (sinc * (np.cos(angle) - sinc) / angle - fill * angle * ramp**2)
    texture = np.exp(np.tensordot(p[5:], terms, 1))
    mixed = (lambda density: density) if shape is None else (lambda density: leak(density, shape))
    signal = mixed(texture * ((1 - static) * (sinc**2 + fill * ramp) + static))
    slopes = [
        mixed((1 - static) * texture * slope * u), mixed(-(1 - static) * texture * slope * v),
        np.full_like(q, noise), static / (1 - static) * (texture - signal), (1 - static) * fill * texture * ramp,
        *(signal * terms),
    ]  # fmt: skip
    return signal + noise, np.array(slopes)
