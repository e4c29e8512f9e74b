"""The types of arguments that several sub-commands take."""

from pathlib import Path
from typing import Annotated

import tyro

Names = Annotated[
    tuple[str, ...],
    tyro.conf.Positional,
    tyro.conf.arg(metavar="CONTROLLER …", help_behavior_hint=""),
]
PolicyName = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="POLICY")]
RobotName = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ROBOT")]
Folder = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]
Switch = Annotated[bool, tyro.conf.FlagCreatePairsOff]  # without a --no- form
Allow = Annotated[
    tuple[str, ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(
        metavar="NAME",
        help="What may run though a file names it: module:Class or file.py:Class of a controller "
        "or a policy, or a policy's file of TorchScript (.pt, .pth, .jit, .ts); repeatable.",
    ),
]
