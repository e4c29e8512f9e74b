"""Training a residual policy with Stable-Baselines3's PPO on the CPU."""

import shlex
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import VecNormalize

from poise.baselines.allowance import allow_words, allows
from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.reading import is_policy
from poise.baselines.registry import controller_config
from poise.baselines.warmup import prepare
from poise.configs.errors import ConfigError
from poise.configs.files import resolve, write_atomic
from poise.configs.outputs import check_out_folder
from poise.configs.schema import build, read_yaml, to_yaml
from poise.envs.balance.base import BalanceEnv
from poise.envs.robots.robot import Robot, load_robot
from poise.envs.robots.variants import coarser_robot
from poise.training.running.folder_lock import FolderLock, check_resume
from poise.training.running.stopping import keeps

from .callbacks import Checkpoints, Progress, RolloutLog
from .checkpoints import restore
from .config import TrainConfig
from .curriculum import ScheduleCallback, curriculum_levels
from .imported import import_policy
from .policy import locate_policy
from .policy_files import BEST, CONFIG, LAST, STATE, check_controller, find_checkpoint
from .symmetry import MirroredMeanStd, MirroredPolicy
from .vec_env import ThreadedVecEnv

#: fields of `PPOConfig` that SB3's PPO takes as they are
AS_CALLED = ("n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda", "clip_range", "ent_coef",
             "vf_coef", "max_grad_norm", "target_kl", "use_sde", "sde_sample_freq")  # fmt: skip
MAY_CHANGE = ("steps", "threads", "keep_every")  # of a configuration that a run goes on with


@allows()
def train(
    config: TrainConfig,
    out: str | Path,
    resume: bool = False,
    progress: bool = True,
    *,
    allow: str | Iterable[str] = (),
    callback: BaseCallback | Sequence[BaseCallback] = (),
) -> Path:
    """Train into the folder `out`; returns the folder of the best checkpoint.

    `out` gets config.yaml, evaluations.csv, tensorboard/, and the policy folders best/, last/ and,
    with `keep_every`, kept/STEPS.
    `resume` goes on from last/, which is written after every rollout; the configuration must be
    the same but for `steps`, `threads` and `keep_every`. A new run begins with the policy
    `config.start_from`, if there is one, of the same robot; its network may be smaller
    (`widened`). The same configuration gives the same weights, whatever the number of threads; a
    resumed run starts new episodes, and so differs. `callback`, one of Stable-Baselines3 or
    several, is also called, such as Weights & Biases' `WandbCallback`; one that only reads
    does not change the result. An external controller (``module:Class``)
    that the configuration names must be among `allow`.

    Raises ConfigError when `out` already holds a run and `resume` is off, or the other way
    round; when the configurations or robots differ; when a file of last/ cannot be read; for
    pushes that do not fit the robot; for an external controller that is not allowed. Raises
    PoiseError when another process writes to `out`, or a file cannot be written.
    """
    out = Path(out)
    checkpoint = checkpoint_of(config, out, resume)
    names = (allow,) if isinstance(allow, str) else allow
    again = ["poise", "train", "--out", str(out), "--resume", *allow_words(names)]
    keeps(out / LAST, f"what is trained is kept in {out}; go on with: {shlex.join(again)}")
    start = None if checkpoint else first_policy(config.start_from)
    curriculum_levels(config)  # refused before anything is compiled
    torch.set_num_threads(1)
    resolve("robots", config.robot)
    if config.controlled:  # else nothing of the controllers is called
        controller_config(config.controller)  # refused before anything is compiled
        prepare()
    with ExitStack() as stack:
        robot = load_robot(config.robot)
        normalize = _training_envs(config, robot)
        stack.callback(normalize.close)
        model = make_model(config, normalize)
        normalize.seed(_env_seed(config.seed))
        state: dict[str, Any] = {}
        stack.enter_context(FolderLock(out))
        checkpoint = checkpoint_of(config, out, resume)  # another run may have ended since
        if isinstance(start, Path):
            restore(start, model, normalize, robot.fingerprint, _seen(normalize))
        elif start is not None:
            import_policy(start, config.make_training_env(robot), model, normalize)
        if checkpoint is not None:
            state = restore(checkpoint, model, normalize, robot.fingerprint)
            check_controller(state, config, checkpoint / STATE)
            model.num_timesteps = state["timesteps"]
            seed = config.seed + model.num_timesteps
            model.set_random_seed(seed)
            normalize.seed(_env_seed(seed))
        write_atomic(out / CONFIG, to_yaml(config))
        model.set_logger(configure(str(out / "tensorboard"), ["tensorboard"]))
        bar = Progress(config)
        stack.callback(bar.close)
        checkpoints = Checkpoints(config, robot, out, state, bar.say)
        stack.callback(checkpoints.close)
        given = [callback] if isinstance(callback, BaseCallback) else list(callback)
        shown = [bar] if progress else []
        callbacks = [*shown, RolloutLog(), ScheduleCallback(config), checkpoints, *given]
        remaining = config.steps - model.num_timesteps
        if remaining > 0:
            model.learn(remaining, callback=callbacks, reset_num_timesteps=checkpoint is None)
    return out / BEST


def first_policy(name: str | None) -> Path | PolicyFileConfig | None:
    """Return the policy that a new run begins with: a folder, one from outside, or None.

    Raises ConfigError for a name of neither, and for a controller that is no policy.
    """
    if name is None:
        return None
    if not is_policy(name) and Path(name).suffix not in (".yaml", ".yml"):
        return locate_policy(name)
    config = controller_config(name)
    if not isinstance(config, PolicyFileConfig):
        raise ConfigError("is a controller, no policy: nothing can be learned from there",
                          source=name, field="start_from")  # fmt: skip
    return config


def make_model(config: TrainConfig, env: VecNormalize) -> PPO:
    """Return a PPO whose first policy is the controller alone: the mean's last layer is zero."""
    ppo = config.ppo

    def learning_rate(remaining: float) -> float:
        return ppo.final_learning_rate + remaining * (ppo.learning_rate - ppo.final_learning_rate)

    actor, critic = list(ppo.net_arch), list(ppo.critic_arch or ppo.net_arch)
    policy: dict[str, object] = {
        "net_arch": actor if actor == critic else {"pi": actor, "vf": critic},
        "activation_fn": torch.nn.ELU if ppo.activation == "elu" else torch.nn.Tanh,
        "log_std_init": ppo.log_std_init,
    }
    if ppo.symmetric:
        policy["mirrors"] = env.env_method("mirrors", indices=0)[0]
    model = PPO(
        MirroredPolicy if ppo.symmetric else "MlpPolicy",
        env,
        learning_rate=learning_rate,
        **{name: getattr(ppo, name) for name in AS_CALLED},
        policy_kwargs=policy,
        seed=config.seed,
        device="cpu",
        stats_window_size=500,
    )
    if config.env.observation.privileged:
        blind_actor(model.policy, _seen(env))
    if ppo.actor_rate < 1.0:
        slow_actor(model.policy, ppo.actor_rate)
    head = model.policy.action_net
    assert isinstance(head, torch.nn.Linear)
    with torch.no_grad():
        head.weight.zero_()
        head.bias.zero_()
    return model


def _seen(env: VecNormalize) -> int:
    """Return the number of observation entries that the actor sees."""
    return int(env.get_attr("seen", indices=0)[0])


def blind_actor(policy: ActorCriticPolicy, seen: int) -> None:
    """Let the actor see the first `seen` entries of an observation alone, the critic all.

    The actor's weights of the others are zero, and stay so.
    """

    def hide(layers: torch.nn.Module, given: tuple[torch.Tensor]) -> torch.Tensor:
        features = given[0].clone()
        features[..., seen:] = 0.0
        return features

    layers = policy.mlp_extractor.policy_net
    layers.register_forward_pre_hook(hide)
    first: Any = next(layers.children())
    with torch.no_grad():
        first.weight[:, seen:] = 0.0


def slow_actor(policy: ActorCriticPolicy, rate: float) -> None:
    """Let every step of the optimizer move the actor by `rate` of what it would, the critic by all.

    With Adam that is a learning rate of its own; the optimizer stays one that SB3 can load.
    """
    actor = [p for name, p in policy.named_parameters() if "value" not in name]
    before = [torch.empty_like(parameter) for parameter in actor]

    @torch.no_grad()
    def remember(*_: object) -> None:
        for old, parameter in zip(before, actor, strict=True):
            old.copy_(parameter)

    @torch.no_grad()
    def shorten(*_: object) -> None:
        for old, parameter in zip(before, actor, strict=True):
            parameter.copy_(torch.lerp(old, parameter, rate))

    policy.optimizer.register_step_pre_hook(remember)
    policy.optimizer.register_step_post_hook(shorten)


def _training_envs(config: TrainConfig, robot: Robot | None = None) -> VecNormalize:
    robot = robot or load_robot(config.robot)
    if config.physics_step is not None:
        robot = coarser_robot(robot, config.physics_step)
    env = config.make_training_env(robot)
    check_pushes(config, env)
    vec = ThreadedVecEnv(config.replicate(env, config.ppo.n_envs), config.threads)
    normalize = VecNormalize(vec, gamma=config.ppo.gamma, clip_obs=10.0, clip_reward=10.0)
    if config.ppo.symmetric:
        moments: Any = MirroredMeanStd(env.mirrors()[0])  # SB3's types say a mapping
        normalize.obs_rms = moments
    return normalize


def check_pushes(config: TrainConfig, env: BalanceEnv) -> None:
    """Raise ConfigError, naming the field, for pushes that do not fit the environment's robot."""
    margin = env.simulation.state.support_margin
    for section in ("env", "evaluation"):
        sampler = getattr(config, section).pushes
        if sampler is None:
            continue
        try:
            sampler.sample(np.random.default_rng(0), env.robot, margin)
        except ConfigError as error:
            name = error.source or error.field
            raise ConfigError(
                error.message, field=f"{section}.pushes.{name}", choices=error.choices
            ) from None


def _env_seed(seed: int) -> int:
    """Seed of the first environment; the others follow, and runs with neighbouring seeds differ."""
    return int(np.random.SeedSequence(seed).generate_state(1)[0])


def checkpoint_of(config: TrainConfig, out: Path, resume: bool) -> Path | None:
    """Return the checkpoint to go on from, or None for a new run; raises ConfigError as `train`."""
    check_out_folder(out)
    try:
        str(out).encode()
    except UnicodeEncodeError:
        raise ConfigError("must be a name in UTF-8: TensorBoard takes no other", source=out,
                          field="out") from None  # fmt: skip
    checkpoint = find_checkpoint(out / LAST)
    check_resume(out, resume, checkpoint is not None, "a training run", "run")
    if checkpoint is None:
        return None
    before = build(TrainConfig, read_yaml(checkpoint / CONFIG), str(checkpoint / CONFIG))
    different = [
        name for name in TrainConfig.__dataclass_fields__
        if name not in MAY_CHANGE and getattr(before, name) != getattr(config, name)
    ]  # fmt: skip
    if different:
        raise ConfigError(
            f"the run was started with another configuration ({', '.join(different)})",
            source=str(checkpoint / CONFIG),
            field=different[0],
        )
    return checkpoint
