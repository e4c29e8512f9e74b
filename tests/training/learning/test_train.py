"""Training: what a run writes, that it repeats, and that it survives a kill."""

import csv
import json
import shlex
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from poise.baselines.balance.stepping.capture_step import CaptureStep
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.configs.errors import ConfigError
from poise.configs.schema import build, read_yaml
from poise.envs.balance.mdp.reward import REWARD_TERMS
from poise.envs.balance.vector.batch import EnvBatch
from poise.envs.physics.pushes.sampler import PushSampler
from poise.envs.sensing.realism import load_realism
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.cli.train import parse_train
from poise.training.learning import callbacks, curriculum
from poise.training.learning.callbacks import Progress
from poise.training.learning.config import Curriculum, PPOConfig, TrainConfig, train_config
from poise.training.learning.policy import load_policy
from poise.training.learning.policy_files import FILES, KEPT, POLICY, STATE
from poise.training.learning.seeds.train import train_seeds
from poise.training.learning.train import _env_seed, train
from poise.training.running import stopping
from poise.training.running.terminal import ProgressLines
from tests.support.shared import finished_run, robot, tiny_config

ROOT = Path(__file__).parents[3]
ROLLOUT = 64  # steps of the tiny configuration


def weights(run, which="last"):
    return [array for layer in load_policy(run / which).layers for array in layer]


def evaluations(run):
    with open(run / "evaluations.csv") as file:
        return list(csv.DictReader(file))


def state(run, which="last"):
    return json.loads((run / which / STATE).read_text())


@pytest.fixture
def run(tmp_path):
    """A copy of the finished run, to write into."""
    return Path(shutil.copytree(finished_run(), tmp_path / "run"))


def test_a_run_writes_everything():
    """best/ and last/ whole, the configuration, the evaluations and TensorBoard's scalars."""
    run = finished_run()
    assert sorted(path.name for path in run.iterdir()) == [
        *("best", "config.yaml", "evaluations.csv", "last", "tensorboard"),
    ]
    for which in ("best", "last"):
        assert sorted(path.name for path in (run / which).iterdir()) == sorted(FILES)
    for path in (run / "config.yaml", run / "last" / "config.yaml"):
        assert build(TrainConfig, read_yaml(path), str(path)) == tiny_config()
    assert state(run)["timesteps"] == 192
    rows = evaluations(run)
    assert [int(row["timesteps"]) for row in rows] == [0, 128, 192]
    assert float(rows[0]["mean_abs_action"]) == 0.0  # the controller alone
    assert float(rows[-1]["mean_abs_action"]) > 0.0
    assert all(0.0 <= float(row["recovered"]) <= 1.0 for row in rows)
    events = EventAccumulator(str(run / "tensorboard"))
    events.Reload()
    tags = events.Tags()["scalars"]
    for tag in ("evaluation/recovered", "train/loss", "rollout/ep_rew_mean", "curriculum/largest"):
        assert tag in tags
    terms = {tag.removeprefix("reward/") for tag in tags if tag.startswith("reward/")}
    assert {"alive", "com", "effort"} < terms <= set(REWARD_TERMS)
    alive = [event.value for event in events.Scalars("reward/alive")]
    assert len(alive) == 3 and all(0.0 < value <= tiny_config().env.reward.alive for value in alive)
    assert [s.step for s in events.Scalars("evaluation/recovered")] == [0, 128, 192]


class Counter(BaseCallback):
    """Counts the steps that it is told of."""

    steps = 0

    def _on_step(self):
        self.steps += self.training_env.num_envs
        return True


def test_a_callback_of_the_user_is_called_and_changes_nothing(tmp_path):
    counter = Counter()
    out = tmp_path / "run"
    train(replace(tiny_config(), steps=64), out, progress=False, callback=counter)
    assert counter.steps == 64
    train(replace(tiny_config(), steps=64), tmp_path / "plain", progress=False)
    for a, b in zip(weights(out), weights(tmp_path / "plain"), strict=True):
        assert np.array_equal(a[0], b[0])


def test_a_stop_tells_the_command_that_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(stopping, "_kept", [])
    out = tmp_path / "my run"
    train(replace(tiny_config(), steps=64), out, progress=False, allow="mine:Controller")
    said = stopping.stop_message().partition("go on with: ")[2]
    assert shlex.split(said) == ["poise", "train", "--out", str(out), "--resume",
                                 "--allow", "mine:Controller"]  # fmt: skip
    assert parse_train(shlex.split(said)[2:]).resume


def test_policies_are_kept_when_told(tmp_path):
    """At the start and whenever so many more steps are done; the training keeps its bits."""
    train(tiny_config(steps=128, keep_every=100), tmp_path, progress=False)
    assert sorted(path.name for path in (tmp_path / KEPT).iterdir()) == [
        f"{n:010d}" for n in (0, 128)
    ]
    train(tiny_config(keep_every=ROLLOUT), tmp_path, resume=True, progress=False)
    kept = sorted((tmp_path / KEPT).iterdir())
    assert [int(path.name) for path in kept] == [0, 128, 192]
    assert state(tmp_path, f"{KEPT}/0000000128")["timesteps"] == 128
    train(tiny_config(steps=128), tmp_path / "plain", progress=False)
    for a, b in zip(
        weights(tmp_path, f"{KEPT}/0000000128"), weights(tmp_path / "plain"), strict=True
    ):
        assert np.array_equal(a, b)
    agent = load_agent(str(kept[1]), robot())
    assert agent.timesteps == 128


def test_best_is_the_best_evaluation():
    """best/ holds the first of the highest scores that training has reached."""
    run = finished_run()
    rows = evaluations(run)
    scores = [float(row["score"]) for row in rows]
    best = int(rows[1 + int(np.argmax(scores[1:]))]["timesteps"])
    assert state(run, "best")["timesteps"] == best


@pytest.mark.parametrize("threads", [1, 2])
def test_the_same_seed_gives_the_same_weights(tmp_path, threads):
    """A second run, in any number of threads, ends with the same bits."""
    train(tiny_config(threads=threads), tmp_path, progress=False)
    for a, b in zip(weights(tmp_path), weights(finished_run()), strict=True):
        assert np.array_equal(a, b)
    assert evaluations(tmp_path) == evaluations(finished_run())


def test_another_seed_gives_other_weights(tmp_path):
    """The seed of the configuration decides."""
    train(tiny_config(seed=1, steps=64), tmp_path, progress=False)
    assert not np.array_equal(weights(tmp_path)[0], weights(finished_run())[0])
    assert evaluations(tmp_path)[0] == evaluations(finished_run())[0]  # held-out pushes are fixed


def test_every_evaluation_meets_the_same_pushes(tmp_path, monkeypatch):
    """The held-out seeds do not change as the run goes on, and are not those of training."""
    seeds, reset = [], EnvBatch.reset

    def spy(self, given, *rest):
        seeds.append(list(given))
        return reset(self, given, *rest)

    monkeypatch.setattr(EnvBatch, "reset", spy)
    train(tiny_config(steps=128), tmp_path, progress=False)
    held_out = [given for given in seeds if len(given) == 5]
    trained = [seed for given in seeds if len(given) == 4 for seed in given]
    assert len(held_out) == 2 and held_out[0] == held_out[1] and len(set(held_out[0])) == 5
    assert len(set(trained)) == 4 and not set(trained) & set(held_out[0])


def test_an_evaluated_policy_sees_every_step(tmp_path, monkeypatch):
    """What it acts on is what the step before has left."""
    seen, predict = [], PPO.predict

    def spy(self, observation, *rest, **named):
        seen.append(observation.copy())
        return predict(self, observation, *rest, **named)

    monkeypatch.setattr(PPO, "predict", spy)
    train(tiny_config(steps=64), tmp_path, progress=False)
    assert len(seen) > 20
    for before, after in pairwise(seen):
        assert (before != after).any(axis=1).all()


def test_neighbouring_seeds_share_no_environment():
    """Environment i of a run gets seed + i: the first seeds of two runs lie far apart."""
    first = sorted(_env_seed(seed) for seed in range(50))
    assert np.diff(first).min() > 256


def test_last_is_written_after_every_rollout(tmp_path, monkeypatch):
    """A kill at any time loses at most the rollout that is running."""
    saved = []

    def spy(folder, model, normalize, config, state):
        saved.append((folder.name, state["timesteps"], len(state["evaluations"])))

    monkeypatch.setattr(callbacks, "save_checkpoint", spy)
    train(tiny_config(), tmp_path, progress=False)
    last = [(steps, rows) for name, steps, rows in saved if name == "last"]
    assert last == [(0, 1), (64, 1), (128, 1), (128, 2), (192, 3)]
    assert saved[0] == ("best", 0, 1)  # the controller alone


def test_a_killed_run_resumes(tmp_path):
    """After SIGKILL the run goes on from the last rollout and reaches its steps."""
    out = tmp_path / "run"
    code = (
        "from tests.support.shared import tiny_config\n"
        "from poise.training.learning.train import train\n"
        f"train(tiny_config(steps=10**6), {str(out)!r}, progress=False)"
    )
    process = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stderr=subprocess.PIPE)
    deadline, seen = time.monotonic() + 300.0, -1
    while seen < 2 * ROLLOUT:
        assert process.poll() is None, process.stderr.read().decode()
        assert time.monotonic() < deadline
        time.sleep(0.02)
        try:
            seen = state(out)["timesteps"]
        except (OSError, ValueError):  # not there yet, or just being replaced
            continue
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stderr.close()

    last = out / "last" if (out / "last").exists() else out / ".last.old"
    reached = json.loads((last / STATE).read_text())["timesteps"]
    assert reached >= seen
    config = tiny_config(steps=reached + 100, threads=2)
    train(config, out, resume=True, progress=False)
    assert state(out)["timesteps"] == reached + 2 * ROLLOUT
    steps = [int(row["timesteps"]) for row in evaluations(out)]
    assert steps[0] == 0 and steps == sorted(set(steps)) and steps[-1] == reached + 2 * ROLLOUT
    assert read_yaml(out / "config.yaml")["steps"] == config.steps
    load_policy(out)


def test_resuming_goes_on_from_the_weights(run):
    """With no steps left nothing changes; with more, training goes on from what there was."""
    before = weights(run)
    train(tiny_config(), run, resume=True, progress=False)
    assert all(np.array_equal(a, b) for a, b in zip(weights(run), before, strict=True))
    train(tiny_config(steps=256), run, resume=True, progress=False)
    after = weights(run)
    moved = np.abs(after[0] - before[0]).max()
    assert 0.0 < moved < 0.05  # a few small steps, no new start
    assert state(run)["timesteps"] == 256
    assert [int(row["timesteps"]) for row in evaluations(run)] == [0, 128, 192, 256]


def test_a_run_starts_from_a_policy(tmp_path):
    """Its first evaluation is that policy's; weights go on from there, steps from 0."""
    first = tiny_config(start_from=str(finished_run() / "last"), seed=5)
    train(first, tmp_path / "run", progress=False)
    before, after = weights(finished_run()), weights(tmp_path / "run")
    change = max(abs(a - b).max() for a, b in zip(before, after, strict=True))
    assert 0.0 < change < 0.05  # another seed's own first weights are further away
    assert state(tmp_path / "run")["timesteps"] == first.steps
    assert evaluations(tmp_path / "run")[0]["mean_abs_action"] != "0.0"


def test_a_larger_network_starts_as_the_policy(tmp_path):
    """Its first evaluation is that of the smaller network; then its new units learn."""
    start = str(finished_run() / "last")
    wide = replace(tiny_config().ppo, net_arch=(32, 24))
    for name, ppo in (("narrow", tiny_config().ppo), ("wide", wide)):
        train(tiny_config(start_from=start, ppo=ppo), tmp_path / name, progress=False)
    narrow, grown = (evaluations(tmp_path / name)[0] for name in ("narrow", "wide"))
    assert float(grown["mean_abs_action"]) == pytest.approx(float(narrow["mean_abs_action"]))
    outgoing = next(w for w in weights(tmp_path / "wide") if w.shape == (32, 24))
    assert np.abs(outgoing[16:, :16]).max() > 0.0


def test_a_start_that_is_no_policy_is_refused(tmp_path):
    """Before anything is written: no such policy, or more layers or units than asked for."""
    with pytest.raises(ConfigError, match="nowhere: no such folder.*residual-step"):
        train(tiny_config(start_from="nowhere"), tmp_path / "run", progress=False)
    start = str(finished_run() / "last")
    for widths, said in (((8,), "other layers"), ((8, 16), "has shape")):
        ppo = replace(tiny_config().ppo, net_arch=widths)
        with pytest.raises(ConfigError, match=rf"policy\.zip: cannot be read.*{said}"):
            train(tiny_config(start_from=start, ppo=ppo), tmp_path / "run", progress=False)
    assert not (tmp_path / "run").exists()


def snapshot(folder):
    return {p: p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.mark.parametrize(
    ("config", "resume", "named"),
    [
        (tiny_config(), False, ("already holds", "--resume")),
        (tiny_config(seed=3), True, ("another configuration", "seed")),
        (tiny_config(ppo=PPOConfig(n_envs=2)), True, ("another configuration", "ppo")),
    ],
)
def test_a_run_is_not_written_over(run, config, resume, named):
    """One error names the folder and the way out; no file changes."""
    before = snapshot(run)
    with pytest.raises(ConfigError) as error:
        train(config, run, resume=resume, progress=False)
    for word in (str(run), *named):
        assert word in str(error.value)
    assert snapshot(run) == before


def test_nothing_to_resume(tmp_path):
    """Resuming an empty folder is refused, and leaves it empty."""
    with pytest.raises(ConfigError, match="no run to resume"):
        train(tiny_config(), tmp_path, resume=True, progress=False)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("spoil", ["truncate", "fingerprint", "controller_fingerprint"])
def test_a_damaged_run_is_not_resumed(run, spoil):
    """One error names the file; nothing is written over."""
    path = run / "last" / (POLICY if spoil == "truncate" else STATE)
    if spoil == "truncate":
        path.write_bytes(path.read_bytes()[:5000])
    else:
        path.write_text(json.dumps({**state(run), spoil: "0" * 64}))
    before = snapshot(run)
    with pytest.raises(ConfigError, match=path.name):
        train(tiny_config(steps=256), run, resume=True, progress=False)
    assert snapshot(run) == before


def test_the_curriculum_grows_the_pushes(tmp_path, monkeypatch):
    """The largest push starts small and reaches its size after its fraction of the run."""
    largest = []
    start = curriculum.ScheduleCallback._on_rollout_start

    def spy(self):
        start(self)
        largest.append(self.training_env.get_attr("push_sampler")[0].magnitude)

    monkeypatch.setattr(curriculum.ScheduleCallback, "_on_rollout_start", spy)
    config = tiny_config(steps=256, curriculum=Curriculum(start=0.1, share=0.5))
    config = replace(config, evaluation=replace(config.evaluation, trials=1))
    train(config, tmp_path, progress=False)
    expected = [(0.06, 0.06), (0.1, 0.33), (0.1, 0.6), (0.1, 0.6)]
    np.testing.assert_allclose(largest[:4], expected)


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        ({}, [1.0, 1.0, 1.0, 1.0]),
        ({"mixed": True}, [0.125, 0.375, 0.625, 0.875]),
        ({"levels": ("field", "lab", "late")}, [1.0, 0.2, 0.0, 1.0]),  # lab's is a fifth of field's
        ({"levels": ("field", "lab"), "mixed": True}, [0.125, 0.075, 0.625, 0.175]),
    ],
)
def test_the_curriculum_grows_the_errors_of_the_robot(given, parts, tmp_path, monkeypatch):
    """The level of realism is a part of the final one, and that one after its share of the run.

    Mixed, the environments of a run have levels from ideal to that one; with levels, these in turn.
    """
    noises = []
    start = curriculum.ScheduleCallback._on_rollout_start

    def spy(self):
        start(self)
        levels = self.training_env.get_attr("realism")
        noises.append([level.sensors.gyro_noise for level in levels])

    monkeypatch.setattr(curriculum.ScheduleCallback, "_on_rollout_start", spy)
    config = tiny_config(steps=256, curriculum=Curriculum(realism=0.2, share=0.5, **given))
    config = replace(config, env=replace(config.env, realism=load_realism("field")))
    config = replace(config, evaluation=replace(config.evaluation, trials=1))
    train(config, tmp_path, progress=False)
    expected = 0.05 * np.outer([0.2, 0.6, 1.0, 1.0], parts)
    np.testing.assert_allclose(noises[:4], expected)


def test_the_progress_shows_steps_and_success_and_says_when_it_evaluates(tmp_path, monkeypatch):
    """At the start, where the first line is printed, and at the end; rollouts are whole."""
    said = []
    update = Progress.say
    monkeypatch.setattr(Progress, "say", lambda bar, text: (said.append(text), update(bar, text)))
    seen = []
    monkeypatch.setattr(ProgressLines, "update", lambda bar, task, **changes: seen.append(changes))
    train(tiny_config(steps=100), tmp_path, progress=True)
    trials = tiny_config().evaluation.trials
    assert seen[0] == {"rate": f"evaluating: 0/{trials} pushes"}
    assert said[0] == said[-2] == seen[0]["rate"] and said[1] == said[-1] == ""
    last = [each for each in seen if "completed" in each][-1]
    assert last["completed"] == 128 and last["rate"].endswith("/s")


def test_the_progress_ends_where_the_last_rollout_does(capsys):
    """Not at the steps that were asked for."""
    bar = Progress(tiny_config(steps=100))
    bar.num_timesteps, bar.locals = 0, {}
    bar._on_training_start()
    bar.say("evaluating")
    bar.close()
    assert "0/128" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("section", "named"),
    [
        ({"ppo": {"n_envs": 1, "n_steps": 1}}, "ppo: n_envs"),
        ({"ppo": {"net_arch": [64, 0]}}, "ppo: net_arch"),
        ({"ppo": {"gamma": 1.5}}, "ppo.gamma"),
        ({"ppo": {"lr": 1e-3}}, "ppo.lr.*learning_rate"),
        ({"steps": 0}, "steps"),
        ({"seed": 1.5}, "seed"),
        ({"evaluation": {"trials": 0}}, "evaluation.trials"),
    ],
)
def test_bad_configurations_are_refused(section, named):
    """One error names the field, the value and the choices."""
    with pytest.raises(ConfigError, match=named):
        build(TrainConfig, section, "test")


def test_a_level_that_is_not_there_is_refused_before_anything_is_written(tmp_path):
    """One error with field and choices, no folder; seeds likewise."""
    config = tiny_config(curriculum=Curriculum(levels=("field", "lat")))
    named = "^curriculum.levels: no such name: 'lat', did you mean late.*choices: arms, field"
    with pytest.raises(ConfigError, match=named):
        train(config, tmp_path / "run")
    with pytest.raises(ConfigError, match=named):
        train_seeds(config, [0, 1], tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("which", ["env", "evaluation"])
def test_pushes_that_do_not_fit_the_robot_are_refused_before_anything_is_written(tmp_path, which):
    """A body that the robot lacks: one error with field and choices, no folder; seeds likewise."""
    config = tiny_config()
    pushes = PushSampler(magnitude=(0.1, 0.2), unit="specific_impulse", bodies=("tail",))
    config = replace(config, **{which: replace(getattr(config, which), pushes=pushes)})
    named = f"^{which}.pushes.bodies: no body 'tail' .*choices: .*torso"
    with pytest.raises(ConfigError, match=named):
        train(config, tmp_path / "run")
    with pytest.raises(ConfigError, match=named):
        train_seeds(config, [0, 1], tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_steps_are_trained_by_a_word_in_the_configuration(tmp_path):
    """`action: step` trains in `ResidualStepEnv` around `capture-step`, with its own scales."""
    config = train_config("residual-step")
    env = config.make_env()
    assert type(env) is ResidualStepEnv and type(env.controller) is CaptureStep
    assert env.residual == config.step_residual and env.residual.foothold > 0.0
    small = tiny_config(
        action="step", controller="capture-step", step_residual=config.step_residual, steps=128
    )
    train(small, tmp_path / "run", progress=False)
    agent = load_agent(str(tmp_path / "run"), robot(), duration=0.5)
    assert type(agent.env) is ResidualStepEnv
    action = agent.act(agent.env.reset(seed=0)[0])
    assert action.shape == (len(agent.env.action_names),)
