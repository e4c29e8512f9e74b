"""The model card: README.md as Hugging Face reads it, a YAML head and a page."""

import html
from collections.abc import Sequence
from typing import Any

import yaml

import poise
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.configs.texts import code, plain
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.mdp.observation import observation_table
from poise.training.learning.policy import Policy

from .figures import Figure
from .metadata import IDS, actions, units

TAGS = ("deep-reinforcement-learning", "reinforcement-learning", "stable-baselines3", "humanoid",
        "balance", "push-recovery", "mujoco", "onnx")  # fmt: skip

PAGE = """\
# {name}

{what} Simulated robot: {robot}. It was trained for {timesteps:,} steps with PPO by
[Stable-Baselines3](https://github.com/DLR-RM/stable-baselines3) in `{environment}` of Poise
{version}. Nothing of it was tried on a real robot.

{figures}
## Files

| file | what |
| --- | --- |
| `policy.onnx` | raw observations to actions, normalised and limited inside; see its metadata |
| `policy.safetensors` | the actor's weights and its normalisation |
| `{zip}` | for `stable_baselines3.PPO.load`, which unpickles it |
| `vec_normalize.pkl` | for `VecNormalize.load`, which unpickles it |
| `config.json` | SB3's settings and the system, as huggingface_sb3 writes them |
| `results.json` | the figures above |
| `poise/` | what `poise.load_policy` reads |

```python
import numpy as np
import onnxruntime

session = onnxruntime.InferenceSession("policy.onnx")
observations = np.zeros((1, {inputs}), np.float32)
(actions,) = session.run(["actions"], {{"obs": observations}})
```

```python
import poise

policy = poise.load_policy("poise")  # the folder
env = policy.make_env()
```

With SB3 alone observations must be normalised first: `VecNormalize.load("vec_normalize.pkl",
venv)`, then `PPO.load("{zip}")`.

## Observation

Every {period:g} s, clipped to ±10. In SI the units are made of {units}.

{observation}

## Action

Each entry lies within ±1.{below}

| index | entry | 1 is | unit |
| --- | --- | --- | --- |
{action}
{notice}"""


def card(
    name: str,
    archive: str,
    policy: Policy,
    env: BalanceEnv,
    figures: Sequence[Figure],
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
    below = ""
    if isinstance(env, ResidualBalanceEnv):
        below = f" It moves the targets of the controller {code(policy.config.controller)}, which"
        below += f" runs every {env.controller.period:g} s; an action of 0 is this one alone."
    rows = [
        f"| {i} | {plain(entry.name)} | {entry.scale:g} | {entry.unit} |"
        for i, entry in enumerate(actions(env))
    ]
    lines = [f"| {plain(f.name)} | {f.text} |" for f in figures]
    table = "\n".join(["| figure | |", "| --- | --- |", *lines, "", ""]) if figures else ""
    values = ", ".join(f"{key} = {value:.6g}" for key, value in units(env).items())
    page = PAGE.format(
        name=plain(name),
        what="A policy that keeps a humanoid on its feet while it is pushed.",
        robot=code(env.robot.name),
        timesteps=policy.state["timesteps"],
        environment=environment,
        version=poise.__version__,
        figures=table,
        zip=archive,
        inputs=len(policy.mean),
        period=env.config.policy_period,
        units=values,
        observation=observation_table(env.terms),
        below=below,
        action="\n".join(rows),
        notice=f"\n## Origin\n\n{html.escape(notice, quote=False)}" if notice else "",
    )
    text = yaml.safe_dump(head, sort_keys=False, allow_unicode=True, width=1000)
    return f"---\n{text}---\n\n{page}"
