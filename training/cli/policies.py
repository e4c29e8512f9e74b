"""`poise policies`: those of others, known and checked; policies, and what they do, written."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro

from poise.configs.errors import ConfigError, shown
from poise.training.running.options.arguments import Allow, OnRobot, PolicyName
from poise.training.running.options.parsing import answered
from poise.training.running.terminal import terminal

Checked = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]


def show() -> None:
    """List the known public policies, where they are installed, and how to get the others.

    Run each by its name: poise evaluate falcon-g1 --robot unitree_g1. For another policy,
    poise policies check FILE reports what is missing.
    """
    from poise.baselines.policy_files.known import known_policies
    from poise.training.deploy.policy_check.tables import print_policies

    print_policies(known_policies(), terminal())


def check(
    file: Checked, /, *, robot: OnRobot, rollout: Path | None = None, allow: Allow = ()
) -> int:
    """Check a policy: its description, standing for 10 s, and a rollout recorded by its authors.

    Args:
        file: a network (.onnx, .pt), a description (.yaml), a folder, or a known name.
        rollout: an .npz file of observations (T, n) and actions (T, na) of its maker's loop, and,
            if they are known, of the states qpos and qvel of this robot.

    Returns:
        0 if it is described, stands, and agrees with the rollout; else 1.
    """
    from poise.baselines.allowance import allowing
    from poise.envs.robots.robot import load_robot
    from poise.training.deploy.policy_check.check import check_policy
    from poise.training.deploy.policy_check.tables import print_policy_check

    with allowing(allow):
        found = check_policy(file, load_robot(robot), rollout,
                             lambda line: print(f"poise: {line}", file=sys.stderr))  # fmt: skip
    print_policy_check(found, terminal())
    return 0 if found.right else 1


def run_policies(args: Sequence[str]) -> int:
    """Run `poise policies`: the list, or the sub-command `check`."""
    if args and args[0] == "check":
        return answered(check, args[1:], "poise policies check")
    if args and not args[0].startswith("-"):
        raise ConfigError(f"no such command: policies {shown(args[0])}", choices=("check",))
    return answered(show, args, "poise policies")


def export(
    policy: PolicyName,
    /,
    *,
    out: Path,
    result: Path | None = None,
    licence: Annotated[str | None, tyro.conf.arg(metavar="LICENCE")] = None,
    allow: Allow = (),
) -> None:
    """Write a policy for other programs: ONNX, safetensors, Stable-Baselines3, a model card.

    The ONNX file is compared with the policy on 10,000 random observations first. The folder is
    one that Hugging Face takes as it is. Needs poise[export].

    Args:
        policy: a packaged policy (see poise list) or a folder written by poise train.
        out: folder to write to: new, or empty.
        result: a folder of poise evaluate or poise benchmark in which the policy took part, or its
            summary.json: its figures go into the card.
        licence: licence of the policy, by the abbreviation of Hugging Face; not needed for a
            packaged policy.
    """
    from poise.training.benchmarking.trials.names import check_policy_name

    check_policy_name(policy)
    from poise.training.deploy.export.export import export_policy

    worst = export_policy(policy, out, result=result, licence=licence, allow=allow)
    print(f"{out}: ONNX differs from the policy by {worst:.1g} at most")


def dataset(
    controller: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="CONTROLLER")],
    /,
    *,
    out: Path,
    name: str = "poise/pushes-v0",
    suite: str = "strong",
    trials: int | None = None,
    robot: OnRobot = "humanoid",
    seed: int = 0,
    allow: Allow = (),
) -> None:
    """Write trials as a data set of Minari: observations, actions, rewards, the push as arrays.

    Needs poise[dataset].

    Args:
        controller: a controller as poise evaluate takes it; the data are of its environment.
        out: folder to write to: new, or empty; MINARI_DATASETS_PATH for what reads it.
        name: name of the data set, namespace/name-v0.
        suite: suite of pushes: a packaged one or a .yaml file.
        trials: number of episodes; the suite's if not given.
        seed: seed of the trials.
    """
    from poise.training.benchmarking.trials.names import check_names

    check_names([controller], robot=robot, suite=suite)
    from poise.training.deploy.export.dataset import write_dataset

    found = write_dataset(controller, out, name=name, suite=suite, robot=robot, trials=trials,
                          seed=seed, allow=allow)  # fmt: skip
    print(f"{out}: {name}, {found['episodes']} episodes, {found['steps']} steps, "
          f"{found['recovered']} recovered")  # fmt: skip
