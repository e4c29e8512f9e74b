"""Training while motions play: each environment performs one, and the policy sees its phase."""

import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.configs.errors import ConfigError
from poise.configs.schema import build
from poise.training.learning.config import TrainConfig, train_config


def test_environments_perform_the_motions_in_turn() -> None:
    config = train_config("residual-motion")
    env = config.make_env()
    assert env.terms[-1].name == "motion_phase" and config.motions[0] == "standing"
    found = [each for each in config.replicate(env, 7) if isinstance(each, ResidualBalanceEnv)]
    assert [each.motion.name for each in found] == [*config.motions, *config.motions[:2]]
    assert found[0].motion is found[5].motion  # read once


def test_tempo_and_motions_reach_the_environment() -> None:
    fields = {"motion": "bow", "tempo": {"waits": True, "after": "resume"}}
    env = build(TrainConfig, fields, "test").make_env()
    assert isinstance(env, ResidualBalanceEnv) and env.motion.name == "bow"
    assert env.tempo.waits and env.tempo.after == "resume"
    assert env.arguments()["tempo"] == env.tempo
    with pytest.raises(ConfigError, match="no such"):
        config = build(TrainConfig, {"motions": ["standing", "nothing"]}, "test")
        config.replicate(config.make_env(), 2)
    with pytest.raises(ConfigError, match="tempo.*after"):
        ResidualBalanceEnv(tempo={"after": "never"})
