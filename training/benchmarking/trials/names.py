"""Checks of names from the user, before any slow import or compilation."""

import shlex
from collections.abc import Sequence
from pathlib import Path

from poise.baselines.allowance import is_plugin, is_script
from poise.baselines.policy_files.known import GUARDS, RIVALS
from poise.baselines.policy_files.reading import advice, is_policy
from poise.baselines.policy_files.refused import check_not_refused
from poise.configs.errors import ConfigError, meant, shown
from poise.configs.files import packaged, resolve
from poise.configs.problems import Problem
from poise.configs.reading import is_file, is_folder
from poise.configs.texts import check_shown
from poise.envs.sensing.realism import level_names

NO_CONTROL = "zero"


def check_names(
    controllers: Sequence[str] = (),
    *,
    robot: str | None = None,
    suite: str | None = None,
    motion: str | None = None,
    realism: str | None = None,
    physics: str | None = None,
) -> None:
    """Raise ConfigError, which lists the choices, for an unknown name; see `check_name`."""
    if motion is not None and Path(motion).suffix == ".npz":  # a robot's motion
        motion = None
    if motion is not None and Path(motion).suffix.lower() == ".bvh" and is_file(motion):
        raise ConfigError(
            "is motion capture: import it first, by poise motion import "
            f"{shlex.quote(motion)} --robot {robot or 'ROBOT'} --out FILE.npz", source=motion,
            field="motion",
        )  # fmt: skip
    given = {"robots": robot, "suites": suite, "motions": motion, "physics": physics}
    for kind, name in given.items():
        if name is not None:
            resolve(kind, name)
    for name in () if realism is None else level_names(realism):
        resolve("realism", name)
    for name in controllers:
        check_name(name)


def check_name(name: str) -> None:
    """Raise ConfigError, which lists the choices, unless this may be the name of a controller.

    Nothing is loaded or compiled, so the named controller may still be invalid.
    """
    kinds = ("controllers", RIVALS, "policies", GUARDS)
    names = (*(name for kind in kinds for name in packaged(kind)), NO_CONTROL)
    if is_script(name) and is_file(name):
        raise ConfigError(f"a network alone does not say what its numbers mean; {advice(name)}",
                          source=name, field="controller")  # fmt: skip
    of_file = is_file(name) and Path(name).suffix in (".yaml", ".yml")
    if not (name in names or of_file or is_folder(name) or is_policy(name) or is_plugin(name)):
        check_not_refused(name)
        hint = meant(name, names) or ";"
        raise Problem("unknown controller", None, "controller", names, value=shown(name), hint=hint)
    check_shown(name, field="controller")


def check_policy_name(name: str) -> None:
    """Raise ConfigError unless a policy of `poise train` may be called so; as `check_name`."""
    names = packaged("policies")
    if name not in names and not is_folder(name):
        hint = meant(name, names) or ";"
        raise Problem("unknown policy", None, "policy", names, value=shown(name), hint=hint)
