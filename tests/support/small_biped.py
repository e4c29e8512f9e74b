"""A small biped written to a folder, of which tests change one thing at a time."""

from __future__ import annotations

from pathlib import Path

import yaml

BOX_FOOT = '<geom name="{side}_sole" type="box" pos="0.03 0 -0.04" size="0.1 0.04 0.01"/>'
JOINTS = ("hip", "knee", "ankle", "ankle_roll")

LEG = """
<body name="{side}_thigh" pos="0 {y} -0.1">
  <joint name="{side}_hip" axis="0 1 0" range="-100 100"/>
  <geom type="capsule" fromto="0 0 -0.05 0 0 -0.25" size="0.04"/>
  <body name="{side}_shin" pos="0 0 -0.3">
    <joint name="{side}_knee" axis="0 1 0" range="5 150"/>
    <geom type="capsule" fromto="0 0 -0.05 0 0 -0.25" size="0.03"/>
    <body name="{side}_foot" pos="0 0 -0.3">
      <joint name="{side}_ankle" axis="0 1 0" range="-60 60"/>
      <joint name="{side}_ankle_roll" axis="1 0 0" range="-30 30"/>
      {foot}
    </body>
  </body>
</body>
"""

MODEL = """
<mujoco>
  <compiler angle="degree" autolimits="true"/>
  <asset>{asset}</asset>
  <worldbody>
    {world}
    <body name="trunk" pos="0 0 1">
      {root_joint}
      <geom type="box" size="0.08 0.12 0.1"/>
      {trunk}
      {legs}
    </body>
  </worldbody>
  {extra}
</mujoco>
"""


def motors(**attributes: object) -> str:
    """An actuator section with one motor per joint, each with these attributes."""
    text = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    names = [f"{side}_{joint}" for side in ("left", "right") for joint in JOINTS]
    lines = [f'<motor joint="{name}" {text}/>' for name in names]
    return f"<actuator>{''.join(lines)}</actuator>"


def write_biped(
    folder: Path,
    *,
    foot: str = BOX_FOOT,
    right_foot: str | None = None,
    leg: str = LEG,
    asset: str = "",
    world: str = "",
    root_joint: str = "<freejoint/>",
    trunk: str = "",
    extra: str = motors(ctrlrange="-50 50"),
    **description: object,
) -> Path:
    """Write ``biped.xml`` and ``biped.yaml`` and return the path of the latter.

    Args:
        folder: where to write.
        foot: geoms of a foot; ``{side}`` stands for its side.
        right_foot: those of the right foot, if different.
        leg: a leg.
        asset, world, root_joint, trunk, extra: MJCF put in at these places.
        description: fields of the description that replace the default ones.
    """
    legs = ""
    for side, y in (("left", 0.1), ("right", -0.1)):
        geoms = right_foot if side == "right" and right_foot is not None else foot
        legs += leg.format(side=side, y=y, foot=geoms.format(side=side))
    text = MODEL.format(
        asset=asset, world=world, root_joint=root_joint, trunk=trunk, legs=legs, extra=extra
    )
    (folder / "biped.xml").write_text(text)
    return describe(folder, {"mjcf": "biped.xml"}, description)


def describe(folder: Path, source: dict[str, str], description: dict[str, object]) -> Path:
    """The YAML file of the biped whose model `source` names; `description` wins."""
    fields: dict[str, object] = {
        "name": "biped",
        "source": source,
        "root": "trunk",
        "feet": [
            {"name": "left", "body": "left_foot"},
            {"name": "right", "body": "right_foot"},
        ],
        "posture": {"joints": {"*_hip": -20, "*_knee": 40, "*_ankle": -20}},
    }
    path = folder / "biped.yaml"
    path.write_text(yaml.safe_dump(fields | description, sort_keys=False))
    return path
