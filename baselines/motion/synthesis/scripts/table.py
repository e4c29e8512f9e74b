"""A script as a table, as Semakin's figure 4: columns follow each other, rows happen at once."""

import csv
import io

from .printer import arrow_text, body_text, sequence_text, term_text
from .tree import Overlay, Script, Sequence


def plain(script: Script) -> Script:
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
