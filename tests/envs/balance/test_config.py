"""envs/balance/config.py: where an environment's configuration comes from."""

import pytest

from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.envs.balance.config import EnvConfig, SensorConfig, env_config


def test_packaged_configurations_are_found_by_name():
    """Each of them can be read, and overrides win."""
    assert "proprioceptive" in packaged("envs")
    for name in packaged("envs"):
        assert env_config(name) != EnvConfig()
    config = env_config("proprioceptive", sensors={"delay": 0.0})
    assert config.sensors == SensorConfig() and config.observation.terms is not None


def test_an_unknown_name_lists_the_packaged_ones():
    """The line names what there is."""
    with pytest.raises(ConfigError, match=r"no such name: 'nowhere'.*proprioceptive"):
        env_config("nowhere")
