"""The script language: what is read, printed and laid out as a table, and every error's place."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np
import pyparsing as pp
import pytest

from poise.baselines.motion.synthesis.scripts.library import find_script, names_script
from poise.baselines.motion.synthesis.scripts.parser import parse, read_script
from poise.baselines.motion.synthesis.scripts.printer import (
    table_of,
    text_of,
    to_csv,
    without_brackets,
)
from poise.baselines.motion.synthesis.scripts.table import read_table, text_of_table
from poise.baselines.motion.synthesis.scripts.tree import (
    Arrow,
    ClipName,
    Define,
    Modifier,
    Script,
    ScriptTerm,
    clip_names,
)
from poise.configs.errors import ConfigError
from tests.support.scripts import SEED, damaged, random_script


def test_the_dissertation_s_example_as_it_stands() -> None:
    sequence = parse(SEED).sequence
    assert [len(overlay.terms) for overlay in sequence.overlays] == [1, 1, 1, 1]
    assert sequence.overlays[0].terms[0].body == ClipName("бег", quoted=True)
    inner = sequence.overlays[1].terms[0].body.overlays[0].terms
    assert [term.body.name for term in inner] == ["красться", "достать оружие"]
    assert text_of(parse(SEED)) == SEED + "\n"
    assert table_of(parse(SEED)) == [
        ["", "->", "->", "->"],
        ['"бег"', '"красться"', '"лечь"', '"идти"'],
        ["", '"достать оружие"', "", '"убрать оружие"'],
    ]


def test_the_packaged_script_of_it_ends_with_the_line_unchanged() -> None:
    script = find_script("semakin04")
    assert script.text.rstrip().endswith("\n" + SEED)
    assert script.sequence == parse(SEED).sequence
    assert {define.name for define in script.defines if define.quoted} == set(
        clip_names(parse(SEED))
    )


def test_all_that_the_grammar_has() -> None:
    script = parse(
        "both = punch | wave on left_arm, head weight 0.5;  # a comment\n"
        "<stand> -> squat[0.5:2]@1.5 mirrored ->{cross, 0.4} both * 2 "
        "->{insert, duration: 1e0} <stand>"
    )
    assert script.defines[0].name == "both"
    first, cut, both, last = (o.terms[0] for o in script.sequence.overlays)
    assert first.body.name == last.body.name == "stand"
    assert cut.modifiers == (Modifier("[", (0.5, 2.0)), Modifier("@", (1.5,)), Modifier("mirrored"))
    assert both == ScriptTerm(ClipName("both"), (Modifier("*", (2.0,)),))
    assert script.sequence.arrows == (
        Arrow(), Arrow("cross", (("duration", 0.4),)), Arrow("insert", (("duration", 1.0),)),
    )  # fmt: skip
    layer = script.defines[0].sequence.overlays[0].terms[1]
    assert layer.modifiers[0].names == ("left_arm", "head")


def test_overlay_binds_tighter_than_the_arrow() -> None:
    assert len(parse("a -> b | c -> d").sequence.overlays) == 3
    assert parse("a -> b | c -> d") == without_brackets(parse("a -> (b | c) -> d"))
    assert parse("a -> b | c -> d") != parse("a -> (b | c) -> d")


def test_random_scripts_are_printed_and_read_as_the_same_tree() -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        script = random_script(rng)
        assert parse(text_of(script)) == script


def script_of(rows: list[list[str]]) -> Script:
    """The script that a table shows: its columns, with the arrows between them."""
    (arrows, *terms) = (row for row in rows if not row[0].endswith("="))
    columns = [" | ".join(filter(None, column)) for column in zip(*terms, strict=True)]
    text = " ".join(f"{arrow} {column}" for arrow, column in zip(arrows, columns, strict=True))
    return parse("\n".join([*(f"{name} {way};" for name, way in rows[: -1 - len(terms)]), text]))


def test_random_scripts_as_tables_and_back() -> None:
    rng, wide = np.random.default_rng(1), 0
    for _ in range(200):
        script = without_brackets(random_script(rng))
        rows = table_of(script)
        wide += len(rows) > 3
        assert script_of(rows) == script
        read = list(csv.reader(io.StringIO(to_csv(script))))
        assert read == rows
    assert wide > 20


def grammar() -> pp.ParserElement:
    """The grammar once more, as a library for parsers writes it."""
    name, text = pp.Regex(r"[^\W\d]\w*"), pp.Regex(r'"[^"\n]*[^"\s][^"\n]*"')
    number = pp.Regex(r"[0-9]+(\.[0-9]*)?([eE][+-]?[0-9]+)?")
    sequence = pp.Forward()
    kind = pp.one_of("insert cross capture inertial physical", as_keyword=True)
    option = number | pp.Keyword("duration") + ":" + number
    arrow = "->" + pp.Optional("{" + kind + pp.ZeroOrMore("," + option) + "}")
    words = pp.Keyword("on") + name + pp.ZeroOrMore("," + name) | pp.Keyword("mirrored")
    signs = pp.one_of("* @") + number | "[" + number + ":" + number + "]"
    modifier = words | pp.Keyword("weight") + number | signs
    state = "<" + (text | name) + pp.Optional("@" + number) + ">"
    term = (text | name | state | "(" + sequence + ")") + pp.ZeroOrMore(modifier)
    overlay = term + pp.ZeroOrMore("|" + term)
    sequence <<= overlay + pp.ZeroOrMore(arrow + overlay)
    script = pp.ZeroOrMore((text | name) + "=" + sequence + ";") + sequence + pp.StringEnd()
    return script.ignore(pp.Regex(r"#[^\n]*"))


#: what the grammar allows and a script does not: numbers out of range, names twice
BEYOND = ("must be", "the cut ends", "is defined twice", "is given twice")


def test_it_takes_what_another_parser_of_the_grammar_takes() -> None:
    rng, other = np.random.default_rng(2), grammar()
    taken = refused = 0
    for _ in range(250):
        text = text_of(random_script(rng, 2))
        text = damaged(text, rng) if rng.random() < 0.7 else text
        if "\x00" in text or "\u2028" in text:  # blanks of another kind
            continue
        try:
            parse(text)
            ours = True
        except ConfigError as error:
            if error.message.startswith(BEYOND) or "twice" in error.message:
                continue
            ours = False
        taken, refused = taken + ours, refused + (not ours)
        assert ours == accepts(other, text), text
    assert taken > 50 and refused > 50


def accepts(parser: Any, text: str) -> bool:
    try:
        parser.parse_string(text)
    except (pp.ParseException, RecursionError):
        return False
    return True


MOTIONS = '"name", <state>, ('
MODIFIERS = "*, @, [, on, mirrored, weight"
KINDS = "insert, cross, capture, inertial, physical"
WRONG = [
    ("", 1, 1, f"a motion is missing (choices: {MOTIONS})"),
    ("# nothing", 1, 10, f"a motion is missing (choices: {MOTIONS})"),
    ("walk ->", 1, 8, f'after "->" a motion is missing (choices: {MOTIONS})'),
    ("walk ->\n\n", 1, 8, f'after "->" a motion is missing (choices: {MOTIONS})'),
    ("walk\n-> -> run", 2, 4, f'after "->" a motion is missing, found "->" (choices: {MOTIONS})'),
    ("-> walk", 1, 1, f'a motion is missing, found "->" (choices: {MOTIONS})'),
    ("walk |", 1, 7, f'after "|" a motion is missing (choices: {MOTIONS})'),
    ("walk | | run", 1, 8, f'after "|" a motion is missing, found "|" (choices: {MOTIONS})'),
    ("()", 1, 2, f'after "(" a motion is missing, found ")" (choices: {MOTIONS})'),
    ("(a -> b", 1, 8, f'")" is missing for the "(" of line 1, column 1, found the end'
     f" (choices: ), ->, |, {MODIFIERS})"),
    ("a ->\n (b c)", 2, 5, '")" is missing for the "(" of line 2, column 2, found "c"'
     f" (choices: ), ->, |, {MODIFIERS})"),
    ("a)", 1, 2, '")" closes no bracket'),
    ("a -> (b | c)) -> d", 1, 13, '")" closes no bracket'),
    ("a b", 1, 3, f'"b" cannot follow a motion (choices: ->, |, {MODIFIERS})'),
    ('a "b"', 1, 3, f'"b" cannot follow a motion (choices: ->, |, {MODIFIERS})'),
    ("a 3", 1, 3, f'"3" cannot follow a motion (choices: ->, |, {MODIFIERS})'),
    ("a;", 1, 2, f'";" cannot follow a motion (choices: ->, |, {MODIFIERS})'),
    ("a - b", 1, 3, "'-' means nothing in a script (choices: ->, |, (, ), <, >, *, @, [, ], :, "
     ",, {, }, =, ;)"),
    ("a &\nb", 1, 3, "'&' means nothing in a script (choices: ->, |, (, ), <, >, *, @, [, ], :, "
     ",, {, }, =, ;)"),
    ("a -> ../b.npz", 1, 6, "'.' means nothing in a script; quote the path of a file (choices: ->, "
     "|, (, ), <, >, *, @, [, ], :, ,, {, }, =, ;)"),
    ('a -> "b', 1, 6, "the quote is not closed on its line"),
    ('"a\n" -> b', 1, 1, "the quote is not closed on its line"),
    ('a -> ""', 1, 6, "a name is empty"),
    ('"  "', 1, 1, "a name is empty"),
    ("<> -> a", 1, 2, 'after "<" the name of a posture is missing, found ">"'),
    ("<stand -> a", 1, 8, 'after "stand" ">" is missing, found "->"'),
    ("a *", 1, 4, 'after "*" a number is missing'),
    ("a * 2.5", 1, 5, "must be a whole number from 1 to 100, not 2.5"),
    ("a * 0", 1, 5, "must be a whole number from 1 to 100, not 0"),
    ("a @ 99", 1, 5, "must be a number from 0.1 to 10, not 99"),
    ("a @ fast", 1, 5, 'after "@" a number is missing, found "fast"'),
    ("a[2:1]", 1, 5, "the cut ends at 1 s, not after its begin at 2 s"),
    ("a[1]", 1, 4, 'after "1" ":" is missing, found "]"'),
    ("a[1:2", 1, 6, 'after "2" "]" is missing'),
    ("a[-1:2]", 1, 3, "'-' means nothing in a script (choices: ->, |, (, ), <, >, *, @, [, ], :,"
     " ,, {, }, =, ;)"),
    ("a | b on", 1, 9, 'after "on" a link group is missing'),
    ("a | b on arms,", 1, 15, 'after "," a link group is missing'),
    ("a | b weight 2", 1, 14, "must be a number from 0 to 1, not 2"),
    ("a ->{jump} b", 1, 6, f"no transition 'jump' (choices: {KINDS})"),
    ("a ->{} b", 1, 6, f'after "{{" the kind of a transition is missing, found "}}" (choices: '
     f"{KINDS})"),
    ("a ->{cross, 0} b", 1, 13, "must be a number from 0.05 to 60, not 0"),
    ("a ->{cross, time: 1} b", 1, 13, "no option 'time' (choices: duration)"),
    ("a ->{cross, 1, 2} b", 1, 16, "duration is given twice"),
    ("a ->{cross 1} b", 1, 12, 'after "cross" "}" is missing, found "1"'),
    ("x = a -> b", 1, 11, "after the definition of 'x' \";\" is missing, found the end (choices: "
     f";, ->, |, {MODIFIERS})"),
    ("x = a;\nx = b;\nx", 2, 1, "'x' is defined twice"),
    ('"x" = a;\nx = b;\n"x" = c;\nx', 3, 1, "'x' is defined twice"),
    ('"" = a;\na', 1, 1, "a name is empty"),
    ("x = ;\nx", 1, 5, f'after "=" a motion is missing, found ";" (choices: {MOTIONS})'),
    ("x = a;", 1, 7, f'after ";" a motion is missing (choices: {MOTIONS})'),
    ("a * 1e999", 1, 5, "must be a whole number from 1 to 100, not inf"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "line", "column", "said"), WRONG)
def test_wrong_scripts_say_line_column_and_choices(
    text: str, line: int, column: int, said: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        parse(text, "wave.motion")
    assert str(caught.value) == f"wave.motion: line {line}, column {column}: {said}"


def test_hostile_scripts_are_refused_at_once() -> None:
    with pytest.raises(ConfigError, match="has 10001 characters, more than 10000"):
        parse("a" * 10_001)
    with pytest.raises(ConfigError, match="line 1, column 51: more than 50 brackets in each other"):
        parse("(" * 4000)
    with pytest.raises(ConfigError, match="line 1, column 4001: more than 1000 terms"):
        parse("a | " * 2000 + "a")
    assert len(parse("a | " * 999 + "a").sequence.overlays[0].terms) == 1000
    with pytest.raises(ConfigError, match="must be a whole number from 1 to 100, not inf"):
        parse("a * " + "9" * 5000)


def test_damaged_scripts_are_read_or_refused_in_one_line() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        text = damaged(text_of(random_script(rng)), rng)
        try:
            script = parse(text, "damaged.motion")
        except ConfigError as error:
            assert str(error).startswith("damaged.motion: ") and "\n" not in str(error)
        else:
            assert parse(text_of(script)) == script


def test_names_that_no_text_has_are_not_printed() -> None:
    tree = parse("a").sequence
    broken = ScriptTerm(ClipName('a"b', quoted=True))
    overlay = type(tree.overlays[0])((broken,))
    with pytest.raises(ConfigError, match="clip: cannot be quoted"):
        text_of(Script((), type(tree)((overlay,))))
    assert text_of(Script((Define("x", tree),), tree)) == "x = a;\na\n"


def test_scripts_in_files(tmp_path) -> None:
    path = tmp_path / "бег.motion"
    path.write_text(SEED)
    assert read_script(path) == parse(SEED)
    path.write_bytes(b"\xff")
    with pytest.raises(ConfigError, match="cannot be read"):
        read_script(path)


def test_the_clips_of_a_script_are_known_by_name() -> None:
    script = parse('both = (kick | "a b" on arms) * 2; <up> -> both -> (walk[0:1] -> stand) @ 2')
    assert clip_names(script) == {"kick", "a b", "both", "up", "walk", "stand"}


def test_a_table_is_read_back_and_may_be_edited(tmp_path: Path) -> None:
    """Of 200 random scripts the table is the script; a cell that is changed changes its term, a row
    that is added happens at once, a column that is added comes next."""
    rng = np.random.default_rng(7)
    for _ in range(200):
        script = without_brackets(random_script(rng))
        assert parse(text_of_table(table_of(script))) == script
    file = tmp_path / "edited.csv"
    file.write_text(to_csv(parse("squat -> (punch | wave on left_arm)")))
    assert read_table(file) == without_brackets(parse("squat -> (punch | wave on left_arm)"))
    file.write_text(",->,->{cross}\nbow,punch,stand\n,wave on left_arm,\n")
    assert find_script(str(file)) == parse("bow -> punch | wave on left_arm ->{cross} stand")
    for text, words in (
        (",->\nbow\n", "column 2 has not a term"),
        ("bow,punch\n", "row of arrows"),
    ):
        file.write_text(text)
        with pytest.raises(ConfigError, match=words):
            read_table(file)


def test_a_csv_of_numbers_is_a_clip(tmp_path) -> None:
    """A table of a script begins with an arrow or a term, a clip of postures with a number."""
    table, clip = tmp_path / "script.csv", tmp_path / "clip.csv"
    table.write_text(",->\nstand,walk\n", encoding="utf-8")
    clip.write_text("-0.013,0.2,0.79\n", encoding="utf-8")
    assert names_script(str(table)) and not names_script(str(clip))
    assert names_script(str(tmp_path / "missing.csv"))  # the reader says that it is not there
