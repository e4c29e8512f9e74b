"""Scripts are read by recursive descent; the grammar is in `tree.py`."""

from pathlib import Path

from poise.configs.errors import ConfigError, shown
from poise.configs.reading import read_text

from .tokens import Token, tokens, wrong
from .tree import (
    KINDS,
    OPTIONS,
    Arrow,
    ClipName,
    Define,
    Modifier,
    Overlay,
    Script,
    ScriptTerm,
    Sequence,
    StateName,
)

MOST_BYTES = 1 << 16
MOST_DEPTH = 50  # of brackets
MOST_TERMS = 1000
MOTIONS = ('"name"', "<state>", "(")
MODIFIERS = ("*", "@", "[", "on", "mirrored", "weight")
#: modifier or option → least and largest number
BOUNDS = {
    "*": (1.0, 100.0),
    "@": (0.1, 10.0),
    "[": (0.0, 600.0),
    "weight": (0.0, 1.0),
    "duration": (0.05, 60.0),
}


def read_script(path: str | Path) -> Script:
    """The script in a ``.motion`` file of UTF-8 text; raises ConfigError as `parse`."""
    return parse(read_text(path, MOST_BYTES), str(path))


def parse(text: str, source: str = "script") -> Script:
    """The tree of a script.

    Raises:
        ConfigError: what is wrong first, with `source`, line, column and what may stand there; more
            than 10,000 characters, 50 brackets in each other, or 1,000 terms.
    """
    return _Parser(text, source).script()


class _Parser:
    """One token after the other; `self.next` is the one that is looked at."""

    def __init__(self, text: str, source: str):
        self.text, self.source = text, source
        self.tokens = tokens(text, source)
        self.place = self.depth = self.terms = 0

    @property
    def next(self) -> Token:
        return self.tokens[self.place]

    def script(self) -> Script:
        defines: list[Define] = []
        while self.next.kind in ("name", "string") and self.tokens[self.place + 1].text == "=":
            defines.append(self.define([define.clip for define in defines]))
        sequence = self.sequence()
        if self.next.text == ")":
            raise self.wrong('")" closes no bracket')
        if self.next.kind != "end":
            raise self.wrong(f"{self.shown()} cannot follow a motion", ("->", "|", *MODIFIERS))
        return Script(tuple(defines), sequence, self.text, self.source)

    def define(self, known: list[ClipName]) -> Define:
        at = self.next.at
        clip = self.quoted() if self.next.kind == "string" else ClipName(self.take().text, at=at)
        if clip in known:
            raise self.wrong(f"{shown(clip.name)} is defined twice", at=at)
        self.take()
        sequence = self.sequence()
        if self.next.text != ";":
            raise self.wrong(f'after the definition of {shown(clip.name)} ";" is missing, found '
                             f"{self.shown()}", (";", "->", "|", *MODIFIERS))  # fmt: skip
        self.take()
        return Define(clip.name, sequence, clip.quoted, at)

    def sequence(self) -> Sequence:
        overlays, arrows = [self.overlay()], []
        while self.next.text == "->":
            arrows.append(self.arrow())
            overlays.append(self.overlay())
        return Sequence(tuple(overlays), tuple(arrows))

    def overlay(self) -> Overlay:
        terms = [self.term()]
        while self.next.text == "|":
            self.take()
            terms.append(self.term())
        return Overlay(tuple(terms))

    def term(self) -> ScriptTerm:
        at, body = self.next.at, self.body()
        self.terms += 1
        if self.terms > MOST_TERMS:
            raise self.wrong(f"more than {MOST_TERMS} terms", at=at)
        modifiers = []
        while self.next.text in MODIFIERS and self.next.kind in ("sign", "name"):
            modifiers.append(self.modifier())
        return ScriptTerm(body, tuple(modifiers), at)

    def body(self) -> ClipName | StateName | Sequence:
        token = self.next
        if token.kind == "string":
            return self.quoted()
        if token.kind == "name":
            return ClipName(self.take().text, at=token.at)
        if token.text == "<":
            return self.state()
        if token.text == "(":
            return self.bracket()
        raise self.missing("a motion", MOTIONS)

    def quoted(self) -> ClipName:
        token = self.take()
        name = token.text[1:-1]
        if not name.strip():
            raise self.wrong("a name is empty", at=token.at)
        return ClipName(name, quoted=True, at=token.at)

    def state(self) -> StateName:
        at = self.take().at
        if self.next.kind == "string":
            name = self.quoted().name
        else:
            name = self.expect("name", "the name of a posture").text
        time = None
        if self.next.text == "@":
            self.take()
            time = self.number("[")
        self.sign(">")
        return StateName(name, time, at)

    def bracket(self) -> Sequence:
        opening = self.take()
        self.depth += 1
        if self.depth > MOST_DEPTH:
            raise self.wrong(f"more than {MOST_DEPTH} brackets in each other", at=opening.at)
        inner = self.sequence()
        if self.next.text != ")":
            place = wrong("", self.text, opening.at, self.source).field
            raise self.wrong(f'")" is missing for the "(" of {place}, found {self.shown()}',
                             (")", "->", "|", *MODIFIERS))  # fmt: skip
        self.take()
        self.depth -= 1
        return inner

    def modifier(self) -> Modifier:
        token = self.take()
        at = token.at
        if token.text == "mirrored":
            return Modifier("mirrored", at=at)
        if token.text == "on":
            names = [self.expect("name", "a link group").text]
            while self.next.text == ",":
                self.take()
                names.append(self.expect("name", "a link group").text)
            return Modifier("on", names=tuple(names), at=at)
        if token.text == "[":
            return Modifier("[", self.cut(), at=at)
        number = self.number(token.text, whole=token.text == "*")
        kind = {"*": "*", "@": "@", "weight": "weight"}[token.text]
        return Modifier(kind, (number,), at=at)  # type: ignore[arg-type]

    def cut(self) -> tuple[float, float]:
        start = self.number("[")
        self.sign(":")
        at, end = self.next.at, self.number("[")
        if not start < end:
            raise self.wrong(f"the cut ends at {end:g} s, not after its begin at {start:g} s",
                             at=at)  # fmt: skip
        self.sign("]")
        return start, end

    def arrow(self) -> Arrow:
        at = self.take().at
        if self.next.text != "{":
            return Arrow(at=at)
        self.take()
        kind = self.expect("name", "the kind of a transition", KINDS)
        if kind.text not in KINDS:
            raise self.wrong(f"no transition {shown(kind.text)}", KINDS, kind.at)
        options: dict[str, float] = {}
        while self.next.text == ",":
            self.take()
            name = self.option_name()
            if name in options:
                raise self.wrong(f"{name} is given twice")
            options[name] = self.number(name)
        self.sign("}")
        return Arrow(kind.text, tuple(options.items()), at)

    def option_name(self) -> str:
        if self.next.kind != "name":
            return OPTIONS[0]
        name = self.take()
        if name.text not in OPTIONS:
            raise self.wrong(f"no option {shown(name.text)}", OPTIONS, name.at)
        self.sign(":")
        return name.text

    def number(self, of: str, whole: bool = False) -> float:
        token = self.expect("number", "a number")
        value, (least, most) = float(token.text), BOUNDS[of]
        if not least <= value <= most or (whole and value != int(value)):
            kind = "a whole number" if whole else "a number"
            raise self.wrong(f"must be {kind} from {least:g} to {most:g}, not {value:g}",
                             at=token.at)  # fmt: skip
        return value

    def expect(self, kind: str, what: str, choices: tuple[str, ...] | None = None) -> Token:
        if self.next.kind != kind:
            raise self.missing(what, choices)
        return self.take()

    def sign(self, sign: str) -> None:
        if self.next.text != sign or self.next.kind != "sign":
            raise self.missing(f'"{sign}"')
        self.take()

    def take(self) -> Token:
        token = self.next
        self.place += token.kind != "end"
        return token

    def missing(self, what: str, choices: tuple[str, ...] | None = None) -> ConfigError:
        last = self.tokens[self.place - 1].text if self.place else ""
        after = f"after {_quoted(last)} " if last else ""
        found = f", found {self.shown()}" if self.next.kind != "end" else ""
        return self.wrong(f"{after}{what} is missing{found}", choices)

    def shown(self) -> str:
        return _quoted(self.next.text) if self.next.kind != "end" else "the end"

    def wrong(
        self, message: str, choices: tuple[str, ...] | None = None, at: int | None = None
    ) -> ConfigError:
        place = self.next.at if at is None else at
        return wrong(message, self.text, place, self.source, choices)


def _quoted(text: str) -> str:
    """A word in double quotes, its own ones left out."""
    bare = text.strip('"')
    return f'"{bare[:40]}…"' if len(bare) > 40 else f'"{bare}"'
