"""Older and other spellings of options, and what a wrong one looks like."""

from collections.abc import Iterable, Mapping, Sequence

from poise.configs.errors import meant

#: command → how an option may be spelled, too, and how it is called there
ALSO: Mapping[str, Mapping[str, str]] = {
    "replay": {"--controller": "--controllers"},
    "view": {"--controller": "--controllers"},
    **{name: {"--controllers": "--controller"} for name in ("walk", "tune", "qp-set", "train")},
}
#: commands that take controllers before the flags, and may be given them behind one
BEFORE = {"evaluate": ("--controllers", "--controller"),
          "benchmark": ("--controllers", "--controller")}  # fmt: skip


def respelled(command: str, args: Sequence[str]) -> list[str]:
    """The arguments of a command as it calls them."""
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
    """What an error of an unknown option adds: the one that it looks like, if any.

    An option of a section is found by its own name, too: --gamma is --ppo.gamma.
    """
    options, flag = list(options), flag.replace("_", "-")
    last = {name.rpartition(".")[2].lstrip("-"): name for name in reversed(options)}
    if (own := flag.lstrip("-")) in last:
        return f", did you mean {last[own]}?"
    if told := meant(flag, options):
        return told
    near = meant(own, last)
    return f", did you mean {last[near[15:-1]]}?" if near else ""
