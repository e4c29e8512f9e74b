"""The sub-commands that write a policy, or what it does, for other programs."""

from pathlib import Path
from typing import Annotated

import tyro

from .arguments import Allow, PolicyName


def export(
    policy: PolicyName,
    /,
    *,
    out: Path,
    result: Path | None = None,
    licence: str | None = None,
    allow: Allow = (),
) -> None:
    """Write a policy for other programs: ONNX, safetensors, Stable-Baselines3, a model card.

    The ONNX file is compared with the policy on 10,000 random observations first. The folder is
    one that Hugging Face takes as it is. Needs pip install -e '.[export]' in a checkout.

    Args:
        policy: a packaged policy (see poise list) or a folder written by poise train.
        out: folder to write to: new, or empty.
        result: a folder of poise evaluate or poise benchmark in which the policy took part, or its
            summary.json: its figures go into the card.
        licence: of the policy, as Hugging Face abbreviates it; of a packaged one it is known.
    """
    from poise.training.trials.names import check_policy_name

    check_policy_name(policy)
    from poise.training.export.export import export_policy

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
    robot: str = "humanoid",
    seed: int = 0,
    allow: Allow = (),
) -> None:
    """Write trials as a data set of Minari: observations, actions, rewards, the push as arrays.

    Needs pip install -e '.[dataset]' in a checkout.

    Args:
        controller: as poise evaluate takes one; its environment is that of the data.
        out: folder to write to: new, or empty; MINARI_DATASETS_PATH for what reads it.
        name: of the data set, namespace/name-v0.
        suite: of pushes: packaged or a .yaml file.
        trials: number of episodes; the suite's if not given.
        robot: a packaged robot (see poise list) or a .yaml description.
        seed: of the trials.
    """
    from poise.training.trials.names import check_names

    check_names([controller], robot=robot, suite=suite)
    from poise.training.export.dataset import write_dataset

    found = write_dataset(controller, out, name=name, suite=suite, robot=robot, trials=trials,
                          seed=seed, allow=allow)  # fmt: skip
    print(f"{out}: {name}, {found['episodes']} episodes, {found['steps']} steps, "
          f"{found['recovered']} recovered")  # fmt: skip
