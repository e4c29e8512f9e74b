"""A small biped as URDF written to a folder, of which tests change one thing at a time."""

from __future__ import annotations

import struct
from pathlib import Path

from tests.support.small_biped import describe

INERTIAL = (
    '<inertial><origin xyz="0 0 {z}"/><mass value="{mass}"/>'
    '<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>'
)
BOX_SOLE = (
    '<collision name="{side}_sole"><origin xyz="0.03 0 -0.04"/>'
    '<geometry><box size="0.2 0.08 0.02"/></geometry></collision>'
)
JOINTS = ("hip_roll", "hip", "knee", "ankle", "ankle_roll")
LEG = """
<link name="{side}_hip_link">{light}</link>
<link name="{side}_thigh">{limb}</link>
<link name="{side}_shin">{limb}</link>
<link name="{side}_ankle_link">{light}</link>
<link name="{side}_foot">{limb}{foot}</link>
<joint name="{side}_hip_roll" type="revolute"><parent link="trunk"/>
  <child link="{side}_hip_link"/><origin xyz="0 {y} -0.1"/><axis xyz="1 0 0"/>{limit}</joint>
<joint name="{side}_hip" type="revolute"><parent link="{side}_hip_link"/>
  <child link="{side}_thigh"/><axis xyz="0 1 0"/>{limit}</joint>
<joint name="{side}_knee" type="revolute"><parent link="{side}_thigh"/><child link="{side}_shin"/>
  <origin xyz="0 0 -0.3"/><axis xyz="0 1 0"/>{limit}</joint>
<joint name="{side}_ankle" type="revolute"><parent link="{side}_shin"/>
  <child link="{side}_ankle_link"/><origin xyz="0 0 -0.3"/><axis xyz="0 1 0"/>{limit}</joint>
<joint name="{side}_ankle_roll" type="revolute"><parent link="{side}_ankle_link"/>
  <child link="{side}_foot"/><axis xyz="1 0 0"/>{limit}</joint>
"""
LIMIT = '<limit lower="-2" upper="2" effort="60" velocity="10"/><dynamics damping="0.3"/>'
TRUNK = '<collision name="trunk"><geometry><box size="0.16 0.12 0.2"/></geometry></collision>'


def mesh(name: str, kind: str = "collision") -> str:
    """A mesh of a link."""
    return f'<{kind}><geometry><mesh filename="{name}"/></geometry></{kind}>'


def write_stl(path: Path, size: tuple[float, float, float] = (0.05, 0.05, 0.05)) -> Path:
    """A tetrahedron as a binary STL file."""
    corners = [(0.0, 0.0, 0.0), *((x * (i == 0), y * (i == 1), z * (i == 2))
                                  for i, (x, y, z) in enumerate([size] * 3))]  # fmt: skip
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    text = b"\0" * 80 + struct.pack("<I", len(faces))
    for face in faces:
        numbers = [0.0, 0.0, 0.0, *(x for corner in face for x in corners[corner])]
        text += struct.pack("<12f", *numbers) + b"\0\0"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text)
    return path


def write_urdf(
    folder: Path,
    *,
    foot: str = BOX_SOLE,
    trunk: str = TRUNK,
    extra: str = "",
    limit: str = LIMIT,
    change: tuple[str, str] = ("", ""),
    **description: object,
) -> Path:
    """Write ``biped.urdf`` and ``biped.yaml`` and return the path of the latter.

    Args:
        folder: where to write.
        foot: collisions of a foot; ``{side}`` stands for its side.
        trunk: collisions and visuals of the trunk.
        extra: links and joints put in at the end.
        limit: of every joint.
        change: a text of the URDF file and what takes its place, wherever it stands.
        description: fields of the description that replace the default ones.
    """
    limb = INERTIAL.format(z=-0.1, mass=2.0, i=0.01)
    light = INERTIAL.format(z=0.0, mass=0.1, i=0.001)
    parts = [f'<link name="trunk">{INERTIAL.format(z=0.0, mass=12.0, i=0.1)}{trunk}</link>']
    for side, y in (("left", 0.1), ("right", -0.1)):
        own = foot.format(side=side)
        parts.append(LEG.format(side=side, y=y, light=light, limb=limb, foot=own, limit=limit))
    text = f'<robot name="biped">{"".join(parts)}{extra}</robot>'
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "biped.urdf").write_text(text.replace(*change) if change[0] else text)
    return describe(folder, {"urdf": "biped.urdf"}, description)
