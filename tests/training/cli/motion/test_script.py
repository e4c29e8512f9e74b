"""`poise motion graph`, `plan` and `synth`: files in and out, and errors as one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.graphs.motion_graph import read_graph
from poise.training.cli.entry import main
from tests.support.motion_files import small_bvh

THREE = ["humanoid_stand", "humanoid_squat", "humanoid_punch"]
PACKAGED = "poise.training.motion.following.scripts.packaged_clips"


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("graph") / "graph.yaml"
    state = ["--state", "up=humanoid_stand@0.5", "--plot", str(path.with_suffix(".png"))]
    assert main(["motion", "graph", *THREE, "--out", str(path), *state]) == 0
    return path


def test_a_graph_of_clips(graph: Path) -> None:
    made = read_graph(graph)
    assert list(made.names) == THREE and set(made.states) == {"up"}
    assert made.between("humanoid_stand", "humanoid_squat")
    assert graph.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_a_plan_and_its_table(graph: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = "stand -> (squat | punch on arms)"
    assert main(["motion", "plan", script, "--graph", str(graph), "--k", "2", "--table"]) == 0
    printed = capsys.readouterr().out
    assert "way 1, cost" in printed and "way 2, cost" in printed
    assert ",->\nstand,squat\n,punch on arms\n" in printed


def test_a_script_becomes_a_file_and_the_record_of_it(
    graph: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, script = tmp_path / "out.bvh", tmp_path / "own.motion"
    script.write_text("# own\nstand -> squat\n")
    ends = ["--from", "up", "--to", "up"]
    assert (
        main(["motion", "synth", str(script), "--graph", str(graph), "--out", str(out), *ends]) == 0
    )
    record = json.loads(out.with_suffix(".plan.json").read_text())
    clip = read_bvh(out, "m", "y", "z").clip
    assert clip.duration == pytest.approx(record["duration"], abs=0.02)
    assert record["script"] == "<up> -> stand -> squat -> <up>\n" and record["seconds"] > 0.0
    assert record["parts"][-1]["ends"] == pytest.approx(record["duration"])


def test_a_script_is_performed_by_one_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is left of its motion, and the report has its timeline."""
    monkeypatch.setattr(PACKAGED, lambda: THREE[:2])  # retargeting takes a second or two a clip
    script, page = tmp_path / "own.motion", tmp_path / "page.html"
    script.write_text("stand[0:1] -> squat[0.7:2]\n")
    follow = ["motion", "follow", str(script), "--starts", "1", "--report", str(page)]
    assert main(follow) == 0
    assert "own by momentum-qp on humanoid, not pushed" in capsys.readouterr().out
    assert "squat" in page.read_text()
    assert {path.name for path in tmp_path.iterdir()} == {"own.motion", "page.html"}


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["plan", "squat ->"], 'script: line 1, column 9: after "->" a motion is missing'),
        (["plan", "jump"], "script: line 1, column 1: no motion 'jump' (choices: humanoid_stand"),
        (["plan", "no.motion"], "no.motion: cannot be read (No such file or directory)"),
        (["synth", "squat", "--out", "x.npz"], "x.npz: out: must be the name of a .npz or .bvh"),
        (["synth", "squat", "--out", "x.npz", "--robot", "humanoid"], "robot: is of no robot, not"),
        (["synth", "squat", "--out", "x.bvh", "--from", "lie"], "no posture 'lie' (choices: up,"),
    ],
)
def test_errors_are_one_line_and_exit_code_2(
    arguments: list[str], text: str, graph: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(["motion", *arguments, "--graph", str(graph)]) == 2
    error = capsys.readouterr().err
    assert text in error and error.count("\n") == 1


def test_a_misspelt_clip_is_said_before_any_is_loaded(
    graph: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """To retarget them for a robot takes a minute; also of a graph, and in brackets."""
    monkeypatch.setattr("poise.training.motion.following.scripts.load_clips", pytest.fail)
    said = "column 11: no motion 'sqaut', did you mean squat? (choices: "
    for more in (["--robot", "humanoid"], [], ["--graph", str(graph)]):
        assert main(["motion", "plan", "stand -> (sqaut * 2)", *more]) == 2
        assert said in capsys.readouterr().err


def test_wrong_settings_of_a_graph(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "w.yaml").write_text(
        "weights:\n- {before: humanoid_stand, after: x, weight: 1.0}\n"
    )
    (tmp_path / "v.yaml").write_text("weight: []\n")
    (tmp_path / "other.bvh").write_text(small_bvh())
    for more, text in (
        (["--least", "3"], "graph: least 3 s is more than most 2 s"),
        (
            ["--state", "up=standing"],
            "state: must be NAME=CLIP@SECONDS, not 'up=standing'",
        ),
        (["--state", "up=x@1"], "graph: no clip is called 'x'"),
        (["--weights", "w.yaml"], "graph: no clip is called 'x'"),
        (["--weights", "v.yaml"], "v.yaml: must hold a list, weights, and nothing else"),
        (["other.bvh"], "other: clips: has another skeleton than 'humanoid_stand'"),
        (["x.npz"], "x.npz: cannot be read"),
    ):
        assert main(["motion", "graph", "humanoid_stand", *more, "--out", "g.yaml"]) == 2
        assert text in capsys.readouterr().err


def test_a_clip_that_changed_is_noticed(
    graph: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = graph.read_text()
    digest = read_graph(graph).clips[0].digest
    other = tmp_path / "other.yaml"
    other.write_text(text.replace(digest, "sha256:0"))
    assert main(["motion", "plan", "stand", "--graph", str(other)]) == 2
    assert "clips.humanoid_stand: is not the file that it was" in capsys.readouterr().err
