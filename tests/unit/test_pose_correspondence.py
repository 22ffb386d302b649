"""Which sphere is which: found without truth where the body has no turn into itself, else up to these."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uwsim.pose import problems
from uwsim.pose.correspondence import nearest, search, symmetries

TURNS = {"bi6": 24, "py5": 4, "st4": 2, "pl4": 8}
NOISE = 2e-4
WITHIN = 3e-3


def cloud(count=7, seed=11):
    return np.random.default_rng(seed).uniform(-0.05, 0.05, (count, 3))


def seen(target_m, seed):
    """Return image points of a target in a random pose, in random order, and which point of the target each is."""
    rng = np.random.default_rng(seed)
    camera = target_m @ Rotation.random(random_state=seed).as_matrix().T + [0.03, 0.02, 0.5]
    order = rng.permutation(len(target_m))
    return (camera[:, :2] / camera[:, 2:] + rng.normal(0, NOISE, (len(camera), 2)))[order], order


@pytest.mark.parametrize("name", TURNS)
def test_turns_of_the_layouts(name):
    """Expected: as many as the body's group of rotations has, each a rigid turn: distances between points stay."""
    target_m = problems.layout(name, edge_m=0.08)
    turns = symmetries(target_m)
    assert len(turns) == TURNS[name]
    gaps = np.linalg.norm(target_m[:, None] - target_m[None], axis=-1)
    for turn in turns:
        assert gaps[np.ix_(turn, turn)] == pytest.approx(gaps, abs=1e-9)
    assert len(symmetries(cloud())) == 1


@pytest.mark.parametrize("seed", range(4))
def test_a_body_without_symmetry_is_told_from_its_picture(seed):
    """Setup: seven points, one hidden, two lights that are none of the body's. Expected: every name right."""
    target_m = cloud()
    image, order = seen(target_m, seed)
    rng = np.random.default_rng(50 + seed)
    image = np.concatenate([image[1:], rng.uniform(-0.1, 0.15, (2, 2))])
    match = search(target_m, image, within=WITHIN)
    assert len(match.body) == 6
    assert np.array_equal(order[1:][match.seen], match.body)


@pytest.mark.parametrize("name", TURNS)
def test_a_symmetrical_body_is_told_up_to_its_turns(name):
    target_m = problems.layout(name, edge_m=0.08)
    image, order = seen(target_m, 2)
    match = search(target_m, image, within=WITHIN, least=4)
    assert any(np.array_equal(turn[match.body], order[match.seen]) for turn in symmetries(target_m))


def test_another_body_is_not_found():
    """Negative control: the picture of one cloud does not show another."""
    image, _ = seen(cloud(seed=12), 1)
    match = search(cloud(seed=11), image, within=WITHIN, least=6)
    assert match is None


def test_a_point_that_all_others_contradict_has_no_name():
    """Setup: nine points, one moved by 10 standard deviations, less than what a pair may be off. Expected: it is left
    out and the others are right. Negative control: with noise alone all have names, in 40 of 40 pictures."""
    target_m = cloud(9)
    for seed in range(40):
        image, order = seen(target_m, seed)
        match = search(target_m, image, within=WITHIN)
        assert np.array_equal(order[match.seen], match.body) and len(match.body) == 9
    left_out = 0
    for seed in range(10):
        image, order = seen(target_m, seed)
        image[4] += [10 * NOISE, 0]
        match = search(target_m, image, within=WITHIN)
        assert np.array_equal(order[match.seen], match.body)
        left_out += 4 not in match.seen and len(match.body) == 8
    assert left_out >= 9


def test_nearest_pairs_each_once_and_not_too_far():
    expected = np.array([[0.0, 0.0], [10.0, 0.0], [np.nan, np.nan]])
    match = nearest(expected, np.array([[9.0, 0.0], [0.5, 0.0], [0.6, 0.0], [50.0, 0.0]]), within=3.0)
    assert match.body.tolist() == [0, 1] and match.seen.tolist() == [1, 0]
    assert len(nearest(expected, np.empty((0, 2)), within=3.0).body) == 0


def test_too_few_points_are_refused():
    with pytest.raises(ValueError, match="search: got 3 points"):
        search(cloud(3), np.zeros((5, 2)), within=WITHIN)
    assert search(cloud(), np.zeros((2, 2)), within=WITHIN) is None
