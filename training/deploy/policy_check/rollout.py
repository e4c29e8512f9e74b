"""A rollout that a policy's maker recorded, and what it tells of a description."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.policy_files.observations import Observer
from poise.baselines.policy_files.terms import Place, Seen, meaning
from poise.configs.archives import read_arrays
from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation

CLOSE = 1e-3  # of an observation's numbers, which others compute in 32 bits from other states
SAME = 1e-4  # of actions from the same observations
UNIT = 0.01  # of the length of a direction
#: terms that a rollout does not tell: they follow what was commanded
COMMANDED = ("velocity_commands", "phase", "phase_sin", "phase_cos")


@dataclass(frozen=True)
class Rollout:
    """Steps of a policy as its maker saw them: T of them.

    Attributes:
        observations: (T, n) what the network was given.
        actions: (T, na) what it answered.
        qpos, qvel: (T, nq), (T, nv) the states, as MuJoCo has them of this robot; None: not told.
    """

    observations: np.ndarray
    actions: np.ndarray
    qpos: np.ndarray | None = None
    qvel: np.ndarray | None = None


@dataclass(frozen=True)
class Finding:
    """What was compared, whether it is right (None: that cannot be told), and by how much."""

    what: str
    right: bool | None
    text: str


def read_rollout(path: Path) -> Rollout:
    """The arrays `observations` and `actions` of an .npz file; `qpos` and `qvel`, if it has them.

    Raises ConfigError for a file without the first two, and for arrays of other shapes.
    """
    arrays = read_arrays(path, ("observations", "actions"))
    with suppress(ConfigError):  # states need not be told
        arrays |= read_arrays(path, ("qpos", "qvel"))
    rollout = Rollout(**{name: np.squeeze(values) for name, values in arrays.items()})
    steps = {len(values) for values in arrays.values()}
    if len(steps) != 1 or rollout.observations.ndim != 2 or rollout.actions.ndim != 2:
        shapes = ", ".join(f"{name} {values.shape}" for name, values in arrays.items())
        raise ConfigError(f"needs (T, n) observations and (T, na) actions, not {shapes}",
                          source=path)  # fmt: skip
    return rollout


def compare(policy: PolicyFile, rollout: Rollout, source: Path) -> list[Finding]:
    """What a rollout tells of a policy's network and of how its observation is put together.

    Raises ConfigError for a policy with several inputs, and for observations or actions of another
    size.
    """
    if len(policy.observer.sizes) != 1:
        raise ConfigError("a rollout of one input can be compared, not of several", source=source)
    sizes = *policy.observer.sizes.values(), len(policy.action)
    given = rollout.observations.shape[1], rollout.actions.shape[1]
    if sizes != given:
        raise ConfigError(f"has {given[0]} observations and {given[1]} actions, the description "
                          f"{sizes[0]} and {sizes[1]}", source=source)  # fmt: skip
    return [_network(policy, rollout), *_terms(policy, rollout)]


def _network(policy: PolicyFile, rollout: Rollout) -> Finding:
    """Whether the network answers as it did."""
    policy.network.reset()
    (name,) = policy.observer.sizes
    answers = [policy.network.act({name: each})["action"] for each in rollout.observations]
    policy.network.reset()
    worst = float(np.max(np.abs(np.array(answers) - rollout.actions)))
    return Finding("network", worst <= SAME, f"its actions differ by {worst:.1g} at most")


def _terms(policy: PolicyFile, rollout: Rollout) -> Iterator[Finding]:
    """Each term of the observation, at the first place of each age."""
    (places,) = policy.observer.places().values()
    for place in places:
        where = f"{place.term.term} at {place.start}:{place.start + place.size}"
        if place.age:
            where += f", {place.age} steps ago"
        yield Finding(where, *_judged(place, policy, rollout))


def _judged(place: Place, policy: PolicyFile, rollout: Rollout) -> tuple[bool | None, str]:
    """Whether a term is right, and what was found of it."""
    observed = rollout.observations[place.age + 1 :]
    shown = observed[:, place.start : place.start + place.size]
    expected = _expected(place, policy, rollout)
    if expected is not None and len(expected):
        right, text = _compared(expected, shown)
        other = None if right else _lies(expected, observed)
        return right, text if other is None else f"lies at {other}:{other + place.size}"
    if meaning(place.term) == "projected_gravity":
        lengths = np.linalg.norm(shown / np.array(place.term.scale), axis=1)
        worst = float(np.max(np.abs(lengths - 1.0)))
        return worst < UNIT, f"its length is 1 within {worst:.1g}"
    return None, "cannot be told without states (qpos, qvel)"


def _expected(place: Place, policy: PolicyFile, rollout: Rollout) -> np.ndarray | None:
    """What a term showed from the step `age` + 1 on; None where that is not known."""
    states = rollout.qpos is not None and rollout.qvel is not None
    name = meaning(place.term)
    if name in COMMANDED or place.term.at_rest is not None:
        return None
    if not states and name not in ("last_action", "constant"):
        return None
    now = replace(place.term, history=1, lag=0)
    config = replace(policy.config, observations=(now,), history="term")
    joints, names = policy.joints, policy.robot.joint_names
    known, moved = ([names[i] for i in each] for each in (joints.index, joints.moved))
    alone = Observer(config, known, moved, "")
    simulation, found = Simulation(policy.robot), []
    for step in range(1, len(rollout.actions) - place.age):
        if rollout.qpos is not None and rollout.qvel is not None:
            simulation.reset(rollout.qpos[step], rollout.qvel[step])
        state = simulation.state
        seen = Seen(state, state.q[joints.index], state.qvel[6:][joints.index], joints.default,
                    rollout.actions[step - 1], np.zeros(3), 0.0, np.zeros(1))  # fmt: skip
        found.append(alone.observe(seen)[""])
    return np.array(found)


def _lies(expected: np.ndarray, observations: np.ndarray) -> int | None:
    """The place at which a term lies in the observations; None where it lies nowhere."""
    size = expected.shape[1]
    moves = np.ptp(expected, axis=0).max() > CLOSE  # constants lie everywhere
    for start in range(observations.shape[1] - size + 1) if moves else ():
        if np.max(np.abs(observations[:, start : start + size] - expected)) <= CLOSE:
            return start
    return None


def _compared(expected: np.ndarray, shown: np.ndarray) -> tuple[bool, str]:
    """Whether two histories of a term are the same; where they differ, by which factor or place."""
    worst = float(np.max(np.abs(expected - shown)))
    if worst <= CLOSE:
        return True, f"differs by {worst:.1g} at most"
    size = float(np.sum(expected * expected))
    factor = float(np.sum(expected * shown)) / size if size > 0.0 else 0.0
    if np.max(np.abs(factor * expected - shown)) <= CLOSE:
        return False, f"is {factor:.3g} times what is described: its scale?"
    order = _order(expected, shown)
    if order is not None:
        return False, f"has another order: {order}"
    return False, f"differs by {worst:.2g}: another term, place or zero?"


def _order(expected: np.ndarray, shown: np.ndarray) -> list[int] | None:
    """The places in `expected` of the columns of `shown`; None where they are not the same ones."""
    found = [int(np.argmin(np.max(np.abs(expected - column[:, None]), axis=0)))
             for column in shown.T]  # fmt: skip
    same = np.max(np.abs(expected[:, found] - shown)) <= CLOSE
    return found if same and len(set(found)) == len(found) else None
