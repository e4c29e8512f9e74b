"""Nothing that is loaded runs code: every loader, with a trap that leaves a mark when it runs."""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import os
import pickle
import subprocess
import sys
import threading
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import poise
from poise.baselines.allowance import NOTHING, check_allowed, named
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.plugins import find_plugin
from poise.baselines.registry import controller_config, load_controller, momentum_qp_config
from poise.configs.errors import ConfigError, PoiseError
from poise.envs.compiled import warmup
from poise.training.benchmarking.evaluation.evaluate import benchmark, evaluate
from poise.training.benchmarking.metrics.seed_groups import seed_groups
from poise.training.benchmarking.results.compare import compare
from poise.training.benchmarking.results.leaderboard import write_leaderboard
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.replay import film, replay
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.jobs import Job, TrialStage, run_job
from poise.training.cli.entry import main
from poise.training.deploy.export.export import export_policy
from poise.training.deploy.qp_set.export import write_qp_set
from poise.training.deploy.standalone.controller import load_standalone
from poise.training.learning.config import train_config
from poise.training.learning.policy import load_policy
from poise.training.learning.policy_files import check_controller, controller_fingerprint
from poise.training.learning.seeds.train import train_seeds
from poise.training.learning.train import train
from poise.training.learning.tuning.candidates import Candidate
from poise.training.learning.tuning.candidates import worth_of_trials as play_candidate
from poise.training.learning.tuning.gains import Gains
from poise.training.learning.tuning.search import tune, tune_config
from poise.training.learning.tuning.tasks import TuneConfig
from poise.training.pictures.report import page
from poise.training.pictures.report.page import write_report
from poise.training.pictures.view.view import view, view_trial
from poise.training.running.executor import Executor
from tests.support.report_folders import copied
from tests.support.shared import robot, tiny_config
from tests.support.trap import NAMES, Ground, allowed_there, loaded_there
from tests.support.weekly import daily

ROOT = Path(__file__).parents[2]
REFUSED = "runs external code"
GAINS = {"arguments.gain": (0.1, 1.0)}


@pytest.fixture
def ground(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Ground]:
    """A trap in the current folder; modules and their places are forgotten afterwards."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.chdir(tmp_path)
    ground = Ground(tmp_path)
    yield ground
    ground.forget()


def check_trap(ground: Ground, names: list[str], load: Callable[[], Any]) -> None:
    """The loader refuses, on one line that says how to allow it; allowed, the trap is sprung."""
    with pytest.raises(ConfigError, match=REFUSED) as error:
        load()
    assert "--allow" in str(error.value) and "\n" not in str(error.value)
    assert not ground.sprung()
    with poise.allowing(names), contextlib.suppress(PoiseError):
        load()
    assert ground.sprung()


@pytest.mark.parametrize("way", NAMES)
def test_a_policy_runs_no_controller_that_it_names(ground: Ground, way: str) -> None:
    """However its folder names it."""
    name = NAMES[way](ground)
    folder = ground.policy(name)
    allow = [name if ":" in name else ground.code]
    check_trap(ground, allow, lambda: load_policy(folder))


def _train_config(g: Ground, name: str) -> Any:
    return train_config(g.yaml("train.yaml", base="residual", controller=name))


def _tuning(g: Ground, name: str) -> str:
    return g.yaml("tune.yaml", controller=name, gains={k: list(v) for k, v in GAINS.items()})


def _tuned(g: Ground, name: str) -> None:
    """A candidate's mapping, as a search hands it to a process."""
    candidate = {"kind": "outside", "name": name}
    config = TuneConfig("momentum-qp", {"com.weight": (0.1, 1.0)})
    play_candidate(Candidate(0, config, candidate, (object(),)))


def _once(make: Callable[[Ground, str], Path], folder: str) -> Callable[[Ground, str], Path]:
    """The folder, made when it is first asked for."""
    return lambda g, name: g.here / folder if (g.here / folder).exists() else make(g, name)


policy = _once(Ground.policy, "policy")
seeds = _once(Ground.seeds, "seeds")
evaluation = _once(Ground.evaluation, "evaluation")
finished = _once(Ground.benchmark, "benchmark")
STATE = {"controller_fingerprint": "0"}

#: who reads a name from a file, and may not run it
LOADERS: dict[str, Callable[[Ground, str], Any]] = {
    "controller_config": lambda g, n: controller_config(n),
    "controller_config, mapping": lambda g, n: controller_config({"kind": "outside", "name": n}),
    "load_controller": lambda g, n: load_controller(n, robot()),
    "find_plugin": lambda g, n: find_plugin(n),
    "load_agent": lambda g, n: load_agent(n, robot()),
    "load_agent, a policy's folder": lambda g, n: load_agent(str(policy(g, n)), robot()),
    "load_policy, best checkpoint": lambda g, n: load_policy(
        _once(lambda g, n: g.policy(n, "run/best"), "run")(g, n)
    ),
    "load_policy, steps": lambda g, n: load_policy(
        _once(lambda g, n: g.policy(n, action="step"), "policy")(g, n)
    ),
    "load_policy, a link to its folder": lambda g, n: load_policy(
        _once(lambda g, n: _linked(g.policy(n)), "linked")(g, n)
    ),
    "controller_fingerprint": lambda g, n: controller_fingerprint(tiny_config(controller=n)),
    "check_controller": lambda g, n: check_controller(STATE, tiny_config(controller=n), Path("s")),
    "TrainConfig.make_env": lambda g, n: tiny_config(controller=n).make_env(robot()),
    "train": lambda g, n: train(_train_config(g, n), g.here / "out", progress=False),
    "train, seeds": lambda g, n: train_seeds(_train_config(g, n), [0], g.here / "out", workers=1),
    "replay": lambda g, n: replay(evaluation(g, n), 0),
    "replay, chosen": lambda g, n: replay(evaluation(g, n), 0, n),
    "replay, YAML": lambda g, n: replay(evaluation(g, NAMES["YAML"](g)), 0),
    "replay, YAML in a benchmark": lambda g, n: replay(finished(g, NAMES["YAML"](g)), 0),
    "replay, of a policy": lambda g, n: replay(evaluation(g, str(policy(g, n))), 0),
    "replay, of a benchmark": lambda g, n: replay(finished(g, n), 0),
    "replay, of what was read": lambda g, n: replay(load_results(finished(g, n)), 0, n),
    "film": lambda g, n: film(evaluation(g, n), 0, [n], g.here / "out.mp4"),
    "view, a trial": lambda g, n: view_trial(evaluation(g, n), 0, port=0, seconds=0.1),
    "view, a policy's folder": lambda g, n: view([str(policy(g, n))], port=0, seconds=0.1),
    "export": lambda g, n: export_policy(str(policy(g, n)), g.here / "out"),
    "standalone, a policy's folder": lambda g, n: load_standalone(str(policy(g, n))),
    "evaluate, a policy's folder": lambda g, n: evaluate([str(policy(g, n))], out=g.here / "out"),
    "evaluate, a folder of seeds": lambda g, n: evaluate([str(seeds(g, n))], out=g.here / "out"),
    "evaluate, YAML on YAML": lambda g, n: evaluate([NAMES["YAML on YAML"](g)], out=g.here / "out"),
    "benchmark, a policy's folder": lambda g, n: benchmark(
        [str(policy(g, n))], g.suite(), out=g.here / "out"
    ),
    "benchmark, a folder of seeds": lambda g, n: benchmark(
        [str(seeds(g, n))], g.suite(), out=g.here / "out"
    ),
    "benchmark, what its folder holds": lambda g, n: benchmark(
        ["zero"], g.suite(), out=finished(g, n)
    ),
    "a job": lambda g, n: run_job(Job(TrialStage("humanoid", 1.0, None), n, None)),
    "tune": lambda g, n: tune(tune_config(_tuning(g, n)), g.here / "out"),
    "tune, a policy's folder": lambda g, n: tune(
        TuneConfig("momentum-qp", {"com.weight": (0.1, 1.0)}, policy=str(policy(g, n))),
        g.here / "out",
    ),
    "gains": lambda g, n: Gains(n, GAINS, "humanoid"),
    "a candidate": _tuned,
}


def _linked(folder: Path) -> Path:
    link = folder.parent / "linked"
    link.symlink_to(folder.name)
    return link


@pytest.mark.parametrize("loader", LOADERS)
def test_no_loader_runs_what_a_file_names(ground: Ground, loader: str) -> None:
    """What it reads was written by someone else."""
    check_trap(ground, [ground.code], lambda: LOADERS[loader](ground, ground.code))


#: commands that read a file with the name; what they print is checked
COMMANDS: dict[str, Callable[[Ground, str], list[str]]] = {
    "evaluate": lambda g, n: ["evaluate", str(policy(g, n)), "--out", "out"],
    "benchmark": lambda g, n: ["benchmark", "--controllers", str(policy(g, n)), "--out", "out"],
    "replay": lambda g, n: ["replay", str(evaluation(g, n)), "--trial", "0"],
    "view": lambda g, n: ["view", str(policy(g, n)), "--port", "0", "--seconds", "1"],
    "view, a trial": lambda g, n: ["view", str(evaluation(g, n)), "--trial", "0", "--port", "0"],
    "export": lambda g, n: ["export", str(policy(g, n)), "--out", "exported"],
    "replay, of its controller": lambda g, n: [
        "replay", str(evaluation(g, n)), "--trial", "0", "--controller", n,
    ],
    "train": lambda g, n: [
        "train", "--out", "out", "--config",
        g.yaml("train.yaml", base="residual", controller=n),
    ],
    "tune": lambda g, n: ["tune", "--out", "out", "--config", _tuning(g, n)],
}  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_says_what_a_file_wants_to_run(
    ground: Ground, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """On one line, with exit code 2; with --allow it runs, that once."""
    line = COMMANDS[command](ground, ground.code)
    assert main(line) == 2 and not ground.sprung()
    error = capsys.readouterr().err
    assert REFUSED in error and f"--allow {ground.code}" in error and error.count("\n") == 1
    assert main([*line, "--allow", "other:Thing"]) == 2 and not ground.sprung()
    assert main([*line, "--allow", "other:Thing", "--allow", ground.code]) == 2
    assert ground.sprung() and REFUSED not in capsys.readouterr().err.splitlines()[-1]
    with pytest.raises(ConfigError):
        check_allowed(ground.code)


def test_a_name_for_allow_has_a_form(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """module:Class, nothing else."""
    for name in ("module", "a:b:c", "own.yaml", "evil\x1b[2J:C"):
        assert main(["replay", str(tmp_path), "--trial", "0", "--allow", name]) == 2
        assert "allow" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["random", "benchmark"])
def test_a_report_runs_no_controller_of_its_folder(
    ground: Ground,
    kind: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is written without the trial, and says so; allowed, the controller is played."""
    monkeypatch.setattr(page, "can_draw", lambda: "no pictures in this test")
    folder = copied(kind, ground.here)
    for name in ("settings.yaml", "summary.json", "trials.csv"):
        text = (folder / name).read_text()
        for around in ("{}: ", '"{}"', ",{},"):
            text = text.replace(around.format("zero"), around.format(ground.code))
        (folder / name).write_text(text)
    load_results(folder)
    compare(folder, folder)
    if kind == "benchmark":
        write_leaderboard([folder], ground.here / "page.md")
    assert main(["report", str(folder)]) == 0 and not ground.sprung()
    assert REFUSED in (folder / "report.html").read_text()
    assert f"--allow {ground.code}" in capsys.readouterr().out
    write_report(folder, allow=ground.code)
    assert ground.sprung()


#: files with the name where nobody looks for a controller
ELSEWHERE: dict[str, Callable[[Ground, str], Any]] = {
    "a momentum QP": lambda g, n: momentum_qp_config(n),
    "a momentum QP, YAML": lambda g, n: momentum_qp_config(NAMES["YAML"](g)),
    "qp-set": lambda g, n: write_qp_set(g.here / "out", controller=n),
    "the QP of lqr-lip": lambda g, n: controller_config(
        {"kind": "lqr-lip", "qp": {"kind": "outside", "name": n}}
    ),
    "the QP of lqr-lip, YAML": lambda g, n: controller_config(
        {"kind": "lqr-lip", "qp": NAMES["YAML"](g)}
    ),
    "a kind": lambda g, n: controller_config({"kind": n}),
    "base": lambda g, n: controller_config({"base": n}),
    "a policy's base": lambda g, n: load_policy(g.policy("momentum-qp", base=n)),
    "a policy's robot": lambda g, n: load_policy(g.policy("momentum-qp", robot=n)),
    "a policy's motion": lambda g, n: load_policy(g.policy("momentum-qp", motion=n)),
    "a policy's action": lambda g, n: load_policy(g.policy("momentum-qp", action=n)),
    "a policy's start": lambda g, n: train(
        tiny_config(start_from=str(g.here / "none")), g.here / "out"
    ),
    "a robot's file": lambda g, n: load_agent(
        "momentum-qp",
        poise.envs.robots.robot.load_robot(g.yaml("robot.yaml", model=n, root=n, feet=[])),
    ),
    "a suite": lambda g, n: evaluate(
        ["zero"], g.yaml("suite.yaml", quiet={}, controllers=[n]), out=g.here / "out"
    ),
    "a suite of benchmarks": lambda g, n: benchmark(
        ["zero"], g.yaml("suite.yaml", duration=1.0, controllers=[n]), out=g.here / "out"
    ),
    "limits": lambda g, n: evaluate(
        ["zero"], out=g.here / "out", limits=g.yaml(
            "limits.yaml", robot=n, fingerprint="0", controller=n,
            table={"directions": [0], "impulses": [1]},
        ),
    ),
    "a search to go on with": lambda g, n: _other_search(g, n),
    "a run to go on with": lambda g, n: _other_run(g, n),
}  # fmt: skip


def _other_search(g: Ground, name: str) -> None:
    (g.here / "out").mkdir()
    g.yaml("out/config.yaml", controller=name, gains={"gain": [0.0, 1.0]})
    tune(TuneConfig("momentum-qp", {"com.weight": (0.1, 1.0)}), g.here / "out", resume=True)


def _other_run(g: Ground, name: str) -> None:
    g.policy(name, "out/last")
    train(tiny_config(), g.here / "out", resume=True)


@pytest.mark.parametrize("place", ELSEWHERE)
def test_a_name_in_another_place_is_an_error(ground: Ground, place: str) -> None:
    """Even where the code is allowed: there it has nothing to do."""
    with poise.allowing(ground.code), pytest.raises(ConfigError):
        ELSEWHERE[place](ground, ground.code)
    assert not ground.sprung()


class Pickled:
    """Runs `code` when it is unpickled."""

    def __init__(self, mark: Path):
        self.mark = mark

    def __reduce__(self) -> tuple[Any, ...]:
        return exec, (f"open({str(self.mark)!r}, 'w').close()",)


@pytest.mark.parametrize("part", ["data", "policy.pth", "policy.optimizer.pth", "statistics"])
def test_nothing_in_a_policy_is_unpickled(ground: Ground, part: str) -> None:
    """Neither on loading it, nor when training starts from it or goes on with it."""
    folder, mark = ground.policy("momentum-qp"), ground.here / "unpickled"
    if part == "statistics":
        np.savez(folder / "vecnormalize.npz", obs_mean=np.array([Pickled(mark)], dtype=object))
    else:
        _replace(folder / "policy.zip", part, mark)
    with contextlib.suppress(ConfigError):
        load_policy(folder)
    with contextlib.suppress(ConfigError):
        train(tiny_config(start_from=str(folder), steps=64), ground.here / "out", progress=False)
    assert not mark.exists()
    pickle.loads(pickle.dumps(Pickled(mark)))
    assert mark.exists()


def _replace(path: Path, member: str, mark: Path) -> None:
    """Write a pickle into an archive, as SB3 (settings) or torch (weights) would."""
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    if member == "data":
        text = base64.b64encode(pickle.dumps(Pickled(mark))).decode()
        content["data"] = json.dumps({"x": {":type:": "", ":serialized:": text}}).encode()
    else:
        torch.save({"x": Pickled(mark)}, path.with_suffix(".pth"))
        content[member] = path.with_suffix(".pth").read_bytes()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in content.items():
            archive.writestr(name, data)


#: where a user says a controller himself
SAID: dict[str, Callable[[str], Any]] = {
    "Python": lambda name: evaluate([name], out="out"),
    "an environment": lambda name: ResidualBalanceEnv(robot(), controller=name),
    "evaluate": lambda name: main(["evaluate", name, "--out", "out"]),
    "benchmark": lambda name: main(["benchmark", "--controllers", name, "--out", "out"]),
    "train": lambda name: main(["train", f"--controller={name}", "--out", "out"]),
    "tune": lambda name: main(["tune", "--controller", name, "--out", "out"]),
}


@pytest.mark.parametrize("where", SAID)
def test_what_is_typed_or_handed_over_may_run(ground: Ground, where: str) -> None:
    """A class by its name, or in a file of kind outside that says so itself."""
    for name in (f"{ground.module}:Trap", ground.code, NAMES["YAML"](ground)):
        ground.forget()
        with contextlib.suppress(ConfigError):
            SAID[where](name)
        assert ground.sprung()


def test_what_stands_for_a_name() -> None:
    """Of all that may be handed over as a controller."""
    assert named("momentum-qp", "a:B", ["c:D", {"kind": "outside", "name": "e:F"}]) == [
        "a:B", "c:D", "e:F",
    ]  # fmt: skip
    assert named(None, 3, "a.yaml", {"name": "a:B"}, {"kind": "outside", "name": 3}) == []


def test_a_permission_ends_with_its_block() -> None:
    """It names a class, not its module; it is neither other threads' nor left over."""
    found: list[str] = []

    def ask() -> None:
        with contextlib.suppress(ConfigError):
            check_allowed("os:getcwd")
            found.append("allowed")

    with poise.allowing("os:getcwd"), poise.allowing(["os:sep"]):
        check_allowed("os:getcwd")
        check_allowed("os:sep")
        with pytest.raises(ConfigError, match=r"'os:system'.*--allow os:system,"):
            check_allowed("os:system")
        thread = threading.Thread(target=ask)
        thread.start()
        thread.join()
    with pytest.raises(ConfigError):
        check_allowed("os:getcwd")
    assert not found


def test_the_line_to_copy_is_safe_to_paste() -> None:
    """A name that a shell would run is quoted."""
    with pytest.raises(ConfigError, match=r"--allow 'x;\$\(reboot\).py:C',"):
        check_allowed("x;$(reboot).py:C")


def test_a_file_is_the_same_by_any_path(ground: Ground) -> None:
    """Links are followed; another file of the same name is another."""
    with poise.allowing("link.py:Trap"):
        check_allowed(ground.code)
        check_allowed(f"./{ground.module}.py:Trap")
        with pytest.raises(ConfigError):
            check_allowed(f"{ground.module}_package/{ground.module}.py:Trap")


@pytest.mark.parametrize("name", ["circle.py:Trap", "circle.pt"])
def test_links_in_a_circle_are_no_file(ground: Ground, name: str) -> None:
    """Neither what is allowed nor what a file names."""
    link = Path(name.partition(":")[0])
    link.symlink_to(link)
    named = "circle" if sys.version_info < (3, 13) else "other"  # then it is the path of no file
    with pytest.raises(ConfigError, match=named):
        with poise.allowing(name):
            check_allowed(name.replace("circle", "other"))
    with pytest.raises(ConfigError, match="circle"):
        check_allowed(name)


def test_an_allowed_policy_can_make_its_environment_later(ground: Ground) -> None:
    """What `load_policy` was allowed holds for `make_env`; not for another policy."""
    code = "from poise.baselines.whole_body.momentum_qp import MomentumQP\ndef make(robot):\n"
    (ground.here / "fine.py").write_text(f"{code}    return MomentumQP(robot)\n")
    folder = ground.policy("fine.py:make")
    with poise.allowing("fine.py:make"):
        config = tiny_config(controller="fine.py:make")
        state = json.loads((folder / "state.json").read_text())
        state["controller_fingerprint"] = controller_fingerprint(config)
    (folder / "state.json").write_text(json.dumps(state))
    loaded = load_policy(folder, robot(), allow=["fine.py:make"])
    assert loaded.make_env(robot=robot()).controller.period > 0.0
    with pytest.raises(ConfigError, match=rf"policy/config.yaml: controller: {REFUSED}"):
        load_policy(folder, robot())
    with pytest.raises(ConfigError, match=REFUSED):
        loaded.config.make_env(robot())
    assert seed_groups([str(folder), str(folder)], {}) == []  # reads policies, refuses quietly


def test_modules_of_the_current_folder_replace_no_library(
    ground: Ground, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A module that is found elsewhere is taken from there; the folder is searched last."""
    (ground.here / "wave.py").write_text((ground.here / f"{ground.module}.py").read_text())
    monkeypatch.delitem(sys.modules, "wave", raising=False)
    with poise.allowing(["wave:Trap", "wave:open", "nowhere:Trap"]):
        with pytest.raises(ConfigError, match="'wave' has no 'Trap'"):
            find_plugin("wave:Trap")
        with pytest.raises(ConfigError, match="No module named 'nowhere'"):
            find_plugin("nowhere:Trap")
    assert not ground.sprung() and str(ground.here) not in sys.path
    with poise.allowing(f"{ground.module}:Trap"):
        find_plugin(f"{ground.module}:Trap")
    assert sys.path[-1] == str(ground.here) and sys.path.count(str(ground.here)) == 1


@pytest.mark.parametrize("backend", daily(["local", "joblib"]))
def test_processes_are_told_what_is_allowed(ground: Ground, backend: str) -> None:
    """That, and no more; and they import nothing from the current folder."""
    for module in ("multiprocessing", "joblib", "signal", "numpy", "poise", "contextlib", "yaml"):
        (ground.here / f"{module}.py").write_text((ground.here / f"{ground.module}.py").read_text())
    workers = 1 if backend == "local" else 2  # joblib plays with one in this process
    with poise.allowing("a:B"), Executor(backend, workers) as executor:
        names = ["a:B", "a:C"]
        assert dict(executor.each(allowed_there, names)) == {"a:B": True, "a:C": False}
    assert not ground.sprung()


def test_workers_load_what_is_allowed(ground: Ground) -> None:
    """An external controller in a process of its own."""
    (ground.here / "fine.py").write_text(
        "class Zero:\n    period = 0.004\n    def __init__(self, robot): pass\n"
        "    def reset(self, state): pass\n    def torques(self, state, targets): return 0\n"
    )
    with poise.allowing("fine:Zero"), Executor("local", 1) as executor:
        assert dict(executor.each(loaded_there, ["fine:Zero"])) == {"fine:Zero": "fine:Zero"}


def test_the_current_folder_plants_nothing(ground: Ground) -> None:
    """A downloaded folder, entered and read there: no module, no setting of a library runs."""
    trap = (ground.here / f"{ground.module}.py").read_text()
    libraries = ("numpy", "yaml", "poise", "mujoco", "numba", "torch", "scipy", "cma", "ray",
                 "rliable", "sitecustomize", "usercustomize", "matplotlib", "tyro")  # fmt: skip
    for module in (*libraries, *sys.stdlib_module_names):
        (ground.here / f"{module}.py").write_text(trap)
    (ground.here / ".numba_config.yaml").write_text(
        f"cache_dir: {ground.here}\ncache_locator_classes: {ground.module}.Trap\n"
    )
    ground.policy("momentum-qp-compensated")
    code = (
        "import poise; poise.load_policy('policy'); import numba, poise.training.cli; "
        "assert not numba.config.CACHE_DIR and not numba.config.CACHE_LOCATOR_CLASSES; "
        "assert poise.training.cli.entry.main(['replay', '.', '--trial', '0']) == 2"
    )  # fmt: skip
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert not ground.sprung()


def test_kernels_are_compiled_apart_from_the_current_folder(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The processes that compile are started with -P."""
    started: list[list[str]] = []

    class Process:
        stdin = io.BytesIO()

        def __init__(self, command: list[str], **_: object):
            started.append(command)

        def wait(self) -> int:
            return 0

        kill = wait

    monkeypatch.setattr(warmup.subprocess, "Popen", Process)
    assert warmup._compile_apart("poise.baselines.environments.kernels", ["solver"])
    assert started[0][:2] == [sys.executable, "-P"]


#: calls that run or unpickle what a file holds → where the package makes them
DANGEROUS = {
    # Besides plugins: solvers and libraries of fixed lists, the files of one of our rooms, kernels
    # that a pickle of ours names, public names.
    "import_module": {
        "baselines/plugins.py",
        "baselines/solvers/problem.py",
        "configs/kinds.py",
        "envs/compiled/calls.py",
        "src/poise/lazy.py",
    },
    "exec_module": {"baselines/plugins.py"},
    "find_plugin": {"baselines/plugins.py", "training/benchmarking/trials/agents.py"},
    "PluginConfig": {"baselines/plugins.py", "baselines/registry.py"},
    # TorchScript, of a file that `policy_file_config` has asked about
    "torch.jit.load": {"baselines/policy_files/networks.py"},
    "load_network": {"baselines/policy_files/controller.py"},
    # MuJoCo's data within a copy; what the main process and its workers say to each other
    "pickle.loads": {"envs/compiled/copies.py", "training/running/processes.py"},
    **{name: set() for name in ("exec", "eval", "__import__", "run_path", "Unpickler")},
}


def test_code_is_imported_in_one_place() -> None:
    """By `find_plugin`, which asks first; solvers come from a fixed list. Nothing unpickles."""
    found: dict[str, set[str]] = {name: set() for name in DANGEROUS}
    for folder in ("envs", "baselines", "training", "configs", "src"):
        for path in (ROOT / folder).rglob("*.py"):
            place = path.relative_to(ROOT).as_posix()
            nodes = ast.walk(ast.parse(path.read_text()))
            for call in (node for node in nodes if isinstance(node, ast.Call)):
                name, text = ast.unparse(call.func), ast.unparse(call)
                for known in {name, name.rpartition(".")[2]} & set(found):
                    found[known].add(place)
                assert name not in ("pickle.load", "PPO.load", "joblib.load"), place
                assert name != "torch.load" or "weights_only=True" in text, place
                assert name != "np.load" or "allow_pickle=False" in text, place
                assert name != "load_from_zip_file" or "load_data=False" in text, place
                assert name != "yaml.load" or text.endswith("Loader=Loader)"), place
    assert found == DANGEROUS


def test_nothing_is_allowed_to_begin_with() -> None:
    """Not even what the user would type first."""
    assert NOTHING.names == frozenset()
    with pytest.raises(ConfigError, match=REFUSED):
        find_plugin("os:getcwd")


@pytest.mark.parametrize("kind", [np.zeros(0), np.zeros(3), ["outside"], None, 1])
def test_a_kind_that_is_no_text_names_no_code(kind: object) -> None:
    """Arrays compare entry by entry."""
    assert named({"kind": kind, "name": "trap.py:Trap"}) == []
    assert named({"kind": "outside", "name": "trap.py:Trap"}) == ["trap.py:Trap"]
