"""Trained policies in NumPy: the same actions as SB3, and nothing executed on loading."""

import io
import json
import pickle
import shutil
import zipfile
from base64 import b64encode
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml
from stable_baselines3.common.evaluation import evaluate_policy

import poise
from poise.baselines.registry import controller_config
from poise.configs.errors import ConfigError, PoiseWarning
from poise.configs.files import resolve
from poise.envs import load_robot, replicate
from poise.training import ThreadedVecEnv
from poise.training.learning.checkpoints import restore, save_checkpoint
from poise.training.learning.policy import load_policy
from poise.training.learning.policy_files import (
    CONFIG,
    FILES,
    POLICY,
    STATE,
    STATISTICS,
    controller_fingerprint,
)
from poise.training.learning.train import _training_envs, make_model
from tests.support.shared import finished_run, robot, tiny_config


@pytest.fixture(scope="module")
def model():
    normalize = _training_envs(tiny_config())
    model = make_model(tiny_config(), normalize)
    yield model
    normalize.close()


@pytest.fixture
def folder(tmp_path):
    """A copy of a policy folder, to spoil."""
    return Path(shutil.copytree(finished_run() / "last", tmp_path / "policy"))


def observations(model, n=200):
    rng = np.random.default_rng(0)
    return rng.uniform(-12.0, 12.0, (n, *model.observation_space.shape)).astype(np.float32)


def test_it_acts_as_sb3_does(model):
    """On random observations the NumPy policy equals model.predict to 1e-5."""
    normalize = model.get_env()
    restore(finished_run() / "last", model, normalize, robot().fingerprint)
    with torch.no_grad():  # larger actions than a few steps of training give
        model.policy.action_net.weight.mul_(50.0)
    policy = load_policy(finished_run() / "last")
    weight, bias = policy.layers[-1]
    policy.layers[-1] = (50.0 * weight, bias)
    seen = observations(model)
    expected, _ = model.predict(normalize.normalize_obs(seen), deterministic=True)
    actions = policy.act(seen)
    assert actions.shape == expected.shape and np.ptp(expected) > 0.5
    np.testing.assert_allclose(actions, expected, atol=1e-5)


def test_predict_is_act_as_sb3_calls_it():
    """One observation or several, in the action space's numbers; code for SB3's models takes it."""
    policy = poise.load_policy()
    env = policy.make_env(duration=0.2)
    observation, _ = env.reset(seed=0)
    batch = np.stack([observation, 0.5 * observation])
    action, state = policy.predict(observation)
    assert state is None and env.action_space.contains(action)
    assert np.array_equal(action, policy.act(observation).astype(np.float32))
    starts = np.array([True, False])
    actions, state = policy.predict(batch, state=None, episode_start=starts, deterministic=True)
    assert state is None and actions.shape == (2, *env.action_space.shape)
    assert np.array_equal(actions[0], action) and np.any(actions[1] != action)
    with pytest.raises(ConfigError, match="deterministic: has the mean of its actions only"):
        policy.predict(observation, deterministic=False)
    envs = ThreadedVecEnv(replicate(env, 2))
    mean, _ = evaluate_policy(policy, envs, n_eval_episodes=2, warn=False)
    assert mean > 5.0  # ten steps upright
    envs.close()


def test_an_entry_that_never_changed_is_no_division_by_zero(folder):
    """A variance of zero, as of feet that never left the ground, gives finite actions."""
    with np.load(folder / STATISTICS) as data:
        arrays = dict(data)
    arrays["obs_var"][3] = 0.0
    np.savez(folder / STATISTICS, **arrays)
    policy = load_policy(folder)
    assert np.isfinite(policy.act(arrays["obs_mean"])).all()
    assert np.isfinite(policy.act(arrays["obs_mean"] + 1e-3)).all()


def test_one_observation_gives_the_same_bits_as_a_batch():
    """What an observation makes of it does not depend on its company."""
    policy = load_policy(finished_run())
    seen = np.random.default_rng(1).normal(size=(7, len(policy.mean)))
    batch = policy.act(seen)
    assert batch.shape == (7, policy.layers[-1][0].shape[1])
    for row, action in zip(seen, batch, strict=True):
        assert np.array_equal(policy.act(row), action)
    assert np.array_equal(policy.act(seen[:3]), batch[:3])


def test_the_first_policy_is_the_controller_alone(tmp_path):
    """Before any training the action is exactly zero, whatever is observed."""
    normalize = _training_envs(tiny_config())
    model = make_model(tiny_config(), normalize)
    seen = observations(model, 20)
    assert not model.predict(seen, deterministic=True)[0].any()
    config = tiny_config()
    state = {
        "timesteps": 0,
        "fingerprint": robot().fingerprint,
        "controller_fingerprint": controller_fingerprint(config),
    }
    save_checkpoint(tmp_path / "first", model, normalize, config, state)
    assert not load_policy(tmp_path / "first").act(seen).any()
    normalize.close()


def test_a_policy_brings_its_environment():
    """It acts in the environment of its own configuration, which arguments may change."""
    policy = load_policy(finished_run())
    env = policy.make_env(duration=0.1)
    assert env.config.pushes == tiny_config().env.pushes and env.config.duration == 0.1
    observation, _ = env.reset(seed=0)
    action = policy.act(observation)
    assert action.shape == env.action_space.shape
    env.step(action)


def test_an_environment_is_made_from_a_policy_or_a_configuration():
    """By name, folder or object; what is neither is refused with what there is."""
    run = finished_run()
    for name in (run, load_policy(run), tiny_config(), "any-robot"):
        env = poise.make_env(name, duration=0.1)
        assert env.config.duration == 0.1 and env.controller is not None
    with pytest.raises(ConfigError, match="no such folder, and no packaged policy"):
        poise.make_env("residul")


def test_what_was_learned_in_field_stays_on_its_gains():
    """There another controller takes the place of `walk` alone, and under an ideal policy."""
    walk, field = controller_config("walk"), controller_config("walk-field")
    for name, below in (("residual-walk", field), ("residual-walk-field", walk)):
        env = poise.make_env(name, realism="field")
        env.reset(seed=0)
        assert env.controller.config.gait == below.gait, name
    assert walk.gait != field.gait


def test_a_run_folder_means_its_best():
    """load_policy takes a run, a policy folder, or text."""
    run = finished_run()
    best = load_policy(run / "best").layers[0][0]
    assert np.array_equal(load_policy(run).layers[0][0], best)
    assert np.array_equal(poise.load_policy(str(run)).layers[0][0], best)


@pytest.mark.parametrize("name", FILES)
def test_a_missing_file_is_named(folder, name):
    """A policy without its statistics, or any other file, is refused."""
    (folder / name).unlink()
    with pytest.raises(ConfigError, match=f"policy: {name}: no {name}"):
        load_policy(folder)
    with pytest.raises(ConfigError, match="nowhere: no such folder.*choices: ppo-position"):
        load_policy(folder / "nowhere")


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.99])
def test_a_truncated_file_is_named(folder, name, share):
    """However much is left of a file, the error names it."""
    whole = (folder / name).read_bytes()
    (folder / name).write_bytes(whole[: int(share * len(whole))])
    if name == CONFIG and share > 0.0:  # half a YAML may still be YAML
        (folder / name).write_bytes(whole[: int(share * len(whole))] + b": [")
    with pytest.raises(ConfigError, match=name):
        load_policy(folder)


def test_other_bytes_in_the_weights_are_refused(folder):
    """A flipped byte inside policy.zip does not pass as weights."""
    data = bytearray((folder / POLICY).read_bytes())
    with zipfile.ZipFile(folder / POLICY) as archive:
        middle = archive.getinfo("policy.pth").header_offset + 3000
    data[middle] ^= 0xFF
    (folder / POLICY).write_bytes(data)
    with pytest.raises(ConfigError, match=POLICY):
        load_policy(folder)


def test_another_robot_is_refused(folder):
    """The fingerprint of the robot must be that of the training."""
    with pytest.raises(
        ConfigError, match=f"{STATE}: robot: the policy was trained on the robot 'humanoid'"
    ):
        load_policy(folder, robot("tall"))
    with pytest.raises(ConfigError, match="'humanoid', not on 'tall'"):
        load_policy(folder, robot("tall"))
    assert load_policy(folder, robot()).state["robot"] == "humanoid"


def test_another_version_of_the_controller_is_refused(folder):
    """A policy moves the targets of the gains that it learned on."""
    state = json.loads((folder / STATE).read_text())
    (folder / STATE).write_text(json.dumps({**state, "controller_fingerprint": "0" * 64}))
    with pytest.raises(ConfigError, match=f"{STATE}: controller: .*momentum-qp"):
        load_policy(folder)


def test_another_action_size_is_refused(folder):
    """A configuration with more residuals than the network has outputs is refused."""
    config = (folder / CONFIG).read_text()
    assert "height: 0.0" in config
    (folder / CONFIG).write_text(config.replace("height: 0.0", "height: 0.1"))
    with pytest.raises(ConfigError, match="is for .* the environment has"):
        load_policy(folder)


def rewrite(folder, **changes):
    """policy.zip with some members replaced; functions get the old bytes."""
    with zipfile.ZipFile(folder / POLICY) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(folder / POLICY, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, changes.get(name.replace(".", "_"), data))


def weights(folder, change):
    """The bytes of policy.pth after `change(weights)`."""
    with zipfile.ZipFile(folder / POLICY) as archive:
        loaded = torch.load(io.BytesIO(archive.read("policy.pth")), weights_only=True)
    change(loaded)
    blob = io.BytesIO()
    torch.save(loaded, blob)
    return blob.getvalue()


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda w: w["action_net.weight"].fill_(float("nan")), "not finite"),
        (lambda w: w.pop("action_net.bias"), "action_net.bias"),
        (lambda w: w.update({"action_net.weight": torch.zeros(6, 16)}), "a bias does not fit"),
        (
            lambda w: w.update(
                {"action_net.weight": torch.zeros(6, 16), "action_net.bias": torch.zeros(6)}
            ),
            "6 actions",
        ),
        (lambda w: w.update({"action_net.weight": torch.zeros(4, 9)}), "layers do not fit"),
        (lambda w: w.update({"action_net.weight": "text"}), "action_net.weight is a str"),
    ],
)
def test_weights_that_make_no_policy_are_refused(folder, change, named):
    """Wrong shapes, sizes and numbers are found before the first action."""
    rewrite(folder, policy_pth=weights(folder, change))
    with pytest.raises(ConfigError, match=f"{POLICY}.*{named}"):
        load_policy(folder)


@pytest.mark.parametrize("wrong", [np.nan, -1.0])
def test_statistics_that_are_none_are_refused(folder, wrong):
    """A variance that is negative or not a number is refused."""
    with np.load(folder / STATISTICS) as data:
        arrays = dict(data)
    arrays["obs_var"][3] = wrong
    np.savez(folder / STATISTICS, **arrays)
    with pytest.raises(ConfigError, match=f"{STATISTICS}.*not statistics"):
        load_policy(folder)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("obs_mean", lambda x: x.astype(complex)),
        ("obs_mean", lambda x: x.astype("M8[s]")),
        ("obs_mean", lambda x: x.astype([("a", float)])),
        ("obs_var", lambda x: x > 0.0),
        ("obs_mean", lambda x: x + 1e308),
        ("obs_var", lambda x: x + 1e38),
        ("epsilon", lambda x: np.array(5e-324)),
        ("clip_obs", lambda x: np.array(1e300)),
        ("clip_obs", lambda x: np.ones(3)),
    ],
)
def test_statistics_are_floats_of_a_sane_size(folder, name, value):
    """Complex numbers, dates, records, flags, and numbers that no training gives."""
    with np.load(folder / STATISTICS) as data:
        arrays = dict(data)
    np.savez(folder / STATISTICS, **{**arrays, name: value(arrays[name])})
    with pytest.raises(ConfigError, match=f"{STATISTICS}.*({name}|other shapes)"):
        load_policy(folder)


@pytest.mark.parametrize("reader", ["load_policy", "restore"])
@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda w: w.to(torch.complex64), "torch.complex64"),
        (lambda w: w > 0.0, "torch.bool"),
        (lambda w: w.to(torch.int64), "torch.int64"),
        (lambda w: w + 1e38, "at most 1e"),
        (lambda w: torch.zeros(1).expand(100_000, 100_000), "larger than their file"),
    ],
)
def test_weights_are_floats_of_a_sane_size(folder, model, reader, change, named):
    """Complex numbers, flags, whole numbers, huge ones, and a number that is repeated 10^10 times,
    by evaluation and by resuming."""
    key = "action_net.weight"
    rewrite(folder, policy_pth=weights(folder, lambda w: w.update({key: change(w[key])})))
    with pytest.raises(ConfigError, match=f"{POLICY}.*{named}"):
        if reader == "load_policy":
            load_policy(folder)
        else:
            restore(folder, model, model.get_env(), robot().fingerprint)


@pytest.mark.parametrize("inside", [False, True])
def test_weights_that_unpack_to_too_much_are_refused(folder, inside):
    """200 MiB of zeros in 200 kB: as policy.pth, and in the archive that policy.pth is."""
    blob = io.BytesIO()
    with zipfile.ZipFile(blob, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data/0", bytes(200 << 20))
    if inside:
        rewrite(folder, policy_pth=blob.getvalue())
    else:
        (folder / POLICY).write_bytes(blob.getvalue())
    with pytest.raises(ConfigError, match=f"{POLICY}.*more than 128 MiB"):
        load_policy(folder)


class Bomb:
    """Writes a file when it is unpickled."""

    def __init__(self, path):
        self.path = str(path)

    def __reduce__(self):
        return open, (self.path, "w")


@pytest.mark.parametrize("reader", ["load_policy", "restore"])
@pytest.mark.parametrize(
    "member", ["data", "policy_pth", "policy_optimizer_pth", "pytorch_variables_pth", STATISTICS]
)
def test_loading_executes_nothing(folder, tmp_path, model, member, reader):
    """Pickles hidden in any file of the folder are not run, by evaluation or by resuming."""
    mark = tmp_path / "executed"
    pickled = pickle.dumps(Bomb(mark))
    if member == STATISTICS:
        np.savez(folder / STATISTICS, obs_mean=np.array([Bomb(mark)], dtype=object))
    elif member == "data":
        entry = {":type:": "x", ":serialized:": b64encode(pickled).decode()}
        rewrite(folder, data=json.dumps(dict.fromkeys(["policy_class", "seed"], entry)).encode())
    else:
        blob = io.BytesIO()
        torch.save({"action_net.weight": Bomb(mark)}, blob)
        rewrite(folder, **{member: blob.getvalue()})
    try:
        if reader == "load_policy":
            load_policy(folder)
        else:
            restore(folder, model, model.get_env(), robot().fingerprint)
    except ConfigError as error:
        assert str(folder) in str(error) and "weights_only" not in str(error)
    assert not mark.exists()
    pickle.loads(pickled)  # the bomb is a real one
    assert mark.exists()


def test_the_shipped_policy_is_named_when_it_is_missing():
    """Without an argument the packaged policy is loaded; if there is none, the error says so."""
    try:
        policy = load_policy()
    except ConfigError as error:
        assert "residual" in str(error)
    else:
        assert policy.act(np.zeros(len(policy.mean))).shape == (policy.layers[-1][0].shape[1],)


def test_the_shipped_policy_fits_the_packaged_controller():
    """It loads, stands without a push, and is quiet at the end."""
    policy = poise.load_policy()
    assert policy.config.controller == "feedback-step"
    env = policy.make_env(duration=1.5, pushes=None)
    observation, _ = env.reset(seed=0)
    for _ in range(env.max_steps):
        action = policy.act(observation)
        observation, _, fallen, _, _ = env.step(action)
        assert not fallen
    assert env.recovered


def test_a_robot_in_other_physics_is_taken_and_told(tmp_path: Path) -> None:
    """Other options of the simulation; not another body under the same options."""
    other = yaml.safe_load(resolve("robots", "humanoid").read_text())
    path = tmp_path / "other.yaml"
    path.write_text(yaml.safe_dump({**other, "options": {"timestep": 0.001, "cone": "elliptic"}}))
    told = (
        "timestep 0.001 instead of 0.002, friction the model's own instead of 0.8, "
        "cone elliptic instead of the model's own"
    )
    with pytest.warns(PoiseWarning, match=told):
        policy = load_policy("residual-torque", load_robot(path))
    known = load_policy("residual-torque")
    env = known.make_env(robot=load_robot(path))
    observation, _ = env.reset(seed=0)
    assert np.array_equal(policy.act(observation), known.act(observation))
    compact = yaml.safe_load(resolve("robots", "compact").read_text())
    compact["source"]["mjcf"] = str(resolve("robots", "compact").parent / "compact.xml")
    path.write_text(yaml.safe_dump({**compact, "options": {"timestep": 0.001}}))
    with pytest.raises(ConfigError, match="was trained on the robot 'humanoid'"):
        load_policy("residual-torque", load_robot(path))
