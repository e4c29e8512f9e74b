"""baselines/plugins.py, and the example of docs/controllers.md."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from stable_baselines3 import PPO

import poise
from poise.baselines.allowance import is_plugin
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.plugins import PluginController
from poise.baselines.registry import controller_config, load_controller
from poise.configs.errors import ConfigError, PoiseError
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.physics.simulation import Simulation
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.trial import Trial
from tests.support.shared import robot

SETTINGS = {"duration": 1.2, "pushes": None}
CONTROLLER = """
import numpy as np
class Zero:
    period = 0.004
    def __init__(self, robot, size=None): self.size = size or robot.model.nu
    def reset(self, state): pass
    def torques(self, state, targets): return np.zeros(self.size)
class Infinite(Zero):
    def torques(self, state, targets): return np.full(self.size, np.inf)
class Slow(Zero):
    period = -1.0
class Broken:
    def __init__(self, robot): raise RuntimeError("no such\\nrobot")
class Nothing:
    def __init__(self, robot): pass
class Counting:
    begun = 0
    def __init__(self, robot): self.action = np.zeros(robot.model.nu)
    def reset(self): type(self).begun += 1
    def act(self, observation): return self.action
def make(robot): return Zero(robot)
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A module of someone else's, in the current folder; whatever it holds may run."""
    name = f"someone_{tmp_path.name.replace('-', '_')}"
    (tmp_path / f"{name}.py").write_text(CONTROLLER)
    monkeypatch.chdir(tmp_path)
    classes = ("Zero", "Infinite", "Slow", "Broken", "Nothing", "Counting", "make", "Nobody")
    names = [f"{place}:{each}" for place in (name, f"{name}.py") for each in classes]
    with poise.allowing([*names, "no_such_module:Zero", "nowhere.py:Zero"]):
        yield name


@pytest.fixture
def example(tmp_path: Path) -> Iterator[Path]:
    """The example in the docs, saved as they say."""
    page = (Path(__file__).parents[2] / "docs/controllers.md").read_text()
    code, sb3 = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(code.splitlines()) <= 45
    path = tmp_path / "my_controller.py"
    path.write_text(code)
    (tmp_path / "my_sb3.py").write_text(sb3)
    places = (f"{path}:ShiftedCoM", f"{path}:Still", f"{tmp_path}/my_sb3.py:MyPolicy")
    with poise.allowing(places):
        yield path


def test_the_example_of_the_docs_is_played(example: Path) -> None:
    """The controller holds a quiet robot and takes part as any other; the policy does, too."""
    trial = Trial(0, seed=1)
    agent = load_agent(f"{example}:ShiftedCoM", robot(), **SETTINGS)
    assert run_trial(agent, trial).recovered
    policy = load_agent(f"{example}:Still", robot(), **SETTINGS)
    assert isinstance(policy.env, ResidualBalanceEnv)
    alone = load_agent("momentum-qp", robot(), **SETTINGS)
    assert run_trial(policy, trial) == run_trial(alone, trial)


def test_what_sb3_has_trained_is_played(example: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second example: its file is looked for in the current folder."""
    monkeypatch.chdir(example.parent)
    model = PPO("MlpPolicy", ResidualBalanceEnv(robot()), n_steps=8, batch_size=8, device="cpu")
    model.save("sb3_residual")
    agent = load_agent("my_sb3.py:MyPolicy", robot(), **SETTINGS)
    seen, _ = agent.env.reset(seed=0)
    expected = model.predict(seen, deterministic=True)[0]
    assert np.array_equal(agent.act(seen), expected)


def test_a_module_in_the_current_folder_is_found(module: str) -> None:
    """By its name, by its file, and by a function that makes it."""
    for name in (f"{module}:Zero", f"{module}.py:Zero", f"{module}:make"):
        controller = load_controller(name, robot())
        assert isinstance(controller, PluginController) and controller.period == 0.004
        assert load_agent(name, robot(), **SETTINGS).name == name


def test_arguments_come_from_a_file(module: str, tmp_path: Path) -> None:
    """kind: outside takes a name and arguments; its fingerprint changes with either."""
    path = tmp_path / "own.yaml"
    path.write_text(f"kind: outside\nname: {module}:Zero\narguments: {{size: 3}}\n")
    controller = load_controller(str(path), robot())
    with pytest.raises(PoiseError, match=r"torques have shape \(3,\), not \(21,\)"):
        controller.torques(Simulation(robot()).state, None)
    names = (str(path), f"{module}:Zero")
    assert len({load_agent(name, robot(), **SETTINGS).fingerprint for name in names}) == 2


def test_the_fingerprint_follows_the_file(module: str, tmp_path: Path) -> None:
    """Another text of the module is another controller."""
    before = controller_config(f"{module}.py:Zero")
    path = tmp_path / f"{module}.py"
    path.write_text(path.read_text() + "# changed\n")
    assert controller_config(f"{module}.py:Zero") != before


def test_numbers_that_are_none_are_an_error(module: str) -> None:
    """MuJoCo would take zeros instead; the controller is told."""
    controller = load_controller(f"{module}:Infinite", robot())
    with pytest.raises(PoiseError, match="Infinite: torques are not finite"):
        controller.torques(Simulation(robot()).state, None)


def test_a_policy_starts_every_trial_anew(module: str) -> None:
    """In the torque environment, unless it says otherwise; `reset` is called before each trial."""
    agent = load_agent(f"{module}:Counting", robot(), **SETTINGS)
    assert type(agent.env) is TorqueBalanceEnv
    for number in (1, 2):
        run_trial(agent, Trial(0, seed=1))
        assert agent.act.__self__.begun == number
    assert np.array_equal(agent.act(np.zeros(1)), np.zeros(21))


def test_several_environments_get_a_controller_each(module: str) -> None:
    """A copy of the environment, as training makes them, has its own instance."""
    env = ResidualBalanceEnv(robot(), controller=f"{module}:Zero")
    other = ResidualBalanceEnv(**env.arguments())
    assert other.controller.inner is not env.controller.inner


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("{}:Nobody", "has no 'Nobody' .choices.*Zero"),
        ("no_such_module:Zero", "'no_such_module' cannot be imported: ModuleNotFoundError"),
        ("nowhere.py:Zero", "'nowhere.py' cannot be imported: FileNotFoundError"),
        ("{}:Broken", "Broken: cannot be made for the robot 'humanoid': RuntimeError: no such rob"),
        ("{}:Nothing", "has neither torques .* nor act"),
        ("{}:Slow", "period: must be seconds, at most 1, not -1.0"),
    ],
)
def test_what_is_wrong_is_said(module: str, name: str, message: str) -> None:
    """One line that names the module or the class."""
    with pytest.raises(ConfigError, match=message) as error:
        load_agent(name.format(module), robot(), **SETTINGS)
    assert "\n" not in str(error.value)


def test_names_from_outside_have_a_colon() -> None:
    """Paths and packaged names have none."""
    assert all(map(is_plugin, ("a.b:C", "a/b.py:C", "my files/b.py:C")))
    assert not any(map(is_plugin, ("momentum-qp", "a/b.yaml", "a:b:c", "a:b.c", "a b:C", 3)))
