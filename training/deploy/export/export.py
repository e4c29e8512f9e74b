"""`poise export`: a policy as a folder for other programs, checked before it is there."""

import json
import os
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.allowance import allows
from poise.configs.extras import needing
from poise.configs.files import check_new_folder, new_folder, packaged
from poise.configs.reading import MIB, is_file, read_bytes, read_text
from poise.configs.schema import build, read_yaml
from poise.envs.robots.robot import load_robot
from poise.training.learning.config import TrainConfig
from poise.training.learning.policy import ACTOR, Policy, load_policy, locate_policy
from poise.training.learning.policy_files import CONFIG, FILES

from .card import card
from .check import check_onnx
from .figures import figures
from .metadata import IDS, metadata
from .onnx_graph import narrowed, onnx_bytes
from .stock import write_stock

ONNX, TENSORS = "policy.onnx", "policy.safetensors"
OWN = "poise"  # folder of what `load_policy` reads
NOTICE, LICENCE = "NOTICE.md", "LICENSE"  # of whose the policy was before
OURS = "apache-2.0"  # licence of the packaged policies
LARGEST = 256 * MIB  # of a policy's file


@allows()
def export_policy(
    policy: str | Path,
    out: str | Path,
    *,
    result: str | Path | None = None,
    licence: str | None = None,
    allow: str | Iterable[str] = (),
) -> float:
    """Write the folder `out`: ONNX, safetensors, SB3's files and a model card.

    The folder is one that `huggingface_hub.upload_folder` can push as it is, and huggingface_sb3
    can load. It appears when it is complete and its ONNX file has been compared with
    `Policy.predict` on 10,000 random observations.

    Args:
        policy: a packaged policy, a policy folder, or a run folder of `poise train`.
        out: a folder that does not exist, or is empty.
        result: a folder of `poise evaluate` or `poise benchmark`, or its summary.json, whose
            figures of this policy go into the card.
        licence: for the card; if not given, that of the packaged policies, and none for others.
        allow: as of `load_policy`.

    Returns:
        The largest difference of an action of the ONNX file from that of `Policy.predict`.

    Raises:
        ConfigError: no such policy, as `load_policy`; `out` is not empty; a library is missing; a
            result in which the policy took no part.
        PoiseError: an exported file does not act as the policy does (1e-6 for ONNX, 1e-4 for SB3,
            which computes with 32 bits); the folder cannot be written.
    """
    check_new_folder(out)
    with needing("export", "export"):
        import onnx  # noqa: F401
        import onnxruntime  # noqa: F401
        import safetensors  # noqa: F401
    source, name = locate_policy(policy), _name(policy)
    config = source / CONFIG
    robot = load_robot(build(TrainConfig, read_yaml(config), str(config)).robot)  # once for all
    loaded = load_policy(source, robot, allow=allow)
    env = loaded.make_env(robot=robot)
    found = figures(loaded, str(policy), robot, result)
    if licence is None and str(policy) in packaged("policies"):
        licence = OURS
    # as huggingface_sb3 names it
    archive = f"ppo-{IDS[loaded.config.action].replace('/', '-')}.zip"
    notice = read_text(source / NOTICE, MIB) if is_file(source / NOTICE) else ""
    with new_folder(out) as part:
        said = metadata(loaded, env)
        (part / ONNX).write_bytes(onnx_bytes(loaded, said))
        (part / TENSORS).write_bytes(safetensors_bytes(loaded, said))
        worst = check_onnx(part / ONNX, loaded)
        write_stock(part, archive, loaded, env, source)
        _copy(FILES, source, part / OWN)
        _copy([n for n in (NOTICE, LICENCE) if is_file(source / n)], source, part)
        (part / "config.json").write_text(_settings(part / archive), "utf-8")
        # huggingface_sb3's words where it has one; returns are not measured
        results = {"is_deterministic": True, "figures": [asdict(figure) for figure in found]}
        text = json.dumps(results, indent=1, ensure_ascii=False) + "\n"
        (part / "results.json").write_text(text, "utf-8")
        page = card(name, archive, loaded, env, found, licence, notice)
        (part / "README.md").write_text(page, "utf-8")
    return worst


def _name(policy: str | Path) -> str:
    """Return the policy's name: of a run, that of its folder."""
    path = Path(os.path.abspath(policy))  # not resolved: a link's name is as good as another
    return path.parent.name if path.name in ("best", "last") else path.name


def _copy(names: Iterable[str], source: Path, folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_bytes(read_bytes(source / name, LARGEST))


def _settings(archive: Path) -> str:
    """config.json: what SB3 says of the model, and of the system that wrote it."""
    with zipfile.ZipFile(archive) as members:
        said: dict[str, Any] = json.loads(members.read("data"))
        said["system_info"] = members.read("system_info.txt").decode()
    return json.dumps(said) + "\n"


def tensors(policy: Policy) -> dict[str, np.ndarray]:
    """Return all numbers that decide the policy's actions, by name.

    The actor's layers have the names and the shape (out, in) that they have in SB3's state_dict.
    `observation.mean`, `.scale` (no,) and `.clip` () normalise; a symmetric policy has `.order` and
    `.sign` of its mirror images, for `observation.` and `action.`. Weights have 32 bits where these
    hold them exactly, as those of every policy that was trained here.
    """
    *hidden, (weight, bias) = policy.layers
    found = {"action_net.weight": weight.T, "action_net.bias": bias}
    for i, (weight, bias) in enumerate(hidden):  # the activations between them count, too
        found |= {f"{ACTOR}{2 * i}.weight": weight.T, f"{ACTOR}{2 * i}.bias": bias}
    found = {name: np.ascontiguousarray(narrowed(values)) for name, values in found.items()}
    found["observation.mean"], found["observation.scale"] = policy.mean, policy.scale
    found["observation.clip"] = np.array(policy.clip)
    for side, mirror in zip(("observation", "action"), policy.mirrors or (), strict=False):
        found[f"{side}.order"] = mirror.order.astype(np.int64)
        found[f"{side}.sign"] = mirror.sign
    return found


def safetensors_bytes(policy: Policy, metadata: Mapping[str, str]) -> bytes:
    """Return the file of `tensors` with these metadata; the same policy gives the same bytes."""
    from safetensors.numpy import save

    return bytes(save(tensors(policy), metadata=dict(metadata)))
