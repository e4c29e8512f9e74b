"""One interface to all methods of inverse kinematics."""

from collections.abc import Mapping, Sequence

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.configs.numbers import finite_array, whole_number
from poise.configs.problems import out_of_range
from poise.envs.compiled.copies import Copyable
from poise.envs.robots.robot import Robot

from .bounded import Objective, solve_bounded
from .chain import Chain
from .goals import IkGoal, IkOptions, IkResult, Misses
from .prior import PosePrior
from .steps import STEPS

BOUNDED = "bounded"
METHODS = (BOUNDED, *STEPS)
SAMPLES = 32  # random postures of which the nearest is a restart
PRIOR_WEIGHT = 1e-5  # [m²] of the prior's cost beside ½‖e‖²
SLACK = 1e-9  # [rad] beyond a limit that is rounding


class InverseKinematics(Copyable):
    """Finds postures of one robot in which some of its bodies reach goals and one stays.

    Args:
        robot: whose joints move.
        ends: bodies that are to reach goals, in the order of the goals; one may be there twice.
        base: the body that stays where it is; the root, if none is named.
        method: `bounded` keeps limits as bounds; `ccd`, `jacobian-transpose`, `gauss-newton` and
            `damped` clip to them.
        mobility: joint, or a pattern of names, → share from 0, which stands still, to 1.
        along: bodies whose joints may move as well, without a goal: a prior has a say in them.
        prior: how usual postures are, for `bounded`; over all joints of the robot.
        prior_weight: w [m²] of its cost.
        options: see `IkOptions`.

    Raises:
        ConfigError: an unknown body, joint or method, a share out of range, no joint that may
            move, a prior for another method or of other joints.
    """

    def __init__(
        self,
        robot: Robot,
        ends: Sequence[str],
        *,
        base: str | None = None,
        method: str = BOUNDED,
        mobility: Mapping[str, float] | None = None,
        along: Sequence[str] = (),
        prior: PosePrior | None = None,
        prior_weight: float = PRIOR_WEIGHT,
        options: IkOptions | None = None,
    ):
        if method not in METHODS:
            raise ConfigError(f"no such method: {shown(method)}", field="method", choices=METHODS)
        if prior is not None and method != BOUNDED:
            raise ConfigError(f"{method!r} takes no prior", field="prior", choices=(BOUNDED,))
        if prior is not None and prior.mean.shape != (len(robot.joint_names),):
            raise ConfigError(f"is over {len(prior.mean)} joints, {robot.name!r} has "
                              f"{len(robot.joint_names)}", field="prior")  # fmt: skip
        if not 0.0 <= prior_weight < np.inf:
            raise out_of_range(prior_weight, field="prior_weight", least=0, form="g")
        self.robot, self.method, self.options = robot, method, options or IkOptions()
        self.prior, self.prior_weight = prior, prior_weight
        self.names = tuple(ends)
        self.chain = Chain(robot, base or robot.description.root, ends, mobility, along)

    def solve(
        self,
        goals: Sequence[IkGoal],
        start: np.ndarray | None = None,
        *,
        restarts: int = 0,
        seed: int = 0,
    ) -> IkResult:
        """The posture that comes nearest to the goals, begun at `start` (nq,) or standing.

        Where the goals are not reached, up to `restarts` more starts follow: each the nearest to
        the goals of 32 random postures within the limits. With a prior, which goals never quite
        outweigh, all are tried and the best of them counts.

        Raises:
            ConfigError: goals of other bodies, a start that is no posture of the robot, counts
                below 0.
        """
        if tuple(goal.body for goal in goals) != self.names:
            raise ConfigError("must be those of the ends, in their order", field="goals",
                              choices=self.names)  # fmt: skip
        whole_number(restarts, 0, "restarts")
        rng = np.random.default_rng(whole_number(seed, 0, "seed"))
        whole = self._posture(start)
        self.chain.place(whole)
        misses = Misses(self.chain, goals, self.options.lever)
        objective = Objective(misses, self.prior, self.prior_weight)
        best, count, taken = self.chain.q.copy(), 0, 0
        least, first = np.inf, self.chain.clipped(best) if self.options.limits else best
        for count in range(1, restarts + 2):
            if count > 1:
                chances = rng.uniform(*self.chain.free, (SAMPLES, len(self.chain.qpos)))
                first = min(chances, key=objective.value)
            if self.method == BOUNDED:
                q, steps = solve_bounded(objective, first, self.options)
            else:
                q, steps = self._step_by_step(misses, first)
            taken += steps
            if (value := objective.value(q)) < least:
                best, least = q, value
            if self.prior is None and self._residual(misses, best) <= self.options.tolerance:
                break
        residual = self._residual(misses, best)
        within = bool(np.all(np.abs(best - self.chain.clipped(best)) <= SLACK))
        return IkResult(self.chain.whole(best, whole), residual, taken, count,
                        residual <= self.options.tolerance, within, least)  # fmt: skip

    def _step_by_step(self, misses: Misses, q: np.ndarray) -> tuple[np.ndarray, int]:
        """Steps until the goals are reached, or the residual becomes no smaller."""
        best, least, since, taken = q, self._residual(misses, q), 0, 0
        while taken < self.options.iterations and since < self.options.patience:
            if least <= self.options.tolerance:
                break
            step = STEPS[self.method](misses, self.options)
            step *= min(1.0, self.options.largest_step / max(np.abs(step).max(), 1e-300))
            q = self.chain.clipped(q + step) if self.options.limits else q + step
            residual, taken, since = self._residual(misses, q), taken + 1, since + 1
            if residual < least:
                best, least, since = q, residual, 0
        return best, taken

    def _residual(self, misses: Misses, q: np.ndarray) -> float:
        self.chain.move(q)
        return misses.residual()

    def _posture(self, start: np.ndarray | None) -> np.ndarray:
        if start is None:
            return self.robot.standing_qpos.copy()
        posture = finite_array(start, self.robot.standing_qpos.shape)
        if posture is None:
            raise ConfigError(f"must be {len(self.robot.standing_qpos)} finite numbers",
                              field="start")  # fmt: skip
        return posture


def solve_ik(
    robot: Robot,
    goals: Sequence[IkGoal],
    *,
    base: str | None = None,
    start: np.ndarray | None = None,
    method: str = BOUNDED,
    mobility: Mapping[str, float] | None = None,
    along: Sequence[str] = (),
    prior: PosePrior | None = None,
    options: IkOptions | None = None,
    restarts: int = 0,
    seed: int = 0,
) -> IkResult:
    """The posture of a robot that comes nearest to goals; one call of `InverseKinematics`."""
    solver = InverseKinematics(robot, [goal.body for goal in goals], base=base, method=method,
                               mobility=mobility, along=along, prior=prior,
                               options=options)  # fmt: skip
    return solver.solve(goals, start, restarts=restarts, seed=seed)
