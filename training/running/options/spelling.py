"""Older and alternative spellings of options, and suggestions for a wrong one."""

from collections.abc import Iterable, Mapping, Sequence

from poise.configs.errors import meant

#: command → alternative spelling → option
ALSO: Mapping[str, Mapping[str, str]] = {
    "replay": {"--controller": "--controllers"},
    "view": {"--controller": "--controllers"},
    **{name: {"--controllers": "--controller"} for name in ("walk", "tune", "qp-set", "train")},
}
#: commands with controllers as positional arguments → flags that are accepted for them
BEFORE = {"evaluate": ("--controllers", "--controller"),
          "benchmark": ("--controllers", "--controller")}  # fmt: skip


def respelled(command: str, args: Sequence[str]) -> list[str]:
    """Return the arguments of a command in its own spelling."""
    names, before = ALSO.get(command, {}), BEFORE.get(command, ())
    front: list[str] = []
    rest: list[str] = []
    into = rest
    for arg in args:
        flag, equals, value = arg.partition("=")
        if flag in before:
            into = front
            front += [value] if equals else []
            continue
        if arg.startswith("--"):
            into = rest
        into.append(f"{names.get(flag, flag)}{equals}{value}" if arg.startswith("--") else arg)
    return front + rest


def suggestion(flag: str, options: Iterable[str]) -> str:
    """Return a hint for an unknown option: the most similar one, or an empty text.

    An option of a section is also found by its last name: --gamma suggests --ppo.gamma.
    """
    options, flag = list(options), flag.replace("_", "-")
    last = {name.rpartition(".")[2].lstrip("-"): name for name in reversed(options)}
    if (own := flag.lstrip("-")) in last:
        return f", did you mean {last[own]}?"
    if hint := meant(flag, options):
        return hint
    near = meant(own, last)
    return f", did you mean {last[near[15:-1]]}?" if near else ""
