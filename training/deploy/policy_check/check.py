"""All checks of an external policy on a robot."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from poise.baselines.allowance import is_script
from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.policy_files.known import RIVALS, known_policies
from poise.baselines.policy_files.networks import onnx_session
from poise.baselines.policy_files.observations import tracks_motion
from poise.baselines.policy_files.onnx.files import BYTES, digest, is_network
from poise.baselines.policy_files.onnx.metadata import metadata_fields
from poise.baselines.policy_files.refused import check_not_refused
from poise.baselines.registry import controller_config
from poise.configs.errors import ConfigError, meant, shown
from poise.configs.files import packaged
from poise.configs.reading import is_file, is_folder, read_bytes
from poise.envs.robots.robot import Robot

from .guess import WORDS, Layout, Sizes, layouts, network_sizes
from .proposals import (
    Say,
    Tried,
    clock_is_open,
    clocks,
    order_is_open,
    silent,
    steps_missing,
    try_clocks,
    try_histories,
)
from .rollout import Finding, compare_rollout
from .standing import SECONDS, Stood, stand


@dataclass(frozen=True)
class PolicyCheck:
    """The findings of `check_policy`.

    Attributes:
        file: that was checked.
        known: the public policy that the network is, by its sum, or None.
        sizes: of the network.
        layouts: usual observations of its size, where nothing describes it.
        unsaid: fields of `WORDS` that are not specified.
        stood: how it stood; None where nothing describes it.
        findings: results of the comparison with a rollout.
        tried: readings of what the description leaves open, where it fell or was never at rest.
        proposed: the one of them that stood best, better than what is described; or None.
        held: whether it tracks a motion whose first frame is held.
        amends: whether the description does not fit the network without the proposal.
    """

    file: str
    known: str | None
    sizes: Sizes
    layouts: tuple[Layout, ...]
    unsaid: tuple[str, ...]
    stood: Stood | None
    findings: tuple[Finding, ...]
    tried: tuple[Tried, ...] = ()
    proposed: Tried | None = None
    amends: bool = False
    held: bool = False

    @property
    def right(self) -> bool:
        """Whether it is described, stands, and nothing of the rollout speaks against it."""
        stands = self.stood is not None and self.stood.fell is None and not self.amends
        return stands and all(each.right is not False for each in self.findings)


def check_policy(
    file: str, robot: Robot, rollout: Path | None = None, say: Say = silent
) -> PolicyCheck:
    """Check a policy: a network, or whatever `controller_config` takes for one.

    A network without a description is not run: what a description needs is reported. `say` takes a
    line before each trial.

    Raises ConfigError, which names the field, for a file that is no policy or a wrong description.
    """
    path = Path(file)
    _check_given(file)
    bare = is_file(path) and (is_script(path) or is_network(path))
    known = known_as(path) if bare else None
    said = _said(path) if bare else {}
    if bare and known is None and "observations" not in said:
        sizes = network_sizes(path)
        guesses = tuple(_layouts(sizes, len(robot.joint_names)))
        unsaid = tuple(name for name in WORDS if name not in said)
        return PolicyCheck(file, None, sizes, guesses, unsaid, None, ())
    # the network that was given, which need not be where known ones are looked for
    config = controller_config(
        file if known is None else {"kind": "policy-file", "base": known, "policy": str(path)}
    )
    if not isinstance(config, PolicyFileConfig):
        raise ConfigError("is no external policy", source=file, field="policy")
    sizes = network_sizes(Path(config.policy))
    steps = steps_missing(robot, config, sizes)
    tried = try_histories(robot, config, steps, say) if steps > 1 else []
    proposed = max(tried, key=lambda each: each.stood.rank, default=None)
    if proposed is not None:
        config = proposed.config
    policy = PolicyFile(robot, config)
    findings = () if rollout is None else compare_rollout(policy, rollout)
    say(f"standing for {SECONDS:g} s")
    stood = stand(robot, config)
    if steps == 1:
        if stood.fell is not None and order_is_open(config):
            tried += try_histories(robot, config, 1, say)
        if not stood.rests and clock_is_open(config):
            tried += try_clocks(robot, config, say)
        proposed = _better(tried, stood)
    return PolicyCheck(file, known, sizes, (), _unsaid(config), stood, tuple(findings),
                       tuple(tried), proposed, steps > 1, _holds(config))  # fmt: skip


def _check_given(file: str) -> None:
    """Raise ConfigError, which lists the known policies, for neither a file nor a name of one."""
    names = packaged(RIVALS)
    if file in (*names, *packaged("controllers")) or is_file(file) or is_folder(file):
        return
    check_not_refused(file)
    hint = meant(file, names) or ";"
    raise ConfigError(f"no such policy: {shown(file)}{hint} give a network (.onnx, .pt), a .yaml "
                      "file, a folder, or a known name", field="policy",
                      choices=names)  # fmt: skip


def _holds(config: PolicyFileConfig) -> bool:
    """Return whether a policy tracks a motion whose first frame is held."""
    return tracks_motion(config) and not (config.motion is not None and config.motion.plays)


def known_as(path: Path) -> str | None:
    """Return the public policy that a network is, by its sum."""
    digest(path, path)  # of a pointer of Git LFS, or without its data, that is said
    found = hashlib.sha256(read_bytes(path, BYTES)).hexdigest()
    for known in known_policies():
        if next(iter(known.origin.files.values())).sha256 == found:
            return known.name
    return None


def _better(tried: list[Tried], stood: Stood) -> Tried | None:
    """The reading that stood best of those that stand where it fell, or rest where it did not."""
    fell = stood.fell is not None
    better = [each for each in tried if each.stood.fell is None and (fell or each.stood.rests)]
    return max(better, key=lambda each: each.stood.rank, default=None)


def _said(path: Path) -> dict[str, object]:
    """Return what the metadata of an ONNX file state."""
    if is_script(path):
        return {}
    return metadata_fields(onnx_session(path).get_modelmeta().custom_metadata_map, path)


def _layouts(sizes: Sizes, joints: int) -> list[Layout]:
    """Return the three likeliest layouts of the largest input."""
    given = [size for size in sizes.inputs.values() if size]
    actions = next((size for size in sizes.outputs.values() if size), None)
    if not given or actions is None:
        return []
    return list(layouts(max(given), actions, joints))[:3]


def _unsaid(config: PolicyFileConfig) -> tuple[str, ...]:
    """Fields of `WORDS` and `CLOCK` that nothing says and whose defaults seldom fit."""
    said = {"joints" if name == "motors" else name for name in config.said}
    open_ones = ["joints", "default", "stiffness", "damping", "action_scale"]
    if clocks(config):
        open_ones.append("phase")
    return tuple(name for name in open_ones if name not in said)
