"""Pictures of motions as one HTML file that opens from disk, in the colours of the report."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from markupsafe import Markup

from poise.configs.errors import ConfigError
from poise.configs.files import write_atomic
from poise.configs.outputs import check_out_file
from poise.training.pictures.figures.style import Inline
from poise.training.pictures.report.pages import render_page


class Picture(NamedTuple):
    """One section of the page.

    Attributes:
        title: its heading.
        out: the drawing; of the class "wide" it keeps its size on a narrow screen, and is moved by
            hand there.
        caption: what it shows, below it.
        key: name → sample of a line in the legend.
    """

    title: str
    out: Inline
    caption: str
    key: dict[str, Markup] = {}  # noqa: RUF012 - a default that nothing changes


def check_page(path: Path) -> None:
    """Raise ConfigError for a path that no page can be written to."""
    if path.suffix not in (".html", ".htm"):
        raise ConfigError("must be the name of a .html file", source=path, choices=("*.html",))
    check_out_file(path)


def write_page(path: Path, title: str, lead: str, pictures: Sequence[Picture]) -> None:
    """Write the page; the same pictures give the same file.

    Raises PoiseError if the file cannot be written.
    """
    text = render_page("motion.html.j2", title=title, lead=lead, pictures=pictures)
    write_atomic(path, text)
