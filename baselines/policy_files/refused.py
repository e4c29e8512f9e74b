"""Public families of policies that are known and that no description plays, and why."""

from dataclasses import dataclass, field

from poise.configs.errors import ConfigError
from poise.configs.files import packaged_folder
from poise.configs.reading import read_yaml
from poise.configs.schema import build

from .config import KnownFile
from .known import RIVALS

FILE = "not-described/families.yaml"


@dataclass(frozen=True)
class Refused:
    """A family that is not described.

    Attributes:
        project: ``owner/name`` at GitHub.
        commit: of that project, as it was looked at.
        licence: of the networks.
        reason: why it is not described.
        pointers: path → the file that a pointer of Git LFS stands for there.
    """

    project: str
    commit: str
    licence: str
    reason: str
    pointers: dict[str, KnownFile] = field(default_factory=dict)

    def __str__(self) -> str:
        """One line: why, from where, and what Git LFS is still to fetch."""
        files = "; ".join(f"{path} is a pointer of Git LFS there, to {each.bytes} bytes of SHA-256 "
                          f"{each.sha256}" for path, each in self.pointers.items())  # fmt: skip
        where = f"{self.project} {self.commit}, {self.licence}"
        return f"{self.reason} ({where}{'; ' if files else ''}{files})"


def refused_families() -> dict[str, Refused]:
    """The families by their names; raises ConfigError as `build`."""
    path = packaged_folder(RIVALS) / FILE
    return {name: build(Refused, data, f"{path}: {name}") for name, data in read_yaml(path).items()}


def check_not_refused(name: str) -> None:
    """Raise ConfigError, which says why, for the name of such a family, with a robot's or without.

    ``amo``, ``amo-g1`` and ``AMO`` are the same.
    """
    known = refused_families()
    plain = name.lower().replace("_", "-")
    asked = [each for each in known if plain == each or plain.startswith(f"{each}-")]
    if asked:
        raise ConfigError(f"{asked[0]} is known and is not described: {known[asked[0]]}; write a "
                          "description of your own, see poise policies check", source=name,
                          field="controller")  # fmt: skip
