"""Checks of policies, and the policies that are known, for people in the terminal."""

from collections.abc import Callable

from rich.console import Console

from poise.baselines.allowance import is_script
from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.known import PLACES, Known, find_network, how_to_get, places
from poise.baselines.policy_files.refused import refused_families
from poise.training.running.tables import text_table

from .check import PolicyCheck
from .guess import CLOCK, WORDS
from .proposals import SECONDS as TRIED
from .standing import SECONDS, Stood

OPEN = {
    "history": "not said: how its history lies; each usual order was tried:",
    "clock": "not said: what its clock shows at rest; tried:",
}
VERDICTS = {True: "right", False: "WRONG", None: "undecided"}


def print_policies(known: list[Known], console: Console) -> None:
    """The known policies: whose, for which robot, and whether they are here."""
    missing, rows = [], []
    for each in known:
        found, origin = find_network(each.origin), each.origin
        here = str(found.network or "no")
        if found.network is None:
            missing.append(each)
            for other in found.others:
                here = f"no: {other} has another sum than the known one"
        elif is_script(found.network):
            here += " (TorchScript: --allow it)"
        project, rate = f"{origin.project} {origin.commit}", f"{1.0 / each.period:g}"
        rows.append((each.name, origin.robot, rate, project, origin.licence, here))
    headings = ("policy", "robot", "Hz", "project, commit", "licence", "here")
    table = text_table("", headings, (), rows)
    table.columns[0].no_wrap = True
    console.print(table)
    looked = dict.fromkeys(str(place) for each in known for place in places(each.origin))
    console.print(f"looked for, by size and SHA-256, in the folders of {PLACES}, in checkouts of "
                  "the projects here or beside the repository, and in ../shared/rivals: "
                  f"{', '.join(looked) or 'none of them is there'}",
                  markup=False, highlight=False)  # fmt: skip
    for name, refused in refused_families().items():
        console.print(f"{name}: not described: {refused}", markup=False, highlight=False)
    for each in missing:
        name, file = next(iter(each.origin.files.items()))
        path = f"{each.origin.folder}/{name}" if each.origin.folder else name
        console.print(f"{each.name}: {how_to_get(each.origin)}; {path}, SHA-256 {file.sha256}",
                      markup=False, highlight=False)  # fmt: skip


def print_policy_check(check: PolicyCheck, console: Console) -> None:
    """What is known, what is missing, how it stood, what the rollout tells, and the verdict."""

    def say(line: str) -> None:
        console.print(line, markup=False, highlight=False)

    sides = [", ".join(f"{name} {size or '?'}" for name, size in side.items())
             for side in (check.sizes.inputs, check.sizes.outputs)]  # fmt: skip
    say(f"{check.file}: takes {sides[0]}; gives {sides[1]}")
    if check.known is not None:
        say(f"it is {check.known}, a known policy: that name plays it, too")
    if check.sizes.gives_clip:
        say("it tracks a motion, whose frames it gives for each time_step: motion: {clip: network}")
    if check.held:
        say("it tracks a motion, of which the first frame is held here: poise motion follow CLIP "
            f"--controller {check.known or check.file} plays one")  # fmt: skip
    if check.stood is None:
        _say_missing(check, say)
        return
    for name in check.unsaid:
        taken = getattr(PolicyFileConfig(), name)
        if name == "joints":
            taken = "the robot's first joints, in its order,"
        words = {**WORDS, **CLOCK}[name]
        say(f"not said: {name} ({words}); {taken} {'are' if name == 'joints' else 'is'} taken")
    _say_tried(check, say)
    described = "as it is described, it " if check.proposed is not None and not check.amends else ""
    say(described + _how(check.stood, SECONDS))
    for finding in check.findings:
        say(f"  {VERDICTS[finding.right]}: {finding.what}: {finding.text}")
    say(_verdict(check))


def _how(stood: Stood, seconds: float) -> str:
    """Return how it stood, for so many seconds."""
    if stood.fell is not None:
        return f"fell after {stood.fell:.2f} s"
    return (f"stood for {seconds:g} s, {'at rest' if stood.rests else 'never at rest'}, "
            f"{1000.0 * stood.moved:.0f} mm from where it began")  # fmt: skip


def _say_tried(check: PolicyCheck, say: Callable[[str], None]) -> None:
    """The readings that were tried of what is left open, and the one that is proposed."""
    for what in dict.fromkeys(each.what for each in check.tried):
        say(OPEN[what])
        for each in check.tried:
            if each.what == what:
                say(f"  {each.name}: {_how(each.stood, TRIED)}")
    if sum(each.stood.fell is None for each in check.tried if each.what == "history") > 1:
        say("more than one of them stands: a rollout (--rollout) tells which is right")
    if check.proposed is not None:
        say(f"proposed: {check.proposed.name}, which does best; in the description:")
        say(check.proposed.lines)


def _say_missing(check: PolicyCheck, say: Callable[[str], None]) -> None:
    """What a description needs, and one to begin with."""
    if not check.layouts:
        say("no usual observation has that size")
    for layout in check.layouts:
        say(f"perhaps {layout}")
    say("nothing describes its observation; a description needs, in its authors' terms:")
    for name in check.unsaid:
        say(f"  {name}: {WORDS[name]}")
    say("to begin with, in a .yaml file beside it:")
    say(_skeleton(check))


def _skeleton(check: PolicyCheck) -> str:
    """Return a description with places to fill in."""
    lines = ["kind: policy-file", f"policy: {check.file.rpartition('/')[2]}"]
    lines += [f"{name}: ...  # {WORDS[name]}" for name in check.unsaid if name != "observations"]
    if check.sizes.gives_clip:
        lines.append("motion: {clip: network}")
    lines.append("observations:")
    for layout in check.layouts[:1]:
        names = [name for term in layout.terms for name in term.split(", ")]
        history = f", history: {layout.steps}" if layout.steps > 1 else ""
        lines += [f"  - {{term: {name.split()[0]}{history}}}" for name in names]
    return "\n".join(lines)


def _verdict(check: PolicyCheck) -> str:
    wrong = sum(each.right is False for each in check.findings)
    if wrong:
        return f"the adapter is wrong: {wrong} of {len(check.findings)} findings speak against it"
    if check.amends and check.stood is not None and check.stood.fell is None:
        return "it stands, read as proposed: its own description does not fit its network"
    if check.stood is not None and check.stood.fell is not None:
        return "it does not stand: another robot, gains, order of joints, or term than its own"
    if not check.findings:
        return ("standing is evidence, not proof: --rollout compares it with steps recorded by its "
                "authors")  # fmt: skip
    right = sum(each.right is True for each in check.findings)
    return f"the adapter is right, as far as {right} of {len(check.findings)} findings show"
