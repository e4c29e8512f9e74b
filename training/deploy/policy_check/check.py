"""All that is found out about a policy of somebody else on a robot."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from poise.baselines.allowance import is_script
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.policy_files.known import known_policies
from poise.baselines.policy_files.networks import onnx_session
from poise.baselines.policy_files.onnx.files import BYTES, digest, is_network
from poise.baselines.policy_files.onnx.metadata import metadata_fields
from poise.baselines.registry import controller_config
from poise.configs.errors import ConfigError
from poise.configs.reading import is_file, read_bytes
from poise.envs.robots.robot import Robot

from .guess import WORDS, Layout, Sizes, layouts, network_sizes
from .rollout import Finding, compare, read_rollout

SECONDS = 10.0  # for which it is to stand


@dataclass(frozen=True)
class Stood:
    """How it stood: when it fell [s] or None, how far it went [m], whether it was at rest."""

    fell: float | None
    moved: float
    rests: bool


@dataclass(frozen=True)
class PolicyCheck:
    """The findings of `check_policy`.

    Attributes:
        file: that was checked.
        known: the public policy that the network is, by its sum, or None.
        sizes: of the network.
        layouts: usual observations of its size, where nothing describes it.
        unsaid: fields of `WORDS` that nothing says.
        stood: how it stood; None where nothing describes it.
        findings: what a rollout tells.
    """

    file: str
    known: str | None
    sizes: Sizes
    layouts: tuple[Layout, ...]
    unsaid: tuple[str, ...]
    stood: Stood | None
    findings: tuple[Finding, ...]

    @property
    def right(self) -> bool:
        """Whether it is described, stands, and nothing of the rollout speaks against it."""
        stands = self.stood is not None and self.stood.fell is None
        return stands and all(each.right is not False for each in self.findings)


def check_policy(file: str, robot: Robot, rollout: Path | None = None) -> PolicyCheck:
    """Check a policy: a network, or whatever `controller_config` takes for one.

    A network that nothing describes is not played: what a description needs is told.

    Raises ConfigError for what is no policy, or is described wrongly: in the words of the field.
    """
    path = Path(file)
    bare = is_file(path) and (is_script(path) or is_network(path))
    known = known_as(path) if bare else None
    said = _said(path) if bare else {}
    if bare and known is None and "observations" not in said:
        sizes = network_sizes(path)
        guesses = tuple(_layouts(sizes, len(robot.joint_names)))
        unsaid = tuple(name for name in WORDS if name not in said)
        return PolicyCheck(file, None, sizes, guesses, unsaid, None, ())
    config = controller_config(known or file)
    if not isinstance(config, PolicyFileConfig):
        raise ConfigError("is no policy from outside", source=file, field="policy")
    policy = PolicyFile(robot, config)
    findings = () if rollout is None else compare(policy, read_rollout(rollout), rollout)
    sizes = network_sizes(Path(config.policy))
    return PolicyCheck(file, known, sizes, (), _unsaid(config), stand(robot, config),
                       tuple(findings))  # fmt: skip


def known_as(path: Path) -> str | None:
    """The public policy that a network is, by its sum."""
    digest(path, path)  # of a pointer of Git LFS, or without its data, that is said
    found = hashlib.sha256(read_bytes(path, BYTES)).hexdigest()
    for known in known_policies():
        if next(iter(known.origin.files.values())).sha256 == found:
            return known.name
    return None


def stand(robot: Robot, config: PolicyFileConfig) -> Stood:
    """Let it stand for ten seconds, nearly undisturbed."""
    env = ResidualBalanceEnv(robot, controller=config, pushes=None, duration=SECONDS)
    env.reset(seed=0, options={"push": []})
    start, rest = env.simulation.state.com.copy(), np.zeros(len(env.action_names))
    while not env.fallen and env.simulation.time < SECONDS - 1e-9:
        env.step_without_info(rest)
    moved = float(np.linalg.norm((env.simulation.state.com - start)[:2]))
    return Stood(env.simulation.time if env.fallen else None, moved, bool(env.recovered))


def _said(path: Path) -> dict[str, object]:
    """What the metadata of an ONNX file say."""
    if is_script(path):
        return {}
    return metadata_fields(onnx_session(path).get_modelmeta().custom_metadata_map, path)


def _layouts(sizes: Sizes, joints: int) -> list[Layout]:
    """Usual layouts of the largest input, the likeliest three."""
    given = [size for size in sizes.inputs.values() if size]
    actions = next((size for size in sizes.outputs.values() if size), None)
    if not given or actions is None:
        return []
    return list(layouts(max(given), actions, joints))[:3]


def _unsaid(config: PolicyFileConfig) -> tuple[str, ...]:
    """Fields of `WORDS` that are as they are where nothing says them, which is seldom right."""
    usual = PolicyFileConfig()
    named = config.joints or config.motors
    return tuple(
        name
        for name in ("joints", "default", "stiffness", "damping")
        if getattr(config, name) == getattr(usual, name) and not (name == "joints" and named)
    )
