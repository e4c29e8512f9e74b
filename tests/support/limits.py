"""Limits that bind where a pushed humanoid recovers."""

#: kind → a limit of the humanoid that some ticks of `recovery` run into
EXAMPLES = {
    "torque": {"joints": ["*_knee", "abdomen_*"], "share": 0.3},
    "joint-speed": {"joints": ["*_knee", "*_shoulder*"], "largest": 0.1},
}


def described(*names, **changes):
    """The `limits` of a configuration: some examples, each under its kind."""
    return {name: {"kind": name, **EXAMPLES[name], **changes} for name in names or EXAMPLES}
