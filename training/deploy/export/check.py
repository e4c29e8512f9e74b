"""Comparison of an exported file with the policy."""

from pathlib import Path
from typing import Final

import numpy as np

from poise.baselines.policy_files.networks import onnx_session
from poise.configs.errors import PoiseError
from poise.training.learning.policy import Policy

from .onnx_graph import INPUT, OUTPUT

COUNT: Final = 10_000  # observations
TOLERANCE: Final = 1e-6  # of an action


def observations(policy: Policy, count: int = COUNT, seed: int = 0) -> np.ndarray:
    """Return (count, no) float32 random observations, within what training met and far beyond.

    A third is normally distributed as the observations of the training; another third spreads over
    one and a half times the limits of the normalised observation, the rest over those of the raw
    one, ±10. All entries of some of the rows lie at their limits.
    """
    rng, size = np.random.default_rng(seed), len(policy.mean)
    third = count // 3
    met = policy.mean + rng.normal(size=(third, size)) / policy.scale
    reach = 1.5 * policy.clip / policy.scale
    beyond = policy.mean + reach * rng.uniform(-1.0, 1.0, (third, size))
    raw = rng.uniform(-10.0, 10.0, (count - 2 * third, size))
    raw[:10] = np.sign(raw[:10]) * 10.0
    return np.concatenate([met, beyond, raw]).astype(np.float32)


def check_onnx(path: Path, policy: Policy, count: int = COUNT) -> float:
    """Return the largest difference of an action from that of `Policy.predict`, which it returns.

    Raises PoiseError where it is more than `TOLERANCE`, or an action is not finite.
    """
    seen = observations(policy, count)
    (actions,) = onnx_session(path).run([OUTPUT], {INPUT: seen})
    return largest_difference(actions, policy.predict(seen)[0], TOLERANCE, path.name)


def largest_difference(
    actions: np.ndarray, expected: np.ndarray, tolerance: float, name: str
) -> float:
    """The largest difference; raises PoiseError where it is more than `tolerance`, or no number."""
    worst = float(np.abs(actions.astype(float) - expected.astype(float)).max())
    if not worst <= tolerance:  # NaN too
        raise PoiseError(
            f"{name}: its actions differ by {worst:.2g} from the policy's, more than "
            f"{tolerance:g}: nothing was written"
        )
    return worst
