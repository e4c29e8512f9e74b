"""From a YAML file, a folder or an ONNX file to the configuration of a policy."""

import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

from poise.baselines.allowance import check_allowed, is_script
from poise.configs.errors import ConfigError, shown
from poise.configs.files import packaged, resolve
from poise.configs.reading import is_file, is_folder, read_yaml, whole_path
from poise.configs.schema import build, on_base

from .bounds import with_pairs
from .checkpoints import check_no_checkpoint
from .config import Origin, PolicyFileConfig
from .deploy import deploy_fields, is_deploy
from .known import RIVALS, expect_network
from .motion.config import NETWORK, TIME_STEP
from .networks import onnx_session
from .onnx.bounds import try_network
from .onnx.files import description, digest, is_network, is_policy_place, only_network
from .onnx.metadata import metadata_fields

COMMONEST = "unitree_g1"  # of the robots that public policies are for


def advice(network: str | Path) -> str:
    """What helps with a network that nothing describes."""
    return (f"poise policies check {shlex.quote(str(network))} --robot {COMMONEST} (or the robot "
            "that it is for) says what a description of it needs")  # fmt: skip


def is_policy(name: object) -> bool:
    """Return whether `name` is that of an external policy.

    Such are packaged policies, ONNX files, folders that hold or describe a network, and files
    like ``deploy.yaml``.
    """
    if not isinstance(name, (str, Path)):
        return False
    is_yaml = Path(name).suffix in (".yaml", ".yml") and is_file(name)
    return name in packaged(RIVALS) or is_policy_place(name) or (
        is_yaml and is_deploy(read_yaml(name))
    )  # fmt: skip


def policy_config(name: str | Path) -> PolicyFileConfig:
    """The policy that a name stands for, see `is_policy`; raises as `policy_file_config`."""
    place = resolve(RIVALS, name) if name in packaged(RIVALS) else Path(name)
    if is_folder(place):
        return _in_folder(place)
    if is_network(place):
        return policy_file_config({"policy": place.name}, place)
    data = on_base(read_yaml(place), RIVALS, place)
    return policy_file_config({"deploy": place.name} if is_deploy(data) else data, place)


def _in_folder(place: Path) -> PolicyFileConfig:
    described = description(place)
    if described is None:
        return policy_file_config({"policy": str(only_network(place, place))}, place)
    data = read_yaml(described)
    if is_deploy(data):
        data = {"deploy": described.name}
    if "policy" not in data and described.parent != place:  # params/ beside exported/
        data["policy"] = str(only_network(place, described))
    return policy_file_config(data, described)


def policy_file_config(data: dict[str, Any], source: Path) -> PolicyFileConfig:
    """The configuration that a mapping describes, and the files that it names.

    What `data` says wins over `deploy`, and this over the metadata of an ONNX file. Paths are
    relative to the folder of `source` and become absolute; the digest is that of the files now.
    Where it names no network but an `origin`, it is the known one that is found, by its sum.

    Raises ConfigError naming the file and the field: an unknown field, a wrong type, a missing
    file, TorchScript that the user has not allowed, no observations.
    """
    folder, data = source.parent, dict(data)
    for name in ("policy", "deploy"):
        if not isinstance(data.get(name) or "", str):
            raise ConfigError(f"must be a path, not {shown(data[name])}", source=source, field=name)
    below: dict[str, Any] = {}
    if deploy := data.pop("deploy", None):
        below = deploy_fields(read_yaml(folder / deploy), folder / deploy)
    named = data.get("policy") or below.get("policy")
    if not named and data.get("origin"):
        origin = build(Origin, data["origin"], f"{source}: origin")
        named = str(expect_network(origin, source.stem))
    path, version = _network(named, folder, source)
    if not is_script(path):
        try_network(path, version)
        session = onnx_session(path)
        below = {**metadata_fields(session.get_modelmeta().custom_metadata_map, path), **below}
        data = _with_time_step(below, data, [each.name for each in session.get_inputs()])
    said = {**below, **data, "policy": str(path)}
    if isinstance(below.get("motion"), dict) and isinstance(data.get("motion"), dict):
        said["motion"] = {**below["motion"], **data["motion"]}
    said = _with_clip(said, folder, source)
    config = build(PolicyFileConfig, with_pairs(said), source)
    if not config.observations or not all(config.inputs.values()):
        raise ConfigError(f"what the policy sees is not said; {advice(path)}", source=source,
                          field="observations")  # fmt: skip
    return replace(config, digest=version, described_in=str(source), said=tuple(sorted(said)))


def _with_time_step(
    below: dict[str, Any], said: dict[str, Any], inputs: list[str]
) -> dict[str, Any]:
    """What is said, in which an input `time_step` shows the frame of the clip."""
    terms = said.get("observations", below.get("observations"))
    others = [name for name in inputs if name != TIME_STEP]
    if TIME_STEP not in inputs or isinstance(terms, dict) or not terms or len(others) != 1:
        return said
    return {**said, "observations": {others[0]: terms, TIME_STEP: [{"term": TIME_STEP}]}}


def _with_clip(said: dict[str, Any], folder: Path, source: Path) -> dict[str, Any]:
    """The description with the whole path of its clip."""
    motion = said.get("motion")
    if not isinstance(motion, dict):
        return said
    clip = motion.get("clip")
    if not isinstance(clip, str) or clip in ("", NETWORK):
        return said
    path = whole_path(folder / clip, source, "motion.clip")
    if not is_file(path):
        raise ConfigError(f"no such file: {path}", source=source, field="motion.clip")
    return {**said, "motion": {**motion, "clip": str(path)}}


def _network(name: str | None, folder: Path, source: Path) -> tuple[Path, str]:
    """The policy's file, which the user must have allowed if it is code, and its digest."""
    path = whole_path(folder / name, source, "policy") if name else only_network(folder, source)
    if is_folder(path):
        raise ConfigError(f"is a folder, not a network: {path}", source=source, field="policy")
    if not is_file(path):
        raise ConfigError(f"no such file: {path}", source=source, field="policy")
    version = digest(path, source)  # what is missing beside it is said before onnxruntime finds it
    if is_script(path):
        check_no_checkpoint(path)
        check_allowed(str(path))
    return path, version
