"""Configuration as dataclasses: read YAML, build strictly, write back."""

import dataclasses
import functools
import math
import operator
import types
from pathlib import Path
from typing import (
    Any,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

import numpy as np
import yaml

from .errors import ConfigError, meant, shown
from .files import packaged, resolve
from .kinds import OfKind, kind_of
from .problems import Problem, out_of_range
from .reading import read_yaml
from .yaml_loader import DEPTH

T = TypeVar("T")
MOST_BASES = 32  # a file, its base, the base of that
FINITE = "a finite number"
MOST_ENTRIES = 1_000_000  # of an array among the values of a configuration
# libyaml's takes a quarter of the time of Python's; not every PyYAML has it
DUMPER: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def on_base(
    data: dict[str, Any],
    kind: str,
    source: str | Path,
    above: tuple[Path, ...] = (),
    parts: tuple[str, ...] = (),
) -> dict[str, Any]:
    """`data` over the file of `kind` that its `base` names, mappings merged; as it is without one.

    Each of the fields `parts` may have a `base` of that kind, too. It is looked up before anything
    is merged, so a file's own base of a part hides what its base has there.

    Raises ConfigError for a base that does not exist, cannot be read, or leads back to itself.
    """

    for part in parts:
        if isinstance(data.get(part), dict):
            data = {**data, part: on_base(data[part], kind, f"{source}: {part}", above)}
    if "base" not in data:
        return data
    if not isinstance(data["base"], str):
        raise ConfigError("must be a name", source=source, field="base", choices=packaged(kind))
    if len(above) > MOST_BASES:
        raise ConfigError(f"more than {MOST_BASES} on each other", source=source, field="base")
    path = resolve(kind, data["base"])
    if path in above:
        raise ConfigError(
            f"{shown(data['base'])} leads back to itself", source=source, field="base"
        )
    base = on_base(read_yaml(path), kind, path, (*above, path), parts)
    return overlay(base, {key: value for key, value in data.items() if key != "base"})


def overlay(base: dict[str, Any], data: dict[str, Any]) -> dict[str, Any]:
    """`base` with the entries of `data` in their places."""
    merged = dict(base)
    for key, value in data.items():
        both = isinstance(value, dict) and isinstance(base.get(key), dict)
        merged[key] = overlay(base[key], value) if both else value
    return merged


def build(cls: type[T], data: dict[str, Any], source: str | Path) -> T:
    """Return a dataclass instance from a mapping, strictly.

    Fields may be bool, int, float, str, Path, Literal, Optional and other unions, tuple, list,
    dict with string keys, Any, and dataclasses of these. An int is taken for a float; nothing else
    is converted. A number must be finite. ``field(metadata={"min": 0, "max": 1, "above": 0})``
    bounds a number (min and max inclusive, above exclusive), or each number of a tuple, list or
    dict. A ValueError of ``__post_init__`` becomes a ConfigError. A class variable ``RENAMED``
    maps the old name of a field to its name: an error of the old one says the new one. A field with
    ``metadata={"filled": True}`` is filled in by code, and no choice in an error. A dataclass with
    a static method ``named`` may be given by a name, which that takes.

    Args:
        cls: the dataclass.
        data: field names and plain values, as YAML gives them.
        source: the file, or another name of where data came from; errors begin with it.

    Raises:
        ConfigError: an unknown or missing field, a wrong type, a value out of range.
    """
    return _build(cls, data, str(source), "", {})


def checked(hint: type[T], data: Any, source: str | Path) -> T:
    """Return plain values as a type hint describes them, checked as :func:`build` does.

    The hint may also hold TypedDicts. Their unknown keys are kept as they are: whoever wrote the
    file may know more.

    Raises:
        ConfigError: a missing key, a wrong type; it names `source` and the field.
    """
    return _build(hint, data, str(source), "", {})


def to_dict(obj: Any, levels: int = DEPTH) -> Any:
    """Return a dataclass as plain dicts, lists, strings and numbers; the inverse of :func:`build`.

    A field with ``metadata={"omit": "default"}`` is left out where it is its default: what was
    written before there was such a field, and hashes of it, stay as they are.

    Raises ConfigError for more `levels` than a file may have, and an array of more entries.
    """
    if levels < 0:
        raise ConfigError(f"more than {DEPTH} levels")
    if dataclasses.is_dataclass(obj) and not isinstance(obj, type):
        fields = [f for f in dataclasses.fields(obj) if f.init]
        values = {f.name: getattr(obj, f.name) for f in fields if not _is_omitted(f, obj)}
        return {name: to_dict(value, levels - 1) for name, value in values.items()}
    if isinstance(obj, dict):
        return {key: to_dict(value, levels - 1) for key, value in obj.items()}
    if isinstance(obj, (list, tuple)):
        return [to_dict(value, levels - 1) for value in obj]
    if isinstance(obj, (np.ndarray, np.generic)):
        if obj.size > MOST_ENTRIES:
            raise ConfigError(f"an array of more than {MOST_ENTRIES} entries")
        return obj.tolist()
    return str(obj) if isinstance(obj, Path) else obj


def _is_omitted(field: dataclasses.Field[Any], obj: object) -> bool:
    """Return whether :func:`to_dict` leaves a field of this object out."""
    if field.metadata.get("omit") != "default":
        return False
    factory = field.default_factory
    default = field.default if factory is dataclasses.MISSING else factory()
    return bool(getattr(obj, field.name) == default)


def to_yaml(obj: Any) -> str:
    """Return the YAML text of :func:`to_dict`, fields in order; :func:`read_yaml` reads it."""
    text = yaml.dump(to_dict(obj), Dumper=DUMPER, sort_keys=False, allow_unicode=True, width=100)
    return str(text)


def _build(hint: Any, value: Any, source: str, path: str, bounds: Any) -> Any:
    """The value as the type hint wants it; `path` is the dotted field, `bounds` its metadata."""

    def wrong(expected: str) -> Problem:
        return Problem("type", source, path, expected=expected, value=shown(value))

    origin, args = get_origin(hint), get_args(hint)
    if hint is Any:
        return value
    if dataclasses.is_dataclass(hint):
        if isinstance(value, str) and hasattr(hint, "named"):
            return hint.named(value)
        return _build_dataclass(_of_kind(hint, value, source, path), value, source, path)
    if is_typeddict(hint):
        return _build_typed_dict(hint, value, source, path)
    if origin in (Union, types.UnionType):
        return _build_union(args, value, source, path, bounds)
    if origin is Literal:
        if not any(value == arg and type(value) is type(arg) for arg in args):
            raise Problem("unknown value", source, path, args, value=shown(value))
        return value
    if origin in (tuple, list) or hint in (tuple, list):
        if not isinstance(value, (list, tuple)):
            raise wrong("a list")
        kind = origin or hint
        if kind is list or not args or args[-1] is Ellipsis:
            hints = [args[0] if args else Any] * len(value)
        elif len(args) != len(value):
            raise wrong(f"a list of {len(args)}")
        else:
            hints = list(args)
        pairs = zip(hints, value, strict=True)
        return kind(_build(h, v, source, f"{path}[{i}]", bounds) for i, (h, v) in enumerate(pairs))
    if origin is dict or hint is dict:
        if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
            raise wrong("a mapping with names as keys")
        item = args[1] if args else Any
        return {k: _build(item, v, source, f"{path}.{k}", bounds) for k, v in value.items()}
    if hint in (int, float):
        return _build_number(hint, value, source, path, bounds)
    if hint is Path and isinstance(value, (str, Path)):
        return Path(value)
    if hint in (bool, str) and isinstance(value, hint):
        return value
    if hint in (type(None), None) and value is None:
        return None
    names = {bool: "true or false", str: "text", Path: "a path", type(None): "null"}
    if hint not in names:
        raise TypeError(f"{path}: config fields cannot have the type {hint}")
    raise wrong(names[hint])


@functools.cache
def _hints(cls: type) -> dict[str, Any]:
    return get_type_hints(cls)


def _build_dataclass(cls: Any, data: Any, source: str, path: str) -> Any:
    fields = {field.name: field for field in dataclasses.fields(cls) if field.init}
    if not isinstance(data, dict):
        raise Problem(
            "type", source, path, fields, expected="a mapping of fields", value=shown(data)
        )
    prefix = f"{path}." if path else ""
    own = [name for name, field in fields.items() if not field.metadata.get("filled")]
    renamed = getattr(cls, "RENAMED", {})
    for key in data:
        if key in renamed and key not in fields:
            raise Problem("renamed", source, f"{prefix}{key}", name=shown(renamed[key]))
        if key not in fields:
            hint = meant(key, own)
            raise Problem("unknown field", source, f"{prefix}{key}", own, hint=hint)
    hints = _hints(cls)
    values = {}
    for name, field in fields.items():
        if name in data:
            values[name] = _build(hints[name], data[name], source, prefix + name, field.metadata)
        elif field.default is field.default_factory is dataclasses.MISSING:
            raise Problem("missing", source, prefix + name)
    try:
        return cls(**values)
    except ConfigError as error:
        if error.source is not None:
            raise
        place = f"{prefix}{error.field}" if error.field else path or None
        raise ConfigError(
            error.message, source=source, field=place, choices=error.choices
        ) from error
    except ValueError as error:
        raise ConfigError(str(error), source=source, field=path or None) from error


def _of_kind(cls: Any, data: Any, source: str, path: str) -> Any:
    """Return the class that the `kind` of the data names, where `cls` is the base of several."""
    if not issubclass(cls, OfKind) or kind_of(cls) or not isinstance(data, dict):
        return cls
    kinds, field = cls.kinds(), f"{path}.kind" if path else "kind"
    kind = data.get("kind")
    if not isinstance(kind, str) or kind not in kinds:
        problem = "missing" if kind is None else "unknown kind"
        raise Problem(problem, source, field, kinds, value=shown(kind))
    return kinds[kind]


def _build_typed_dict(cls: Any, data: Any, source: str, path: str) -> dict[str, Any]:
    if not isinstance(data, dict):
        raise ConfigError(f"must be a mapping, not {shown(data)}", source=source, field=path)
    prefix, values, hints = f"{path}." if path else "", dict(data), _hints(cls)
    for name in sorted(cls.__required_keys__ - data.keys()):
        raise ConfigError("is missing", source=source, field=f"{prefix}{name}")
    for name in [name for name in hints if name in data]:
        values[name] = _build(hints[name], data[name], source, prefix + name, {})
    return values


def _build_union(args: tuple, value: Any, source: str, path: str, bounds: Any) -> Any:
    if value is None and type(None) in args:
        return None
    errors = []
    for option in args:
        if option is not type(None):
            try:
                return _build(option, value, source, path, bounds)
            except ConfigError as error:
                errors.append(error)
    # An option that had the right shape failed inside: then only its error helps.
    inside = [error for error in errors if error.field != path or _out_of_bounds(error)]
    if inside or len(errors) == 1:
        raise (inside or errors)[0]
    raise ConfigError(
        ", or ".join(dict.fromkeys(error.message for error in errors)),
        source=source,
        field=path,
        choices=[choice for error in errors for choice in error.choices or ()] or None,
    )


def _out_of_bounds(error: ConfigError) -> bool:
    """Whether a value is of the right type, and only its size is wrong."""
    if not isinstance(error, Problem):
        return False
    return error.problem == "range" or error.facts.get("expected") == FINITE


def _build_number(kind: type, value: Any, source: str, path: str, bounds: Any) -> int | float:
    def wrong(expected: str) -> Problem:
        return Problem("type", source, path, expected=expected, value=shown(value))

    allowed = int if kind is int else (int, float)
    if isinstance(value, bool) or not isinstance(value, allowed):
        raise wrong("a whole number" if kind is int else "a number")
    try:
        number = kind(value)
        finite = math.isfinite(number)
    except OverflowError:  # of a whole number with more than 308 digits
        finite = False
    if not finite:
        raise wrong(FINITE)
    for name, bound, inside in (
        ("least", "min", operator.ge), ("most", "max", operator.le), ("above", "above", operator.gt)
    ):  # fmt: skip
        if bound in bounds and not inside(number, bounds[bound]):
            raise out_of_range(value, path, source, **{name: bounds[bound]})
    return number
