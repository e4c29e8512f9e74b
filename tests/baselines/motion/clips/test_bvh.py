"""BVH files: what is read is what was written, axes and units are found, faults have their line."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.motion.clips.axes import named_axes
from poise.baselines.motion.clips.bvh import read_bvh, write_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh, packaged_clips
from poise.baselines.motion.clips.rotations import angle_between
from poise.configs.errors import ConfigError, PoiseError
from tests.support.captured import captured
from tests.support.motion_files import FRAMES, mutated, small_bvh
from tests.support.refused import invalid

MUTATIONS = 150


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.bvh"
    path.write_text(small_bvh())
    return path


@pytest.mark.parametrize("name", packaged_clips())
def test_packaged_clips_are_read_written_and_read(name: str, tmp_path: Path) -> None:
    """Six decimals: places to 1e-6 of the file's unit, rotations to 1e-6 degrees."""
    clip, axes = read_bvh(find_bvh(name))
    moved = clip.turned(0.3).resampled(clip.dt * 1.7)  # values that six decimals do not hold
    for each in (clip, moved):
        write_bvh(each, tmp_path / "again.bvh", axes)
        again = read_bvh(tmp_path / "again.bvh", str(axes.unit), *axes.names).clip
        assert np.abs(each.root - again.root).max() / axes.unit < 1e-6
        assert np.degrees(angle_between(each.rotations, again.rotations).max()) < 2e-6
        assert again.skeleton.names == each.skeleton.names
        assert np.abs(again.skeleton.end_offsets - each.skeleton.end_offsets).max() < 1e-6
        assert again.dt == pytest.approx(each.dt, rel=1e-6)


def check_upright(clip: Clip) -> None:
    """The head is above, the left hip to the left of who faces x."""
    places, roles = clip.faced().places()[0], clip.skeleton.roles
    assert places[roles["head"], 2] > 1.2
    assert places[roles["hip_left"], 1] > 0.05 > -0.05 > places[roles["hip_right"], 1]


def test_axes_and_unit_are_found(tmp_path: Path) -> None:
    """As most programs write them, and in those of a file with z up, whose unit is no usual one."""
    clip, axes = read_bvh(find_bvh("humanoid_squat"))
    assert axes.names == ("y", "z") and axes.unit == 1.0
    assert 0.7 < clip.skeleton.leg_length < 0.75  # of the default humanoid
    check_upright(clip)
    write_bvh(clip, tmp_path / "other.bvh", named_axes("z", "-y", 3.7))
    other, axes = read_bvh(tmp_path / "other.bvh")
    assert axes.names == ("z", "-y")
    assert other.skeleton.leg_length == pytest.approx(0.8)
    check_upright(other)


def test_axes_and_unit_of_captures_are_found() -> None:
    clip, wave = captured("cmu02_squat"), captured("fair1_wave_hello")
    assert 0.8 < clip.skeleton.leg_length < 0.9
    assert wave.skeleton.leg_length == pytest.approx(0.8)
    check_upright(clip)
    check_upright(wave)


def test_another_frame_of_axes_is_the_same_motion(small: Path, tmp_path: Path) -> None:
    clip = read_bvh(small).clip
    path = tmp_path / "centimetres.bvh"
    write_bvh(clip, path, named_axes("-x", "y", 0.01))
    again, axes = read_bvh(path)
    assert axes.names == ("-x", "y") and axes.unit == 0.01
    assert np.abs(again.places() - clip.places()).max() < 1e-7


def test_joints_in_any_order_are_written_as_what_they_are(tmp_path: Path) -> None:
    """Files have joints depth first; a skeleton may have them breadth first."""
    clip = read_bvh(find_bvh("humanoid_wave")).clip
    skeleton = clip.skeleton
    levels = [0] * len(skeleton.names)
    for i, parent in enumerate(skeleton.parents[1:], start=1):
        levels[i] = levels[parent] + 1
    order = sorted(range(len(levels)), key=levels.__getitem__)
    assert order != sorted(order)
    new = {old: i for i, old in enumerate(order)}
    broad = replace(
        clip, rotations=clip.rotations[:, order],
        skeleton=replace(
            skeleton, names=tuple(skeleton.names[i] for i in order),
            parents=np.array([new.get(int(skeleton.parents[i]), -1) for i in order]),
            offsets=skeleton.offsets[order], orders=tuple(skeleton.orders[i] for i in order),
            end_parents=np.array([new[int(i)] for i in skeleton.end_parents]),
        ),
    )  # fmt: skip
    write_bvh(broad, tmp_path / "broad.bvh")
    again = read_bvh(tmp_path / "broad.bvh", "m", "y", "z").clip
    assert again.skeleton.names == skeleton.names
    assert np.abs(again.places() - clip.places()).max() < 1e-5
    ends = [each.skeleton.ends(*each.skeleton.global_pose(each.root, each.rotations))
            for each in (clip, again)]  # fmt: skip
    assert np.abs(ends[1] - ends[0]).max() < 1e-5


def test_places_are_those_that_the_file_says(small: Path) -> None:
    """Hips at 0.95 m, straight legs of 0.8 m: ankles at 5 cm; left is y."""
    clip = read_bvh(small).clip
    first = dict(zip(clip.skeleton.names, clip.places()[0], strict=True))
    assert first["LeftFoot"] == pytest.approx([0.0, 0.1, 0.05], abs=1e-6)
    assert first["RightLeg"] == pytest.approx([0.0, -0.1, 0.45], abs=1e-6)
    knee = clip.places()[FRAMES // 2, clip.skeleton.roles["knee_left"]]
    assert knee[0] > 0.05  # a knee bends forward


VALUES = "".join(small_bvh().partition("Frame Time:")[1:])
FAULTS = {
    "HIERARCHY": ("HIERACHY", "line 1: 'HIERACHY' begins no line"),
    "ROOT Hips\n{": ("ROOT Hips\nOFFSET", "line 3: 'OFFSET' where '{' must stand"),
    "OFFSET 0.1 -0.1 0": ("OFFSET 0.1 -0.1", "line 8: 2 numbers instead of 3"),
    "OFFSET -0.1 -0.1 0": ("OFFSET -0.1 x 0", "line 27: 'x' is no number"),
    "CHANNELS 3 Z": ("CHANNELS 3 W", "line 9: no such channel: 'Wrotation' (choices: Xposition"),
    "JOINT LeftLeg": ("JOINT Hips", "line 10: a second joint is called 'Hips'"),
    "Frames: 12": ("Frames: 13", "line 59: the file ends after 12 rows, 'Frames:' says 13"),
    "Frames: 12\n": ("Frames: 10000000000\n", "line 46: 10000000000 frames"),
    "MOTION\nFrames: 12": ("MOTION\nFrames: 1" + 30 * "0", f"line 46: 1{30 * '0'} frames"),
    "Frame Time: 0.033333": ("Frame Time: 0", "line 47: a frame time must be"),
    "0.950000 0.000000 0.000000": ("0.950000 0.000000", "line 48: 23 values instead of 24"),
    "0.949000": ("inf", "line 49: 'inf' is no number"),
    VALUES: ("", "line 46: the file ends before a line 'Frame Time:'"),
    "}\nMOTION": ("MOTION", "line 46: 1 '{' are not closed"),
}


@pytest.mark.parametrize("old", FAULTS)
def test_a_fault_has_the_number_of_its_line(old: str, tmp_path: Path) -> None:
    new, text = FAULTS[old]
    path = tmp_path / "wrong.bvh"
    path.write_text(small_bvh().replace(old, new, 1))
    with pytest.raises(ConfigError) as error:
        read_bvh(path)
    assert f"wrong.bvh: {text}" in str(error.value)
    assert "\n" not in str(error.value)


def test_unknown_legs_are_named_or_need_unit_and_axes(small: Path) -> None:
    """Where neither names nor structure tell: here one leg is longer."""
    text = small.read_text().replace("UpLeg", "Tentacle").replace("-0.4 0", "-0.3 0", 1)
    small.write_text(text)
    with invalid("joints", "'hip_left'"):
        read_bvh(small)
    assert len(read_bvh(small, "m", "y", "z").clip) == FRAMES
    joints = {"hip_left": "LeftTentacle", "hip_right": "RightTentacle"}
    named, axes = read_bvh(small, joints=joints)
    assert axes.names == ("y", "z") and axes.unit == 1.0
    assert named.skeleton.names[named.skeleton.roles["hip_left"]] == "LeftTentacle"
    with invalid("joints", "'wing'", "hip_left"):
        read_bvh(small, joints={"wing": "LeftLeg"})
    with invalid("joints.hip_left", "'x'"):
        read_bvh(small, joints={"hip_left": "x"})


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("mile",), ("unit", "'mile'", "m")),
        (("m", "w"), ("up", "'w'", "x")),
        (("m", "y", "-y"), ("forward",)),
    ],
)
def test_wrong_units_and_axes(
    small: Path, arguments: tuple[str, ...], text: tuple[str, ...]
) -> None:
    with invalid(*text):
        read_bvh(small, *arguments)


def test_without_the_library_the_error_says_how_to_get_it(
    small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pybvh", None)
    clip = read_bvh(small).clip
    with pytest.raises(ConfigError, match=r"pip install -e '\.\[motion\]'"):
        write_bvh(clip, small)


def test_mutated_files_are_read_or_refused_in_one_line(tmp_path: Path) -> None:
    read = refused = 0
    for seed in range(MUTATIONS):
        path = tmp_path / "mutated.bvh"
        text = mutated(small_bvh(), np.random.default_rng(seed))
        path.write_text(text, encoding="utf-8", errors="replace")
        try:
            clip = read_bvh(path).clip
            assert isinstance(clip, Clip) and np.isfinite(clip.places()).all()
            read += 1
        except PoiseError as error:
            assert "\n" not in str(error) and "mutated.bvh" in str(error)
            refused += 1
    assert read > 5 and refused > MUTATIONS / 2
