"""The extras of the package, and how they are installed."""


def how_to_install(extra: str) -> str:
    """The commands that install an extra such as "view", for a message or a docstring."""
    return f"pip install 'poise[{extra}]', in a checkout pip install -e '.[{extra}]'"
