"""The model card: README.md as Hugging Face reads it, a YAML head and a page."""

import html
from collections.abc import Sequence
from typing import Any

import yaml

import poise
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.configs.texts import markdown_page
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.mdp.observation import observation_table
from poise.training.learning.policy import Policy

from .figures import ExportFigure
from .metadata import IDS, actions, units

TAGS = ("deep-reinforcement-learning", "reinforcement-learning", "stable-baselines3", "humanoid",
        "balance", "push-recovery", "mujoco", "onnx")  # fmt: skip


def card(
    name: str,
    archive: str,
    policy: Policy,
    env: BalanceEnv,
    figures: Sequence[ExportFigure],
    licence: str | None,
    notice: str,
) -> str:
    """README.md of an exported folder.

    Args:
        name: of the policy.
        archive: name of SB3's file.
        policy: what is exported.
        env: the environment that it acts in.
        figures: of results; without any the head has no model-index.
        licence: as Hugging Face abbreviates it, or None, which leaves it out.
        notice: what must be said of the policy's origin, or nothing.
    """
    head: dict[str, Any] = {} if licence is None else {"license": licence}
    environment = IDS[policy.config.action]
    head |= {"library_name": "stable-baselines3", "tags": [environment, *TAGS]}
    if figures:
        task = "reinforcement-learning"
        result = {  # in the form that huggingface_sb3 writes
            "task": {"type": task, "name": task},
            "dataset": {"name": environment, "type": environment},
            "metrics": [{"type": f.key, "value": f.value, "name": f.name} for f in figures],
        }
        head["model-index"] = [{"name": name, "results": [result]}]
    below = env.controller if isinstance(env, ResidualBalanceEnv) else None
    page = markdown_page(
        "poise.training.deploy.export",
        "card.md.j2",
        name=name,
        robot=env.robot.name,
        timesteps=policy.state["timesteps"],
        environment=environment,
        version=poise.__version__,
        figures=figures,
        zip=archive,
        inputs=len(policy.mean),
        period=env.config.policy_period,
        units=", ".join(f"{key} = {value:.6g}" for key, value in units(env).items()),
        observation=observation_table(env.terms),
        controller=policy.config.controller,
        controller_period=None if below is None else below.period,
        actions=actions(env),
        notice=html.escape(notice, quote=False),
    )
    text = yaml.safe_dump(head, sort_keys=False, allow_unicode=True, width=1000)
    return f"---\n{text}---\n\n{page}"
