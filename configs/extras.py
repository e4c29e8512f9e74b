"""The extras of the package, and how they are installed."""


def how_to_install(extra: str) -> str:
    """The command that installs an extra such as "view", for a message or a docstring.

    Poise is on no index yet: it runs in the checkout that Poise is installed from.
    """
    return f"pip install -e '.[{extra}]' in the checkout of Poise"
