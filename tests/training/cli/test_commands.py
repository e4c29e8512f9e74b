"""training/cli/commands.py, entry.py and training/cli/train.py."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import pytest

import poise
from poise.baselines.allowance import SCRIPTS
from poise.configs.errors import ConfigError, PoiseError
from poise.configs.files import packaged, packaged_folder, resolve
from poise.configs.problems import Problem
from poise.configs.schema import to_dict
from poise.training.benchmarking.evaluation import run
from poise.training.benchmarking.results.read import load_results
from poise.training.cli import entry
from poise.training.cli import train as train_command
from poise.training.cli.entry import main
from poise.training.cli.train import parse_train
from poise.training.learning.config import TrainConfig, train_config
from poise.training.running.options.names import FIGURES
from tests.support.evaluations import RANDOM, InProcess, write_suite

RICH = (
    "from poise.training.cli import entry\n"
    "from poise.training.running.terminal import terminal\n"
    "entry._run = lambda _: terminal().print('x')"
)
BAD_SUITE = "random: {trials: many}\n"
BAD_ROBOT = "name: a\nsource: {mjcf: nowhere.xml}\nroot: b\nfeet: []\n"


def test_help_is_light() -> None:
    """Neither the command nor its help loads MuJoCo, Numba, torch or SciPy."""
    code = (
        "import sys\nfrom poise.training.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit as end:\n    assert end.code == 0\n"
        "heavy = {'mujoco', 'numba', 'torch', 'scipy', 'matplotlib'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    names = (
        *("train", "evaluate", "benchmark", "compare", "leaderboard", "replay", "demo", "tune"),
        *("qp-set", "report", "robot", "list", "export", "view", "walk", "gait"),
    )
    for name in names:
        assert name in done.stdout


def test_a_quadratic_program_is_evaluated_without_torch() -> None:
    """Neither who evaluates nor his workers load it, or Matplotlib, before it is of use."""
    code = (
        "import sys\n"
        "import poise.training.benchmarking.evaluation.run\n"
        "import poise.training.benchmarking.trials.jobs\n"
        "heavy = {'torch', 'stable_baselines3', 'matplotlib', 'scipy.signal', 'scipy.stats'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


WRONG = (
    ["evaluate", "momentum-pq"],
    ["benchmark", "--out", "out", "--controllers", "momentum-pq"],
    ["view", "momentum-pq"],
    ["view", "nowhere", "--trial", "3"],
    ["walk", "--robot", "robby"],
    ["gait", "--compare", "lip", "--out", "out", "--human", "me"],
    ["export", "residul", "--out", "out"],
    ["train", "--out", "out", "--config", "residul"],
)


def test_a_wrong_name_is_refused_before_anything_heavy_is_imported() -> None:
    """One command after another, in a process that has none of it yet."""
    code = (
        f"import sys\nfrom poise.training.cli import main\nfor args in {WRONG}:\n"
        "    assert main(args) == 2, args\n"
        "    heavy = {'mujoco', 'numba', 'torch', 'scipy', 'matplotlib'} & set(sys.modules)\n"
        "    assert not heavy, (args, heavy)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = done.stderr.splitlines()
    assert len(told) == len(WRONG) and all(line.startswith("poise: ") for line in told)


@pytest.mark.parametrize(
    "args",
    [
        ["walk", "--speed", "9"],
        ["walk", "--controller", "momentum-qp"],
        ["evaluate", "walk", "momentum-qp", "--suite", "walk", "--out", "out"],
    ],
    ids=" ".join,
)
def test_what_cannot_be_walked_is_refused_before_a_controller_is_made(
    args: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Making one compiles its kernels."""

    def never(*_: object) -> None:
        raise AssertionError("compiles")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("poise.training.pictures.sessions.walk.load_agent", never)
    monkeypatch.setattr(run, "prepare", never)
    assert main(args) == 2
    assert capsys.readouterr().err.startswith("poise: ")


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"poise {poise.__version__}\n"


def test_bash_completes_commands_and_flags(capsys: pytest.CaptureFixture[str]) -> None:
    """The script that is printed, tried in a shell."""
    assert main(["--print-completion", "bash"]) == 0
    script = capsys.readouterr().out
    complete = "COMP_WORDS=({}); COMP_CWORD={}; _tyro_poise; echo ${{COMPREPLY[@]}}; "
    asked = complete.format("poise eva", 1) + complete.format("poise evaluate --sui", 2)
    done = subprocess.run(["bash", "-c", f"{script}\n{asked}"], capture_output=True, text=True)
    assert "evaluate" in done.stdout.splitlines()[0] and "--suite" in done.stdout.splitlines()[1]


@pytest.mark.parametrize("given", [[], ["cmd"], ["tcsh"], ["bash", "zsh"]])
def test_a_shell_without_completion_is_one_line(
    given: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--print-completion", *given]) == 2
    err = capsys.readouterr().err
    assert err == "poise: print-completion: needs a shell (choices: bash, zsh, fish)\n"


@pytest.mark.parametrize(("name", "hint"), [("evalute", ", did you mean evaluate?"), ("xyz", "")])
def test_an_unknown_command_is_one_line(
    capsys: pytest.CaptureFixture[str], name: str, hint: str
) -> None:
    """It names what it looks like, and all that there are."""
    assert main([name, "momentum-qp"]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"poise: no such command: '{name}'{hint} (choices: demo, train, ")
    assert err.count("\n") == 1


@pytest.mark.parametrize(("args", "before"), [(["list"], ""), (["--help"], ""), (["list"], RICH)])
def test_a_closed_pipe_is_no_error(args: list[str], before: str) -> None:
    """`poise list | head -1` ends without a traceback, with a shell's code for a broken pipe; so
    does what Rich prints."""
    reader, writer = os.pipe()
    os.close(reader)
    code = f"import sys\nfrom poise.training import cli\n{before}\nsys.exit(cli.main({args}))"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")


def test_an_error_with_its_output_closed() -> None:
    """The code is that of bad input without a standard output, 141 if its text finds no reader."""
    command = [sys.executable, "-m", "poise.training.cli", "replay", "nowhere", "--trial", "0"]
    shell = f"{shlex.join(command)} >&-; echo $?"
    shut = subprocess.run(["sh", "-c", shell], capture_output=True, text=True, check=False)
    assert shut.stdout == "2\n" and "Traceback" not in shut.stderr
    reader, writer = os.pipe()
    os.close(reader)
    assert subprocess.run(command, stderr=writer, check=False).returncode == 141
    os.close(writer)


def test_a_broken_pipe_of_another_kind_is_raised(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One to a process, say: the output is read, so this is an error like any other."""

    def fail(_: object) -> int:
        raise BrokenPipeError

    monkeypatch.setattr(entry, "_run", fail)
    with pytest.raises(BrokenPipeError):
        main(["list"])
    print("still here")
    assert "still here" in capsys.readouterr().out


def bad_input(
    args: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> PoiseError:
    """The error of a command in a folder with bad files: one line, exit code 2, nothing written."""
    Path("bad.yaml").write_text(BAD_SUITE)
    Path("text.yaml").write_text("kind: [random\n")
    Path("robot.yaml").write_text(BAD_ROBOT)
    Path("run").mkdir()
    errors: list[PoiseError] = []
    before = entry.print_error
    monkeypatch.setattr(entry, "print_error", lambda error: (errors.append(error), before(error)))
    assert main(args) == 2
    (error,) = errors
    assert capsys.readouterr().err == f"poise: {error}\n" and "\n" not in str(error)
    assert not list(Path("run").iterdir()) and not Path("out").exists()
    return error


#: command | problem | source | field | what is meant | facts
REFUSED = """
evaluate zero --workers 0 | range |  | workers |  | least=1
evaluate zero --trials 0 | range |  | trials |  | least=1
evaluate pid | unknown controller |  | controller | pd | value='pid'
evaluate momentum-pq | unknown controller |  | controller | momentum-qp | value='momentum-pq'
evaluate zero --suite rndom | unknown name |  | suite | random | value='rndom'
evaluate zero --robot robby | unknown name |  | robot |  | value='robby'
evaluate zero --suite bad.yaml | type | bad.yaml | random.trials |  | value='many'
benchmark --out out --controllers pid | unknown controller |  | controller | pd | value='pid'
benchmark --out out --suite bad.yaml | type | bad.yaml | random.trials |  | value='many'
train --out run --config nothing | unknown name |  | training |  | value='nothing'
train --out run --seed 1 --ppo.gamma 2 | range | command line | ppo.gamma |  | most=1.0; value=2.0
train --out run --config bad.yaml | unknown field | bad.yaml | random |  |
tune --out run --controller pid | unknown name |  | controller | pd | value='pid'
robot robby | unknown name |  | robot |  | value='robby'
walk --speed nan | type | command | ahead |  | expected=a finite number; value=nan
walk --step-time 9 | range | command | step_time |  | most=5.0; value=9.0
walk --push 9@999 | range | push | direction |  | most=360.0; value=999.0
walk --seed -1 | range |  | seed |  | least=0; value=-1
gait --compare lip --out g --starts 0 | range |  | starts |  | least=1; value=0
gait --compare lip --out g --human me | unknown name |  | human |  | value='me'
gait --compare lop --out g | unknown controller |  | controller |  | value='lop'
walk --controller wlk | unknown controller |  | controller | walk | value='wlk'
export residul --out out | unknown policy |  | policy | residual | value='residul'
view momentum-pq | unknown controller |  | controller | momentum-qp | value='momentum-pq'
tune --out out --policy residul | unknown controller |  | controller | residual | value='residul'
train --out out --controller pid | unknown name |  | controller | pd | value='pid'
train --out out --robot robby | unknown name |  | robot |  | value='robby'
evaluate zero --sede 1 | unknown option | evaluate | --sede | --seed |
evaluate zero --suit random | unknown option | evaluate | --suit | --suite |
evaluate zero --seed one | type | evaluate | --seed |  | expected=a whole number; value='one'
evaluate zero --seed | no value | evaluate | --seed |  | count=1
evaluate zero --robot g1 | unknown name |  | robot | unitree_g1 | value='g1'
evaluate zero --robot Humanoid | unknown name |  | robot | humanoid | value='Humanoid'
evaluate zero --backend slurm | choice | evaluate | --backend |  | value='slurm'
evaluate zero random | unknown controller |  | controller |  | value='random'
evaluate feedback_step | unknown controller |  | controller | feedback-step | value='feedback_step'
evaluate zero -seed 1 | unknown option | evaluate | -seed | --seed |
benchmark momentum-pq --out o | unknown controller |  | controller | momentum-qp |
benchmark --out out --suite standart | unknown name |  | suite | standard | value='standart'
compare run | needs | compare |  |  | what=DIR_B
replay run | needs | replay |  |  | what=--trial N
replay run --trial first | type | replay | --trial |  | expected=a whole number; value='first'
view --tril 3 | unknown option | view | --tril | --trial |
view --robot t1 | unknown name |  | robot | booster_t1 | value='t1'
walk --sped 1 | unknown option | walk | --sped | --speed |
walk fast | unknown argument | walk |  |  | value='fast'
walk --speed fast | type | walk | --speed |  | expected=a number; value='fast'
train | needs | train |  |  | what=--out PATH
train --out run --ppo.gama 1 | unknown option | train | --ppo.gama | --ppo.gamma |
train --out run --gamma 1 | unknown option | train | --gamma | --ppo.gamma |
train --out run --ppo.gamma high | type | train | --ppo.gamma |  | expected=a number; value='high'
train --out run --action fly | choice | train | --action |  | value='fly'
export residual-torque | needs | export |  |  | what=--out PATH
push | unknown command |  |  |  | value='push'
evalute zero | unknown command |  |  | evaluate | value='evalute'
motion imprt | unknown command |  |  | import | value=motion 'imprt'
motion info | needs | motion info |  |  | what=FILE
--vesion | unknown option |  | --vesion | --version |
robot g1 | unknown name |  | robot | unitree_g1 | value='g1'
"""


@pytest.mark.parametrize("line", REFUSED.strip().splitlines())
def test_bad_input_is_one_line_and_exit_code_2(
    line: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The error has the file, the field, what is wrong, and what may have been meant."""
    monkeypatch.chdir(tmp_path)
    command, problem, source, field, meant, facts = (cell.strip() for cell in line.split("|"))
    error = bad_input(command.split(), monkeypatch, capsys)
    assert isinstance(error, Problem) and error.problem == problem
    assert (error.source or "", error.field or "") == (source, field)
    for name, value in (fact.split("=", 1) for fact in facts.split("; ") if fact):
        assert str(error.facts[name]) == value
    assert meant in error.facts.get("hint", "") and (", did you" in str(error)) == bool(meant)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["evaluate"], "controller: give at least one"),
        (["evaluate", "zero", "--suite", "text.yaml"], "text.yaml: not valid YAML"),
        (["evaluate", "zero", "--robot", "robot.yaml"], "robot.yaml: feet: a biped has two feet"),
        (["evaluate", "run"], "a policy folder holds"),
        (["replay", "run", "--trial", "0"], "holds no finished result: settings.yaml"),
        (["compare", "run", "run"], "settings.yaml, summary.json, trials.csv missing"),
        (["leaderboard", "run"], "summary.json: cannot be read"),
        (["report", "run"], "holds no finished result: settings.yaml, summary.json"),
        (["report", "nowhere"], "nowhere: no such folder"),
        (["walk", "--duration", "0"], "duration: must be above 0 and finite, not 0"),
        (
            ["walk", "--push", "9@9", "--push-at", "nan"],
            "push_at: must be within the 20 s",
        ),
        (["walk", "--controller", "zero"], "walk: controller: the controller 'zero' does not walk"),
        (["walk", "--push", "20"], "push: must be an impulse and a direction such as 20@90, not"),
        (["walk", "--push", "a@b"], "push: must be an impulse and a direction such as 20@90, not"),
        (["walk", "--push", "9@9", "--push-at", "30"], "push_at: must be within the 20 s"),
        (["walk", "--video", "a.gif"], "a.gif: the name of a video must end in .mp4 or .webp"),
        (["gait", "--compare", "zero", "--out", "g"], "gait: controller: the controller 'zero' do"),
        (["gait", "--compare", "lip", "lip", "--out", "g"], "compare: needs names, all different"),
        (["gait", "--compare", "lip", "--out", "g", "--speeds", "0"], "speeds: must be finite and"),
        (
            ["gait", "--compare", "lip", "--out", "g", "--duration", "3"],
            "duration: must be at",
        ),
        (
            ["evaluate", "zero", "--suite", "walk"],
            "suite walk: controller: the controller 'zero'",
        ),
        (["walk", "--speed", "9"], "out of range: 'humanoid' supports at most"),
        (["walk", "--controller", "momentum-qp"], "the controller 'momentum-qp' does not walk"),
        (["view", "nowhere", "--trial", "3"], "nowhere: no such folder"),
        (["robot", "robot.yaml", "--out", "run/a.json"], "robot.yaml: feet: a biped has two feet"),
        (["evaluate", "my_file.py:Mine"], "'my_file.py' cannot be imported: FileNotFoundError"),
        (["benchmark"], "benchmark: needs --out PATH"),
        (["train", "--out", "run", "--resume", "--config"], "command line: argument --config: exp"),
        (["train", "--quick", "--resume"], "train: --quick: goes with no --config and no --resume"),
        (["train", "--out", "run", "--start-from", "residul"], "residul: no such folder"),
    ],
)
def test_other_bad_input_is_one_line_and_exit_code_2(
    args: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The line names the file, the field and what is wrong; nothing is written."""
    monkeypatch.chdir(tmp_path)
    assert message in str(bad_input(args, monkeypatch, capsys))


def test_a_traceback_is_left_to_real_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only Poise's own errors become a line."""
    monkeypatch.setitem(entry.COMMANDS, "list", lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        main(["list"])


def test_evaluate_and_replay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One command plays, the other plays one of its trials again and says that it is the same."""
    monkeypatch.setattr(run, "Executor", InProcess)
    InProcess.played, InProcess.stop_after = 0, None
    suite, out = str(write_suite(tmp_path, RANDOM)), str(tmp_path / "out")
    args = ["evaluate", "zero", "--suite", suite, "--out", out, "--trials", "2", "--seed", "3"]
    assert main(args) == 0
    shown = capsys.readouterr().out
    assert InProcess.played == 2 and f"{out}/summary.json" in shown
    command = f"poise view {out} --trial 0 --controllers zero"
    assert f"lost trials of zero: 0, 1 ({command})\n" in shown
    assert main([*args, "--json"]) == 0 and InProcess.played == 2
    told = capsys.readouterr()
    assert json.loads(told.out)["controllers"]["zero"]["recovered"] == 0
    assert "lost trials of zero" in told.err
    other = [*args[:-1], "4"]
    assert main(other) == 2
    assert "holds a result with seed 3, not 4" in capsys.readouterr().err
    assert main([*other, "--overwrite"]) == 0 and InProcess.played == 4
    capsys.readouterr()
    assert main(["replay", out, "--trial", "1"]) == 0
    shown = capsys.readouterr().out
    assert "trial 1, zero: fell" in shown and "exactly as recorded" in shown
    path = tmp_path / "out/trials.csv"
    max_com = load_results(out).record("zero", 1).line["max_com"]
    path.write_text(path.read_text().replace(max_com, "0.5"))
    assert main(["replay", out, "--trial", "1"]) == 1
    assert "differs from the record" in capsys.readouterr().out


def test_ctrl_c_says_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 130, no traceback; the same command finishes the evaluation."""
    monkeypatch.setattr(run, "Executor", InProcess)
    InProcess.played, InProcess.stop_after = 0, 1
    suite, out = str(write_suite(tmp_path, RANDOM)), str(tmp_path / "out")
    args = ["evaluate", "zero", "--suite", suite, "--out", out]
    assert main(args) == 130
    assert f"kept in {out}; the same command goes on" in capsys.readouterr().err
    InProcess.stop_after = None
    assert main(args) == 0 and InProcess.played == 4


def test_list_names_what_is_packaged(capsys: pytest.CaptureFixture[str]) -> None:
    """Every folder of configurations, whatever there is in it, with a line on each."""
    assert main(["list", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    folders = [each.name for each in packaged_folder(".").iterdir() if packaged(each.name)]
    assert {"robots", "envs", "controllers", "suites"} < set(folders)
    for kind in folders:
        assert [entry["name"] for entry in told[kind]] == packaged(kind)
        assert all(each["about"] for each in told[kind]) or kind == "limits", kind
    (torque,) = [entry for entry in told["policies"] if entry["name"] == "residual-torque"]
    assert (torque["robot"], torque["j50"], torque["on"]) == ("humanoid", 38.1, "feedback-step")
    assert main(["list"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "residual-torque humanoid 38.1 targets, steps feedback-step the default" in shown
    assert "as on the leaderboards; suite standard on humanoid, " in shown


def test_j50_of_the_list_is_that_of_the_leaderboards() -> None:
    """Of a controller that was played again the later one, which its page has."""
    docs = Path(__file__).parents[3] / "docs"
    if not docs.is_dir():
        pytest.skip("not a checkout")
    known = json.loads((packaged_folder(".") / FIGURES).read_text())
    scores, suites = known["j50"], known["suites"]
    assert scores.keys() == suites.keys()
    for page in docs.glob("leaderboard*.md"):
        measured: dict[str, float] = {}
        for source in re.findall(r"docs/results/\S+?\.json", page.read_text().splitlines()[2]):
            result = json.loads((docs.parent / source).read_text())
            measured |= {name: own["j50_mean"] for name, own in result["controllers"].items()}
            assert suites[result["robot"]["name"]] == result["suite"]
        assert measured
        for name, told in scores[result["robot"]["name"]].items():
            if name in measured:
                assert told == pytest.approx(measured[name], abs=0.3), name


def test_without_arguments_the_commands_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    """So does `python -m poise`."""
    assert main([]) == 0
    assert "  demo " in capsys.readouterr().out
    done = subprocess.run([sys.executable, "-m", "poise", "--version"], capture_output=True,
                          text=True, check=True)  # fmt: skip
    assert done.stdout == f"poise {poise.__version__}\n"


@pytest.mark.parametrize("command", ["evaluate", "benchmark"])
def test_help_says_how_an_own_class_is_named(
    capsys: pytest.CaptureFixture[str], command: str
) -> None:
    assert main([command, "--help"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "--allow my_file.py:Class" in shown and shown.count("my_file.py:Class") == 2


@pytest.mark.parametrize("command", ["evaluate", "benchmark", "replay", "report", "tune", "train"])
def test_help_says_what_may_be_allowed(capsys: pytest.CaptureFixture[str], command: str) -> None:
    """Whatever `poise.allowing` takes."""
    assert main([command, "--help"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "--allow NAME" in shown
    assert "module:Class or file.py:Class" in shown and all(end in shown for end in SCRIPTS)


def test_flags_of_train_replace_fields_of_the_file(tmp_path: Path) -> None:
    """Nested fields by dotted flags; the rest is the file's; ranges are checked."""
    path = tmp_path / "mine.yaml"
    path.write_text("steps: 1000\nseed: 5\nppo: {n_envs: 4}\nenv: {duration: 3.0}\n")
    args = ["--config", str(path), "--out", "run", "--seed", "7", "--ppo.net-arch", "8", "16"]
    command = parse_train([*args, "--env.pushes.magnitude", "0.1", "0.3", "--resume"])
    settings = command.settings
    assert (settings.steps, settings.seed, settings.ppo.n_envs) == (1000, 7, 4)
    assert settings.ppo.net_arch == (8, 16) and settings.env.duration == 3.0
    assert settings.env.pushes is not None and settings.env.pushes.magnitude == (0.1, 0.3)
    assert command.resume and command.out == Path("run")
    with pytest.raises(ConfigError, match="command line: env.duration"):
        parse_train([*args, "--env.duration", "-1"])


def test_train_without_flags_is_the_packaged_configuration() -> None:
    """No flag changes a field by itself."""
    command = parse_train(["--out", "run"])
    assert to_dict(command.settings) == to_dict(train_config(train_command.DEFAULT))
    assert not command.resume


def test_a_quick_training_needs_no_folder() -> None:
    """The packaged configuration of that name; flags replace its fields. It stays small."""
    command = parse_train(["--quick", "--seed", "3"])
    assert command.settings == replace(train_config("quick"), seed=3)
    assert command.out == Path("runs/quick") and command.settings.steps <= 500_000
    assert parse_train(["--quick", "--out", "run"]).out == Path("run")


def test_another_robot_is_trained_by_a_configuration_that_fits_it() -> None:
    """The packaged default names bodies of the humanoid."""
    settings = parse_train(["--out", "run", "--robot", "tall"]).settings
    assert settings == replace(train_config(train_command.ANY_ROBOT), robot="tall")
    humanoid = str(resolve("robots", "humanoid"))
    same = parse_train(["--out", "run", "--robot", humanoid]).settings
    assert same == replace(train_config(train_command.DEFAULT), robot=humanoid)
    named = parse_train(["--out", "run", "--robot", "tall", "--config", "residual"]).settings
    assert named == replace(train_config("residual"), robot="tall")


def test_resume_takes_the_runs_own_configuration(tmp_path: Path) -> None:
    """Without --config, a run goes on as it was started."""
    (tmp_path / "config.yaml").write_text("steps: 77\n")
    command = parse_train(["--out", str(tmp_path), "--resume"])
    assert command.settings == TrainConfig(steps=77)
    assert parse_train(["--out", str(tmp_path)]).settings.steps != 77


def test_train_trains(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sub-command hands configuration, folder and resume on."""
    seen = []

    def train(*args: object, allow: object) -> Path:
        seen.append(args)
        return tmp_path

    monkeypatch.setattr(train_command, "train", train)
    assert main(["train", "--out", str(tmp_path), "--steps", "9"]) == 0
    ((config, out, resume),) = seen
    assert config.steps == 9 and out == tmp_path and resume is False


@pytest.mark.parametrize(
    "error",
    [MemoryError("Unable to allocate 8 GiB"), mujoco.FatalError("Could not allocate memory")],
)
def test_too_little_memory_is_told_in_a_line(
    error: Exception, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """NumPy's error and MuJoCo's; other errors of MuJoCo stay what they are."""

    def full(*_: object) -> int:
        raise error

    monkeypatch.setattr(entry, "_run", full)
    assert entry.main(["list"]) == 2
    text = capsys.readouterr().err
    assert text.startswith("poise: there is not enough memory: ") and text.count("\n") == 1
    error = mujoco.FatalError("invalid name")
    with pytest.raises(mujoco.FatalError, match="invalid name"):
        entry.main(["list"])


@pytest.mark.parametrize(("push", "code"), [("5@90", 0), ("150@0", 1)])
def test_a_walk_that_falls_exits_with_code_1(
    push: str, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["walk", "--duration", "4", "--push", push, "--push-at", "1.5"]) == code
    assert ("fell after" in capsys.readouterr().out) == bool(code)
