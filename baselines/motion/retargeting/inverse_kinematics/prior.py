"""How usual a posture is, by the principal components of postures that were seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from poise.configs.errors import ConfigError
from poise.configs.numbers import real_array

LEAST = 1e-3  # [rad] of ρ


@dataclass(frozen=True, eq=False)
class PosePrior:
    """A normal distribution of postures by its principal components [Notes, lecture 6].

    −2 log p(x) = Σ_k ((u_k·(x − x̄))/σ_k)² + ‖r‖²/ρ² + a constant, r what the components leave of
    x − x̄. The notes have the sum alone, which is ρ = ∞: then most directions cost nothing, and a
    posture may go anywhere along them. A finite ρ is probabilistic PCA [Tipping99].

    Attributes:
        mean: (n,) x̄ [rad].
        components: (k, n) unit vectors u_k, that of the largest variance first.
        deviations: (k,) σ_k [rad], above 0.
        explained: the share of the whole variance that they have.
        rest: ρ [rad], the standard deviation along every direction that they leave.
    """

    mean: np.ndarray
    components: np.ndarray
    deviations: np.ndarray
    explained: float
    rest: float = np.inf

    def __post_init__(self) -> None:
        for array in (self.mean, self.components, self.deviations):
            array.setflags(write=False)

    @classmethod
    def fit(cls, postures: np.ndarray, variance: float = 0.95, *, rest: bool = True) -> PosePrior:
        """The fewest components that have a share `variance` of the variance.

        Args:
            postures: (F, n) joint positions [rad], at least two of them different.
            variance: above 0 and at most 1.
            rest: whether what the components leave costs anything: ρ² is then the mean of the
                variances that are left, at least (1e-3 rad)².

        Raises:
            ConfigError: other postures, or another share.
        """
        array = real_array(postures)
        if array is None or array.ndim != 2 or len(array) < 2 or not np.isfinite(array).all():
            raise ConfigError("must be two or more postures of finite numbers", field="postures")
        if not 0.0 < variance <= 1.0:
            raise ConfigError(f"must be above 0 and at most 1, not {variance:g}", field="variance")
        mean = array.mean(axis=0)
        _, values, rows = np.linalg.svd(array - mean, full_matrices=False)
        variances = values**2 / (len(array) - 1)
        if not variances[0] > 1e-18:
            raise ConfigError("are all the same", field="postures")
        rank = int(np.sum(variances > 1e-12 * variances[0]))
        shares = np.cumsum(variances[:rank]) / variances.sum()
        count = min(int(np.searchsorted(shares, variance - 1e-12)) + 1, rank)
        left = variances[count:].sum() / max(array.shape[1] - count, 1)
        return cls(mean, rows[:count].copy(), np.sqrt(variances[:count]), float(shares[count - 1]),
                   max(float(np.sqrt(left)), LEAST) if rest else np.inf)  # fmt: skip

    @property
    def whitening(self) -> np.ndarray:
        """W (k, n), rows u_k/σ_k, and below them, for a finite ρ, (I − Σ u_k u_kᵀ)/ρ (n, n)."""
        rows = self.components / self.deviations[:, None]
        if np.isinf(self.rest):
            return rows
        left = np.eye(len(self.mean)) - self.components.T @ self.components
        return np.concatenate([rows, left / self.rest])

    def cost(self, posture: np.ndarray) -> np.ndarray:
        """‖W (x − x̄)‖² of postures (…, n): 0 for the mean, and over those that were fitted as a
        mean the number of their directions."""
        return (((np.asarray(posture) - self.mean) @ self.whitening.T) ** 2).sum(axis=-1)

    def projected(self, posture: np.ndarray) -> np.ndarray:
        """The nearest postures (…, n) that the components make: x̄ + Σ_k u_k (u_k·(x − x̄))."""
        return self.mean + (posture - self.mean) @ self.components.T @ self.components
