"""Policy folders: written whole, read without executing anything."""

import os
import shutil

import numpy as np
import pytest

from poise.configs.errors import ConfigError, PoiseError
from poise.training.learning import checkpoints
from poise.training.learning.checkpoints import restore, save_checkpoint
from poise.training.learning.policy_files import (
    FILES,
    POLICY,
    STATE,
    STATISTICS,
    find_checkpoint,
    read_state,
)
from poise.training.learning.train import _training_envs, make_model
from tests.support.shared import finished_run, robot, tiny_config

STATE_NOW = {"timesteps": 64, "evaluations": []}


@pytest.fixture(scope="module")
def trained():
    """A model and its statistics, restored from the finished run."""
    normalize = _training_envs(tiny_config())
    model = make_model(tiny_config(), normalize)
    restore(finished_run() / "last", model, normalize, robot().fingerprint)
    yield model, normalize
    normalize.close()


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "last"


def save(folder, trained, **state):
    save_checkpoint(folder, *trained, tiny_config(), {**STATE_NOW, **state})


def test_what_is_saved_is_restored(folder, trained):
    """Weights, optimizer, statistics and state come back bit for bit."""
    model, normalize = trained
    save(folder, trained, fingerprint=robot().fingerprint)
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    env = _training_envs(tiny_config())
    fresh = make_model(tiny_config(), env)
    state = restore(folder, fresh, env, robot().fingerprint)
    assert state["timesteps"] == 64
    for a, b in zip(model.policy.parameters(), fresh.policy.parameters(), strict=True):
        assert np.array_equal(a.detach(), b.detach())
    with np.load(finished_run() / "last" / STATISTICS) as data:
        assert np.array_equal(env.obs_rms.mean, data["obs_mean"]) and env.obs_rms.mean.any()
        assert env.ret_rms.count == data["ret_count"]
    moments = [list(m.policy.optimizer.state.values()) for m in (model, fresh)]
    assert len(moments[0]) > 0
    for a, b in zip(*moments, strict=True):
        assert np.array_equal(a["exp_avg_sq"], b["exp_avg_sq"])
    for name in ("mean", "var", "count"):
        for which in ("obs_rms", "ret_rms"):
            a, b = (getattr(getattr(e, which), name) for e in (normalize, env))
            assert np.array_equal(a, b) and np.shape(a) == np.shape(b)
    env.close()


def test_the_folder_is_replaced_as_a_whole(folder, trained, monkeypatch):
    """When writing fails half way, the old folder is untouched; later saving works."""
    save(folder, trained)

    def full(*args, **kwargs):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(checkpoints.np, "savez", full)
        with pytest.raises(PoiseError, match="No space left"):
            save(folder, trained, timesteps=128)
    assert read_state(folder / STATE)["timesteps"] == 64 and find_checkpoint(folder) == folder
    assert [path.name for path in folder.parent.iterdir()] == ["last"]
    save(folder, trained, timesteps=128)
    assert read_state(folder / STATE)["timesteps"] == 128
    assert sorted(path.name for path in folder.parent.iterdir()) == ["last"]


def test_a_kill_between_the_renames_loses_nothing(folder, trained):
    """The old folder is found under its other name, until a new one is in place."""
    save(folder, trained)
    old = folder.with_name(".last.old")
    os.replace(folder, old)
    assert find_checkpoint(folder) == old
    removed = []
    real = shutil.rmtree

    def watched(path, **kwargs):
        removed.append((path, folder.exists()))
        real(path, **kwargs)

    shutil.rmtree, restored = watched, real
    try:
        save(folder, trained, timesteps=128)
    finally:
        shutil.rmtree = restored
    assert all(there for path, there in removed if path == old)
    assert find_checkpoint(folder) == folder and not old.exists()


@pytest.mark.parametrize("name", FILES)
def test_half_a_folder_is_none(folder, trained, name):
    """A folder that lacks a file is not taken for a checkpoint."""
    save(folder, trained)
    (folder / name).unlink()
    assert find_checkpoint(folder) is None


def test_an_impossible_folder_is_refused(tmp_path, trained):
    """A file where the folder should be is one error that names it."""
    (tmp_path / "file").write_text("")
    with pytest.raises(PoiseError, match="file"):
        save(tmp_path / "file" / "last", trained)


@pytest.mark.parametrize("name", [POLICY, STATISTICS, STATE])
@pytest.mark.parametrize("content", [b"", b"nonsense", b"half"])
def test_damaged_files_are_named(folder, trained, name, content):
    """Whatever is wrong with a file, restoring it is one ConfigError with its path."""
    save(folder, trained, fingerprint=robot().fingerprint)
    whole = (folder / name).read_bytes()
    (folder / name).write_bytes(whole[: len(whole) // 2] if content == b"half" else content)
    with pytest.raises(ConfigError, match=name):
        restore(folder, *trained, robot().fingerprint)


def test_statistics_of_another_size_are_refused(folder, trained):
    """Arrays that do not fit the environment are not taken."""
    save(folder, trained, fingerprint=robot().fingerprint)
    with np.load(folder / STATISTICS) as data:
        arrays = dict(data)
    arrays["obs_mean"] = arrays["obs_mean"][:-1]
    np.savez(folder / STATISTICS, **arrays)
    with pytest.raises(ConfigError, match=f"{STATISTICS}.*obs_mean"):
        restore(folder, *trained, robot().fingerprint)


@pytest.mark.parametrize("text", ["[]", "{}", '{"timesteps": "many"}', '{"timesteps": 1.5}'])
def test_a_state_must_have_its_steps(tmp_path, text):
    """state.json that parses but says nothing is refused."""
    (tmp_path / STATE).write_text(text)
    with pytest.raises(ConfigError, match=STATE):
        read_state(tmp_path / STATE)
