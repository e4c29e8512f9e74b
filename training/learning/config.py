"""Everything that decides a training run; written beside its results."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.tempo import Tempo
from poise.baselines.balance.stepping.planning.config import CaptureStepConfig
from poise.baselines.environments.hand_over import HandOverConfig
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.scales import ResidualScales, StepScales
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.environments.velocity import VelocityEnv
from poise.baselines.environments.walking import ResidualWalkEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.baselines.registry import ControllerConfig, controller_config
from poise.baselines.walking.calibration import Calibration
from poise.baselines.walking.schedule import CommandSampler
from poise.configs.files import resolve
from poise.configs.schema import build, on_base, read_yaml
from poise.envs.balance.base import BalanceEnv, EnvConfig
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.servos import ServoConfig
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.balance.vector.batch import replicate
from poise.envs.physics.pushes.sampler import PushSampler
from poise.envs.robots.robot import Robot

MOST_STEPS = 4_000_000  # of a rollout, which is kept in memory
MOST_SEED = 2**31 - 1  # that torch and NumPy take, also with a run's steps added


@dataclass(frozen=True)
class PPOConfig:
    """Stable-Baselines3's PPO, its names.

    Attributes:
        n_envs: Environments that are stepped side by side.
        n_steps: Policy steps of each environment in a rollout, after which the policy is updated.
        batch_size: Samples of one gradient step.
        n_epochs: Passes over a rollout in its update.
        learning_rate: Step size of Adam at the start.
        final_learning_rate: Step size of Adam at the end of the run; it falls linearly in between.
        actor_rate: Learning rate of the actor over that of the critic: small for an actor that is
            already trained.
        gamma: Discount γ of a reward that comes one policy step later.
        gae_lambda: Decay λ of advantage estimation: 1 for returns alone, 0 for one step and the
            critic.
        clip_range: Relative change of an action's probability beyond which the loss is clipped.
        ent_coef: Weight of the policy's entropy in the loss.
        vf_coef: Weight of the critic's error in the loss.
        max_grad_norm: Norm at which a gradient is clipped.
        target_kl: The update of a rollout ends where the KL divergence exceeds 1.5 times this;
            None: never.
        net_arch: Widths of the actor's hidden layers, and of the critic's unless it has its own.
        critic_arch: Widths of the critic's hidden layers; None: as the actor's.
        activation: Function between the layers of actor and critic.
        log_std_init: Logarithm of the exploration's standard deviation at the start.
        log_std_final: The same at the end of the run, linear in time in between; None: it is
            learned.
        use_sde: Explore by noise that is smooth in the state, as SB3's gSDE.
        sde_sample_freq: Policy steps after which that noise is resampled; -1: once per rollout.
        symmetric: Make the policy its own mirror image, see `symmetry.py`: each push teaches two.
    """

    n_envs: int = field(default=32, metadata={"min": 1, "max": 4096})
    n_steps: int = field(default=128, metadata={"min": 1})
    batch_size: int = field(default=1024, metadata={"min": 2})
    n_epochs: int = field(default=8, metadata={"min": 1})
    learning_rate: float = field(default=3e-4, metadata={"above": 0.0})
    final_learning_rate: float = field(default=5e-5, metadata={"min": 0.0})
    actor_rate: float = field(default=1.0, metadata={"above": 0.0, "max": 1.0, "omit": "default"})
    gamma: float = field(default=0.99, metadata={"above": 0.0, "max": 1.0})
    gae_lambda: float = field(default=0.95, metadata={"min": 0.0, "max": 1.0})
    clip_range: float = field(default=0.2, metadata={"above": 0.0})
    ent_coef: float = field(default=0.0, metadata={"min": 0.0})
    vf_coef: float = field(default=0.5, metadata={"min": 0.0})
    max_grad_norm: float = field(default=0.5, metadata={"above": 0.0})
    target_kl: float | None = field(default=None, metadata={"above": 0.0})
    net_arch: tuple[int, ...] = (128, 128)
    critic_arch: tuple[int, ...] | None = field(default=None, metadata={"omit": "default"})
    activation: Literal["tanh", "elu"] = field(default="tanh", metadata={"omit": "default"})
    log_std_init: float = -1.5
    log_std_final: float | None = None
    use_sde: bool = False
    sde_sample_freq: int = field(default=16, metadata={"min": -1})
    symmetric: bool = False

    def __post_init__(self):
        if self.symmetric and self.use_sde:
            raise ValueError("symmetric: not with use_sde")
        if self.n_envs * self.n_steps < 2:
            raise ValueError("n_envs × n_steps must be at least 2")
        if self.n_envs * self.n_steps > MOST_STEPS:
            raise ValueError(f"n_envs × n_steps must be at most {MOST_STEPS}")
        for name, widths in (("net_arch", self.net_arch), ("critic_arch", self.critic_arch or ())):
            if len(widths) > 16 or not all(1 <= width <= 4096 for width in widths):
                raise ValueError(f"{name}: at most 16 widths from 1 to 4096")


@dataclass(frozen=True)
class Curriculum:
    """Pushes and errors of the robot grow to their final size over a fraction of the run.

    Attributes:
        start: Largest push at the start of the run, over its final size.
        realism: Realism level at the start of the run, as a fraction of the final one: see
            `Realism.scaled`.
        mixed: Train environment k of n under (k + ½)/n of the level, and not all under the whole.
        levels: Realism levels assigned to the environments in turn, in place of `env.realism`;
            evaluations keep `env.realism`.
        share: Fraction of the run over which both grow.
    """

    start: float = field(default=1.0, metadata={"above": 0.0, "max": 1.0})
    realism: float = field(default=1.0, metadata={"above": 0.0, "max": 1.0, "omit": "default"})
    mixed: bool = field(default=False, metadata={"omit": "default"})
    levels: tuple[str, ...] = field(default=(), metadata={"omit": "default"})
    share: float = field(default=0.3, metadata={"min": 0.0, "max": 1.0})


@dataclass(frozen=True)
class EvaluationConfig:
    """Held-out pushes that the deterministic policy meets during training.

    Attributes:
        every: Environment steps from one evaluation to the next.
        trials: Held-out pushes of each evaluation.
        seed: Seed of the held-out pushes, which are never used for training.
        pushes: Distribution of the held-out pushes; None: that of training.
    """

    every: int = field(default=200_000, metadata={"min": 1})
    trials: int = field(default=128, metadata={"min": 1, "max": 100_000})
    seed: int = field(default=1_000_003, metadata={"min": 0, "max": MOST_SEED})
    pushes: PushSampler | None = None


@dataclass(frozen=True)
class TrainConfig:
    """A policy that moves a controller's targets, its steps too, or gives the torques itself.

    With `action` "step" the environment is `poise/ResidualStep-v0`, and `step_residual` is what an
    action adds instead of `residual`; with "walk" `poise/ResidualWalk-v0`, with these too and
    the `command` that it is given; with "whole" it is `poise/ResidualWhole-v0`, with these
    `servos` and `hand_over` and no `residual`. With "torque" it is `poise/TorqueBalance-v0`, with
    "position" `poise/PositionBalance-v0` with these `servos`, with "velocity" `poise/Velocity-v0`
    with these and the `command` that it follows; then controller, motions and their
    tempo, both residuals, smoothing and gate are not used.

    Attributes:
        robot: Robot to train on: a packaged one (see poise list) or a .yaml description.
        action: What the policy moves: a controller's targets (residual), its steps too (step), a
            walk (walk), servos that take over (whole); or all torques or joint positions by itself
            (torque, position), the latter as commanded, too (velocity).
        controller: Controller below the policy: a packaged one or a .yaml file of one.
        motion: Motion that is performed: a packaged one, a .yaml, or a .npz of poise motion import.
        motions: Motions that the environments perform in turn, one each, instead of `motion`.
        tempo: Whether the motion's time waits for the robot.
        seed: Seed of the weights, the pushes and the exploration.
        steps: Environment steps to train for, in all.
        threads: Threads that step the environments; the result is the same for any number.
        keep_every: Environment steps after which a policy is kept for learning curves; None: none
            is kept.
        start_from: Policy to begin with: a packaged one, a folder of poise train, or one from
            outside; None: the controller alone.
        env: The environment.
        residual: What an action of 1 adds to each target, with `action` residual.
        step_residual: The same with `action` step or walk.
        command: The commands of a walk.
        calibration: What the policy observes in the place of a command, with `action` velocity.
        servos: The servos of `action` position, velocity or whole.
        hand_over: When the servos take over, with `action` whole.
        physics_step: Physics step of the training episodes [s]; None: the robot's own, in which
            policies are evaluated.
        smoothing: Time constant τ of the low-pass that an action goes through [s].
        gate: Distance of the capture point from its reference below which the action fades out [m].
        ppo: Stable-Baselines3's PPO.
        curriculum: How pushes and the realism level grow over the run.
        evaluation: Held-out pushes during the run.
    """

    robot: str = "humanoid"
    action: Literal["residual", "step", "walk", "whole", "torque", "position", "velocity"] = (
        "residual"
    )
    controller: str = "momentum-qp"
    motion: str = "standing"
    motions: tuple[str, ...] = field(default=(), metadata={"omit": "default"})
    tempo: Tempo = field(default_factory=Tempo, metadata={"omit": "default"})
    seed: int = field(default=0, metadata={"min": 0, "max": MOST_SEED})
    steps: int = field(default=3_000_000, metadata={"min": 1})
    threads: int = field(default=2, metadata={"min": 1})
    keep_every: int | None = field(default=None, metadata={"min": 1, "omit": "default"})
    start_from: str | None = None
    env: EnvConfig = field(default_factory=EnvConfig)
    residual: ResidualScales = field(default_factory=ResidualScales)
    step_residual: StepScales = field(default_factory=StepScales)
    command: CommandSampler = field(default_factory=CommandSampler, metadata={"omit": "default"})
    calibration: Calibration = field(default_factory=Calibration, metadata={"omit": "default"})
    servos: ServoConfig = field(default_factory=ServoConfig)
    hand_over: HandOverConfig = field(default_factory=HandOverConfig, metadata={"omit": "default"})
    physics_step: float | None = field(default=None, metadata={"above": 0.0, "max": 0.01})
    smoothing: float = field(default=0.0, metadata={"min": 0.0})
    gate: float = field(default=0.0, metadata={"min": 0.0})
    ppo: PPOConfig = field(default_factory=PPOConfig)
    curriculum: Curriculum = field(default_factory=Curriculum)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)

    @property
    def controlled(self) -> bool:
        """Whether a controller is below the policy."""
        return self.action not in ("torque", "position", "velocity")

    def make_training_env(self, robot: Robot | None = None, **overrides: Any) -> BalanceEnv:
        """Return `make_env` with terms that only the critic observes: `observation.privileged`."""
        return self.make_env(robot, **{"observation": self.env.observation, **overrides})

    def make_env(self, robot: Robot | None = None, **overrides: Any) -> BalanceEnv:
        """Return the environment of this run; `overrides` replace its arguments or fields of `env`.

        A loaded `robot` spares loading it again. What the critic alone sees is left out. Raises
        ConfigError for an external controller that the user has not allowed, see `allowing`.
        """
        if self.env.observation.privileged and "observation" not in overrides:
            overrides["observation"] = replace(self.env.observation, privileged=())
        if self.action == "torque":
            return TorqueBalanceEnv(robot or self.robot, self.env, **overrides)
        if self.action == "position":
            arguments = {"servos": self.servos, **overrides}
            return PositionBalanceEnv(robot or self.robot, self.env, **arguments)
        if self.action == "velocity":
            own = {"servos": self.servos, "command": self.command}
            arguments = {**own, "calibration": self.calibration, **overrides}
            return VelocityEnv(robot or self.robot, self.env, **arguments)
        if "controller" not in overrides:  # an environment takes a name for what the user says
            overrides["controller"] = self.controller_below()
        kinds: dict[str, tuple[type[ResidualBalanceEnv], dict[str, Any]]] = {
            "residual": (ResidualBalanceEnv, {"residual": self.residual}),
            "step": (ResidualStepEnv, {"residual": self.step_residual}),
            "walk": (ResidualWalkEnv, {"residual": self.step_residual, "command": self.command}),
            "whole": (ResidualWholeEnv, {"servos": self.servos, "hand_over": self.hand_over}),
        }
        kind, own = kinds[self.action]
        common = {"motion": (*self.motions, self.motion)[0], "tempo": self.tempo,
                  "smoothing": self.smoothing, "gate": self.gate}  # fmt: skip
        return kind(robot or self.robot, self.env, **{**common, **own, **overrides})

    def controller_below(self) -> ControllerConfig:
        """The controller below; what was learned where it is uncertain was learned on its gains."""
        config = controller_config(self.controller)
        if self.env.realism.uncertain and isinstance(config, CaptureStepConfig):
            return replace(config, uncertain=None)
        return config

    def replicate(self, env: BalanceEnv, count: int) -> list[BalanceEnv]:
        """`env` and more like it, `count` in all; with `motions` they perform these in turn.

        Raises ConfigError for a motion that there is not, or not for this robot.
        """
        envs = replicate(env, count)
        references = [load_motion(name, env.robot) for name in self.motions]
        for i, each in enumerate(envs):
            if references and isinstance(each, ResidualBalanceEnv):
                each.motion = references[i % len(references)]
        return envs


def train_config(name_or_path: str | Path) -> TrainConfig:
    """Return a packaged training configuration (`configs/training`) or a path to one.

    `base` in it names another one, whose fields hold where it has none of its own. Raises
    ConfigError naming the file, the field and the choices.
    """
    path = resolve("training", name_or_path)
    return build(TrainConfig, on_base(read_yaml(path), "training", path), str(path))
