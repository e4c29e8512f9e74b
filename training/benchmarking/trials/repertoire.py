"""The motions that the trials of a suite perform, kept beside the trials."""

from dataclasses import dataclass
from pathlib import Path

from poise.baselines.balance.references.robot_clip import RobotClip, write_robot_clip

FOLDER = "motions"  # in that of the results


@dataclass(frozen=True)
class Repertoire:
    """The motions that the trials of a suite perform."""

    durations: dict[str, float]  #: name → duration [s]
    digests: dict[str, str]  #: name → hash of what decides it
    clips: dict[str, RobotClip]  #: name → the robot's postures, of those that are not keyframes

    def write(self, folder: Path) -> None:
        """Keep the clips in the folder of the results; raise PoiseError if that fails."""
        for name, clip in self.clips.items():
            (folder / FOLDER).mkdir(exist_ok=True)
            write_robot_clip(clip, kept(folder, name))


def kept(folder: Path, name: str) -> Path:
    """Where the clip of a motion is kept."""
    return folder / FOLDER / f"{name}.npz"
