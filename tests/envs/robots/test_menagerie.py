"""envs/robots/menagerie.py, and the packaged robots whose models others have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.configs.errors import ConfigError
from poise.configs.files import packaged, resolve
from poise.configs.schema import build, read_yaml
from poise.envs.robots import menagerie
from poise.envs.robots.description import RobotDescription, match_names
from poise.envs.robots.menagerie import VARIABLES, WHEEL, find_model
from poise.envs.robots.robot import load_robot
from tests.support.refused import invalid
from tests.support.small_biped import write_biped
from tests.support.weekly import daily

#: name → mass [kg] and number of joints, by the makers' model
ROBOTS = {
    "unitree_g1": (33.3, 29),
    "unitree_h1": (51.4, 19),
    "booster_t1": (31.6, 23),
    "robotis_op3": (3.15, 20),
    "apptronik_apollo": (80.9, 32),
    "berkeley_humanoid": (16.1, 12),
}
FILE = "own_robot/own.xml"


@pytest.fixture
def nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine without any model: an empty home."""
    for name in (*VARIABLES, "ROBOT_DESCRIPTIONS_CACHE", "MENAGERIE_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(menagerie, "WHEEL", "no_such_package")
    return tmp_path


def put(folder: Path, file: str = FILE) -> Path:
    (folder / file).parent.mkdir(parents=True)
    (folder / file).write_text("<mujoco/>")
    return folder / file


def test_where_there_is_none_one_line_says_how_to_get_it(nothing: Path) -> None:
    """A package, or a checkout."""
    with pytest.raises(ConfigError) as error:
        load_robot("unitree_g1")
    text = str(error.value)
    assert text.startswith(str(resolve("robots", "unitree_g1"))) and "source.menagerie" in text
    assert "pip install -e '.[robots]'" in text and "POISE_MENAGERIE" in text and "\n" not in text


@pytest.mark.parametrize("variable", VARIABLES)
def test_a_checkout_is_named_by_the_environment(
    nothing: Path, monkeypatch: pytest.MonkeyPatch, variable: str
) -> None:
    """Where it is set, no other place is looked at; what it holds is said."""
    put(nothing / "home/.cache/robot_descriptions/mujoco_menagerie")
    checkout = nothing / "checkout"
    found = put(checkout)
    monkeypatch.setenv(variable, str(checkout))
    assert find_model(FILE, "own.yaml") == found
    with pytest.raises(ConfigError) as error:
        find_model("unitree_g1/g1.xml", "own.yaml")
    text = f"own.yaml: source.menagerie: {variable}={checkout} has no unitree_g1/g1.xml"
    assert str(error.value) == f"{text} (choices: own_robot)"
    monkeypatch.setenv(variable, str(found))
    with invalid("source.menagerie", f"{variable}={found}"):
        find_model(FILE, "own.yaml")


def test_a_home_that_nobody_has(nothing: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither a checkout in it nor a machine without one is a traceback."""
    monkeypatch.delenv("HOME")
    monkeypatch.setattr("pwd.getpwuid", _nobody)
    with invalid("source.menagerie", "own_robot/own.xml"):
        find_model(FILE, "own.yaml")
    monkeypatch.setenv(VARIABLES[0], "~nosuchuser/menagerie")
    with invalid("source.menagerie", f"{VARIABLES[0]}=~nosuchuser/", source="own.yaml"):
        find_model(FILE, "own.yaml")


def _nobody(number: int) -> None:
    raise KeyError(number)


@pytest.mark.parametrize("file", ["**/own.xml", "a\0/own.xml", "[/own.xml", "/own.xml"])
def test_a_folder_of_a_strange_name_is_not_there(nothing: Path, file: str) -> None:
    """Whatever a description of anybody asks for."""
    with invalid("source.menagerie", "own.xml"):
        find_model(file, "own.yaml")


def test_what_packages_brought_is_found(nothing: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The wheel first, then downloads of robot_descriptions and of mujoco_menagerie."""
    cache = nothing / "home/.cache"
    unfinished = put(cache / "mujoco_menagerie/models/own_robot-0123", "own.xml")
    with pytest.raises(ConfigError):
        find_model(FILE, "own.yaml")
    (unfinished.parent / ".complete").touch()
    assert find_model(FILE, "own.yaml") == unfinished
    described = put(cache / "robot_descriptions/mujoco_menagerie")
    assert find_model(FILE, "own.yaml") == described
    put(nothing / "site/some_wheel", f"{menagerie.IN_WHEEL}/{FILE}")
    monkeypatch.syspath_prepend(str(nothing / "site"))
    monkeypatch.setattr(menagerie, "WHEEL", "some_wheel")
    assert find_model(FILE, "own.yaml").is_relative_to(nothing / "site")


def test_a_description_of_ones_own_may_use_it(
    nothing: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The YAML file lies elsewhere."""
    (nothing / "checkout/own_robot").mkdir(parents=True)
    written = write_biped(nothing / "checkout/own_robot")
    fields = read_yaml(written)
    fields["source"] = {"menagerie": f"own_robot/{fields['source']['mjcf']}"}
    own = nothing / "own.yaml"
    own.write_text(yaml.safe_dump(fields))
    monkeypatch.setenv(VARIABLES[0], str(nothing / "checkout"))
    assert load_robot(own).fingerprint == load_robot(written).fingerprint


def described() -> list[str]:
    """Packaged robots whose models others have."""
    texts = {name: read_yaml(resolve("robots", name)) for name in packaged("robots")}
    return sorted(name for name, text in texts.items() if "menagerie" in text["source"])


def test_packaged() -> None:
    """These, each with the licence of its model, called as Menagerie calls its folder."""
    assert set(described()) == set(ROBOTS)
    for name in described():
        source = build(RobotDescription, read_yaml(resolve("robots", name)), name).source
        assert source.licence.startswith(("BSD-3-Clause (", "Apache-2.0 ("))
        assert (source.menagerie or "").startswith(f"{name}/")


@pytest.mark.parametrize("name", daily(ROBOTS, 3))
def test_it_is_as_its_maker_says_and_stands(name: str) -> None:
    """Mass, joints, motors; bodies to push and roles that exist; a second from a shaky start."""
    pytest.importorskip(WHEEL, reason="its model is not installed: pip install 'poise[robots]'")
    robot, (mass, joints) = load_robot(name), ROBOTS[name]
    assert robot.mass == pytest.approx(mass, rel=0.01) and len(robot.joint_names) == joints
    assert np.all(robot.torque_limit > 0.0)
    bodies = {robot.model.body(i).name for i in range(robot.model.nbody)}
    assert robot.description.push_bodies and bodies.issuperset(robot.description.push_bodies)
    for role, scales in robot.description.roles.items():
        match_names(scales, list(robot.joint_names), name, f"roles.{role}")
    env = ResidualBalanceEnv(robot, pushes=None, duration=1.0)
    margins = [env.simulation.state.support_margin(angle) for angle in (0.0, 90.0, 180.0, 270.0)]
    assert min(margins) > 0.05 * robot.height_com
    env.reset(seed=0)
    while env.episode.running:
        env.step_without_info(np.zeros(4))
    assert not env.fallen
