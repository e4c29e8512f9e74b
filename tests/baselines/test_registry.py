"""Controllers by name: what a file may leave to another one."""

import pytest

from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.registry import (
    controller_config,
    is_replaced,
    load_controller,
    where_uncertain,
)
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.configs.schema import to_dict
from poise.envs.sensing.realism import load_realism
from tests.support.policies import linear, write_onnx
from tests.support.refused import invalid
from tests.support.shared import robot


@pytest.mark.parametrize("name", packaged("controllers"))
def test_every_packaged_controller_can_be_made(name):
    """With a period and the two methods."""
    controller = load_controller(name, robot())
    assert controller.period > 0.0 and callable(controller.reset) and callable(controller.torques)


def test_a_base_holds_where_a_file_says_nothing(tmp_path):
    """Single gains are replaced, their neighbours stay."""
    path = tmp_path / "mine.yaml"
    path.write_text("base: momentum-qp\nperiod: 0.01\ncom: {offset: 0.05}\n")
    mine, base = to_dict(controller_config(path)), to_dict(controller_config("momentum-qp"))
    assert mine.pop("period") == 0.01 != base.pop("period")
    assert mine["com"].pop("offset") == 0.05 != base["com"].pop("offset")
    assert mine == base


def test_the_packaged_variant_differs_in_its_solver_alone():
    """`momentum-qp-osqp` has the baseline's gains, whatever they are tuned to."""
    variant, base = (controller_config(name) for name in ("momentum-qp-osqp", "momentum-qp"))
    assert isinstance(variant, MomentumQPConfig) and variant.solver == "osqp"
    different = {k for k, v in to_dict(variant).items() if v != to_dict(base)[k]}
    assert different == {"solver", "solver_options"}


def test_a_public_policy_is_a_base_without_a_kind(tmp_path):
    """The field `kind` is that of its description."""
    write_onnx(tmp_path / "own.onnx", linear(384, 29))
    path = tmp_path / "twice.yaml"
    path.write_text("base: amp-getup-g1\npolicy: own.onnx\ncopies: 2\n")
    config = controller_config(path)
    assert isinstance(config, PolicyFileConfig)
    assert (config.copies, config.policy_period, len(config.joints)) == (2, 0.02, 29)


@pytest.mark.parametrize("base", ["nonsense", "3", "{}"])
def test_a_base_that_is_none_is_refused(tmp_path, base):
    """Naming the choices."""
    path = tmp_path / "mine.yaml"
    path.write_text(f"base: {base}\n")
    with pytest.raises(ConfigError, match="momentum-qp"):
        controller_config(path)


def test_what_takes_its_place_is_not_handed_on(tmp_path):
    """A file on `walk` is its own gains at every level, unless it names another controller."""
    assert where_uncertain(controller_config("walk")) == controller_config("walk-field")
    path = tmp_path / "mine.yaml"
    path.write_text("base: walk\n")
    assert where_uncertain(controller_config(path)) is None
    assert where_uncertain(controller_config("momentum-qp")) is None
    path.write_text("base: walk\nuncertain: walk-fast\n")
    assert where_uncertain(controller_config(path)) == controller_config("walk-fast")


@pytest.mark.parametrize(
    ("level", "replaced"),
    [
        ("ideal", ()),
        ("late", ()),
        ("lab", ("walk",)),
        ("field", ("walk", "feedback-step")),
        ({"body": {"payload": 0.1}}, ("walk",)),
        ({"sensors": {"tilt_bias": [0.0, 0.015], "encoder_bias": 0.004}}, ("walk",)),
        (
            {"sensors": {"tilt_bias": 0.01, "encoder_bias": 0.006}, "motors": {"backlash": 0.005}},
            ("walk", "feedback-step"),
        ),
    ],
)
def test_it_takes_its_place_from_some_error_of_the_legs_on(level, replaced):
    """`walk` at any error of sensors and bodies, `feedback-step` from 0.02 rad on."""
    for name in ("walk", "feedback-step"):
        assert is_replaced(controller_config(name), load_realism(level)) is (name in replaced)


def test_from_where_on_is_not_handed_on(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("base: feedback-step\nuncertain: feedback-step-field\n")
    assert controller_config("feedback-step").uncertain_from == 0.02
    assert controller_config(path).uncertain_from == 0.0
    path.write_text("base: feedback-step\n")
    assert controller_config(path).uncertain_from == 0.0


@pytest.mark.parametrize(
    ("named", "error"),
    [
        ("nonsense", ("uncertain", "'nonsense'", "walk-field")),
        (
            "momentum-qp",
            ("uncertain", "'momentum-qp'", "'walk'"),
        ),
        ("walk", ("uncertain", "'walk'", "'uncertain'", "'walk-field'")),
        ("3", ("uncertain",)),
    ],
)
def test_what_cannot_take_its_place_is_refused(tmp_path, named, error):
    """As soon as the file is read, whatever the level."""
    path = tmp_path / "mine.yaml"
    path.write_text(f"base: walk-field\nuncertain: {named}\n")
    with invalid(*error):
        controller_config(path)
