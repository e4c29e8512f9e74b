"""A tree as text: what `parse` reads as the same tree; or as a table, as Semakin's figure 4:
columns follow each other, rows happen at once."""

import csv
import io

from poise.configs.errors import ConfigError, shown

from .tree import Arrow, ClipName, Modifier, Overlay, Script, ScriptTerm, Sequence, StateName


def text_of(script: Script) -> str:
    """The text of a script: a line for each definition, one for the sequence.

    Raises ConfigError for a name with a quote or a line break in it, which no text has.
    """
    lines = [f"{body_text(each.clip)} = {sequence_text(each.sequence)};" for each in script.defines]
    return "\n".join([*lines, sequence_text(script.sequence)]) + "\n"


def sequence_text(sequence: Sequence) -> str:
    """A sequence without brackets about it."""
    parts = [overlay_text(sequence.overlays[0])]
    for arrow, overlay in zip(sequence.arrows, sequence.overlays[1:], strict=True):
        parts += [arrow_text(arrow), overlay_text(overlay)]
    return " ".join(parts)


def overlay_text(overlay: Overlay) -> str:
    """Terms with `|` between them."""
    return " | ".join(term_text(term) for term in overlay.terms)


def term_text(term: ScriptTerm) -> str:
    """A motion and its modifiers."""
    return " ".join([body_text(term.body), *(_modifier(modifier) for modifier in term.modifiers)])


def arrow_text(arrow: Arrow) -> str:
    """`->`, or with what was chosen by hand."""
    if not arrow.kind:
        return "->"
    options = [f"{name}: {shortest_number(value)}" for name, value in arrow.options]
    return f"->{{{', '.join([arrow.kind, *options])}}}"


def shortest_number(value: float) -> str:
    """The shortest text of a number that is read as the same."""
    return repr(float(value)).removesuffix(".0")


def body_text(body: ClipName | StateName | Sequence) -> str:
    """A motion without its modifiers; raises ConfigError for a name that no text has."""
    if isinstance(body, Sequence):
        return f"({sequence_text(body)})"
    if isinstance(body, StateName):
        name = body.name if body.name.isidentifier() else body_text(ClipName(body.name, True))
        return f"<{name}>" if body.time is None else f"<{name} @ {shortest_number(body.time)}>"
    if '"' in body.name or "\n" in body.name:
        raise ConfigError(f"cannot be quoted: {shown(body.name)}", field="clip")
    return f'"{body.name}"' if body.quoted else body.name


def _modifier(modifier: Modifier) -> str:
    numbers = [shortest_number(value) for value in modifier.numbers]
    if modifier.kind == "[":
        return f"[{numbers[0]}:{numbers[1]}]"
    if modifier.kind == "on":
        return f"on {', '.join(modifier.names)}"
    return " ".join([modifier.kind, *numbers])


def without_brackets(script: Script) -> Script:
    """The script without brackets that say nothing: a sequence in a sequence, one term alone."""
    return Script(script.defines, _plain(script.sequence), script.text, script.source)


def table_of(script: Script) -> list[list[str]]:
    """Rows of cells. The first has the arrow into each column, the others a term in each cell.

    Before them stands a row of two cells, `NAME =` and a sequence, for each definition.
    """
    sequence = _plain(script.sequence)
    rows = [[f"{body_text(each.clip)} =", sequence_text(each.sequence)] for each in script.defines]
    rows.append(["", *(arrow_text(arrow) for arrow in sequence.arrows)])
    for i in range(max(len(overlay.terms) for overlay in sequence.overlays)):
        rows.append([term_text(o.terms[i]) if i < len(o.terms) else "" for o in sequence.overlays])
    return rows


def to_csv(script: Script) -> str:
    """The table as comma-separated values, in which a spreadsheet can edit it."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(table_of(script))
    return text.getvalue()


def _plain(sequence: Sequence) -> Sequence:
    overlays, arrows = [], []
    for i, overlay in enumerate(sequence.overlays):
        arrows += [sequence.arrows[i - 1]] if i else []
        inner = _alone(overlay)
        overlays += [overlay] if inner is None else list(inner.overlays)
        arrows += [] if inner is None else list(inner.arrows)
    return Sequence(tuple(overlays), tuple(arrows))


def _alone(overlay: Overlay) -> Sequence | None:
    """The sequence in brackets that is all of an overlay, or None."""
    term = overlay.terms[0]
    if len(overlay.terms) > 1 or term.modifiers or not isinstance(term.body, Sequence):
        return None
    return _plain(term.body)
