"""Read a URDF file by MuJoCo's own reader: as it stands in ROS, with a root that floats."""

import os
import re
import sysconfig
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import mujoco

from poise.configs.errors import ConfigError, naming, shown
from poise.configs.reading import is_file, is_folder, read_text

from .mjcf_bounds import MJCF_BYTES, MjcfText, check_spec

PACKAGE = "package://"
PACKAGES = "ROS_PACKAGE_PATH"  # of the environment: folders of packages, separated by colons
#: of a name that does not depend on where the file lies, on Windows too
ABSOLUTE = re.compile(r"package://|file://|/|[A-Za-z]:[/\\]")
ABOVE = 3  # folders in which the end of a name is looked for
MESHES = (".stl", ".obj", ".msh")  # that MuJoCo reads
HIDDEN = 3  # group of collision geometry, which pictures leave out where there is something to see
WHEELS = (
    "cmeel.prefix/share"  # in site-packages: where wheels such as example-robot-data put theirs
)
FREE, EQUAL_JOINTS = mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtEq.mjEQ_JOINT


def read_urdf(path: Path, srdf: Path | None = None) -> mujoco.MjSpec:
    """The model in a URDF file, with a free joint where its root is fixed to the world.

    Links keep their names and frames, those at fixed joints too. A link's mass is what the file
    says, not that of its geometry. The effort of a joint's limit is its ``actuatorfrcrange``.
    Meshes are found as `find_file` says; what is only seen is left out where its mesh is missing or
    of a form that MuJoCo does not read.

    Args:
        path: the URDF file.
        srdf: an SRDF file; the pairs of links in its ``disable_collisions`` do not collide. Links
            that the URDF file lacks do not count.

    Raises:
        ConfigError: a file is missing or does not parse, or is larger than a robot's model is; a
            mesh that collides is missing; a joint mimics another; a floating joint is not the
            root's.
    """
    with naming(field="source.urdf"):
        robot = _parse(path, "URDF")
        _set_compiler(robot)
        files = _rename_meshes(robot)
        names = Counter(name for joint in robot.findall("joint") if (name := joint.get("name")))
        if names and (most := names.most_common(1)[0])[1] > 1:  # MuJoCo says so much later
            raise ConfigError(f"{path} is not valid URDF: two joints are called {shown(most[0])}")
        try:
            spec = mujoco.MjSpec.from_string(ElementTree.tostring(robot, encoding="unicode"))
        except Exception as error:  # of MuJoCo, of the text in the file
            raise ConfigError(f"{path} is not valid URDF: {error}") from None
        _take_meshes(spec, files, path)
        check_spec(spec, {path.parent})
        for geom in spec.geoms:
            geom.mass = geom.density = 0.0
            geom.group = HIDDEN if geom.contype or geom.conaffinity else geom.group
        _check_joints(spec)
        _let_root_float(spec)
    if srdf is not None:
        with naming(field="source.srdf"):
            _exclude_pairs(spec, _parse(srdf, "SRDF"))
    return spec


def find_file(name: str, near: Path) -> Path | None:
    """The file that a URDF file or a description, `near`, names; None where there is none.

    ``package://NAME/rest`` is looked for in a folder NAME that is a parent of `near` or lies in one
    of its parents, then in the folders of ROS_PACKAGE_PATH, then where wheels of the cmeel family
    put packages. Any other name is relative to `near`.
    """
    if not name.startswith(PACKAGE):
        files = [near.parent / name.removeprefix("file://")]
    else:
        package, _, rest = name.removeprefix(PACKAGE).lstrip("/").partition("/")
        files = [folder / rest for folder in _package_folders(package, near)]
    return next(filter(is_file, files), None)


def find_mesh(name: str, near: Path) -> Path | None:
    """`find_file`, else by the last folders of a package's or another machine's name, looked for
    beside `near`, then one and two folders above."""
    return find_file(name, near) or next(filter(is_file, _ends(name, near)), None)


def _ends(name: str, near: Path) -> Iterator[Path]:
    """Where the ends of an absolute name may lie, the longest end first."""
    root = ABSOLUTE.match(name)
    if root is None:
        return
    parts = [part for part in name[root.end() :].replace("\\", "/").split("/") if part]
    if ".." not in parts:
        for first in range(1, len(parts)):
            for folder in [*near.resolve().parents][:ABOVE]:
                yield folder.joinpath(*parts[first:])


def _package_folders(package: str, near: Path) -> Iterator[Path]:
    """The folders in which a package may lie."""
    named = [Path(x) for x in os.environ.get(PACKAGES, "").split(os.pathsep) if x]
    for folder in [*near.resolve().parents, *named]:
        if folder.name == package:
            yield folder
        if is_folder(folder / package):
            yield folder / package
    yield Path(sysconfig.get_path("purelib")) / WHEELS / package


def _parse(path: Path, kind: str) -> ElementTree.Element:
    """The root element of a URDF or SRDF file, read within bounds."""
    if not is_file(path):
        raise ConfigError(f"no such file: {path}")
    MjcfText(path)
    text = read_text(path, MJCF_BYTES)
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ConfigError(f"{path} is not valid {kind}: {error}") from None
    if robot.tag != "robot":
        raise ConfigError(f"{path} is not valid {kind}: it begins with <{robot.tag}>")
    return robot


def _set_compiler(robot: ElementTree.Element) -> None:
    """Settings of MuJoCo's own, in the element that a URDF file may have for them."""
    options = robot.find("mujoco")
    if options is None:
        options = ElementTree.SubElement(robot, "mujoco")
    compiler = options.find("compiler")
    if compiler is None:
        compiler = ElementTree.SubElement(options, "compiler")
    compiler.attrib |= {"fusestatic": "false", "discardvisual": "false", "strippath": "false"}
    compiler.attrib.pop("meshdir", None)  # names are relative to the file, as in ROS


def _exclude_pairs(spec: mujoco.MjSpec, semantics: ElementTree.Element) -> None:
    links = {body.name for body in spec.bodies}
    pairs = {
        frozenset((each.get("link1", ""), each.get("link2", "")))
        for each in semantics.iter("disable_collisions")
    }
    for first, second in sorted(sorted(pair) for pair in pairs if len(pair) == 2 and pair <= links):
        spec.add_exclude(bodyname1=first, bodyname2=second)


def _rename_meshes(robot: ElementTree.Element) -> dict[str, str]:
    """New name → name in the file: MuJoCo takes files of one name in two folders for one."""
    names: dict[tuple[str, str], str] = {}
    for mesh in robot.iter("mesh"):
        file, scale = mesh.get("filename", ""), mesh.get("scale", "")
        new = names.setdefault((file, scale), f"mesh{len(names)}")
        mesh.set("filename", f"{new}.stl")
    return {new: file for (file, _), new in names.items()}


def _take_meshes(spec: mujoco.MjSpec, files: dict[str, str], path: Path) -> None:
    """Give the meshes their files. Where one cannot be had, what is only seen of it goes."""
    lost = set()
    for mesh in spec.meshes:
        file = find_mesh(files[mesh.name], path)
        if file is None or file.suffix.lower() not in MESHES:
            lost.add(mesh.name)
        else:
            mesh.file = str(file.resolve())
    for geom in [geom for geom in spec.geoms if geom.meshname in lost]:
        if geom.contype or geom.conaffinity:
            raise _unread(files[geom.meshname], geom.parent.name, path)
        spec.delete(geom)
    for mesh in [mesh for mesh in spec.meshes if mesh.name in lost]:
        spec.delete(mesh)


def _unread(name: str, link: str, path: Path) -> ConfigError:
    """A mesh with which a link collides, and that there is not, or not in a form for MuJoCo."""
    if find_mesh(name, path) is not None:
        reason = f"is not of a form that MuJoCo reads ({', '.join(MESHES)}): convert it to one"
    elif name.startswith(PACKAGE):
        reason = f"is missing: its package is looked for above {path.parent} and in {PACKAGES}"
    else:
        reason = "is missing"
    return ConfigError(f"the mesh {shown(name)} of the link {link!r} {reason}")


def _check_joints(spec: mujoco.MjSpec) -> None:
    """Refuse joints that mimic others, and floating ones that hold more than a root."""
    for equal in spec.equalities:
        if equal.type == EQUAL_JOINTS:
            raise ConfigError(
                f"the joint {equal.name1!r} mimics {equal.name2!r}, which is not supported: "
                "make it fixed"
            )
    for joint in spec.joints:
        if joint.type == FREE and joint.parent.parent.name != "world":
            raise ConfigError(
                f"the floating joint {joint.name!r} does not join its link to the world"
            )


def _let_root_float(spec: mujoco.MjSpec) -> None:
    """A free joint for the link that stands on the world without a joint, if there is one alone."""
    tops = [body for body in spec.bodies if body.parent is not None and body.parent.name == "world"]
    if len(tops) == 1 and not tops[0].joints:
        tops[0].add_freejoint()
