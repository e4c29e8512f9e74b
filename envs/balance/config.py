"""The configuration of an environment: pushes, start, fall, reward and time."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from poise.configs.errors import ConfigError, shown
from poise.configs.files import resolve
from poise.configs.schema import build, read_yaml, to_dict
from poise.envs.physics.engines.config import Physics, load_physics
from poise.envs.physics.pushes.sampler import PushSampler
from poise.envs.sensing.config import EstimatorConfig
from poise.envs.sensing.realism import Realism, load_realism
from poise.envs.terrain.flat import Flat
from poise.envs.terrain.terrain import Terrain

from .mdp.reward import RewardWeights
from .mdp.termination import FallLimits
from .start import StartNoise as StartNoise

OMIT = {"omit": "default"}  # from files, while a field has its default


class UnknownArgument(ConfigError, TypeError):
    """An argument that the environment does not have. A TypeError too, as of any function.

    TorchRL gives every environment arguments of its own, and takes back what raises a TypeError.
    """


@dataclass(frozen=True)
class ObservationConfig:
    """The terms that an observation is made of, by name and in this order.

    Attributes:
        terms: Terms of the observation by name, in this order; None: the environment's own.
        extra: Terms of the observation that come after those.
        history: Policy steps that the observation shows, all terms of a step side by side, the
            oldest first.
        history_stride: How many times the policy runs in the `policy_period` that it was trained
            with; the frames of the observation are that period apart, see `Interleaving`.
        privileged: Terms of this step that come last, of the true robot in its true state: for a
            critic that observes more than the policy [Pinto18].
    """

    terms: tuple[str, ...] | None = None
    extra: tuple[str, ...] = ()
    history: int = field(default=1, metadata={"min": 1, "max": 100, "omit": "default"})
    history_stride: int = field(default=1, metadata={"min": 1, "max": 100, "omit": "default"})
    privileged: tuple[str, ...] = field(default=(), metadata=OMIT)


@dataclass(frozen=True)
class EnvConfig:
    """Everything about an environment that is not its robot or its controller.

    A field that came later is left out of files while it has its default, with which environments
    are as they were before: fingerprints of policies hash these files.

    Attributes:
        policy_period: Time between two actions [s].
        duration: Length of an episode [s].
        pushes: Pushes that are drawn at a reset; None: none.
        noise: Disturbance of the start.
        fallen: Fraction of the episodes that begin on the ground, in one of `FALLEN_POSTURES`.
        fall: When the robot has fallen, and when it is quiet.
        reward: Weights of the reward's terms.
        observation: What the observation is made of.
        realism: How real sensors, motors, body and ground are: a level by name, file or fields.
        estimator: How the state is estimated where it is not known exactly.
        terrain: What the robot stands on.
        physics: What engine steps the robot: a name, a file or fields.
        clip_action: Take actions beyond [-1, 1] as 1 or -1, instead of refusing them.
    """

    policy_period: float = field(default=0.02, metadata={"above": 0.0, "max": 1.0})
    duration: float = field(default=6.0, metadata={"above": 0.0, "max": 1e6})
    pushes: PushSampler | None = field(
        default_factory=lambda: PushSampler(magnitude=(0.2, 0.5), unit="specific_impulse")
    )
    noise: StartNoise = field(default_factory=StartNoise)
    fallen: float = field(default=0.0, metadata={"min": 0.0, "max": 1.0, **OMIT})
    fall: FallLimits = field(default_factory=FallLimits)
    reward: RewardWeights = field(default_factory=RewardWeights)
    observation: ObservationConfig = field(default_factory=ObservationConfig, metadata=OMIT)
    realism: Realism = field(default_factory=Realism, metadata=OMIT)
    estimator: EstimatorConfig = field(default_factory=EstimatorConfig, metadata=OMIT)
    terrain: Terrain = field(default_factory=Flat, metadata=OMIT)
    physics: Physics = field(default_factory=Physics, metadata=OMIT)
    clip_action: bool = field(default=False, metadata=OMIT)


def env_config(config: EnvConfig | str | Path | Mapping | None, **overrides: object) -> EnvConfig:
    """An EnvConfig from a .yaml file, a mapping or an object; `overrides` win.

    `terrain` may be the name of a kind alone, `realism` that of a level, `estimator` that of a
    kind, `physics` that of an engine.

    Raises ConfigError naming the file, the field and the choices, UnknownArgument for an override
    that is no field.
    """
    for name in overrides:
        if name not in EnvConfig.__dataclass_fields__:
            raise UnknownArgument(
                f"unexpected keyword argument {shown(name)}",
                source="environment",
                choices=EnvConfig.__dataclass_fields__,
            )
    source = "environment"
    if isinstance(config, (str, Path)):
        path = resolve("envs", config)
        config, source = read_yaml(path), str(path)
    fields = {} if config is None else to_dict(config)
    if not isinstance(fields, Mapping):
        raise ConfigError(
            f"must be an EnvConfig, a file or a mapping, not {shown(config)}",
            source=source,
            field="config",
            choices=EnvConfig.__dataclass_fields__,
        )
    overrides = {name: to_dict(value) for name, value in overrides.items()}
    merged = {**fields, **overrides}
    if "realism" in merged:
        merged["realism"] = to_dict(load_realism(merged["realism"]))
    if "physics" in merged:
        merged["physics"] = to_dict(load_physics(merged["physics"]))
    if isinstance(merged.get("estimator"), str):
        merged["estimator"] = {"kind": merged["estimator"]}
    if isinstance(merged.get("terrain"), str):
        merged["terrain"] = {"kind": merged["terrain"]}
    return build(EnvConfig, merged, source)
