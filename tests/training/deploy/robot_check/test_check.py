"""training/deploy/robot_check: the check of a robot, its warnings, its table and its picture."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image
from rich.console import Console

from poise.configs.errors import PoiseWarning
from poise.envs.compiled.maths.pendulum import ankle_limit
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import load_robot
from poise.training.cli.entry import main
from poise.training.deploy.robot_check import check as module
from poise.training.deploy.robot_check.check import RobotCheck, check_robot
from poise.training.deploy.robot_check.standing.rest import Rest
from poise.training.deploy.robot_check.tables import print_robot_check, summary
from poise.training.deploy.robot_check.uses import IN_PLACE, STEPPING, Uses
from tests.support.small_biped import LEG, motors, write_biped
from tests.support.small_urdf import INERTIAL, write_urdf


@pytest.fixture(scope="module")
def check(tmp_path_factory: pytest.TempPathFactory) -> RobotCheck:
    """Of a robot with nothing wrong."""
    return check_robot(write_urdf(tmp_path_factory.mktemp("robot"), armature={"*": 0.01}))


@pytest.fixture
def no_controllers(monkeypatch: pytest.MonkeyPatch) -> None:
    """No controller is tried on the robot, which is most of a check: for what figures show."""
    nobody = {family: Uses((), {}) for family in (IN_PLACE, STEPPING)}
    monkeypatch.setattr(module, "controllers_for", lambda _: nobody)


def kinds(check: RobotCheck) -> list[tuple[str, bool]]:
    """The faults' kinds, and whether they matter for stepping alone."""
    return [(fault.kind, fault.stepping) for fault in check.faults]


def test_figures(check: RobotCheck) -> None:
    """Those of the robot; the impulses are the pendulum's; controllers of both families."""
    assert check.name == "biped" and check.mass == pytest.approx(24.4) and check.joints == 10
    assert set(check.torque_limits.values()) == {60.0} and check.without_motor == ()
    assert [(s.name, s.body, s.length, s.width) for s in check.soles] == [
        ("left", "left_foot", pytest.approx(0.2), pytest.approx(0.08)),
        ("right", "right_foot", pytest.approx(0.2), pytest.approx(0.08)),
    ]
    assert check.both_feet.possible and all(h and h.possible for h in check.one_foot.values())
    assert set(check.one_foot) == {"left", "right"} and check.self_contacts == ()
    omega = np.sqrt(9.81 / check.height_com)
    for each in check.directions:
        limit = check.mass * ankle_limit(float(omega), each.margin, 0.1)
        assert each.in_place == pytest.approx(limit) and each.one_step > each.in_place
        assert each.reach <= each.margin + 1e-9
    assert [d.direction for d in check.directions] == [22.5 * i for i in range(16)]
    assert check.in_place == pytest.approx(np.mean([d.in_place for d in check.directions]))
    assert "momentum-qp" in check.controllers[IN_PLACE].takes
    assert "capture-step" in check.controllers[STEPPING].takes
    assert "unitree-g1-velocity" not in str(check.controllers)
    assert check.faults == ()


def test_margins_are_the_support_polygon_s(check: RobotCheck, tmp_path: Path) -> None:
    """From the CoM to the toes, the heels and the sides."""
    state = Simulation(load_robot(write_urdf(tmp_path, armature={"*": 0.01}))).state
    edges = {0.0: (0, 1), 90.0: (1, 1), 180.0: (0, -1), 270.0: (1, -1)}
    for each in check.directions:
        if each.direction in edges:
            axis, sign = edges[each.direction]
            edge = (sign * state.support_polygon[:, axis]).max()
            assert each.margin == pytest.approx(edge - sign * state.com[axis], abs=1e-6)
    assert check.posture.com == pytest.approx(state.com[:2], abs=1e-9)


@pytest.mark.usefixtures("no_controllers")
def test_posture_against_the_model_s(tmp_path: Path) -> None:
    """What differs most from the keyframes and from the zero posture; what levelling changed."""
    legs = " ".join(["0.4 0.7 -0.35 0"] * 2)
    key = f'<keyframe><key name="crouch" qpos="0 0 1 1 0 0 0 {legs}"/></keyframe>'
    joints = {"*_hip": -20, "*_knee": 40, "*_ankle": -19}
    path = write_biped(tmp_path, extra=motors(ctrlrange="-90 90") + key, posture={"joints": joints})
    posture = check_robot(path).posture
    assert posture.keyframes == ("crouch",) and posture.keyframe is None
    assert 0.3 < posture.levelling.amount < 1.0
    assert posture.differences["zero posture"].joint.endswith("_knee")
    assert posture.differences["zero posture"].amount == pytest.approx(40.0, abs=1.0)
    hip = posture.differences["crouch"]
    assert hip.joint.endswith("_hip") and hip.amount == pytest.approx(20 + 22.918, abs=1.0)


@pytest.mark.usefixtures("no_controllers")
def test_a_body_in_another_is_warned_of(tmp_path: Path) -> None:
    """By its shape: meshes collide with their hulls."""
    straight = {"joints": {"*_hip": 0, "*_knee": 5, "*_ankle": -5}}
    pad = '<geom type="box" pos="0 0.1 -0.5" size="0.02 0.02 0.08"/>'
    mesh = '<geom type="mesh" mesh="wedge" pos="0 -0.1 -0.5"/>'
    asset = '<mesh name="wedge" vertex="0 0 .08  .05 0 -.08  -.05 .05 -.08  -.05 -.05 -.08"/>'
    found = check_robot(write_biped(tmp_path, trunk=pad + mesh, asset=asset, posture=straight))
    text = {fault.kind: fault.text for fault in found.faults}
    assert "left_shin" in text["self-collision"] and "right_shin" not in text["self-collision"]
    assert "right_shin" in text["overlapping meshes"] and "mm" in text["overlapping meshes"]
    assert "convex hulls" in text["overlapping meshes"]
    leaning = replace(found, rest=Rest(2.0, lean=6.3, foot_drift=1e-4))
    clean = replace(leaning, self_contacts=())
    drifting = replace(clean, rest=Rest(2.0, foot_drift=0.02))
    told = [texts(each)["drift"] for each in (leaning, clean, drifting)]
    assert "inside each other" in told[0] and "armature" in told[1]  # it has none
    assert "options.cone" in told[2] and "options.cone" not in "".join(told[:2])


@pytest.mark.usefixtures("no_controllers")
def test_straight_knees_and_a_foot_without_roll_are_warned_of(tmp_path: Path) -> None:
    """For stepping; the joints and the feet are named."""
    leg = LEG.replace('<joint name="{side}_ankle_roll" axis="1 0 0" range="-30 30"/>', "")
    path = write_biped(
        tmp_path, leg=leg, extra="", torque_limits={"*": 90}, armature={"*": 0.03},
        posture={"joints": {"*_hip": -2.5, "*_knee": 5, "*_ankle": -2.5}},
    )  # fmt: skip
    found = check_robot(path)
    assert kinds(found)[:2] == [("straight knees", True), ("no ankle roll", True)]
    assert "left_knee (5°), right_knee (5°)" in found.faults[0].text
    assert "left, right" in found.faults[1].text
    assert ("one foot", True) in kinds(found)


@pytest.mark.usefixtures("no_controllers")
def test_a_motor_of_one_leg_alone_is_warned_of(tmp_path: Path) -> None:
    """Before all else; joints that neither side drives are meant to be so."""
    left, right = (f'<motor joint="{side}_knee" ctrlrange="-50 50"/>' for side in ("left", "right"))
    one = motors(ctrlrange="-50 50").replace(right, "")
    first = check_robot(write_biped(tmp_path, extra=one)).faults[0]
    assert first.kind == "no motor"
    assert first.text.startswith("right_knee (its twin left_knee has one): ")
    found = check_robot(write_biped(tmp_path, extra=one.replace(left, "")))
    assert set(found.without_motor) == {"left_knee", "right_knee"}
    assert "no motor" not in texts(found)


@pytest.mark.usefixtures("no_controllers")
def test_a_sole_that_rocks_is_warned_of(tmp_path: Path) -> None:
    """Of three pairs of balls one behind the other, the middle one hangs 1 mm lower."""

    def foot(raised: float) -> str:
        places = [(x, y) for x in (-0.07, 0.03, 0.13) for y in (-0.04, 0.04)]
        return "".join(
            f'<geom size="0.01" pos="{x} {y} {-0.04 + raised * (x != 0.03)}"/>' for x, y in places
        )

    flat = check_robot(write_biped(tmp_path, foot=foot(0.0)))
    assert flat.sole_contacts == {"left": 6, "right": 6}
    assert "few contacts" not in dict(kinds(flat))
    rocking = check_robot(write_biped(tmp_path, foot=foot(0.001)))
    assert rocking.sole_contacts == {"left": 2, "right": 2}
    assert dict(kinds(rocking))["few contacts"] is False
    assert "left at 2, right at 2" in texts(rocking)["few contacts"]


def test_weak_motors_are_warned_of(check: RobotCheck, tmp_path: Path) -> None:
    """Standing, or with one foot lifted; the joint is named."""
    rotors = {"*": 0.01}
    weak = check_robot(write_urdf(tmp_path, torque_limits={"*_knee": 2}, armature=rotors))
    assert ("torque", False) in kinds(weak) and "_knee" in weak.faults[0].text
    needed = max(h.torque_fraction or 0 for h in check.one_foot.values())
    assert needed > 1.3 * (check.both_feet.torque_fraction or 0)
    limits = {"*": 60 * needed / 1.2}
    enough = check_robot(write_urdf(tmp_path, torque_limits=limits, armature=rotors))
    assert {kind for kind, _ in kinds(enough)} == {"one foot"} and enough.both_feet.possible
    assert "120% of the torque limit of" in enough.faults[0].text


def test_a_com_beside_the_soles_is_warned_of(check: RobotCheck) -> None:
    """Where a margin is zero."""
    fallen = (replace(check.directions[0], margin=0.0), *check.directions[1:])
    found = replace(check, directions=fallen).faults
    assert [fault.kind for fault in found if fault not in check.faults] == ["CoM"]


def shown(check: RobotCheck) -> str:
    console = Console(width=140, record=True, quiet=True)
    console.quiet = False
    with console.capture() as captured:
        print_robot_check(check, console)
    return captured.get()


def test_the_table_says_it(check: RobotCheck) -> None:
    """Figures with their units, the controllers, and the warnings or that there are none."""
    text = shown(check)
    for part in ("24.40 kg", "200 × 80 mm", "left_knee, bent 40°", "pitch and roll", "no warnings",
                 "60 N·m", f"{check.in_place:.1f}", f"{check.one_step / check.mass:.2f}",
                 "controllers in place: abe07", "controllers stepping: capture-step"):  # fmt: skip
        assert part in text, part
    heading = next(line for line in text.splitlines() if "in place" in line)
    for column in ("direction", "in place [N·s]", "in place [N·s/kg]", "one step ≤ [N·s/kg]"):
        assert column in heading
    refused = {STEPPING: Uses((), {"capture-step": "has [no] feet"})}
    text = shown(replace(check, controllers=refused, one_foot={"left": None}, licence="[MIT]"))
    assert "controllers stepping: none\n  not capture-step: has [no] feet" in text
    assert "no posture found" in text and "[MIT]" in text


def test_the_command_writes_figures_and_a_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], can_render: None
) -> None:
    """JSON that strict readers take, and a PNG in which something is drawn."""
    path = write_urdf(tmp_path, armature={"*": 0.01})
    out, picture = tmp_path / "a/b.json", tmp_path / "biped.png"
    assert main(["robot", str(path), "--out", str(out), "--picture", str(picture)]) == 0
    assert capsys.readouterr().out.endswith(f"{out}\n{picture}\n")
    figures = json.loads(out.read_text(), parse_constant=lambda text: pytest.fail(text))
    assert figures["mass"] == pytest.approx(24.4) and figures["faults"] == []
    assert figures["one_foot"]["left"]["torque_fraction"] < 1.0
    assert figures["in_place"] == pytest.approx(
        np.mean([each["in_place"] for each in figures["directions"]])
    )
    with Image.open(picture) as image:
        pixels = np.asarray(image.convert("RGB"))
    assert pixels.shape[1] > 1000 and len(np.unique(pixels.reshape(-1, 3), axis=0)) > 500


def test_legs_that_are_too_slow_for_a_step_are_warned_of(tmp_path: Path) -> None:
    """By damping; controllers whose steps are too short for them are named, and only those."""
    robot = load_robot(write_urdf(tmp_path))
    robot.model.dof_damping[6:] = 60.0
    found = check_robot(robot)
    fault = next(fault for fault in found.faults if fault.kind == "slow legs")
    never = found.controllers[STEPPING].never_step
    assert fault.stepping and "capture-step" in never and "simbicon" not in never
    assert all(name in fault.text for name in never)
    assert set(never) <= set(found.controllers[STEPPING].takes)


FEATHER = INERTIAL.format(z=0.0, mass=0.015, i=1e-5)


def texts(check: RobotCheck) -> dict[str, str]:
    return {fault.kind: fault.text for fault in check.faults}


@pytest.mark.usefixtures("no_controllers")
def test_joints_that_are_too_light_are_warned_of_before_they_fall(tmp_path: Path) -> None:
    """Feet of 15 g on motors of 60 N·m, as in URDF files; armature by pattern mends it."""
    limb = INERTIAL.format(z=-0.1, mass=2.0, i=0.01)
    foot = '<link name="{side}_foot">'
    light = {side: (foot.format(side=side) + limb, foot.format(side=side) + FEATHER)
             for side in ("left", "right")}  # fmt: skip
    path = write_urdf(tmp_path)
    model = path.with_suffix(".urdf")
    for old, new in light.values():
        assert old in model.read_text()
        model.write_text(model.read_text().replace(old, new))
    fallen = check_robot(path)
    found = texts(fallen)
    assert "left_ankle" in found["light joints"] and "armature: {" in found["light joints"]
    assert fallen.rest.fallen and "give its joints armature" in found["falls"]
    path.write_text(path.read_text() + "armature: {'*': 0.012}\n")
    mended = check_robot(path)
    assert not mended.rest.fallen and mended.rest.unsolved == 0 and mended.faults == ()
    assert mended.rest.chatter < 2.0 and mended.rest.foot_drift < 0.001


@pytest.mark.usefixtures("no_controllers")
def test_motors_without_rotors_are_warned_of(tmp_path: Path) -> None:
    found = texts(check_robot(write_urdf(tmp_path)))
    assert found["no armature"].startswith("10 of 10 motors") and set(found) == {"no armature"}


@pytest.mark.usefixtures("no_controllers")
def test_friction_flags_and_scenery_that_are_not_what_they_seem(tmp_path: Path) -> None:
    """MuJoCo takes the larger friction; limits are off; there is a wall."""
    floor = '<geom name="floor" type="plane" size="9 9 1" friction="0.2"/>'
    wall = '<geom name="wall" type="box" size="0.1 1 1" pos="2 0 1"/>'
    option = '<option><flag limit="disable" gravity="disable"/></option>'
    path = write_biped(
        tmp_path, world=floor + wall, extra=motors(ctrlrange="-60 60") + option,
        armature={"*": 0.02},
    )  # fmt: skip
    with pytest.warns(PoiseWarning, match="gravity: turned on"):
        found = check_robot(path)
    text = texts(found)
    assert "a friction of 1, though the ground has 0.2" in text["friction"]
    assert "disable limit:" in text["flags"] and "wall" in text["scenery"]
    assert "gravity: turned on" in text["changed"] and found.dynamics.friction == 1.0


@pytest.mark.usefixtures("no_controllers")
def test_a_com_near_an_edge_is_warned_of(tmp_path: Path) -> None:
    """And goes to the middle by one word."""
    joints = {"*_hip": -4, "*_knee": 40, "*_ankle": -36}
    lean = {"posture": {"joints": joints}, "armature": {"*": 0.01}}
    assert (
        "posture.com: middle"
        in texts(check_robot(write_urdf(tmp_path, **lean)))["CoM near an edge"]
    )
    lean["posture"] = {"joints": joints, "com": "middle"}
    assert "CoM near an edge" not in texts(check_robot(write_urdf(tmp_path, **lean)))


@pytest.mark.usefixtures("no_controllers")
def test_the_command_writes_the_description_of_a_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the current folder, once; it gives the same robot."""
    path = write_urdf(tmp_path / "maker").with_suffix(".urdf")
    monkeypatch.chdir(tmp_path)
    assert main(["robot", str(path)]) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith("biped.yaml: a guessed") and "no warnings" in printed.out
    described = load_robot("biped.yaml")
    assert yaml.safe_load(Path("biped.yaml").read_text())["source"]["urdf"] == "maker/biped.urdf"
    moved = tmp_path.with_name("moved")
    shutil.copytree(tmp_path, moved)
    assert load_robot(moved / "biped.yaml").fingerprint == described.fingerprint
    with pytest.warns(PoiseWarning):
        assert described.fingerprint == load_robot(path).fingerprint
    Path("biped.yaml").write_text("mine")
    assert main(["robot", str(path)]) == 0
    assert "poise: warning: " in (err := capsys.readouterr().err) and "guessed: root" in err
    assert Path("biped.yaml").read_text() == "mine"


def test_motors_that_stand_but_hold_no_push_are_warned_of(
    check: RobotCheck, tmp_path: Path, no_controllers: None
) -> None:
    """A sound robot recovers from half of its ankle limit in all directions; one whose motors have
    a tenth of the torque stands, falls, and the motor is named."""
    assert check.pushed.trials == 8 and check.pushed.falls == ()
    limit = '<limit lower="-2" upper="2" effort="9" velocity="10"/><dynamics damping="0.3"/>'
    weak = check_robot(write_urdf(tmp_path, limit=limit, armature={"*": 0.01}))
    assert weak.both_feet.possible and not weak.rest.fallen
    assert weak.pushed.falls and weak.pushed.cause.endswith("at its torque limit")
    (fault,) = [each for each in weak.faults if each.kind == "pushed"]
    assert f"falls in {len(weak.pushed.falls)} of 8 directions" in fault.text
    console = Console(record=True, width=200)
    print_robot_check(weak, console)
    assert "pushed, 0.5 of the ankle limit" in console.export_text()


def test_what_was_read_is_known_before_the_checks():
    """One line of the description alone, the first that `poise robot` shows."""
    known = load_robot("humanoid")
    line = summary(known)
    assert line.startswith(f"humanoid: {known.mass:.2f} kg, 21 joints, 21 motors")
    assert all(sole.name in line for sole in known.soles)
