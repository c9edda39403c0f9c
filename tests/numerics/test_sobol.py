import numpy as np
import pytest

from chuteflow.errors import InputError
from chuteflow.numerics.sobol import MOST_DIMENSIONS, Sobol


def test_unscrambled_points_are_those_of_scipy():
    from scipy.stats import qmc  # whose import takes a third of a second

    theirs = qmc.Sobol(MOST_DIMENSIONS, scramble=False).random(4096)
    assert np.array_equal(Sobol(MOST_DIMENSIONS).points(0, 4096), theirs)


@pytest.mark.parametrize("seed", [None, 0, 7])
def test_a_piece_is_the_same_as_in_the_whole(seed):
    whole = Sobol(7, seed).points(0, 3000)
    assert np.array_equal(Sobol(7, seed).points(1234, 2345), whole[1234:2345])


def test_pieces_far_along_are_made_at_once():
    far = Sobol(3, 1).points(1 << 39, (1 << 39) + 1000)
    assert far.min() >= 0.0
    assert far.max() < 1.0
    assert len(np.unique(far[:, 0])) == 1000


@pytest.mark.parametrize("seed", [0, 3])
def test_scrambled_points_stay_a_net(seed):
    """2^k points have one in each of 2^k intervals of each dimension, and in each cell of a 2^a x 2^b grid."""
    x = Sobol(MOST_DIMENSIONS, seed).points(0, 1024)
    assert all(sorted(column) == list(range(1024)) for column in np.floor(x * 1024).astype(int).T)
    cells = np.floor(x[:, 0] * 32).astype(int) * 32 + np.floor(x[:, 1] * 32).astype(int)
    assert sorted(cells) == list(range(1024))


def test_seeds_differ():
    assert not np.array_equal(Sobol(2, 0).points(0, 8), Sobol(2, 1).points(0, 8))


def test_too_many_dimensions_are_refused():
    with pytest.raises(InputError, match=r"9 dimensions: must be from 1 to 8"):
        Sobol(9)
