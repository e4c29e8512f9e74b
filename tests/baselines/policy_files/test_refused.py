"""baselines/policy_files/refused.py: families that are known and are not described."""

from __future__ import annotations

import pytest

from poise.baselines.policy_files.refused import check_not_refused, refused_families
from poise.configs.files import packaged
from poise.training.cli.entry import main
from tests.support.refused import invalid


@pytest.mark.parametrize("name", ["amo", "amo-g1", "AMO", "wbc-agile", "wbc_agile_g1", "homie"])
def test_a_family_is_refused_by_name(name: str) -> None:
    """With why, the project, its commit and licence."""
    with invalid("controller", name.lower().replace("_", "-").removesuffix("-g1"), source=name):
        check_not_refused(name)


def test_other_names_are_not(capsys: pytest.CaptureFixture[str]) -> None:
    """No packaged description, nor a name of nothing."""
    for name in (*packaged("rivals"), "momentum-qp", "nothing", "tamo"):
        check_not_refused(name)
    assert set(refused_families()).isdisjoint(packaged("rivals"))


def test_a_command_says_which_file_git_lfs_has_where(capsys: pytest.CaptureFixture[str]) -> None:
    """One line and exit code 2; the list of policies has it, too."""
    assert main(["evaluate", "gr00t-decoupled-wbc", "--robot", "compact"]) == 2
    error = capsys.readouterr().err
    assert len(error.strip().splitlines()) == 1
    for part in (
        "GR00T-WholeBodyControl-Walk.onnx is a pointer of Git LFS there, to 1886682 bytes",
        "7c82255b6905ffcc4468fa7f8ddcf7b70db168cf1042107ccab887cb6a8e5407",
        "take turns",
    ):
        assert part in error
    assert main(["policies"]) == 0
    assert "homie: not described: its licence" in " ".join(capsys.readouterr().out.split())
