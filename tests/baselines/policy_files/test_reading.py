"""Policies are read from the files of other projects as they are, and what is wrong is named."""

import os
import sys
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import poise
from poise.baselines.policy_files.config import ObservationTerm, PolicyFileConfig
from poise.baselines.policy_files.motion.config import MotionConfig
from poise.baselines.registry import controller_config, load_controller
from poise.configs.errors import ConfigError
from tests.support.policies import gym_config, lab_deploy, linear, within, write_onnx, write_yaml
from tests.support.refused import invalid
from tests.support.shared import robot

N = 7
FARTHEST = sys.float_info.max
METADATA = {
    "joint_names": "left_knee,waist_yaw,right_knee",
    "joint_stiffness": "40.179,14.251,40.179",
    "joint_damping": "2.558,0.907,2.558",
    "default_joint_pos": "0.300,0.000,0.300",
    "observation_names": "base_ang_vel,joint_pos,actions",
    "observation_terms_scale": "1.000,0.500;0.250;0.125,2.000",
    "observation_terms_history_length": "0.000,3.000,1.000",
    "observation_terms_clip": "-inf;inf,-1.000;1.000,-inf;inf",
    "action_scale": "0.351,0.439,0.351",
}


def read(place: Path) -> PolicyFileConfig:
    config = controller_config(str(place))
    assert isinstance(config, PolicyFileConfig)
    return config


def lab_folder(folder: Path, network: str = "policy.onnx", **changes: Any) -> Path:
    """A policy as unitree_rl_mjlab lays it."""
    write_yaml(folder / "deploy.yaml", **lab_deploy(N, **changes))
    write_onnx(folder / network, linear(9 + 3 * N, N))
    return folder


def test_a_folder_of_unitree_rl_mjlab(tmp_path: Path) -> None:
    """Gains lie in the order of the motors, everything else in that of the policy."""
    config = read(lab_folder(tmp_path))
    assert config.motors == (0, 2, 4, 6, 1, 3, 5)
    assert config.stiffness == (100.0, 102.0, 104.0, 106.0, 101.0, 103.0, 105.0)
    assert config.default == config.action_offset == tuple(0.01 * i for i in range(N))
    assert config.action_scale == (0.25,) * N and config.policy_period == 0.02
    assert [term.term for term in config.observations][:2] == ["base_ang_vel", "projected_gravity"]
    assert config.observations[0] == ObservationTerm("base_ang_vel", (0.2, 0.2, 0.2))
    assert config.policy == str(tmp_path / "policy.onnx") and config.history == "term"
    assert read(tmp_path / "deploy.yaml") == config, "the file alone says the same"


def test_a_folder_of_unitree_rl_lab(tmp_path: Path) -> None:
    """params/ beside exported/, histories, whole frames side by side, a clock's period."""
    described = lab_deploy(N)
    for term in described["observations"].values():
        term["history_length"] = 5
    described["observations"] |= {
        "gait_phase": {"params": {"period": 0.6}, "clip": [-1.0, 1.0], "scale": [1.0, 1.0],
                       "history_length": 5},
        "use_gym_history": True,
    }  # fmt: skip
    write_yaml(tmp_path / "params/deploy.yaml", **described)
    write_onnx(tmp_path / "exported/policy.onnx", linear(5 * (11 + 3 * N), N))
    config = read(tmp_path)
    assert config.history == "frame" and config.phase == 0.6
    assert {term.history for term in config.observations} == {5}
    assert config.observations[-1].clip == (-1.0, 1.0)
    load_controller(config, robot("compact"))


def test_some_joints_are_moved_by_the_action(tmp_path: Path) -> None:
    """`joint_ids` of an action are places in the policy's order."""
    described = lab_deploy(N)
    described["observations"]["last_action"]["scale"] = [1.0] * 2
    described["actions"]["JointPositionAction"] |= {
        "joint_ids": [0, 3], "scale": [0.25, 0.5], "offset": [0.0, 0.1],
        "clip": [[-1.0, 1.0], [-2.0, 2.0]],
    }  # fmt: skip
    write_yaml(tmp_path / "deploy.yaml", **described)
    write_onnx(tmp_path / "policy.onnx", linear(9 + 2 * N + 2, 2))
    joints = load_controller(str(tmp_path), robot("compact")).joints
    np.testing.assert_array_equal(joints.moved, [0, 6])
    np.testing.assert_allclose(joints.targets(np.array([9.0, 9.0]), np.zeros(4)), [0.25, 1.1])


@pytest.mark.parametrize("phase", [False, True])
def test_a_configuration_of_unitree_rl_gym(tmp_path: Path, phase: bool) -> None:
    """Its terms are those of its script; its command is not taken over: the robot stands."""
    n_obs = 9 + 3 * N + 2 * phase
    write_yaml(tmp_path / "g1.yaml", **gym_config(N, num_obs=n_obs))
    write_onnx(tmp_path / "policy.onnx", linear(n_obs, N))
    config = read(tmp_path / "g1.yaml")
    terms = {term.term: term.scale for term in config.observations}
    assert list(terms) == ["base_ang_vel", "projected_gravity", "command", "dof_pos", "dof_vel",
                           "actions", "phase"][: 6 + phase]  # fmt: skip
    assert terms["command"] == (2.0, 2.0, 0.25) and terms["base_ang_vel"] == 0.25
    assert config.policy_period == pytest.approx(0.02) and config.command == (0.0, 0.0, 0.0)
    np.testing.assert_array_equal(load_controller(config, robot("compact")).joints.index, range(N))


def test_an_onnx_file_of_mjlab_needs_nothing_else(tmp_path: Path) -> None:
    """Its metadata say it; `joint_pos` is relative there."""
    path = write_onnx(tmp_path / "2026.onnx", linear(3 + 9 + 3, 3), METADATA)
    config = read(path)
    assert config.joints == ("left_knee", "waist_yaw", "right_knee")
    assert config.stiffness == (40.179, 14.251, 40.179) and config.default == (0.3, 0.0, 0.3)
    assert config.observations == (
        ObservationTerm("base_ang_vel"),
        ObservationTerm("joint_pos_rel", (0.5, 0.25, 0.125), (-1.0, 1.0), 3),
        ObservationTerm("actions", 2.0),
    )
    assert read(tmp_path) == config, "the only one in its folder"
    load_controller(config, robot("compact"))


def test_holosomas_metadata_are_lists_in_json(tmp_path: Path) -> None:
    """Names and gains; the rest is said beside them."""
    metadata = {"dof_names": '["left_knee", "right_knee"]', "kp": "[40.5, 41.5]", "kd": "[2, 3]",
                "action_scale": "0.25", "command_ranges": '{"lin_vel_x": [-1.0, 1.0]}'}  # fmt: skip
    write_onnx(tmp_path / "policy.onnx", linear(3, 2), metadata)
    path = write_yaml(tmp_path / "own.yaml", kind="policy-file", default=[0.1, 0.2],
                      observations=[{"term": "base_ang_vel"}])  # fmt: skip
    config = read(path)
    assert config.joints == ("left_knee", "right_knee") and config.action_scale == 0.25
    assert config.stiffness == (40.5, 41.5) and config.damping == (2.0, 3.0)


@pytest.mark.parametrize("names", ["left_knee, right_knee", "['left_knee', 'right_knee']"])
def test_metadata_in_other_forms(tmp_path: Path, names: str) -> None:
    """Blanks behind commas, and lists as Python writes them."""
    metadata = {"joint_names": names, "observation_names": "base_ang_vel, actions"}
    write_onnx(tmp_path / "policy.onnx", linear(5, 2), metadata)
    config = read(tmp_path / "policy.onnx")
    assert config.joints == ("left_knee", "right_knee")
    assert config.observations == (ObservationTerm("base_ang_vel"), ObservationTerm("actions"))


def test_what_a_tracker_is_commanded_is_its_motion(tmp_path: Path) -> None:
    """As BeyondMimic and mjlab export it: the clip is within, what is said beside it is merged."""
    metadata = {"joint_names": "left_knee,right_knee", "anchor_body_name": "torso",
                "observation_names": "command,motion_anchor_ori_b,actions"}  # fmt: skip
    rows = {"joint_pos": (3, 2), "joint_vel": (3, 2), "body_pos_w": (3, 1, 3),
            "body_quat_w": (3, 1, 4)}  # fmt: skip
    within(tmp_path / "p.onnx", 12, metadata, **{n: np.zeros(shape) for n, shape in rows.items()})
    config = read(tmp_path / "p.onnx")
    assert config.motion == MotionConfig(clip="network", anchor="torso")
    assert config.inputs == {
        "obs": (ObservationTerm("motion_command"), ObservationTerm("motion_anchor_ori_b"),
                ObservationTerm("actions")),
        "time_step": (ObservationTerm("time_step"),),
    }  # fmt: skip
    (tmp_path / "own.csv").write_text("")
    own = write_yaml(tmp_path / "own.yaml", kind="policy-file", policy="p.onnx",
                     motion={"clip": "own.csv", "plays": True})  # fmt: skip
    expected = MotionConfig(clip=str(tmp_path / "own.csv"), anchor="torso", plays=True)
    assert read(own).motion == expected


def test_a_slice_of_everything_is_read_as_all(tmp_path: Path) -> None:
    """As Isaac Lab dumps it; nothing is built of it, and no other slice is taken."""
    lab_folder(tmp_path)
    text = (tmp_path / "deploy.yaml").read_text()
    tag = "joint_ids: !!python/object/apply:builtins.slice"
    (tmp_path / "deploy.yaml").write_text(text.replace("joint_ids: null", f"{tag} [null, null]"))
    assert read(tmp_path).action_joints == ()
    (tmp_path / "deploy.yaml").write_text(text.replace("joint_ids: null", f"{tag} [0, 12]"))
    with pytest.raises(ConfigError, match=r"deploy.yaml: .*a slice is read only where it is of"):
        read(tmp_path)


def test_a_known_network_is_found_by_its_sum(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever it is called; another version is told, and played by its path alone."""
    there = tmp_path / "there"
    content = write_onnx(there / "deep/renamed.onnx", linear(3, 2)).read_bytes()
    files = {"policy.onnx": {"bytes": len(content), "sha256": sha256(content).hexdigest()}}
    path = write_yaml(
        tmp_path / "own.yaml", kind="policy-file", joints=["left_knee", "right_knee"],
        observations=[{"term": "base_ang_vel"}],
        origin={"project": "them/theirs", "commit": "1a", "licence": "MIT", "robot": "compact",
                "files": files},
    )  # fmt: skip
    monkeypatch.setenv("POISE_POLICIES", str(there))
    assert read(path).policy == str(there / "deep/renamed.onnx")
    (there / "deep/renamed.onnx").unlink()
    with pytest.raises(ConfigError, match="git clone https://github.com/them/theirs") as error:
        read(path)
    assert "own: policy: the network of own is not here, nor in a folder of POISE_POLICIES" in str(
        error.value
    )
    other = write_onnx(there / "policy.onnx", linear(3, 2, seed=1))
    with pytest.raises(ConfigError, match=f"{other} has another checksum than the known one"):
        read(path)
    text = path.read_text()
    path.write_text(f"{text}policy: {other}\n")
    assert read(path).policy == str(other)


def test_a_description_may_have_another_one_as_its_base(tmp_path: Path) -> None:
    """Of a known policy, so that another version of it is played by its path."""
    write_onnx(tmp_path / "mine.onnx", linear(96, 29))
    path = write_yaml(tmp_path / "own.yaml", kind="policy-file", base="unitree-g1-velocity",
                      policy="mine.onnx", command=[0.5, 0.0, 0.0])  # fmt: skip
    config = read(path)
    assert config.policy == str(tmp_path / "mine.onnx") and len(config.joints) == 29
    assert config.command[0] == 0.5 and len(config.observations) == 6


def test_the_yaml_wins_over_deploy_and_this_over_metadata(tmp_path: Path) -> None:
    """Each says what the others do not."""
    lab_folder(tmp_path)
    write_onnx(tmp_path / "policy.onnx", linear(9 + 3 * N, N), {**METADATA, "joint_names": "a,b"})
    path = write_yaml(tmp_path / "own.yaml", kind="policy-file", deploy="deploy.yaml",
                      policy="policy.onnx", command=[0.5, 0.0, 0.0])  # fmt: skip
    config = read(path)
    assert config.command == (0.5, 0.0, 0.0) and config.joints == ("a", "b")
    assert len(config.observations) == 6 and config.deploy is None


def test_a_digest_tells_versions_apart(tmp_path: Path) -> None:
    """Of the network, and of the file that its numbers are in."""
    digests = []
    for seed in (0, 1):
        (tmp_path / "policy.onnx.data").unlink(missing_ok=True)  # it would be added to
        write_onnx(tmp_path / "policy.onnx", linear(15, 3, seed=seed), METADATA, outside=True)
        digests.append(read(tmp_path).digest)
    assert len(set(digests)) == 2 and (tmp_path / "policy.onnx.data").exists()


def bare(folder: Path, **fields: Any) -> Path:
    write_onnx(folder / "policy.onnx", linear(3, 2))
    return write_yaml(folder / "own.yaml", kind="policy-file", **fields)


def no_data(folder: Path) -> Path:
    write_onnx(folder / "policy.onnx", linear(15, 3), METADATA, outside=True)
    os.remove(folder / "policy.onnx.data")
    return folder


def data_elsewhere(folder: Path) -> Path:
    content = no_data(folder).joinpath("policy.onnx").read_bytes()
    (folder / "policy.onnx").write_bytes(content.replace(b"policy.onnx.data", b"../../etc/passwd"))
    return folder


def circle(folder: Path, name: str = "policy.onnx") -> Path:
    """A link to itself."""
    os.symlink(folder / name, folder / name)
    return folder


def two_networks(folder: Path) -> Path:
    for name in ("a", "b"):
        write_onnx(lab_folder(folder, "a.onnx") / f"{name}.onnx", linear(3, 2))
    return folder


def pointer(folder: Path) -> Path:
    (folder / "policy.onnx").write_text(
        "version https://git-lfs.github.com/spec/v1\noid sha256:0\n"
    )
    return folder


def scribbled(folder: Path) -> Path:
    (folder / "policy.onnx").write_bytes(b"no network")
    return folder


def deploy(**changes: Any) -> Any:
    return lambda folder: lab_folder(folder, **changes)


def gym(**changes: Any) -> Any:
    def write(folder: Path) -> Path:
        write_onnx(folder / "policy.onnx", linear(3, 2))
        return write_yaml(folder / "deploy.yaml", **gym_config(N, **changes)).parent

    return write


def metadata(**changes: str) -> Any:
    return lambda f: write_onnx(f / "policy.onnx", linear(15, 3), {**METADATA, **changes})


HISTORY = "observation_terms_history_length"
LIMITS = "observation_terms_clip"
BAD: dict[str, tuple[Any, tuple[str, ...]]] = {
    "no data file": (no_data, ("policy.onnx needs the file 'policy.onnx.data' beside it",)),
    "data elsewhere": (data_elsewhere, ("has data in '../../etc/passwd', not beside it",)),
    "a pointer": (pointer, ("policy.onnx: is a pointer of Git LFS", "git lfs pull")),
    "no ONNX": (scribbled, ("policy.onnx: is no ONNX file",)),
    "two networks": (two_networks, ("policy: several networks", "choices: a.onnx, b.onnx")),
    "no network": (lambda f: write_yaml(f / "deploy.yaml", **lab_deploy(N)).parent,
                   ("deploy.yaml: policy: no network", ".onnx")),
    "a folder": (lambda f: bare(f, policy="."), ("policy: is a folder, not a network",)),
    "no such network": (lambda f: bare(f, policy="lost.onnx"), ("policy: no such file", "lost")),
    "policy no text": (lambda f: bare(f, policy=3), ("own.yaml: policy: must be a path",)),
    "no name of a file": (lambda f: bare(f, policy="a\0.onnx"), ("own.yaml: policy: is no name",)),
    "links in a circle": (circle, ("policy: ", "policy.onnx")),
    "a described circle": (lambda f: bare(circle(f, "o.onnx"), policy="o.onnx"), ("policy: ",)),
    "least above largest": (lambda f: bare(f, observations=[{"term": "phase", "clip": [1, -1]}]),
                            ("own.yaml: observations[0]: clip: 1.0 is above -1.0",)),
    "least action above largest": (lambda f: bare(f, action_clip=[[-1, 1], [2, 1]]),
                                   ("own.yaml: action_clip[1]: 2.0 is above 1.0",)),
    "nothing seen": (bare, ("own.yaml: observations: what the policy sees is not said",
                            "poise policies check ", "policy.onnx --robot unitree_g1")),
    "an input without terms": (lambda f: bare(f, observations={"obs": []}),
                               ("own.yaml: observations: what the policy sees is not said",)),
    "names that are no list": (metadata(dof_names="[1,"), ("dof_names: is no list in JSON",)),
    **{
        f"a huge {name}": (lambda f, said={name: value}: bare(f, **said),
                           (f"own.yaml: {field}: must be at most {most}",))
        for name, value, field, most in (
            ("stiffness", 1e300, "stiffness", "1000000"),
            ("damping", [1e300], "damping[0]", "1000000"),
            ("action_offset", 1e300, "action_offset", "1000"),
            ("default", 1e300, "default", "1000"),
            ("held", {"waist": {"stiffness": 1e7}}, "held.waist.stiffness", "1000000"),
        )
    },
    "no such deploy": (lambda f: bare(f, deploy="lost.yaml"), ("lost.yaml: cannot be read",)),
    "deploy of nobody": (lambda f: bare(f, deploy="own.yaml"), ("is no configuration of unitree",)),
    "short posture": (deploy(default_joint_pos=[0.0]),
                      ("deploy.yaml: default_joint_pos: has 1 numbers for 7 joints",)),
    "no motors": (deploy(joint_ids_map=[], default_joint_pos=[], stiffness=[]),
                  ("deploy.yaml: joint_ids_map: names no motor",)),
    "few motors": (deploy(stiffness=[1.0] * 3), ("stiffness: has 3 numbers", "goes up to 6")),
    "velocities": (deploy(actions={"JointVelocityAction": {}}),
                   ("actions: must be one of joint positions, not JointVelocityAction",)),
    "a term of the wrong form": (deploy(observations={"base_ang_vel": 3}),
                                 ("observations.base_ang_vel: must be a mapping",)),
    "a history below 0": (deploy(observations={"base_ang_vel": {"history_length": -1}}),
                          ("base_ang_vel: history_length: must be at least 0",)),
    "a field is missing": (deploy(step_dt=None), ("deploy.yaml: step_dt: must be a number",)),
    "num_obs": (gym(num_obs=50), ("num_obs: 50 is neither 9 + 3 × 7 (num_actions)",)),
    "kps": (gym(kps=[1.0]), ("deploy.yaml: kps: has 1 numbers for 7 joints",)),
    "metadata of words": (metadata(joint_damping="a,b"), ("joint_damping: must be numbers",)),
    "metadata of other lengths": (metadata(observation_terms_scale="1.000"),
                                  ("observation_terms_scale: has 1 entries for 3 observations",)),
    **{
        f"a history of {value}": (metadata(**{HISTORY: f"0,{value},1"}),
                                  (f"{HISTORY}: must be a whole number of steps, not {value}",))
        for value in ("nan", "inf", "2.5", "-1.0")
    },
    "a huge history": (metadata(**{HISTORY: "0,1e300,1"}),
                       ("observations[1].history: must be at most 1000",)),
    "bounds of nan": (metadata(**{LIMITS: "-inf;nan,-1;1,-inf;inf"}),
                      ("observations[0].clip[1]: must be a finite number",)),
    "one bound": (metadata(**{LIMITS: "-inf;inf,1,-inf;inf"}),
                  (f"{LIMITS}: must be two numbers, not 1",)),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_named(tmp_path: Path, case: str) -> None:
    """One line: the file, the field, what is wrong."""
    write, parts = BAD[case]
    with pytest.raises(ConfigError) as error:
        controller_config(str(write(tmp_path)))
    text = str(error.value)
    assert all(part in text for part in parts), text
    assert str(tmp_path) in text and "\n" not in text


def test_one_sided_bounds_hold(tmp_path: Path) -> None:
    """The other side is as far as numbers go."""
    path = write_onnx(
        tmp_path / "p.onnx", linear(15, 3), {**METADATA, LIMITS: "-inf;2,-1;inf,-inf;inf"}
    )
    clips = [term.clip for term in read(path).observations]
    assert clips == [(-FARTHEST, 2.0), (-1.0, FARTHEST), None]


class Recording(torch.nn.Module):
    """Counts its calls, which a new trial must not remember."""

    calls: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("calls", torch.zeros(1))

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        self.calls += 1.0
        return self.calls * torch.ones(1, 3)


@pytest.fixture
def script(tmp_path: Path) -> Path:
    """A policy in TorchScript, and a YAML file about it."""
    torch.jit.save(torch.jit.script(Recording()), str(tmp_path / "policy.pt"))
    return write_yaml(tmp_path / "own.yaml", kind="policy-file", policy="policy.pt",
                      joints=["left_knee", "waist_yaw", "right_knee"],
                      observations=[{"term": "base_ang_vel"}])  # fmt: skip


def test_torchscript_is_code(script: Path) -> None:
    """It is not loaded unless the user allows the file, by whatever path."""
    path = script.with_name("policy.pt")
    for place in (script, script.parent):
        with invalid("controller") as error:
            controller_config(str(place))
        assert f"--allow {path}" in str(error.value)
    with poise.allowing(str(script.with_name("other.pt"))), pytest.raises(ConfigError):
        controller_config(str(script))
    with poise.allowing(os.path.relpath(path)):
        controller_config(str(script))


def test_torchscript_forgets_and_is_copied(script: Path) -> None:
    """Whatever state is in the module."""
    with poise.allowing(str(script.with_name("policy.pt"))):
        network = load_controller(str(script), robot("compact")).network
    seen = {"": np.zeros(3)}
    assert [network.act(seen)["action"][0] for _ in range(2)] == [1.0, 2.0]
    kind, arguments = network.__reduce__()
    assert kind(*arguments).act(seen)["action"][0] == 3.0 == network.act(seen)["action"][0]
    network.reset()
    assert network.act(seen)["action"][0] == 1.0


def test_what_code_fills_in_is_no_choice(tmp_path: Path) -> None:
    write_onnx(tmp_path / "policy.onnx", linear(3, 3))
    write_yaml(tmp_path / "own.yaml", kind="policy-file", policy="policy.onnx", stifness=1.0)
    with pytest.raises(ConfigError) as caught:
        controller_config(tmp_path / "own.yaml")
    choices = set(caught.value.choices or ())
    assert caught.value.field == "stifness" and "stiffness" in choices
    assert not choices & {"digest", "described_in", "said"}
