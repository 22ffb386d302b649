"""Spheres that something hides: another sphere in front, a rod across; pairs and streaks told apart."""

import numpy as np
import pytest

from uwsim.images import srgb_uint8_from_linear
from uwsim.pose import sphere_search
from uwsim.pose.sphere_candidates import Candidate
from uwsim.pose.sphere_fit import fit_spheres
from uwsim.pose.sphere_model import Window, model, slope
from uwsim.pose.sphere_search import Search, _Look
from uwsim.pose.spheres import detect_spheres

LIGHT = (-0.25, -0.18, 0.95)
RADII_PX = (3.0, 9.0)


def scene(balls, *, side_px=120, blur_px=0.7, samples=6, bars=(), way=(0.0, 0.0), ground=0.04):
    """Return the linear picture (side, side) of matt balls ((x, y), radius), those that come first in front.

    `bars`: (column, half the width) of dark upright rods in front of what is low in the picture. `way`: that all balls
    move by.
    """
    import cv2

    fine = (np.arange(side_px * samples) + 0.5) / samples
    light = np.array(LIGHT) / np.linalg.norm(LIGHT)
    stops = np.outer((np.arange(12) + 0.5) / 12 - 0.5, way) if any(way) else np.zeros((1, 2))
    picture = np.zeros((len(fine), len(fine)))
    for stop in stops:
        one = np.full_like(picture, ground)
        for (column, row), radius in reversed(balls):
            x, y = (fine[None, :] - column - stop[0]) / radius, (fine[:, None] - row - stop[1]) / radius
            z = np.sqrt(np.clip(1 - x**2 - y**2, 0, None))
            lit = 0.6 * np.clip(light[0] * x + light[1] * y + light[2] * z, 0, None)
            one = np.where(x**2 + y**2 < 1, lit, one)
        picture += one / len(stops)
    for column, half in bars:
        picture[np.ix_(fine > 0.55 * side_px, np.abs(fine - column) < half)] = 0.01
    picture = cv2.GaussianBlur(picture, (0, 0), blur_px * samples)
    return picture.reshape(side_px, samples, side_px, samples).mean(axis=(1, 3))


def image(clean, seed=0):
    rng = np.random.default_rng(seed)
    return srgb_uint8_from_linear(rng.normal(clean[..., None] * np.ones(3), 0.004).clip(0, 1))


def errors(found, balls):
    """Return how far the nearest of the spheres found is from each ball [px]."""
    return np.array([min(np.linalg.norm(one.centre_px - centre) for one in found) for centre, _ in balls])


def pair(apart, turn_deg, radius=6.0):
    """Return two balls, the front one first, their centres so many radii apart."""
    turn = np.deg2rad(turn_deg)
    way = 0.5 * apart * radius * np.array([np.cos(turn), np.sin(turn)])
    middle = np.array([60.3, 59.6])
    return [(middle + way, radius), (middle - way, 0.95 * radius)]


@pytest.mark.parametrize("turn_deg", [20, 110, 200, 290])
@pytest.mark.parametrize("apart", [1.1, 1.5, 1.9, 2.2])
def test_the_rear_one_of_two_balls_is_where_it_is(apart, turn_deg):
    """Setup: two balls, one partly in front of the other or next to it, in either order to the light. Expected: both to
    0.1 px. Negative control: the blob taken for one ball, or for two with the rear one in front, leaves more."""
    balls = pair(apart, turn_deg)
    clean = scene(balls)
    found = detect_spheres(image(clean), radius_px=RADII_PX)
    assert len(found) == 2
    assert np.all(errors(found, balls) < 0.1)
    everywhere = np.ones(clean.shape, bool)
    starts = {"centres_px": np.array([centre for centre, _ in balls]), "radii_px": np.array([6.0, 5.7])}
    right = fit_spheres(clean, everywhere, ~everywhere, shape=np.eye(2), **starts)
    if apart < 1.8:
        swapped = fit_spheres(
            clean, everywhere, ~everywhere, shape=np.eye(2), **{key: value[::-1] for key, value in starts.items()}
        )
        assert swapped is None or swapped[0].left > 1.5 * right[0].left
        one = fit_spheres(
            clean, everywhere, ~everywhere, shape=np.eye(2), centres_px=np.array([60.3, 59.6]), radii_px=7.0
        )
        assert one is None or one[0].left > 5 * right[0].left


WHOLE = [(np.array([25.4, 24.7]), 6.0), (np.array([93.2, 27.9]), 6.2), (np.array([29.7, 92.1]), 5.9)]
HIDDEN = (np.array([88.6, 88.3]), 6.0)


@pytest.mark.parametrize("aside_px, within_px", [(4.8, 0.3), (5.2, 0.3), (5.5, 0.3), (-4.8, 0.7), (-5.5, 0.7)])
def test_a_ball_behind_a_rod_has_the_size_of_the_others(aside_px, within_px):
    """Setup: four balls, a dark rod over a third of one, on its dark side or on its bright one. Expected: one ball, to
    0.3 or 0.7 px. Negative control: it is not where it seems to be if nothing is known of its size (it alone in the
    picture): more than 1 px off, or not found."""
    bars = [(HIDDEN[0][0] + aside_px, 3.5)]
    found = detect_spheres(image(scene([*WHOLE, HIDDEN], bars=bars)), radius_px=RADII_PX)
    assert len(found) == 4
    assert np.all(errors(found, WHOLE) < 0.1)
    assert errors(found, [HIDDEN]) < within_px
    alone = detect_spheres(image(scene([HIDDEN], bars=bars)), radius_px=RADII_PX)
    assert not alone or errors(alone, [HIDDEN]) > 1.0


@pytest.mark.parametrize("half_px", [0.6, 1.2, 2.0])
def test_a_rod_across_the_middle_leaves_one_ball(half_px):
    """Setup: as before, a rod across the middle of one ball. Expected: four spheres, not five; the fourth within 0.15
    px."""
    found = detect_spheres(image(scene([*WHOLE, HIDDEN], bars=[(HIDDEN[0][0], half_px)])), radius_px=RADII_PX)
    assert len(found) == 4
    assert errors(found, [HIDDEN]) < 0.15


def test_a_scrap_of_a_ball_is_left_out():
    """Setup: four balls, of one only a narrow part is seen. Expected: three, none at the part. The ball without the rod
    (negative control) is found."""
    hidden = scene([*WHOLE, HIDDEN], bars=[(HIDDEN[0][0] + 1.5, 5.5)])
    assert hidden[88, 82:86].max() > 0.15
    assert len(detect_spheres(image(hidden), radius_px=RADII_PX)) == 3
    assert len(detect_spheres(image(scene([*WHOLE, HIDDEN])), radius_px=RADII_PX)) == 4


@pytest.mark.parametrize("radius, bar", [(3.8, (1.6, 0.76)), (3.8, (3.2, 1.6)), (8.2, (0.0, 1.37)), (8.8, (0.0, 1.47))])
def test_a_ball_behind_a_rod_may_have_another_size_if_most_is_seen(monkeypatch, radius, bar):
    """Setup: three balls of 6 px, one further away or nearer behind a narrow rod. Expected: four, the fourth within
    0.25 px. Negative control: with only what has the size of the others, not four."""
    aside, half = bar
    ball = (HIDDEN[0], radius)
    picture = image(scene([*WHOLE, ball], bars=[(HIDDEN[0][0] + aside, half)]))
    found = detect_spheres(picture, radius_px=RADII_PX)
    assert len(found) == 4 and errors(found, [ball]) < 0.25
    monkeypatch.setattr(sphere_search, "_MOSTLY_SEEN", 2.0)
    assert len(detect_spheres(picture, radius_px=RADII_PX)) != 4


def test_where_sizes_differ_a_part_may_be_of_any_of_them(monkeypatch):
    """Setup: whole balls of 4.9, 6 and 7.4 px, one of 7.8 px half behind a rod. Expected: four, the fourth within 0.35
    px. Negative control: with sizes taken to be alike it is more than 1 px off."""
    whole = [(centre, radius) for (centre, _), radius in zip(WHOLE, (4.9, 6.0, 7.4), strict=True)]
    ball = (HIDDEN[0], 7.8)
    picture = image(scene([*whole, ball], bars=[(HIDDEN[0][0] + 4.48, 4.98)]))
    found = detect_spheres(picture, radius_px=RADII_PX)
    assert len(found) == 4 and errors(found, [ball]) < 0.35
    monkeypatch.setattr(sphere_search, "_SIZE_SDS", (0.1, 0.1))
    assert errors(detect_spheres(picture, radius_px=RADII_PX), [ball]) > 1.0


def test_balls_of_other_sizes_are_whole():
    """Setup: three balls of 6 px and one of 3.4 px. Expected: all, each to 0.1 px: it is not taken for a part."""
    balls = [*WHOLE, (HIDDEN[0], 3.4)]
    found = detect_spheres(image(scene(balls)), radius_px=RADII_PX)
    assert len(found) == 4 and np.all(errors(found, balls) < 0.1)


def test_streaks_that_go_alike_are_balls_in_motion(monkeypatch):
    """Setup: four balls that move by 9 px, the way of a camera that shifts. Expected: four, each to 0.4 px. Negative
    control: taken for balls at rest, they are not all found so."""
    balls, way = [*WHOLE, HIDDEN], 9.0 * np.array([np.cos(0.5), -np.sin(0.5)])
    moving = image(scene(balls, way=way))
    found = detect_spheres(moving, radius_px=RADII_PX)
    assert len(found) == 4 and np.all(errors(found, balls) < 0.4)
    monkeypatch.setattr(sphere_search, "_move_alike", lambda ways, count: False)
    at_rest = detect_spheres(moving, radius_px=RADII_PX)
    assert len(at_rest) != 4 or errors(at_rest, balls).max() > 0.8


def test_a_pair_among_round_ones_is_no_streak():
    """Setup: two balls one before the other, three round ones. Expected: five, each to 0.15 px."""
    shifted = [(centre + [24.0, 22.0], radius) for centre, radius in pair(1.3, 40)]
    balls = [*shifted, *WHOLE]
    found = detect_spheres(image(scene(balls)), radius_px=RADII_PX)
    assert len(found) == 5 and np.all(errors(found, balls) < 0.15)


@pytest.mark.parametrize("apart_px, spheres", [(9.0, 1), (20.0, 2)])
def test_light_of_a_sphere_next_to_it_is_no_second_one(monkeypatch, apart_px, spheres):
    """Setup: a blob that two balls explain better than one, next to a sphere with which it makes a pair. Expected: one
    ball. Negative control: the sphere is too far off to touch them: two."""
    still = np.zeros(2)
    fits = [
        sphere_search.Fit(np.array(place), 0.01 * np.eye(2), radius, 0.5, 0.99, 0.7, left, 1.0, still, still)
        for place, radius, left in (
            ((30.0, 30.0), 6.0, 1e-3), ((30.0 + apart_px, 30.0), 5.0, 1e-4), ((29.0, 30.0), 5.5, 1e-4),
            ((33.0, 30.0), 3.5, 1e-4),
        )
    ]  # fmt: skip
    blob = Candidate(np.array([30.0, 30.0]), 6.0, 1.0)
    looks = [_Look(blob, np.ones((60, 60), bool), one, None, blob.centre_px, np.eye(2)) for one in fits[:2]]
    search = Search(np.zeros((60, 60)), np.zeros((60, 60), bool), None)
    monkeypatch.setattr(Search, "_split", lambda search, look: fits[2:])
    monkeypatch.setattr(Search, "_two", lambda search, usable, centres_px, radii_px: fits[:2])
    assert len(search._chosen(looks[0], looks, moving=False)) == spheres


def test_ways_are_alike_either_way_round():
    ways = [np.array([6.0, 1.0]), np.array([-6.2, -0.8]), np.array([5.8, 1.2])]
    assert sphere_search._move_alike(ways, 5)
    assert not sphere_search._move_alike(ways, 7)
    assert not sphere_search._move_alike([np.array([6.0, 0]), np.array([0, 6.0]), np.array([-5.0, 5.0])], 3)


@pytest.mark.parametrize("apart", [1.2, 1.7])
def test_the_model_is_the_picture(apart):
    """Setup: two balls rendered by other means, sampled finely, in the model's unknowns. Expected: equal within 1 %
    of the brightest. Negative control: with the rear one in front they differ by more than 15 %."""
    balls = pair(apart, 30)
    clean = scene(balls, samples=16, side_px=120)[40:80, 40:80]
    light = np.array(LIGHT[:2]) / LIGHT[2]
    window = Window(np.zeros(2, int), clean, np.ones(clean.shape), np.eye(2), 3)
    places = [[*(centre - 40.0), np.log(radius)] for centre, radius in balls]
    for order, agree in ((places, True), (places[::-1], False)):
        found, _ = model(window, np.array([np.log(0.7), *light, *np.ravel(order)]))
        off = np.abs(found - clean).max() / clean.max()
        assert off < 0.01 if agree else off > 0.15


@pytest.mark.parametrize("way", [(), (4.0, -1.5)])
@pytest.mark.parametrize("apart", [1.2, 3.0])
def test_the_slope_is_that_of_the_misfit(apart, way):
    """Setup: two balls, at rest and in motion, places, sizes, blur and light somewhat off, weights that differ.
    Expected: twice the slope times what is off is the gradient of the weighted sum of squares, to 5 % (the slope's own
    steps are 0.002). Negative control: with the two balls exchanged it is not."""
    balls = pair(apart, 35)
    clean = scene(balls, way=way or (0.0, 0.0))[40:80, 40:80]
    weights = np.random.default_rng(1).uniform(0.3, 1.7, clean.shape)
    weights[:3] = 0
    window = Window(np.zeros(2, int), clean, weights, np.array([[1.02, 0.03], [0.0, 1 / 1.02]]), 6, shared=3 + len(way))
    places = [[*(centre - 39.6), np.log(0.95 * radius)] for centre, radius in balls]
    unknowns = np.array([np.log(0.8), -0.2, 0.1, *np.multiply(way, 1.1), *np.ravel(places)])

    def off(tried):
        return (np.sqrt(weights) * (model(window, tried)[0] - clean))[weights > 0]

    def misfit(tried):
        return off(tried) @ off(tried)

    steps = 0.002 * np.eye(len(unknowns))
    expected = np.array([(misfit(unknowns + step) - misfit(unknowns - step)) / 0.004 for step in steps])
    found = 2 * slope(window, unknowns, 0.002).T @ off(unknowns)
    found, expected = np.split(found, [window.shared]), np.split(expected, [window.shared])
    for one, other in zip(found, expected, strict=True):
        assert np.linalg.norm(one - other) < 0.05 * np.linalg.norm(other)
    exchanged = np.roll(found[1], 3)
    assert np.linalg.norm(exchanged - expected[1]) > 0.1 * np.linalg.norm(expected[1])
