"""BVH files as programs write them: names, channels, roots, marks, units."""

from pathlib import Path

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.configs.errors import ConfigError
from tests.support.conventions import BODIES, CONVENTIONS, body_bvh, names_of
from tests.support.refused import invalid

ARMS = [f"{role}_{side}" for side in ("left", "right") for role in ("shoulder", "elbow", "wrist")]
LEGS = [f"{role}_{side}" for side in ("left", "right") for role in ("hip", "knee", "ankle", "toe")]
PLAIN = CONVENTIONS["humanik"]


def read(folder: Path, text: str, name: str = "clip.bvh", **how: object) -> Clip:
    (folder / name).write_text(text, encoding="utf-8")
    return read_bvh(folder / name, **how).clip


@pytest.mark.parametrize("name", CONVENTIONS)
def test_joints_are_known_by_the_names_of_programs(name: str, tmp_path: Path) -> None:
    """Or by the structure, of three bodies: every limb, and how long the legs are."""
    convention = CONVENTIONS[name]
    wanted = dict(zip(LEGS + ARMS, names_of(convention)[4:], strict=True))
    for body, (_, thigh, shank, _, _) in enumerate(BODIES):
        skeleton = read(tmp_path, body_bvh(convention, body)).skeleton
        found = {role: skeleton.names[joint] for role, joint in skeleton.roles.items()}
        assert {role: found.get(role) for role in wanted} == wanted
        assert skeleton.leg_length == pytest.approx(thigh + shank, abs=1e-6)
        assert skeleton.rest[skeleton.roles["hip_left"], 1] > 0.05  # to the left, as it faces x


def with_positions(text: str, *, added: bool = False, moved: float = 0.0) -> str:
    """The file with three positions in every joint: the offsets, or with `added` zeros."""
    head, _, rows = text.partition("MOTION")
    offsets = []
    for line in head.splitlines():
        words = line.split()
        if words[:1] == ["OFFSET"]:
            last = words[1:]
        elif words[:1] == ["CHANNELS"]:
            offsets.append(["0"] * 3 if added else last)
    six = head.replace("CHANNELS 3 ", "CHANNELS 6 Xposition Yposition Zposition ")
    lines = rows.splitlines()
    for i, line in enumerate(lines[3:], start=3):
        values = line.split()
        new = values[:6]
        for k, offset in enumerate(offsets[1:]):
            shift = moved * (i % 2) if k == 1 else 0.0
            new += [str(float(x) + shift) for x in offset] + values[6 + 3 * k : 9 + 3 * k]
        lines[i] = " ".join(new)
    return six + "MOTION" + "\n".join(lines) + "\n"


@pytest.mark.parametrize("added", [False, True])
def test_positions_of_rigid_bones_are_the_same_clip(tmp_path: Path, added: bool) -> None:
    """In the offsets' place, or on top of them."""
    plain = read(tmp_path, body_bvh(PLAIN))
    six = read(tmp_path, with_positions(body_bvh(PLAIN), added=added))
    assert np.abs(six.places() - plain.places()).max() < 1e-6


def test_bones_that_stretch_are_refused(tmp_path: Path) -> None:
    with invalid("joints", "'Neck'"):
        read(tmp_path, with_positions(body_bvh(PLAIN), moved=40.0))


def under_a_root(text: str, channels: str, values: str, beside: str = "") -> str:
    """The file with a root above the hips, whose values are the same in every frame."""
    head, _, rows = text.partition("MOTION")
    head = head.replace("ROOT", "JOINT").replace("HIERARCHY\n", "")
    lines = rows.splitlines()
    zeros = " 0 0 0" if beside else ""
    lines[3:] = [f"{values} {line}{zeros}" for line in lines[3:]]
    return (f"HIERARCHY\nROOT Armature\n{{\nOFFSET 0 0 0\nCHANNELS {channels}\n{head}{beside}}}\n"
            "MOTION" + "\n".join(lines) + "\n")  # fmt: skip


THREE = "3 Zrotation Xrotation Yrotation"
SIX = "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
END = "End Site\n{\nOFFSET 1 0 0\n}\n"
PROP = f"JOINT ik_target\n{{\nOFFSET 3 0 0\nCHANNELS {THREE}\n{END}}}\n"


@pytest.mark.parametrize(
    ("channels", "values", "beside"),
    [(THREE, "0 0 0", ""), (SIX, "0 0 0 0 0 0", ""), (SIX, "0 0 0 0 0 0", PROP)],
)
def test_a_root_above_the_hips_is_left_out(
    tmp_path: Path, channels: str, values: str, beside: str
) -> None:
    """Also where other things hang on it: the same clip, on its hips."""
    plain = read(tmp_path, body_bvh(PLAIN))
    clip = read(tmp_path, under_a_root(body_bvh(PLAIN), channels, values, beside))
    assert clip.skeleton.names == plain.skeleton.names
    assert np.abs(clip.places() - plain.places()).max() < 1e-9


def test_a_root_that_turns_and_moves_all_does(tmp_path: Path) -> None:
    """By 90° about the file's x: it stands in z, and so does its rest pose; 2 m to the side."""
    plain = read(tmp_path, body_bvh(PLAIN))
    (tmp_path / "turned.bvh").write_text(under_a_root(body_bvh(PLAIN), SIX, "200 0 0 0 90 0"))
    clip, axes = read_bvh(tmp_path / "turned.bvh")
    assert axes.names == ("z", "-y")
    assert np.abs(clip.skeleton.rest - plain.skeleton.rest).max() < 1e-9
    moved = plain.places() + clip.root[0] - plain.root[0]
    assert np.abs(clip.places() - moved).max() < 1e-9
    assert abs(clip.root[0, 1] - plain.root[0, 1]) == pytest.approx(2.0)


@pytest.mark.parametrize("name", ["clip.BVH", "clip.bvh"])
@pytest.mark.parametrize("mark", ["\ufeff{}", "{}\x1a", "{}\n\0\0", "{}"])
def test_marks_and_suffixes_do_not_count(tmp_path: Path, name: str, mark: str) -> None:
    plain = read(tmp_path, body_bvh(PLAIN))
    clip = read(tmp_path, mark.format(body_bvh(PLAIN).replace("\n", "\r\n")), name)
    assert np.array_equal(clip.places(), plain.places())


SPELLINGS = {
    "small letters": ("CHANNELS", "channels"),
    "capital letters": ("End Site", "END SITE"),
    "a word of another case": ("HIERARCHY", "Hierarchy"),
    "no space after a colon": ("Frames: ", "Frames:"),
    "a space before a colon": ("Frames:", "Frames :"),
    "no space in a keyword": ("Frame Time:", "FrameTime:"),
    "a brace in the line of the name": ("\n{", " {"),
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_keywords_are_read_as_programs_spell_them(tmp_path: Path, spelling: str) -> None:
    text = body_bvh(PLAIN)
    other = text.replace(*SPELLINGS[spelling])
    assert other != text
    assert np.array_equal(read(tmp_path, other).places(), read(tmp_path, text).places())


@pytest.mark.parametrize("order", ["le", "be"])
def test_wide_characters_with_a_mark_are_read(tmp_path: Path, order: str) -> None:
    """As editors of Windows save them."""
    (tmp_path / "wide.bvh").write_bytes(f"\ufeff{body_bvh(PLAIN)}".encode(f"utf-16-{order}"))
    assert read_bvh(tmp_path / "wide.bvh").clip.skeleton.names[0] == "Hips"


def test_a_short_file_of_wide_characters_is_refused(tmp_path: Path) -> None:
    """Half a character at its end, as a copy that broke off leaves it."""
    (tmp_path / "wide.bvh").write_bytes(b"\xff\xfeH\x00I")
    with pytest.raises(ConfigError, match="line 1: "):
        read_bvh(tmp_path / "wide.bvh")


def test_names_in_another_encoding_are_read(tmp_path: Path) -> None:
    text = body_bvh(PLAIN).replace("Spine", "Rücken").encode("latin-1")
    (tmp_path / "a.bvh").write_bytes(text)
    assert "Rücken" in read_bvh(tmp_path / "a.bvh").clip.skeleton.names


@pytest.mark.parametrize("unit", [1.0, 0.1, 0.01, 0.001, 0.0254])
def test_the_unit_is_found_by_the_legs(tmp_path: Path, unit: float) -> None:
    """Metres, decimetres, centimetres, millimetres, inches."""
    (tmp_path / "a.bvh").write_text(body_bvh(PLAIN, unit=unit))
    clip, axes = read_bvh(tmp_path / "a.bvh")
    assert axes.unit == unit
    assert clip.skeleton.leg_length == pytest.approx(0.83, abs=1e-4)
