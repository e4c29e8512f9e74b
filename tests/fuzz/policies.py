"""Policy folders: the packaged ones, with bytes, archive members, arrays and fields changed."""

from __future__ import annotations

import io
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from poise.configs.files import packaged, packaged_folder
from poise.training.learning.policy import load_policy
from poise.training.learning.policy_files import CONFIG, FILES, STATE, STATISTICS
from tests.support.shared import robot

from .texts import Draw, byte_edits, changed, edit_bytes
from .values import Json, decode, packed

METHODS = {
    "stored": zipfile.ZIP_STORED,
    "deflated": zipfile.ZIP_DEFLATED,
    "bzip2": zipfile.ZIP_BZIP2,
    "lzma": zipfile.ZIP_LZMA,
}
ARRAYS = {
    "complex": lambda a: a.astype(complex),
    "bool": lambda a: a.astype(bool),
    "text": lambda a: a.astype("U9"),
    "dates": lambda a: a.astype(int).astype("datetime64[s]"),
    "structured": lambda a: np.zeros(a.shape, [("a", float)]),
    "float16": lambda a: a.astype(np.float16),
    "column": lambda a: a.reshape(-1, 1),
    "shorter": lambda a: a.ravel()[1:],
    "longer": lambda a: np.append(a, 1.0),
    "empty": lambda a: np.zeros((0,)),
    "scalar": lambda a: np.float64(1.0),
    "negative": lambda a: -np.abs(a) - 1.0,
    "nan": lambda a: a * np.nan,
    "large": lambda a: a * 0.0 + 1e308,
    "tiny": lambda a: a * 0.0 + 5e-324,
    "zero": lambda a: a * 0.0,
    "bomb": lambda a: np.zeros(400_000_000, dtype=np.int8),
    "deep": lambda a: a.reshape((1,) * 30 + a.shape),
}


@cache
def _file(policy: str, name: str) -> bytes:
    return (packaged_folder("policies") / policy / name).read_bytes()


@st.composite
def cases(draw: Draw) -> Json:
    """A packaged policy, one of its files, and what is done to it."""
    policy, name = draw(st.sampled_from(packaged("policies"))), draw(st.sampled_from(FILES))
    content = _file(policy, name)
    case: Json = {"policy": policy, "file": name}
    if name in (CONFIG, STATE):
        form = "yaml" if name == CONFIG else "json"
        return {**case, "content": packed(changed(draw, content, form))}
    how = draw(st.sampled_from(["bytes", "member", "member", "missing", "array", "bomb"]))
    if how == "missing":
        return {**case, "content": draw(st.sampled_from([None, packed(b""), packed(b"PK")]))}
    if how == "bytes":
        return {**case, "edits": byte_edits(draw, len(content))}
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = sorted(archive.namelist())
        member = draw(st.sampled_from(members))
        size = archive.getinfo(member).file_size
    case |= {"member": member, "method": draw(st.sampled_from(sorted(METHODS)))}
    if how == "bomb":
        return {**case, "zeros": draw(st.sampled_from([0, 10**6, 2 * 10**8]))}
    if how == "array" and name == STATISTICS:
        case["array"] = draw(st.sampled_from(sorted(ARRAYS)))
        if case["array"] == "bomb" and case["method"] == "lzma":
            case["method"] = "deflated"  # else writing the case takes the seconds of a hang
        return case
    head = draw(st.booleans())  # where formats keep what describes the rest
    return {**case, "edits": byte_edits(draw, min(size, 200) if head else size)}


def _array(content: bytes, change: str) -> bytes:
    array = np.load(io.BytesIO(content), allow_pickle=False)
    text = io.BytesIO()
    np.save(text, ARRAYS[change](array))
    return text.getvalue()


def _rewritten(case: Json, content: bytes) -> bytes:
    """The archive with one member changed."""
    result = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(content)) as old,
        zipfile.ZipFile(result, "w", METHODS[case["method"]]) as new,
    ):
        for name in old.namelist():
            data = old.read(name)
            if name == case["member"]:
                data = _member(case, data)
            new.writestr(name, data)
    return result.getvalue()


def _member(case: Json, data: bytes) -> bytes:
    if "zeros" in case:
        return bytes(case["zeros"])
    return _array(data, case["array"]) if "array" in case else edit_bytes(data, case["edits"])


def changed_file(case: Json) -> bytes | None:
    """What the case puts in the place of the file; None: nothing."""
    content = _file(case["policy"], case["file"])
    if "member" in case:
        return _rewritten(case, content)
    return edit_bytes(content, case["edits"]) if "edits" in case else decode(case["content"])


def play(case: Json, folder: Path) -> None:
    """Load it; what loads acts."""
    path = folder / "policy"
    path.mkdir()
    for name in FILES:
        content = changed_file(case) if name == case["file"] else _file(case["policy"], name)
        if content is not None:
            (path / name).write_bytes(content)
    policy = load_policy(path, robot())
    action = policy.act(np.zeros(len(policy.mean)))
    assert np.isfinite(action).all() and np.abs(action).max() <= 1.0, "no action"
