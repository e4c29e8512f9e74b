"""The configuration of the motion that a tracker follows."""

from dataclasses import dataclass, field
from typing import Literal

NETWORK = "network"  # in the place of a clip's file
TIME_STEP = "time_step"  # an input: the frame of the clip, from 0 on; the last one is held


@dataclass(frozen=True)
class MotionConfig:
    """The motion that a tracker follows.

    Attributes:
        clip: an .npz or .csv file, relative to the YAML file, see `read_clip`; "network": the
            frames that the network gives for each `time_step`; empty: the default posture stands.
        anchor: body whose pose the terms ``motion_anchor_…`` compare; empty: ``torso_link``, or the
            root where the robot has no such body.
        heading: what of the first frame is turned to face as the robot's anchor does: the anchor
            or the root.
        rate: of a .csv file [Hz]; 0: 30.
        plays: whether the clip runs from a trial's begin on; else its first frame is held.
    """

    clip: str = ""
    anchor: str = ""
    heading: Literal["anchor", "root"] = "anchor"
    rate: float = field(default=0.0, metadata={"min": 0.0, "max": 1000.0})
    plays: bool = False
