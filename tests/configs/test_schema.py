"""configs/schema.py, configs/yaml_loader.py and configs/errors.py."""

from __future__ import annotations

import errno
import os
import pickle
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from poise.configs import files as file_names
from poise.configs import schema
from poise.configs.errors import ConfigError, WriteError
from poise.configs.files import packaged, resolve, write_atomic
from poise.configs.kinds import OfKind
from poise.configs.problems import TEXTS, Problem, out_of_range
from poise.configs.schema import build, on_base, read_yaml, to_dict, to_yaml
from tests.support.refused import refused


@dataclass(frozen=True)
class Weights:
    com: float = field(default=1.0, metadata={"min": 0.0})
    posture: float = field(default=1.0, metadata={"above": 0.0, "max": 10.0})


@dataclass(frozen=True)
class Settings:
    name: str
    weights: Weights = Weights()
    steps: int = field(default=1, metadata={"min": 1})
    fast: bool = False
    root: Literal["hard", "soft"] = "hard"
    level: Literal[1, 2] = 1
    limit: float | None = None
    scale: tuple[float, float] = (0.2, 0.2)
    hidden: tuple[int, ...] = (128, 128)
    bodies: list[str] = field(default_factory=list)
    torque: dict[str, float] = field(default_factory=dict)
    many: tuple[Weights, ...] = ()
    mode: Literal["auto"] | float = "auto"
    gain: float | dict[str, float] = 1.0
    file: Path = Path("model.xml")
    extra: Any = None
    derived: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        if self.name == "nobody":
            raise ValueError("nobody is not a name")


def make(**data: Any) -> Settings:
    return build(Settings, {"name": "a", **data}, "file.yaml")


FULL = {
    "name": "b",
    "weights": {"com": 2.0, "posture": 10.0},
    "steps": 4,
    "fast": True,
    "root": "soft",
    "level": 2,
    "limit": 1.5,
    "scale": [0.1, 0.3],
    "hidden": [64],
    "bodies": ["torso"],
    "torque": {"knee": 80.0},
    "many": [{"com": 0.0, "posture": 1.0}],
    "mode": 2.0,
    "gain": {"knee": 1.0},
    "file": "other.xml",
    "extra": [1, "two"],
}


def test_build_makes_every_kind_of_field() -> None:
    """All supported types are built, with nested dataclasses and tuples where they are declared."""
    settings = build(Settings, FULL, "file.yaml")
    assert settings == Settings(
        name="b",
        weights=Weights(2.0, 10.0),
        steps=4,
        fast=True,
        root="soft",
        level=2,
        limit=1.5,
        scale=(0.1, 0.3),
        hidden=(64,),
        bodies=["torso"],
        torque={"knee": 80.0},
        many=(Weights(0.0, 1.0),),
        mode=2.0,
        gain={"knee": 1.0},
        file=Path("other.xml"),
        extra=[1, "two"],
    )
    assert isinstance(settings.scale, tuple) and isinstance(settings.many[0], Weights)


def test_to_dict_is_the_inverse_of_build(tmp_path: Path) -> None:
    """Dataclass to dict, to YAML, to file and back gives the same dataclass."""
    settings = build(Settings, FULL, "file.yaml")
    assert to_dict(settings) == FULL
    write_atomic(tmp_path / "settings.yaml", to_yaml(settings))
    assert build(Settings, read_yaml(tmp_path / "settings.yaml"), "again") == settings


def test_to_dict_turns_numpy_into_plain_values() -> None:
    """Arrays and NumPy scalars become lists and Python numbers, which YAML can hold."""
    plain = to_dict({"a": np.array([1.0, 2.0]), "b": np.float64(3.0)})
    assert plain == {"a": [1.0, 2.0], "b": 3.0}
    assert type(plain["b"]) is float


def test_an_int_is_taken_for_a_float_and_stays_exact() -> None:
    """`limit: 3` gives the float 3.0."""
    limit = make(limit=3).limit
    assert limit == 3.0 and type(limit) is float


NAMES = tuple(Settings.__dataclass_fields__)[:-1]
PARTS = ("com", "posture")


@pytest.mark.parametrize(
    ("data", "problem", "field", "facts"),
    [
        ({"wieghts": {}}, "unknown field", "wieghts", {"choices": NAMES}),
        ({"weights": {"cm": 1}}, "unknown field", "weights.cm", {"choices": PARTS}),
        ({"weights": 3}, "type", "weights", {"value": "3", "choices": PARTS}),
        ({"weights": {"com": -1}}, "range", "weights.com", {"least": 0.0, "value": "-1"}),
        ({"weights": {"posture": 0}}, "range", "weights.posture", {"above": 0.0, "value": "0"}),
        ({"weights": {"posture": 11}}, "range", "weights.posture", {"most": 10.0, "value": "11"}),
        ({"many": [{}, {"com": -1}]}, "range", "many[1].com", {"least": 0.0}),
        ({"steps": True}, "type", "steps", {"expected": "a whole number", "value": "True"}),
        ({"steps": 1.0}, "type", "steps", {"expected": "a whole number", "value": "1.0"}),
        ({"limit": True}, "type", "limit", {"expected": "a number", "value": "True"}),
        ({"limit": "3"}, "type", "limit", {"expected": "a number", "value": "'3'"}),
        ({"limit": float("nan")}, "type", "limit", {"expected": "a finite number"}),
        ({"limit": float("-inf")}, "type", "limit", {"value": "-inf"}),
        ({"limit": 10**400}, "type", "limit", {"expected": "a finite number"}),
        ({"fast": 1}, "type", "fast", {"expected": "true or false", "value": "1"}),
        ({"name": 1}, "type", "name", {"expected": "text", "value": "1"}),
        ({"name": None}, "type", "name", {"expected": "text", "value": "None"}),
        ({"root": "hrad"}, "unknown value", "root", {"choices": ("hard", "soft")}),
        ({"level": True}, "unknown value", "level", {"value": "True", "choices": ("1", "2")}),
        ({"derived": 1}, "unknown field", "derived", {}),
        ({"scale": [1, 2, 3]}, "type", "scale", {"expected": "a list of 2"}),
        ({"scale": 1}, "type", "scale", {"expected": "a list", "value": "1"}),
        ({"scale": [1, "x"]}, "type", "scale[1]", {"expected": "a number", "value": "'x'"}),
        ({"bodies": "torso"}, "type", "bodies", {"expected": "a list", "value": "'torso'"}),
        ({"torque": {1: 2.0}}, "type", "torque", {"expected": "a mapping with names as keys"}),
        ({"torque": {"knee": "x"}}, "type", "torque.knee", {"expected": "a number"}),
        ({"gain": {"knee": "x"}}, "type", "gain.knee", {"expected": "a number"}),
        ({"file": 3}, "type", "file", {"expected": "a path", "value": "3"}),
    ],
)
def test_bad_values_name_file_field_and_choices(
    data: dict, problem: str, field: str, facts: dict
) -> None:
    """Each bad value is one error with the source, the dotted field and what is valid."""
    with refused(problem, field, source="file.yaml", **facts) as caught:
        make(**data)
    assert str(caught.value).startswith(f"file.yaml: {field}: ")


@pytest.mark.parametrize(
    ("data", "field", "choices", "parts"),
    [
        ({"gain": float("nan")}, "gain", None, ("must be a finite number, not nan",)),
        ({"gain": "x"}, "gain", None, ("a number", "'x'", "a mapping with names as keys")),
        ({"mode": "x"}, "mode", ("auto",), ("'x'", "a number")),
        ({"name": "nobody"}, None, None, ("nobody is not a name",)),
    ],
)
def test_all_that_a_union_may_be_and_a_class_s_own_error_are_said(
    data: dict, field: str | None, choices: tuple[str, ...] | None, parts: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigError) as caught:
        make(**data)
    error = caught.value
    assert (error.source, error.field, error.choices) == ("file.yaml", field, choices)
    assert all(part in error.message for part in parts) and "\n" not in str(error)


def test_every_shared_message_holds_its_facts() -> None:
    """In one line, with a hint where a name is nearly right; a copy from a worker is the same."""
    for problem, text in TEXTS.items():
        facts = {name: f"<{name}>" for name in re.findall(r"{(\w+)}", text)}
        error = Problem(problem, "file", "field", ["e"], **facts)
        assert all(fact in str(error) for fact in facts.values()) and "{" not in str(error)
        copy = pickle.loads(pickle.dumps(error))
        assert (str(copy), copy.problem, copy.facts) == (str(error), problem, facts)
        assert (copy.source, copy.field, copy.choices) == ("file", "field", ("e",))
    with refused("unknown field", "wieghts", hint=", did you mean weights?"):
        make(wieghts={})
    limits = {"from 0 to 1": (0, None, 1), "above 0 and at most 1": (None, 0, 1)}
    for said, (least, above, most) in limits.items():
        error = out_of_range(2.0, "a", least=least, above=above, most=most, form="g")
        assert error.facts["limits"] == said and error.facts["value"] == "2"


def test_a_required_field_must_be_there() -> None:
    """A field without a default must be given."""
    with refused("missing", "name", source="file.yaml"):
        build(Settings, {}, "file.yaml")


def test_an_unsupported_field_type_is_the_programmers_error() -> None:
    """A dataclass with a field of another type is a TypeError, not a ConfigError."""

    @dataclass
    class Odd:
        value: complex

    with pytest.raises(TypeError, match="complex"):
        schema._build(complex, 1, "file.yaml", "value", {})


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_numbers_with_an_exponent_are_numbers(tmp_path: Path) -> None:
    """YAML 1.1 reads 1e-3 as text; Poise reads it as a number, and leaves other words alone."""
    text = "a: 1e-3\nb: 3E5\nc: 1.5e6\nd: -2.e-1\ne: .5e1\nf: e3\ng: 1e\nh: 1.5e-3\ni: 0x10\n"
    assert read_yaml(write(tmp_path / "a.yaml", text)) == {
        "a": 1e-3,
        "b": 3e5,
        "c": 1.5e6,
        "d": -0.2,
        "e": 5.0,
        "f": "e3",
        "g": "1e",
        "h": 1.5e-3,
        "i": 16,
    }


def test_merge_keys_work_and_are_not_taken_for_repeated_keys(tmp_path: Path) -> None:
    """A merged mapping may be overridden, also when it is merged again elsewhere."""
    text = "a: &a {x: 1, y: 1}\nb: {deep: &b {<<: *a, x: 2}}\nc: {<<: *b, y: 3}\n"
    data = read_yaml(write(tmp_path / "a.yaml", text))
    assert data["b"]["deep"] == {"x": 2, "y": 1}
    assert data["c"] == {"x": 2, "y": 3}
    text = "long: &a {name: 1}\nother: &b {name: 2, more: 3}\nc: {<<: [*a, *b]}\nd: {<<: 1}\n"
    with pytest.raises(ConfigError, match="what << merges must be a mapping or a list of them"):
        read_yaml(write(tmp_path / "a.yaml", text))
    data = read_yaml(write(tmp_path / "a.yaml", text.partition("d: ")[0]))
    assert data["c"] == {"name": 1, "more": 3}


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("a: 1\nb: 2\na: 3\n", "line 3, column 1: key 'a' occurs twice"),
        ("a: [1, 2\n", "line 2, column 1"),
        ("a: !!python/object:os.system {}\n", "not valid YAML"),
        ("[1]: 2\n? [1]\n: 3\n", "not valid YAML"),
        ("a: 2020-13-45\n", "not valid YAML"),
        ("a: \x01\n", "not valid YAML"),
        ("[" * 3000, "not valid YAML"),
        ("- a\n", "must hold a mapping of fields, found list"),
        ("", "must hold a mapping of fields, found nothing"),
    ],
)
def test_unreadable_yaml_is_one_clear_line(tmp_path: Path, text: str, problem: str) -> None:
    """Whatever is wrong with the text, the error is one line that begins with the file."""
    path = write(tmp_path / "bad.yaml", text)
    with pytest.raises(ConfigError) as caught:
        read_yaml(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and problem in message and "\n" not in message


def test_missing_file_and_folder_are_config_errors(tmp_path: Path) -> None:
    """A path that cannot be read says why."""
    for path, error in ((tmp_path / "none.yaml", errno.ENOENT), (tmp_path, None)):
        with refused("unreadable", source=str(path)) as caught:
            read_yaml(path)
        assert error is None or caught.value.facts["why"] == os.strerror(error)


def test_resolve_finds_packaged_names_and_paths(tmp_path: Path, monkeypatch) -> None:
    """A name is looked up among the packaged files, a path is taken as it is."""
    (tmp_path / "robots").mkdir()
    packaged_file = write(tmp_path / "robots" / "tall.yaml", "")
    monkeypatch.setattr(file_names, "files", lambda package: tmp_path)
    own = write(tmp_path / "own.yaml", "")
    assert packaged("robots") == ["tall"]
    assert resolve("robots", "tall") == packaged_file
    assert resolve("robots", str(own)) == own


@pytest.mark.parametrize(
    ("kind", "field"),
    [("robots", "robot"), ("suites", "suite"), ("policies", "policy"), ("realism", "realism")],
)
@pytest.mark.parametrize("name", ["tiny", "no/such.yaml", "../robots/tall", "."])
def test_resolve_lists_the_choices(
    tmp_path: Path, monkeypatch, name: str, kind: str, field: str
) -> None:
    """An unknown name or path is refused with the packaged names, and the field that takes one."""
    (tmp_path / kind).mkdir()
    write(tmp_path / kind / "tall.yaml", "")
    monkeypatch.setattr(file_names, "files", lambda package: tmp_path)
    problem = {"tiny": "unknown name", ".": "folder"}.get(name, "no file")
    with refused(problem, field, choices=["tall"], value=repr(name)):
        resolve(kind, name)


def test_write_atomic_makes_folders_and_replaces(tmp_path: Path) -> None:
    """Text and bytes are written; nothing but the file is left."""
    path = tmp_path / "new" / "file.txt"
    write_atomic(path, "ωδ")
    write_atomic(path, b"bytes")
    assert path.read_bytes() == b"bytes"
    assert os.listdir(path.parent) == ["file.txt"]


@pytest.mark.parametrize("name", ["", ".", "..", "/"])
def test_write_atomic_replaces_no_folder(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even where the path has no name of its own; nothing is left behind."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(WriteError) as caught:
        write_atomic(name, "text")
    assert caught.value.reason == "it is a folder"
    assert not list(tmp_path.iterdir())


def test_write_atomic_does_not_write_into_the_old_file(tmp_path: Path) -> None:
    """The old file is replaced as a whole: another name for it keeps the old content."""
    path, other = tmp_path / "file.txt", tmp_path / "other.txt"
    write_atomic(path, "old")
    os.link(path, other)
    write_atomic(path, "new")
    assert (path.read_text(), other.read_text()) == ("new", "old")


def test_write_atomic_into_a_file_is_told(tmp_path: Path) -> None:
    """A folder that is a file: one error, and the file stays."""
    (tmp_path / "file").write_text("old")
    with pytest.raises(WriteError):
        write_atomic(tmp_path / "file" / "new", "text")
    assert (tmp_path / "file").read_text() == "old"


def test_write_atomic_keeps_the_old_content_when_it_fails(tmp_path: Path, monkeypatch) -> None:
    """A failure half way leaves the old file and no part of the new one."""
    path = tmp_path / "file.txt"
    write_atomic(path, "old")

    def fail(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(WriteError) as caught:
        write_atomic(path, "new")
    assert (caught.value.path, caught.value.reason) == (str(path), "No space left on device")
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.reason) == (str(caught.value), caught.value.reason)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["file.txt"]


def test_write_atomic_refuses_a_folder(tmp_path: Path) -> None:
    """Writing over a folder is an error of Poise, not of the operating system."""
    with pytest.raises(WriteError):
        write_atomic(tmp_path, "text")


def test_errors_survive_a_process_boundary() -> None:
    """A worker's ConfigError arrives with the same text and fields."""
    error = ConfigError("is wrong", source="a.yaml", field="b", choices=["c", "d"])
    copy = pickle.loads(pickle.dumps(error))
    assert str(copy) == str(error) == "a.yaml: b: is wrong (choices: c, d)"
    assert (copy.field, copy.choices) == ("b", ("c", "d"))


def test_a_base_may_have_a_base(tmp_path: Path) -> None:
    """What is nearest counts; mappings are merged, lists are not."""
    (tmp_path / "a.yaml").write_text("x: 1\nlist: [1, 2]\npart: {y: 1, z: {u: 1, v: 1}}\n")
    (tmp_path / "b.yaml").write_text(f"base: {tmp_path}/a.yaml\npart: {{z: {{u: 2}}}}\n")
    data = {"base": str(tmp_path / "b.yaml"), "list": [3], "part": {"y": 3}}
    found = on_base(data, "training", "c.yaml")
    assert found == {"x": 1, "list": [3], "part": {"y": 3, "z": {"u": 2, "v": 1}}}
    assert data["part"] == {"y": 3}


def test_a_base_that_is_none(tmp_path: Path) -> None:
    """Not a name, no such file, and two that are each other's: one error that names the file."""
    with pytest.raises(ConfigError, match=r"^c.yaml: base: must be a name .*residual-step"):
        on_base({"base": 3}, "training", "c.yaml")
    with pytest.raises(ConfigError, match="nowhere"):
        on_base({"base": "nowhere"}, "training", "c.yaml")
    one, other = tmp_path / "one.yaml", tmp_path / "other.yaml"
    one.write_text(f"base: {other}\n")
    other.write_text(f"base: {one}\n")
    with pytest.raises(ConfigError, match=r"other.yaml: base: .*one.yaml' leads back to itself"):
        on_base({"base": str(one)}, "training", "c.yaml")


@dataclass(frozen=True)
class Shape(OfKind):
    """Base of two kinds."""


@dataclass(frozen=True)
class Disc(Shape):
    radius: float
    kind: Literal["disc"] = "disc"


@dataclass(frozen=True)
class Ring(Shape):
    radius: float
    kind: Literal["ring"] = "ring"
    width: float = 1.0


@dataclass(frozen=True)
class Sketch:
    shapes: dict[str, Shape] = field(default_factory=dict, metadata={"omit": "default"})
    size: float = field(default=1.0, metadata={"omit": "default"})
    more: list[int] = field(default_factory=list)


def test_a_kind_chooses_the_class() -> None:
    """In whatever file it is; writing and building are each other's inverse."""
    data = {"shapes": {"a": {"kind": "ring", "radius": 2}, "b": {"kind": "disc", "radius": 1}}}
    sketch = build(Sketch, data, "f.yaml")
    assert sketch.shapes == {"a": Ring(2.0), "b": Disc(1.0)}
    assert build(Sketch, to_dict(sketch), "f.yaml") == sketch
    for shape, problem, where, choices in (
        ({"radius": 1}, "missing", "shapes.a.kind", ("disc", "ring")),
        ({"kind": "cone"}, "unknown kind", "shapes.a.kind", ("disc", "ring")),
        ({"kind": "disc", "radius": 1, "width": 2}, "unknown field", "shapes.a.width", None),
        ([], "type", "shapes.a", None),
    ):
        with refused(problem, where, source="f.yaml", choices=choices):
            build(Sketch, {"shapes": {"a": shape}}, "f.yaml")


def test_a_field_may_be_left_out_at_its_default() -> None:
    """Only one that says so; with another value it is written, though that be empty or zero."""
    assert to_dict(Sketch()) == {"more": []}
    assert to_dict(Sketch(size=0.0)) == {"size": 0.0, "more": []}
    assert list(to_dict(Sketch({"a": Disc(1.0)}))) == ["shapes", "more"]


def test_a_part_may_have_a_base(tmp_path: Path) -> None:
    """Looked up before the file is merged with its own base, whose part it hides."""
    (tmp_path / "inner.yaml").write_text("x: 1\ny: 1\n")
    (tmp_path / "other.yaml").write_text("x: 2\nz: 2\n")
    inner, other, outer = (f"{tmp_path}/{name}.yaml" for name in ("inner", "other", "outer"))
    (tmp_path / "outer.yaml").write_text(f"a: 1\npart: {{base: {inner}, y: 5}}\n")
    whole = on_base({"base": outer, "part": {"w": 3}}, "training", "c.yaml", parts=("part",))
    assert whole == {"a": 1, "part": {"x": 1, "y": 5, "w": 3}}
    data = {"base": outer, "part": {"base": other}}
    assert on_base(data, "training", "c.yaml", parts=("part",))["part"] == {"x": 2, "y": 5, "z": 2}
    untouched = {"part": {"base": other}}
    assert on_base(untouched, "training", "c.yaml") == untouched
    with pytest.raises(ConfigError, match=r"^c.yaml: part: base: must be a name"):
        on_base({"part": {"base": 3}}, "training", "c.yaml", parts=("part",))


def test_whole_numbers_of_too_many_digits() -> None:
    """They are no finite number, where a whole number is asked for as well."""

    @dataclass(frozen=True)
    class Counted:
        count: int = 1
        size: float = 1.0

    for name in ("count", "size"):
        with pytest.raises(ConfigError, match=f"{name}: must be a finite number"):
            build(Counted, {name: 10**400}, "test")
    assert build(Counted, {"count": 10**300}, "test").count == 10**300


@dataclass(frozen=True)
class Unfit:
    size: float = 1.0

    def __post_init__(self) -> None:
        raise ConfigError("does not fit", field="size", choices=["1", "2"])


@dataclass(frozen=True)
class OfUnfit:
    part: Unfit


def test_an_error_of_a_part_names_file_and_field() -> None:
    """Also one that a part raises about a field of its own, which knows neither."""
    with pytest.raises(ConfigError, match=r"^test: part\.size: does not fit \(choices: 1, 2\)"):
        build(OfUnfit, {"part": {}}, "test")
