"""What `prepare` compiles: `baselines/environments/kernels.py`."""

import subprocess
import sys

import pytest

from poise.baselines.balance.stepping.capture_step import CaptureStep
from poise.baselines.balance.stepping.planning.config import CaptureStepConfig
from poise.baselines.environments import kernels
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.baselines.warmup import PARTS, prepare
from poise.baselines.whole_body import momentum_qp
from poise.configs.schema import build
from tests.support.shared import robot

FURTHER = ("contacts", "planner", "rows", "whole")
# Runs all parts in a process without any kernel, then some steps of an environment, and prints the
# kernels that the parts have not met. Whatever is called by an address or from Python is listed.
CODE = """
import gc, sys
import numpy as np
from numba.core.dispatcher import Dispatcher
from poise.envs.compiled import warmup
warmup.begin()
from poise.baselines.environments import kernels

def known():
    return {
        (each.py_func.__module__, each.py_func.__qualname__, signature)
        for each in gc.get_objects() if isinstance(each, Dispatcher)
        and each.py_func.__module__.startswith("poise.") for signature in each.overloads
    }

for part in sys.argv[1].split(","):
    getattr(kernels, part)()
before = known()
from poise.baselines import ResidualBalanceEnv, ResidualStepEnv, ResidualWholeEnv
from poise.configs.schema import to_dict
rows = to_dict(kernels.EXAMPLES)
for env in (
    ResidualBalanceEnv(controller={"kind": "momentum-qp", **rows}),
    ResidualStepEnv(controller={"kind": "capture-step", "step_qp": rows}),
    ResidualStepEnv(controller="ipm-step"),
    ResidualWholeEnv(hand_over={"opens": 1e-5, "closes": 1e-6}),
):
    for seed in range(2):
        env.reset(seed=seed, options={"push": {"impulse": 20.0, "direction": 90.0, "start": 0.0}})
        for _ in range(3):
            env.step(np.ones(env.action_space.shape))
print(*sorted({name for _, name, _ in known() - before}))
"""


def test_nothing_is_compiled_in_the_middle_of_a_run() -> None:
    """Not by tasks, contacts and limits of either QP, nor by servos that take over."""
    prepare(*FURTHER)
    command = [sys.executable, "-c", CODE, ",".join((*PARTS, *FURTHER))]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@pytest.mark.parametrize("where", ["qp", "step_qp"])
def test_rows_are_prepared_where_they_are_configured(
    where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(momentum_qp, "prepare", lambda *parts: asked.extend(parts))
    CaptureStep(robot(), CaptureStepConfig())
    assert asked == []
    config = build(CaptureStepConfig, {where: kernels.EXAMPLES}, "test")
    CaptureStep(robot(), config)
    assert asked == ["rows"]


def test_the_hand_over_is_prepared(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr(
        "poise.baselines.environments.whole.prepare", lambda *parts: asked.extend(parts)
    )
    ResidualWholeEnv(robot())
    assert asked == ["whole"]
