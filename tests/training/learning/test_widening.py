"""A larger network that begins as a smaller one."""

from itertools import pairwise

import pytest
import torch

from poise.training.learning.checkpoints import widened


def network(*widths, seed):
    torch.manual_seed(seed)
    layers = []
    for before, after in pairwise(widths):
        layers += [torch.nn.Linear(before, after), torch.nn.Tanh()]
    return torch.nn.Sequential(*layers)


@pytest.mark.parametrize("widths", [(5, 7, 6, 2), (5, 12, 6, 2), (5, 7, 11, 2), (5, 12, 11, 2)])
def test_the_larger_network_computes_the_same(widths):
    """On any input; with the weights that it had it computed something else."""
    small, large = network(5, 7, 6, 2, seed=0), network(*widths, seed=1)
    given = torch.randn(40, 5)
    assert (large(given) - small(given)).abs().max() > 0.01
    large.load_state_dict(widened(small.state_dict(), large.state_dict()))
    torch.testing.assert_close(large(given), small(given), rtol=0.0, atol=1e-6)


def test_what_it_is_given_may_lie_anywhere():
    """The small network sees the part of a longer input before an entry, and nothing else."""
    small, large = network(5, 7, 2, seed=0), network(16, 12, 2, seed=1)
    large.load_state_dict(widened(small.state_dict(), large.state_dict(), 11))
    given = torch.randn(40, 16)
    torch.testing.assert_close(large(given), small(given[:, 6:11]), rtol=0.0, atol=1e-6)
    with pytest.raises(ValueError, match=r"0\.weight sees 5 numbers, not 4 or less"):
        widened(small.state_dict(), large.state_dict(), 4)


def test_new_units_can_learn():
    """What comes into them is not zero, and what goes out of them has a slope."""
    small, large = network(5, 7, 2, seed=0), network(5, 12, 2, seed=1)
    large.load_state_dict(widened(small.state_dict(), large.state_dict()))
    large(torch.randn(40, 5)).sum().backward()
    assert large[0].weight[7:].abs().min() > 0.0
    assert large[2].weight.grad[:, 7:].abs().min() > 0.0


@pytest.mark.parametrize(
    ("widths", "said"),
    [((5, 6, 2), r"0\.weight has shape \(7, 5\), not \(6, 5\)"), ((5, 7, 7, 2), "other layers")],
)
def test_a_network_that_cannot_hold_it_is_refused(widths, said):
    """Fewer units, or another number of layers."""
    small, large = network(5, 7, 2, seed=0), network(*widths, seed=1)
    with pytest.raises(ValueError, match=said):
        widened(small.state_dict(), large.state_dict())
