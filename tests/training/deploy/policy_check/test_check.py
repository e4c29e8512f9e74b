"""policy_check: what a network lacks is told, and a wrong description is found out."""

from __future__ import annotations

import pickle
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from poise.baselines.policy_files import known
from poise.baselines.policy_files.config import KnownFile, Origin
from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.policy_files.known import Known
from poise.baselines.policy_files.terms import Seen
from poise.baselines.registry import controller_config
from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.envs.physics.simulation import Simulation
from poise.training.cli.entry import main
from poise.training.deploy.policy_check import check as checking
from poise.training.deploy.policy_check.check import Stood, check_policy
from poise.training.deploy.policy_check.guess import layouts
from poise.training.deploy.policy_check.rollout import Finding, compare_rollout
from tests.support.policies import linear, within, write_onnx, write_yaml
from tests.support.shared import robot

N = 25  # joints of `compact`
TERMS: list[dict[str, Any]] = [
    {"term": "base_ang_vel", "scale": 0.25},
    {"term": "projected_gravity"},
    {"term": "velocity_commands"},
    {"term": "joint_pos_rel"},
    {"term": "joint_vel", "scale": 0.05},
    {"term": "last_action"},
]


@pytest.mark.parametrize(
    ("size", "actions", "joints", "parts"),
    [
        (96, 29, 29, ("96 = base_ang_vel 3 + projected_gravity 3 + velocity_commands", "29")),
        (384, 29, 29, ("384 = 4 × 96: a history of 4 steps of base_ang_vel 3",)),
        (99, 29, 29, ("base_lin_vel", "joint_pos_rel 29")),
        (47, 12, 29, ("phase + joint_pos_rel 12", "last_action 12")),
        (64 + 16, 12, 29, ("80 = base_ang_vel 3 + projected_gravity 3 + phase_cos, phase_sin",)),
    ],
)
def test_sizes_are_guessed(size: int, actions: int, joints: int, parts: tuple[str, ...]) -> None:
    """Usual terms, of all joints or of those that are moved, once or several times."""
    text = str(next(layouts(size, actions, joints)))
    assert all(part in text for part in parts), text
    assert not list(layouts(7, actions, joints))


def test_a_bare_network_is_told_what_it_lacks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In its maker's words, with a description to begin with; exit code 1, nothing played."""
    path = write_onnx(tmp_path / "net.onnx", linear(4 * (9 + 3 * N), N), {"kp": "[40.0]"})
    assert main(["policies", "check", str(path), "--robot", "compact"]) == 1
    text = capsys.readouterr().out
    assert "takes obs 336; gives actions 25" in text
    assert "perhaps 336 = 4 × 84: a history of 4 steps of base_ang_vel 3" in text.replace("\n", " ")
    assert "default_dof_pos" in text and "stiffness:" not in text and "damping: kd, kds" in text
    assert "- {term: joint_vel, history: 4}" in text


@pytest.mark.parametrize(
    ("size", "parts"),
    [
        (154, ("motion_command 58", "motion_anchor_ori_b 6 + base_ang_vel 3")),
        (160, ("motion_anchor_pos_b 3 + motion_anchor_ori_b 6 + base_lin_vel 3",)),
    ],
)
def test_trackers_are_guessed(size: int, parts: tuple[str, ...]) -> None:
    """BeyondMimic's observation, without and with what only an estimator knows."""
    text = str(next(layouts(size, 29, 29)))
    assert all(part in text for part in parts), text


def test_a_history_is_of_a_walk_before_it_is_of_a_tracker() -> None:
    """480 of the G1 is 5 × 96, as unitree_rl_lab exports it, and at last 3 × 160."""
    found = [str(layout) for layout in layouts(480, 29, 29)]
    assert found[0].startswith("480 = 5 × 96: a history of 5 steps of base_ang_vel 3")
    assert found[-1].startswith("480 = 3 × 160: a history of 3 steps of motion_command 58")


def test_a_network_with_a_clip_is_a_tracker(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the names of its inputs and outputs; the description to begin with says so."""
    outputs = {"joint_pos": np.zeros((3, N)), "joint_vel": np.zeros((3, N)),
               "body_pos_w": np.zeros((3, 2, 3)), "body_quat_w": np.zeros((3, 2, 4))}  # fmt: skip
    path = within(tmp_path / "net.onnx", 5 * N + 9, **outputs)
    assert main(["policies", "check", str(path), "--robot", "compact"]) == 1
    text = " ".join(capsys.readouterr().out.split())
    assert "it tracks a motion, whose frames it gives for each time_step" in text
    assert "perhaps 134 = motion_command 50 + motion_anchor_ori_b 6" in text
    assert "motion: {clip: network} observations: - {term: motion_command}" in text


@pytest.mark.parametrize("old", [False, True])
def test_a_checkpoint_is_no_network(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: bool
) -> None:
    """That is told before anybody is asked to trust it: nothing in it is run."""
    path = tmp_path / "model_3200.pth"
    states = {"model_state_dict": torch.nn.Linear(84, N).state_dict(), "iter": 3200}
    torch.save(states, path, _use_new_zipfile_serialization=not old)
    described = write_yaml(
        tmp_path / "own.yaml", kind="policy-file", policy=path.name,
        observations=[{"term": "base_ang_vel"}],
    )  # fmt: skip
    for line in (["policies", "check", str(path)], ["policies", "check", str(described)]):
        assert main([*line, "--robot", "compact"]) == 2
        text = capsys.readouterr().err
        assert text.startswith(f"poise: {path}: is a checkpoint of weights"), text
        assert "export the policy as ONNX or TorchScript" in text and "--allow" not in text


def test_a_pickle_is_no_network(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "policy.pt").write_bytes(pickle.dumps({"weights": [1.0]}))
    check = ["policies", "check", str(tmp_path / "policy.pt"), "--robot", "compact"]
    assert main(check) == 2
    assert "policy.pt: is a pickle, without a network" in capsys.readouterr().err


def test_a_bare_script_is_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As a controller it gets the advice; checked, it is run where it is allowed."""
    path = tmp_path / "net.pt"
    torch.jit.save(torch.jit.script(torch.nn.Linear(84, N)), str(path))
    check = ["policies", "check", str(path), "--robot", "compact"]
    assert main(["evaluate", str(path), "--robot", "compact"]) == 2
    assert f"poise policies check {path} --robot unitree_g1" in capsys.readouterr().err
    assert main(check) == 2
    assert "runs external code" in capsys.readouterr().err
    assert main([*check, "--allow", str(path)]) == 1
    assert "takes observation 84; gives action 25" in capsys.readouterr().out


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A network of `compact`, and a rollout of its maker's loop: states that are drawn."""
    place = tmp_path_factory.mktemp("policy")
    write_onnx(place / "policy.onnx", linear(9 + 3 * N, N, 0.05))
    record(place)
    return place


def described(place: Path, name: str = "own.yaml", **changes: Any) -> Path:
    body = robot("compact")
    fields: dict[str, Any] = {
        "kind": "policy-file", "policy": "policy.onnx", "joints": list(body.joint_names),
        "default": [0.1] * N, "stiffness": 400.0, "damping": 10.0, "action_scale": 0.01,
        "observations": TERMS,
    }  # fmt: skip
    return write_yaml(place / name, **{**fields, **changes})


def record(place: Path) -> None:
    """Observations, actions and states of a loop in which the robot is anywhere."""
    body = robot("compact")
    policy = PolicyFile(body, controller_config(str(described(place, "maker.yaml"))))
    simulation, rng = Simulation(body), np.random.default_rng(0)
    rows: dict[str, list[np.ndarray]] = {}
    action = np.zeros(N)
    for _ in range(12):
        qpos = body.standing_qpos + rng.normal(0.0, 0.1, len(body.standing_qpos))
        state = simulation.reset(qpos, rng.normal(0.0, 0.5, body.model.nv))
        seen = Seen(state, state.q, state.qvel[6:], policy.joints.default, action,
                    np.array([0.5, 0.0, 0.1]), 0.0, np.zeros(2))  # fmt: skip
        observation = policy.observer.observe(seen)[""]
        action = policy.network.act({"": observation})["action"]
        row = {"observations": observation, "actions": action, "qpos": state.qpos.copy(),
               "qvel": state.qvel.copy()}  # fmt: skip
        for name, value in row.items():
            rows.setdefault(name, []).append(np.asarray(value, dtype=float))
    np.savez(place / "full.npz", **{name: np.array(values) for name, values in rows.items()})
    plain = {name: np.array(rows[name]) for name in ("observations", "actions")}
    np.savez(place / "plain.npz", **plain)


def findings(place: Path, rollout: str = "full.npz", **changes: Any) -> list[Finding]:
    config = controller_config(str(described(place, **changes)))
    policy = PolicyFile(robot("compact"), config)
    return compare_rollout(policy, place / rollout)


def test_a_right_adapter_agrees_with_its_makers_rollout(folder: Path) -> None:
    """Term by term; without states only some of them are told."""
    assert [each.right for each in findings(folder)] == [True, True, True, None, True, True, True]
    plain = [each.right for each in findings(folder, "plain.npz")]
    assert plain == [True, None, True, None, None, None, True]


def _swapped() -> list[dict[str, Any]]:
    first, *others, action = TERMS
    return [first, action, *others]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"observations": [{"term": "base_ang_vel"}, *TERMS[1:]]},
         ("base_ang_vel at 0:3", "is 0.25 times what is described: its scale?")),
        ({"default": [0.0] * N}, ("joint_pos_rel at 9:34", "differs by 0.1")),
        ({"joints": lambda names: [names[1], names[0], *names[2:]]},
         ("joint_vel at 34:59", "has another order: [1, 0, 2,")),
        ({"observations": _swapped()}, ("last_action at 3:28", "lies at 59:84")),
    ],
)  # fmt: skip
def test_a_wrong_adapter_is_found_out(
    folder: Path, changes: dict[str, Any], named: tuple[str, str]
) -> None:
    """With the term, and what is wrong with it."""
    made = {name: value(list(robot("compact").joint_names)) if callable(value) else value
            for name, value in changes.items()}  # fmt: skip
    found = {each.what: each for each in findings(folder, **made)}
    assert found[named[0]].right is False and named[1] in found[named[0]].text


def test_another_network_answers_otherwise(folder: Path, tmp_path: Path) -> None:
    """From the same observations."""
    write_onnx(tmp_path / "policy.onnx", linear(9 + 3 * N, N, 0.05, seed=1))
    (network, *_) = compare_rollout(
        PolicyFile(robot("compact"), controller_config(str(described(tmp_path)))),
        folder / "full.npz",
    )
    assert network.what == "network" and network.right is False


@pytest.mark.parametrize("name", ["missing.onnx", "falcon-gx"])
def test_a_name_of_nothing_has_the_known_policies_as_choices(name: str) -> None:
    """Not the controllers, of which none can be checked."""
    with pytest.raises(ConfigError, match=f"policy: no such policy: '{name}'") as error:
        check_policy(name, robot("compact"))
    assert "falcon-g1" in str(error.value) and "momentum-qp" not in str(error.value)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"observations": np.zeros((5, 4)), "actions": np.zeros((5, N))}, "has 4 observations and"),
        ({"observations": np.zeros((5, 84)), "actions": np.zeros((4, N))}, "needs .T, n. obs"),
        ({"observations": np.zeros((5, 84))}, "rollout.npz: cannot be read"),
    ],
)
def test_a_rollout_of_another_form(folder: Path, arrays: dict[str, Any], message: str) -> None:
    """The file and the sizes."""
    np.savez(folder / "rollout.npz", **arrays)
    with pytest.raises(ConfigError, match=message):
        findings(folder, "rollout.npz")


@pytest.mark.parametrize(
    ("fell", "rollout", "code", "line"),
    [
        (None, None, 0, "standing is evidence, not proof"),
        (1.2, None, 1, "it does not stand"),
        (None, "full.npz", 0, "the adapter is right, as far as 6 of 7 findings show"),
        (None, "wrong.npz", 1, "the adapter is wrong: 1 of 7 findings speak against it"),
    ],
)
def test_the_verdict(
    folder: Path, fell: float | None, rollout: str | None, code: int, line: str,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """Of how it stood and of the rollout; the exit code says it, too."""
    monkeypatch.setattr(checking, "stand", lambda robot, config: Stood(fell, 0.01, True))
    with np.load(folder / "full.npz") as full:
        np.savez(folder / "wrong.npz", **{**full, "qvel": full["qvel"] + 0.1 * np.eye(1, 6 + N, 7)})
    more = [] if rollout is None else ["--rollout", str(folder / rollout)]
    path = str(described(folder))
    assert main(["policies", "check", path, "--robot", "compact", *more]) == code
    assert line in capsys.readouterr().out.replace("\n", " ")


def test_it_stands_or_falls(tmp_path: Path) -> None:
    """For ten seconds of the simulation, by its own gains."""
    body = robot("compact")
    write_onnx(tmp_path / "policy.onnx", linear(9 + 3 * N, N, 0.0))
    standing = [float(q) for q in body.standing_qpos[7:]]
    gains = {"*hip*": 400.0, "*knee*": 400.0, "*ankle*": 400.0, "*": 60.0}
    stiff = described(tmp_path, default=standing, stiffness=gains)
    good, bad = (check_policy(str(place), body).stood for place in (
        stiff, described(tmp_path, "limp.yaml", stiffness=1.0)))  # fmt: skip
    assert good is not None and good.fell is None and good.rests and good.moved < 0.1
    assert bad is not None and bad.fell is not None and bad.fell < 5.0


def test_what_is_not_said_is_taken_and_told(tmp_path: Path) -> None:
    """Gains that nothing says are a number that is no policy's own."""
    write_onnx(tmp_path / "policy.onnx", linear(3, N))
    path = write_yaml(tmp_path / "own.yaml", kind="policy-file", motors=list(range(N)), damping=3.0,
                      observations=[{"term": "base_ang_vel"}])  # fmt: skip
    unsaid = check_policy(str(path), robot("compact")).unsaid
    assert unsaid == ("default", "stiffness", "action_scale")


def test_what_is_said_as_it_is_by_default_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Gains of 40 and 1 and a posture of zeros may be a maker's own; joints have no names here."""
    write_onnx(tmp_path / "policy.onnx", linear(3, N))
    usual = {"default": [0.0] * N, "stiffness": 40.0, "damping": 1.0, "action_scale": 0.25}
    path = write_yaml(tmp_path / "own.yaml", kind="policy-file",
                      observations=[{"term": "base_ang_vel"}], **usual)  # fmt: skip
    assert check_policy(str(path), robot("compact")).unsaid == ("joints",)
    main(["policies", "check", str(path), "--robot", "compact"])
    text = " ".join(capsys.readouterr().out.split())
    assert (
        "not said: joints" in text and "the robot's first joints, in its order, are taken" in text
    )


def test_a_known_network_is_recognised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By its sum, whatever its file is called."""
    path = write_onnx(tmp_path / "renamed.onnx", linear(9 + 3 * N, N))
    content = path.read_bytes()
    file = KnownFile(len(content), sha256(content).hexdigest())
    origin = Origin("them/theirs", "1a", {"policy.onnx": file}, "MIT", "compact")
    monkeypatch.setattr(checking, "known_policies", lambda: [Known("theirs", origin, 0.02)])
    assert checking.known_as(path) == "theirs"
    write_onnx(path, linear(9 + 3 * N, N, seed=1))
    assert checking.known_as(path) is None


def test_a_known_network_is_checked_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file that was given, though no copy is where known networks are looked for."""
    path = write_onnx(tmp_path / "policy.onnx", linear(98, 29))

    class Asked(Exception):
        """Of which file the sizes are read first; nothing after it is tried."""

    def asked(path: Path) -> None:
        raise Asked(path)

    monkeypatch.setattr(known, "places", lambda origin: [])
    monkeypatch.setattr(checking, "known_as", lambda path: "unitree-mjlab-2026-03")
    monkeypatch.setattr(checking, "network_sizes", asked)
    with pytest.raises(Asked) as caught:
        check_policy(str(path), robot("compact"))
    assert caught.value.args == (path,)


def test_the_known_policies_are_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the line that gets each, and what is not the known version."""
    monkeypatch.setattr(known, "places", lambda origin: [tmp_path])
    write_onnx(tmp_path / "sim2real/models/falcon/g1_29dof.onnx", linear(3, 2))
    assert main(["policies"]) == 0
    text = "".join(capsys.readouterr().out.split())
    assert all(name in text for name in packaged("rivals"))
    assert "gitclonehttps://github.com/LeCAR-Lab/FALCON&&git-CFALCONcheckout25ad085" in text
    assert "8ac8f51875b878a79d9b5782e702b66572697e204ed262e2002b55631f3105d0" in text
    assert "another" in text and main(["policies", "nothing"]) == 2
