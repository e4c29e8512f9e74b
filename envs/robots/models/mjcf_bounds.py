"""Bounds of an MJCF model, checked before MuJoCo builds it: nothing stops MuJoCo once it began."""

import html
import math
import re
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import mujoco

from poise.configs.errors import ConfigError
from poise.configs.reading import MIB, POINTER, exists, is_file, is_folder, read_text

MJCF_BYTES = 4 * MIB  # of all files of a model together
ELEMENTS = 20_000  # of the XML, copies counted
NESTED = 8  # files that include each other
DIRS = ("assetdir", "meshdir", "texturedir")  # in which files may be
NAMED = 100_000  # places where the files may be that a model names
#: copies that an element may make; MuJoCo's time for the last two grows faster than the square
COPIES = {"replicate": ELEMENTS, "composite": 200, "flexcomp": 1000}
BUILTIN = 200.0  # resolution of a mesh that MuJoCo makes
ASSET_BYTES = 16 * MIB  # of a file of a mesh, a texture or a height field
PIXELS = 10_000_000  # of all textures and height fields together, and of a camera
LISTS = {"bodies": 1000, "joints": 1000, "geoms": 5000, "keys": 1000, "sensors": 5000}
MEMORY = 256 * MIB  # of a simulation's stack
KEPT = 256 * MIB  # of meshes and textures, from one compilation to the next
LONGEST = 10_000  # of what elements may reserve: user data, keyframes, dimensions of a sensor
MOST_ITERATIONS = 1000  # of a solver, in a physics step; MuJoCo simulates one as it compiles
_ITERATIONS = ("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations",
               "sdf_iterations", "sdf_initpoints")  # fmt: skip
_RESERVED = ("nkey", "nuserdata", "nuser_actuator", "nuser_body", "nuser_cam", "nuser_geom",
             "nuser_jnt", "nuser_sensor", "nuser_site", "nuser_tendon")  # fmt: skip

_OPEN = re.compile(r"<!--|<!\[CDATA\[|<\?|<(?=/?[A-Za-z_])")
_CLOSE = {"<!--": "-->", "<![CDATA[": "]]>", "<?": "?>"}
_TAG = re.compile(r"<(/?)([\w:.-]+)((?:\"[^\"]*\"|'[^']*'|[^\"'<>])*)>")
_ATTRIBUTE = re.compile(r"([\w:.-]+)\s*=\s*(\"[^\"]*\"|'[^']*')")


class MjcfText:
    """Counts the elements of MJCF files, with what replicate, include and attach make of them.

    Of the files that they name, none is a pipe or a device: MuJoCo would wait for it for ever.

    Attributes:
        folders: in which MuJoCo may look for the files of meshes and textures.

    Args:
        path: the main file.
    """

    def __init__(self, path: Path):
        self._main = path.parent
        self.folders: set[Path] = set()
        self._elements = self._attached = self._models = self._size = 0
        self._folders = {path.parent, path.parent.resolve()}
        self._within, self._names = {""}, set[str]()
        self._walk(path, 1, 0)
        self._check_regular()
        if self._elements + self._attached * self._models > ELEMENTS:
            raise ConfigError(f"the model has more than {ELEMENTS} elements, with their copies")

    def _walk(self, path: Path, factor: int, depth: int) -> None:
        """Count a file whose elements are copied `factor` times."""
        if depth > NESTED:
            raise ConfigError(f"more than {NESTED} files include each other")
        text = read_text(path, MJCF_BYTES)  # MuJoCo itself takes names that are no text
        if "<!DOCTYPE" in text:  # entities, which some parsers fill in from other files
            raise ConfigError(f"{path} has a document type, which no model needs")
        self._size += len(text)
        if self._size > MJCF_BYTES:
            raise ConfigError(f"its files are together larger than {MJCF_BYTES / MIB:g} MiB")
        self._folders.add(path.parent)
        factors = [factor]
        self.folders.add(path.parent)
        for closing, name, attributes, empty in tags(text):
            if not closing:
                self._count(name, attributes, factors, depth, path.parent)
                named = (value for key, value in attributes.items() if key.startswith("file"))
                self._names.update(named)
                self._within.update(attributes[key] for key in DIRS if key in attributes)
                if name == "replicate" and not empty:
                    factors.append(factors[-1] * _whole(attributes.get("count", "1")))
            elif name == "replicate":
                factors = factors[:-1] or [factor]

    def _count(
        self, name: str, attributes: dict[str, str], factors: list[int], depth: int, folder: Path
    ) -> None:
        factor, count = factors[-1], _whole(attributes.get("count", "1"))
        if count > COPIES.get(name, ELEMENTS):
            raise ConfigError(f"{name} would make more than {COPIES.get(name, ELEMENTS)} copies")
        self._elements += factor * (count if name in ("composite", "flexcomp") else 1)
        if self._elements > ELEMENTS:
            raise ConfigError(f"the model has more than {ELEMENTS} elements, with their copies")
        if name == "mesh" and any(abs(x) > BUILTIN for x in _numbers(attributes.get("params", ""))):
            raise ConfigError(f"params of a mesh must be at most {BUILTIN:g}")
        if name == "hfield" and _sides(attributes) > PIXELS:  # MuJoCo reserves it as it reads
            raise ConfigError(f"a height field may have at most {PIXELS} points")
        if name == "attach":
            self._attached += factor
        if name == "compiler":
            named = (attributes.get(each, "") for each in ("meshdir", "texturedir", "assetdir"))
            self.folders |= {base / each for base in (folder, self._main) for each in named if each}
        if "file" in attributes and name in ("include", "model"):
            before = self._elements
            for base in dict.fromkeys((folder, self._main, self._main.resolve())):
                if is_file(file := base / attributes["file"]):
                    self._walk(file, factor, depth + 1)
                    break
            self._models += self._elements - before if name == "model" else 0

    def _check_regular(self) -> None:
        """Raise ConfigError where a name may be that of what is no regular file."""
        names = self._names | {name.replace("\\", "/").rpartition("/")[2] for name in self._names}
        if len(self._folders) * len(self._within) * len(names) > NAMED:
            raise ConfigError("it names too many files in too many folders")
        for parts in product(self._folders, self._within, names):
            if exists(path := Path(*parts)) and not (is_file(path) or is_folder(path)):
                raise ConfigError(f"{path} is not a regular file")


def bound_cache() -> None:
    """Let MuJoCo keep less of the files that it has read than its own 500 MB in each process."""
    cache = mujoco.mj_getCache()
    if mujoco.mj_getCacheCapacity(cache) > KEPT:
        mujoco.mj_setCacheCapacity(cache, KEPT)


def check_spec(spec: mujoco.MjSpec, folders: set[Path]) -> None:
    """Raise ConfigError for a model that is larger than a robot is, before it is compiled.

    The `folders` are those in which its meshes and textures may lie.
    """
    for name, most in LISTS.items():
        if len(getattr(spec, name)) > most:
            raise ConfigError(f"the model has more than {most} {name}")
    for name in _RESERVED:
        if getattr(spec, name) > LONGEST:
            raise ConfigError(f"size: {name} must be at most {LONGEST}")
    for name in _ITERATIONS:
        if getattr(spec.option, name, 0) > MOST_ITERATIONS:
            raise ConfigError(f"option: {name} must be at most {MOST_ITERATIONS}")
    if max(spec.memory, spec.nstack * 8, spec.njmax * 1000, spec.nconmax * 1000) > MEMORY:
        raise ConfigError(f"size: memory must be at most {MEMORY / MIB:g} MiB")
    reserved = [x for s in spec.sensors for x in (s.dim, s.nsample)]
    reserved += [x for a in spec.actuators for x in (a.actdim, a.nsample)]
    if max(reserved, default=0) > LONGEST:
        raise ConfigError(f"sensors and actuators may have at most {LONGEST} numbers each")
    if any(math.prod(map(int, camera.resolution)) > PIXELS for camera in spec.cameras):
        raise ConfigError(f"a camera may have at most {PIXELS} pixels")
    if spec.visual.global_.offwidth * spec.visual.global_.offheight > PIXELS:
        raise ConfigError(f"visual: a picture may have at most {PIXELS} pixels")
    _check_assets(spec, folders)


def _check_assets(spec: mujoco.MjSpec, folders: set[Path]) -> None:
    """Sizes of textures, height fields and the files of these and of meshes."""
    sides = [t.width * (t.height or t.width) * (1 if t.height else 6) for t in spec.textures]
    sides += [h.nrow * h.ncol for h in spec.hfields]
    names = [name for t in spec.textures for name in (t.file, *t.cubefiles)]
    names += [each.file for each in (*spec.meshes, *spec.hfields, *spec.skins)]
    tried = {folder / way for name in names if name for way in (name, Path(name).name)
             for folder in folders}  # fmt: skip
    for file in {file.resolve() for file in tried if is_file(file)}:
        with file.open("rb") as opened:
            head = opened.read(len(POINTER))
        if file.stat().st_size > ASSET_BYTES:
            raise ConfigError(f"{file} is larger than {ASSET_BYTES / MIB:g} MiB")
        if head.startswith(POINTER):
            raise ConfigError(
                f"{file} is the pointer that Git LFS leaves where a file is to be fetched still: "
                "git lfs pull"
            )
        sides.append(_pixels(head))
    if sum(sides) > PIXELS:
        raise ConfigError(f"textures and height fields may have at most {PIXELS} pixels")


def _pixels(head: bytes) -> int:
    """The pixels that a PNG file begins by naming: a few bytes may unpack to many; else 0."""
    if head[:8] != b"\x89PNG\r\n\x1a\n":
        return 0
    return int.from_bytes(head[16:20]) * int.from_bytes(head[20:24])


def tags(text: str) -> Iterator[tuple[bool, str, dict[str, str], bool]]:
    """All tags of an XML text, in order: closing, name, attributes, empty.

    `closing` is true of ``</name>``, `empty` of ``<name/>``. Comments and the like are left out.
    """
    at = 0
    while match := _OPEN.search(text, at):
        close = _CLOSE.get(match[0])
        if close:
            at = text.find(close, match.end())
            if at < 0:
                return
        elif tag := _TAG.match(text, match.start()):
            at = tag.end()
            pairs = _ATTRIBUTE.findall(tag[3])
            attributes = {key: html.unescape(value[1:-1]) for key, value in pairs}
            yield bool(tag[1]), tag[2], attributes, tag[3].endswith("/")
        else:
            at = match.end()


def _numbers(text: str) -> list[float]:
    return [float(x) for x in re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", text[:1000])]


def _sides(attributes: dict[str, str]) -> int:
    return _whole(attributes.get("nrow", "1")) * _whole(attributes.get("ncol", "1"))


def _whole(text: str) -> int:
    """The product of the numbers in an attribute, none of them less than 1."""
    return int(min(math.prod(max(1.0, x) for x in _numbers(text)), 1e12))
