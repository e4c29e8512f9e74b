"""envs/balance/config.py: where an environment's configuration comes from."""

from dataclasses import fields

from poise.configs.files import packaged
from poise.configs.schema import build, to_dict
from poise.envs.balance.config import EnvConfig, env_config
from poise.envs.balance.mdp.reward import RewardWeights
from poise.envs.sensing.realism import Realism
from tests.support.refused import invalid


def test_packaged_configurations_are_found_by_name():
    """Each of them can be read, and overrides win."""
    assert "proprioceptive" in packaged("envs")
    for name in packaged("envs"):
        assert env_config(name) != EnvConfig()
    config = env_config("proprioceptive", realism="ideal")
    assert config.realism == Realism() and config.observation.terms is not None


def test_what_came_later_is_written_only_where_it_is_used():
    """Fingerprints of policies that know nothing of it hash what is written."""
    plain, terms = to_dict(EnvConfig()), fields(RewardWeights)
    assert not {"observation", "realism", "estimator"} & set(plain)
    off = {term.name for term in terms if term.default == 0.0}
    assert off and set(plain["reward"]) == {term.name for term in terms} - off
    reward = dict.fromkeys(off, 1.0) | {"com": 0.0}
    used = env_config(None, realism={"latency": {"sense": 0.01}}, reward=reward)
    written = to_dict(used)
    assert written["realism"]["latency"]["sense"] == 0.01 and off < set(written["reward"])
    assert written["reward"]["com"] == 0.0 and build(EnvConfig, written, "written") == used


def test_an_unknown_name_lists_the_packaged_ones():
    """The line names what there is."""
    with invalid("env", "'nowhere'", "proprioceptive"):
        env_config("nowhere")
