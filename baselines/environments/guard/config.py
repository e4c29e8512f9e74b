"""The configuration of a guard: walker, recovery policy, and when one replaces the other."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.known import GUARDS, RIVALS
from poise.baselines.policy_files.reading import is_policy
from poise.baselines.registry import controller_config
from poise.configs.errors import ConfigError, meant, shown
from poise.configs.files import packaged, resolve
from poise.configs.reading import is_file, read_yaml
from poise.configs.schema import build, on_base


@dataclass(frozen=True)
class GuardConfig:
    """A walker, and a recovery policy that takes over from it.

    It takes over when the capture point is further than `margin` outside of the support polygon, or
    the root's tilt is beyond `tilt`. It hands back once the robot was calm for `calm_time`, by the
    measure of the policy's own `hand_over`; the walker then restarts, with its command.

    Attributes:
        walker: An external policy that follows a commanded velocity: a name or a path.
        recovery: A policy with servos that take over (`action: whole`): a packaged one, or a folder
            of poise train.
        margin: Distance of the capture point from the support polygon beyond which it takes over
            [m]; a walk leaves the polygon in every step, by less.
        tilt: Tilt of the root from standing beyond which it takes over [rad].
        calm_time: Time for which the robot must be calm before it hands back [s].
    """

    walker: str
    recovery: str
    kind: Literal["guard"] = "guard"
    margin: float = field(default=0.15, metadata={"min": 0.0})
    tilt: float = field(default=0.5, metadata={"above": 0.0, "max": 3.2})
    calm_time: float = field(default=0.2, metadata={"above": 0.0})


def is_guard(name: str | Path) -> bool:
    """Return whether `name` is a packaged guard, or a .yaml file of one."""
    if str(name) in packaged(GUARDS):
        return True
    return (
        Path(name).suffix in (".yaml", ".yml")
        and is_file(name)
        and read_yaml(Path(name)).get("kind") == GuardConfig.kind
    )


def guard_config(name: str | Path) -> GuardConfig:
    """Read a packaged guard or a path to one; fields that it omits are those of its `base`.

    Raises ConfigError naming the file, the field and the choices.
    """
    path = resolve(GUARDS, name)
    data = read_yaml(path)
    try:
        data = on_base(data, GUARDS, str(path))
    except ConfigError as error:  # of a base that is not there: of which file is said here
        raise ConfigError(error.message, source=error.source or path, field="base",
                          choices=error.choices) from None  # fmt: skip
    return build(GuardConfig, data, str(path))


def walker_config(guard: GuardConfig, source: str) -> PolicyFileConfig:
    """The configuration of the walker; raises ConfigError where it is no external policy."""
    name, walkers = guard.walker, packaged(RIVALS)
    if not (is_policy(name) or is_file(name) or name in packaged("controllers")):
        raise ConfigError(f"no such policy: {shown(name)}{meant(name, walkers)}", source=source,
                          field="walker", choices=walkers)  # fmt: skip
    config = controller_config(name)
    if not isinstance(config, PolicyFileConfig):
        raise ConfigError(f"{shown(name)} is of kind {config.kind!r}, no external policy",
                          source=source, field="walker", choices=walkers)  # fmt: skip
    return config
