"""Scripts that come with Poise, and scripts by name, file, table or text."""

from poise.configs.files import packaged_folder
from poise.configs.reading import is_file

from .parser import parse, read_script
from .table import begins_with_number, read_table
from .tree import Script


def packaged_scripts() -> list[str]:
    """Names of the packaged scripts."""
    return sorted(path.stem for path in packaged_folder("scripts").glob("*.motion"))


def find_script(script: str) -> Script:
    """A ``.motion`` file, a ``.csv`` table of one (`table.read_table`), a packaged script by its
    name, or the text of a script itself.

    Raises ConfigError as `parse`, and for a file that is not there.
    """
    packaged = packaged_folder("scripts") / f"{script}.motion"
    if script.isidentifier() and is_file(packaged):
        return read_script(packaged)
    if script.endswith(".csv"):
        return read_table(script)
    return read_script(script) if script.endswith(".motion") else parse(script)


def names_script(text: str) -> bool:
    """Whether the name of a motion is that of a script, or a script: a file, or an arrow.

    A ``.csv`` file that begins with a number is a clip of postures, not a table.
    """
    if text.endswith(".csv"):
        return not begins_with_number(text)
    return text.endswith(".motion") or "->" in text or text in packaged_scripts()


def between(script: Script, start: str | None, goal: str | None) -> Script:
    """The script from one posture to another, as if it began and ended with <NAME>."""
    at = script.sequence.overlays[0].terms[0].at
    before = f"<{start}> -> " if start is not None else ""
    after = f"\n-> <{goal}>" if goal is not None else ""
    if not before and not after:
        return script
    return parse(f"{script.text[:at]}{before}{script.text[at:]}{after}", script.source)
