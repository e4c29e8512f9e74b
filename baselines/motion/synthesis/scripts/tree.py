"""What a script says, as a tree. Places in the text are kept for errors and count in no comparison.

    script   = { define } sequence ;
    define   = clip "=" sequence ";" ;
    sequence = overlay { arrow overlay } ;
    arrow    = "->" [ "{" kind { "," option } "}" ] ;
    overlay  = term { "|" term } ;
    term     = ( clip | state | "(" sequence ")" ) { modifier } ;
    clip     = STRING | NAME ;
    state    = "<" ( STRING | NAME ) [ "@" NUMBER ] ">" ;
    modifier = "*" NUMBER | "@" NUMBER | "[" NUMBER ":" NUMBER "]" | "on" NAME { "," NAME }
             | "mirrored" | "weight" NUMBER ;
    kind     = "insert" | "cross" | "capture" | "inertial" | "physical" ;
    option   = NUMBER | NAME ":" NUMBER ;

`|` is overlay, both at once, and binds tighter than `->`; the first term of an overlay is the base.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal

from poise.configs.errors import ConfigError

from .tokens import wrong

KINDS = ("insert", "cross", "capture", "inertial", "physical")
OPTIONS = ("duration",)  # the first is the one without a name

ModifierKind = Literal["*", "@", "[", "on", "mirrored", "weight"]


@dataclass(frozen=True)
class ClipName:
    """A clip by its name. Quoted and bare names are two sets: "a" is not what defines a bare a."""

    name: str
    quoted: bool = False
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class StateName:
    """A posture: by its name, or of a clip at a time [s]."""

    name: str
    time: float | None = None
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Modifier:
    """What is done with a term.

    Attributes:
        kind: `*` repeats, `@` is the speed, `[` cuts, `on` are link groups.
        numbers: one of `*`, `@` and weight; two times [s] of `[`.
        names: the link groups of `on`.
    """

    kind: ModifierKind
    numbers: tuple[float, ...] = ()
    names: tuple[str, ...] = ()
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class ScriptTerm:
    """A clip, a state or a sequence in brackets, with its modifiers in order."""

    body: ClipName | StateName | Sequence
    modifiers: tuple[Modifier, ...] = ()
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Overlay:
    """Terms at once; the first one is the base."""

    terms: tuple[ScriptTerm, ...]


@dataclass(frozen=True)
class Arrow:
    """A transition: any if `kind` is empty, else one by hand, with its options."""

    kind: str = ""
    options: tuple[tuple[str, float], ...] = ()
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Sequence:
    """Overlays one after the other, with an arrow before each but the first."""

    overlays: tuple[Overlay, ...]
    arrows: tuple[Arrow, ...] = ()


@dataclass(frozen=True)
class Define:
    """A name for a sequence, in what follows."""

    name: str
    sequence: Sequence
    quoted: bool = False
    at: int = field(default=0, compare=False)

    @property
    def clip(self) -> ClipName:
        """The name as it stands where it is used."""
        return ClipName(self.name, self.quoted, self.at)


@dataclass(frozen=True)
class Script:
    """A script; `text` and `source` are for errors."""

    defines: tuple[Define, ...]
    sequence: Sequence
    text: str = field(default="", compare=False)
    source: str = field(default="script", compare=False)

    def wrong(self, message: str, at: int, choices: Iterable[object] | None = None) -> ConfigError:
        """The error of a place in it, with line and column."""
        return wrong(message, self.text, at, self.source, choices)

    @contextmanager
    def blamed(self, at: int) -> Iterator[None]:
        """What raises ConfigError inside says line and column of this place instead."""
        try:
            yield
        except ConfigError as error:
            raise self.wrong(error.message, at) from None


def clip_names(script: Script) -> set[str]:
    """The names of clips and postures in a script, those that it defines among them."""
    return {body.name for body in bodies(script)}


def bodies(script: Script) -> Iterator[ClipName | StateName]:
    """The clips and postures in a script, and in what it defines, as often as they are there."""

    def within(sequence: Sequence) -> Iterator[ClipName | StateName]:
        for term in (term for overlay in sequence.overlays for term in overlay.terms):
            if isinstance(term.body, Sequence):
                yield from within(term.body)
            else:
                yield term.body

    for sequence in (*(define.sequence for define in script.defines), script.sequence):
        yield from within(sequence)
