"""Every command that an output prints runs as it is printed, from the same folder."""

from __future__ import annotations

import html
import re
import shlex
import shutil
from pathlib import Path

import pytest
import torch

from poise.baselines.allowance import allow_words
from poise.configs.errors import ConfigError, PoiseWarning
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.trials.agents import code_of
from poise.training.benchmarking.trials.push_limits import load_limits
from poise.training.cli.entry import main
from poise.training.cli.train import last_words
from poise.training.pictures.sessions.spec import SessionSpec
from tests.support.evaluations import RANDOM, InProcess, write_suite
from tests.support.policies import helper, write_graph, write_yaml
from tests.support.rivals import network
from tests.support.shared import finished_run, tiny_config
from tests.support.small_urdf import write_urdf
from tests.support.trap import Ground

ROOT = Path(__file__).parents[3]
PRINTED = re.compile(
    r"\b(poise (?:view|replay|evaluate|robot|policies|train|report) [^\n]*?)"
    r"(?:\)?$|</code>| writes the| \(or )",
    re.M,
)
FIELD = "demi tour/проба"  # paths with a space, and letters beyond ASCII
ENDS = {"view": ["--seconds", "0.2", "--port", "0"], "evaluate": ["--trials", "1"]}  # or hours


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, of an awkward name; trials are played in this process.

    It holds an external controller, `mine.py:StifferAnkles`, and a file that names it.
    """
    pytest.importorskip("viser", reason="not installed: pip install 'poise[view]'")
    folder = tmp_path / FIELD
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    monkeypatch.setattr(evaluation, "Executor", InProcess)
    InProcess.played, InProcess.stop_after = 0, None
    for name in ("mine.py", "theirs.py"):
        shutil.copy(ROOT / "examples/own_controller.py", name)
    Path("outside.yaml").write_text("kind: outside\nname: mine.py:StifferAnkles\n")
    Path("my file.yaml").write_text("base: outside.yaml\n")
    Path("trunk.yaml").write_text("base: momentum-qp\nposture: {leg_weight: 2.0}\n")
    Path("theirs.yaml").write_text("kind: outside\nname: theirs.py:StifferAnkles\n")
    write_suite(folder, RANDOM)
    return folder


def commands(text: str) -> list[str]:
    """What is printed to be typed."""
    return PRINTED.findall(text)


def played(command: str) -> int:
    """The exit code of a command line; one that goes on for ever ends soon."""
    words = shlex.split(command)[1:]
    return main([*words, *ENDS.get(words[0], [])])


def test_of_lost_trials(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An external controller; a file that names one, which needs what it was allowed before."""
    names = ["zero", "mine.py:StifferAnkles", "my file.yaml"]
    args = ["evaluate", *names, "--suite", "suite.yaml", "--trials", "2", "--out", "my out"]
    assert main([*args, "--allow", "mine.py:StifferAnkles"]) == 0
    shown = commands(capsys.readouterr().out)
    assert [shlex.split(command)[2] for command in shown] == ["my out"] * 3
    assert "--allow" not in next(line for line in shown if "zero" in line)
    assert [played(command) for command in shown] == [0, 0, 0]


def test_a_command_allows_what_its_controller_needs_and_no_more(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of several files and classes that were allowed together, each has its own."""
    names = ["trunk.yaml", "my file.yaml", "theirs.yaml"]
    allow = ["mine.py:StifferAnkles", "theirs.py:StifferAnkles"]
    args = ["evaluate", *names, "--suite", "suite.yaml", "--trials", "2", "--out", "out"]
    assert main([*args, *allow_words(allow)]) == 0
    shown = commands(capsys.readouterr().out)
    needed = {}
    for command in shown:
        words = shlex.split(command)
        needed[words[words.index("--controllers") + 1]] = words[words.index("--controllers") + 2 :]
    assert needed["my file.yaml"] == ["--allow", allow[0]]
    assert needed["theirs.yaml"] == ["--allow", allow[1]]
    assert needed.get("trunk.yaml", []) == []
    assert [played(command) for command in shown] == [0] * len(shown)


def test_what_has_to_be_allowed(here: Path) -> None:
    """Found out without running it: of files, of a policy's folder, of a policy of TorchScript."""
    folder = here / "scripted"
    write_yaml(folder / "policy.yaml", kind="policy-file", joints=["a"], policy="net.pt",
               observations=[{"term": "gravity"}])  # fmt: skip
    torch.jit.save(torch.jit.trace(torch.nn.Linear(3, 1), torch.zeros(1, 3)), folder / "net.pt")
    ground = Ground(here)
    policy, script = str(ground.policy(ground.code)), [str(folder / "net.pt")]
    assert code_of("a:B") == ["a:B"] and code_of(policy) == [ground.code]
    assert code_of(str(folder)) == code_of(str(folder / "policy.yaml")) == script
    for name in ("zero", "momentum-qp", "residual-torque", "trunk.yaml", "no such"):
        assert code_of(name) == []
    assert not ground.sprung()


def test_of_a_packaged_policy_of_torchscript() -> None:
    """Its name is no path; its network is a file that has to be allowed."""
    path = network("booster-deploy-t1")
    assert code_of("booster-deploy-t1") == [str(path.resolve())]


def test_of_limits_of_another_robot(here: Path) -> None:
    """The robot is written as it is typed: its file, where it is no packaged one."""
    described = write_urdf(here)
    with pytest.raises(ConfigError) as error:
        load_limits(load_robot(described), "humanoid")
    words = shlex.split(*commands(str(error.value)))
    assert load_robot(words[words.index("--robot") + 1]).name == "biped"


def test_of_the_report(
    here: Path, can_render: None, few_frames: None, capsys: pytest.CaptureFixture[str]
) -> None:
    """A film of each of the worst trials."""
    args = ["my file.yaml", "--suite", "suite.yaml", "--trials", "1", "--out", "my out"]
    assert main(["evaluate", *args, "--allow", "mine.py:StifferAnkles"]) == 0
    assert main(["report", "my out", "--allow", "mine.py:StifferAnkles"]) == 0
    capsys.readouterr()
    page = html.unescape(Path("my out/report.html").read_text(encoding="utf-8"))
    shown = sorted(set(commands(page)))
    assert shown and all("--video trial.mp4" in command for command in shown)
    assert played(shown[0]) == 0 and Path("trial.mp4").stat().st_size > 0


def test_of_a_training(here: Path) -> None:
    """What it is compared by, and what shows it."""
    run = Path("my run")
    shutil.copytree(finished_run(), run)
    evaluate, view = commands("\n".join(last_words(tiny_config(), run)))
    assert played(evaluate) == 0 and played(view) == 0


def test_of_the_viewer(here: Path) -> None:
    """What it says that plays the same again, of a policy's folder or a file that was allowed."""
    spec = SessionSpec(("my file.yaml",), seed=3, pushes=("20@90@1.5",),
                       allow=("mine.py:StifferAnkles",))  # fmt: skip
    assert played(spec.command) == 0


def test_of_a_guessed_robot(here: Path) -> None:
    """The model lies in another folder; the description is written to the current one."""
    folder = Path("a robot")
    folder.mkdir()
    model = write_urdf(folder).with_suffix(".urdf")
    with pytest.warns(PoiseWarning) as told:
        load_robot(model)
    (command,) = [c for each in told for c in commands(str(each.message))]
    assert played(command) == 0 and Path(f"{model.stem}.yaml").is_file()


def test_of_a_network_alone(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The check that is proposed says what a description of it needs."""
    network = Path("a network.onnx")
    inputs, outputs = [("obs", [1, 5], 1)], [("actions", [1, 5], 1)]
    write_graph(network, [helper.make_node("Identity", ["obs"], ["actions"])], {}, inputs, outputs)
    assert main(["evaluate", str(network), "--trials", "1", "--out", "out"]) == 2
    (command,) = commands(capsys.readouterr().err)
    assert played(command) == 1
    assert "takes obs 5" in capsys.readouterr().out
