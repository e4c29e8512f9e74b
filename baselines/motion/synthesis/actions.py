"""A script's actions, in order: brackets and names of its own resolved, overlays made."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace

from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.synthesis.scripts.printer import overlay_text
from poise.baselines.motion.synthesis.scripts.tree import (
    Arrow,
    ClipName,
    Modifier,
    Overlay,
    Script,
    ScriptTerm,
    Sequence,
    StateName,
    bodies,
)
from poise.configs.errors import ConfigError, meant, shown

from .stage import Stage, changed, layer_of, overlaid_clip, whole_name

MOST_ACTIONS = 1000
OVER = ("on", "weight")


@dataclass(frozen=True)
class Actions:
    """What is wanted.

    Attributes:
        names: of clips of the stage, in order.
        arrows: the one into each but the first.
        start, goal: names of postures, or empty.
    """

    names: tuple[str, ...]
    arrows: tuple[Arrow, ...]
    start: StateName | None = None
    goal: StateName | None = None


Item = tuple[Arrow, Overlay, int]  # the arrow before it, how many definitions it sees


class Reader:
    """The actions of a script on a stage.

    `make` turns an inner sequence into one clip. `again` is given every clip that has been changed.
    """

    def __init__(
        self, script: Script, stage: Stage, make: Callable[[Actions], Clip],
        again: Callable[[Clip], Clip],
    ):  # fmt: skip
        self.script, self.stage, self.make, self.again = script, stage, make, again
        self.count = 0

    def actions(self) -> Actions:
        """Those of the whole script.

        A posture that is first or last is where the way begins or ends. Any other is an action, a
        rest in it; so is each of a script of postures alone.

        Raises ConfigError with line and column: no such clip, link group or posture, a posture that
        is not alone, a modifier that cannot be used, more than 1,000 actions.
        """
        items = self._flat(self.script.sequence, len(self.script.defines), Arrow())
        states = [state_of(item[1]) for item in items]
        if all(states):
            if len(items) == 1:
                raise self.script.wrong("a script needs a motion or two postures", 0)
            return self._actions(items)
        start, goal = states[0], states[-1] if len(items) > 1 else None
        inner = items[start is not None : len(items) - (goal is not None)]
        said = "next to a first or last posture no transition is chosen by hand"
        for state, arrow in ((start, inner[0][0]), (goal, items[-1][0])):
            if state is not None and arrow.kind:
                raise self.script.wrong(said, arrow.at)
        return replace(self._actions(inner), start=start, goal=goal)

    def _actions(self, items: list[Item]) -> Actions:
        names = tuple(self._name(overlay, seen) for _, overlay, seen in items)
        return Actions(names, tuple(arrow for arrow, _, _ in items[1:]))

    def _flat(self, sequence: Sequence, seen: int, arrow: Arrow) -> list[Item]:
        """Overlays in order; sequences that only repeat are laid out."""
        items: list[Item] = []
        for into, overlay in zip((arrow, *sequence.arrows), sequence.overlays, strict=True):
            term = overlay.terms[0]
            times, rest = _repeats(term)
            body, inner = self._body(term, seen)
            alone = len(overlay.terms) == 1
            for turn in range(times if alone else 1):
                self._counted(term)
                before = Arrow() if turn else into
                if alone and isinstance(body, Sequence) and not rest:
                    items += self._flat(body, inner, before)
                else:
                    left = Overlay((replace(term, modifiers=rest),)) if alone else overlay
                    items.append((before, left, seen))
        return items

    def _counted(self, term: ScriptTerm) -> None:
        self.count += 1
        if self.count > MOST_ACTIONS:
            raise self.script.wrong(f"more than {MOST_ACTIONS} actions", term.at)

    def _body(self, term: ScriptTerm, seen: int) -> tuple[ClipName | StateName | Sequence, int]:
        """What a term is, and how many definitions it sees: those before its own."""
        body = term.body
        if isinstance(body, ClipName):
            for i, define in enumerate(self.script.defines[:seen]):
                if define.clip == body:
                    return define.sequence, i
        return body, seen

    def _name(self, overlay: Overlay, seen: int) -> str:
        """The clip of the stage that an overlay is; made now if the graph has it not."""
        term = overlay.terms[0]
        body, _ = self._body(term, seen)
        if (state := state_of(overlay)) is not None:
            return self.stage.hold(state, self.script)
        if len(overlay.terms) == 1 and isinstance(body, ClipName) and not term.modifiers:
            return self._found(body)
        text = overlay_text(overlay)
        if text not in self.stage.derived:
            clip = self._overlaid(overlay, seen)
            with self.script.blamed(term.at):
                self.stage.add(text, clip)
        return text

    def _overlaid(self, overlay: Overlay, seen: int) -> Clip:
        base = self._clip(overlay.terms[0], seen, ())
        if len(overlay.terms) == 1:
            return base
        layers = []
        for term in overlay.terms[1:]:
            over = tuple(m for m in term.modifiers if m.kind in OVER)
            layers.append(layer_of(self._clip(term, seen, OVER), over, self.script))
        at = overlay.terms[1].at
        clip = overlaid_clip(base, layers, at, self.script)
        with self.script.blamed(at):
            return self.again(clip)

    def _clip(self, term: ScriptTerm, seen: int, skipped: tuple[str, ...]) -> Clip:
        """The clip of a term by itself, but for modifiers of the kinds `skipped`."""
        times, modifiers = _repeats(term)
        body, inner = self._body(term, seen)
        if isinstance(body, StateName):
            raise self.script.wrong("a posture stands alone", term.at)
        if times > 1 or isinstance(body, Sequence):
            once = body if isinstance(body, Sequence) else Sequence((Overlay((ScriptTerm(body),)),))
            items = [item for _ in range(times) for item in self._flat(once, inner, Arrow())]
            clip = self.make(self._actions(items))
        else:
            clip = self.stage.clips[self._found(body)]
        for modifier in modifiers:
            if modifier.kind not in skipped:
                clip = changed(clip, modifier, self.script)
                with self.script.blamed(modifier.at):
                    clip = self.again(clip) if modifier.kind == "@" else clip
        return clip

    def _found(self, body: ClipName) -> str:
        name = self.stage.find(body.name)
        if name is None:
            raise _no_motion(self.script, body, [*self.stage.packed, *self.stage.others])
        return name


def check_clips(script: Script, names: Collection[str], others: Iterable[str] = ()) -> None:
    """Raise ConfigError as `Reader.actions` for a clip that is none of `names`, before these are
    loaded: to retarget them takes a minute. `others` are choices, too."""
    defined = {define.clip for define in script.defines}
    for body in bodies(script):
        named = not isinstance(body, ClipName) or body in defined
        if not named and whole_name(body.name, names) is None:
            raise _no_motion(script, body, [*names, *others])


def _no_motion(script: Script, body: ClipName | StateName, names: list[str]) -> ConfigError:
    choices = [*(define.name for define in script.defines), *names]
    short = [name.partition("_")[2] for name in names if "_" in name]  # which will do
    hint = meant(body.name, [name for name in (*short, *choices) if name != body.name])
    return script.wrong(f"no motion {shown(body.name)}{hint}", body.at, choices)


def state_of(overlay: Overlay) -> StateName | None:
    """The posture that an overlay is, alone and unchanged, or None."""
    term = overlay.terms[0]
    alone = len(overlay.terms) == 1 and not term.modifiers
    return term.body if alone and isinstance(term.body, StateName) else None


def _repeats(term: ScriptTerm) -> tuple[int, tuple[Modifier, ...]]:
    """Return how often a term is repeated, and its other modifiers."""
    times = 1
    for modifier in term.modifiers:
        if modifier.kind == "*":
            times = min(times * int(modifier.numbers[0]), MOST_ACTIONS + 1)
    return times, tuple(modifier for modifier in term.modifiers if modifier.kind != "*")
