"""A rollout recorded by a policy's authors, compared with its description."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from poise.baselines.policy_files.controller import PolicyFile, observer_of
from poise.baselines.policy_files.motion.track import MOTION_TERMS
from poise.baselines.policy_files.networks import OnnxNetwork
from poise.baselines.policy_files.terms import CLOCKS, COMMANDS, Seen, TermPlace, meaning
from poise.configs.archives import read_archive, read_arrays
from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation

CLOSE = 1e-3  # of an observation's numbers, which others compute in 32 bits from other states
SAME = 1e-4  # of actions from the same observations
UNIT = 0.01  # of the length of a direction
#: terms that a rollout does not tell: they follow what was commanded
COMMANDED = (*COMMANDS, *CLOCKS, *MOTION_TERMS)


@dataclass(frozen=True)
class RecordedRollout:
    """T steps of a policy, recorded by its authors.

    Attributes:
        observations: (T, n) values of each input of the network; "" stands for the only one.
        actions: (T, na) its outputs.
        qpos, qvel: (T, nq), (T, nv) states in MuJoCo's order; None: not recorded.
        memories: (T, …) its recurrent state before each step, by name; empty: not recorded.
    """

    observations: dict[str, np.ndarray]
    actions: np.ndarray
    qpos: np.ndarray | None = None
    qvel: np.ndarray | None = None
    memories: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class Finding:
    """What was compared, whether it is right (None: undecided), and by how much."""

    what: str
    right: bool | None
    text: str


def read_rollout(
    path: Path, inputs: Sequence[str] = ("",), memories: Sequence[str] = ()
) -> RecordedRollout:
    """Return the arrays of an .npz file: `observations` and `actions`, and what else it has.

    `qpos` and `qvel` are the states. Of a network that remembers the file may hold each memory
    before each step, by its name; of one with several inputs it holds each of them by its name in
    the place of `observations`.

    Raises ConfigError for a file without the first two, and for arrays of other shapes.
    """
    names = {each: each or "observations" for each in inputs}
    held = {name.removesuffix(".npy") for name in read_archive(path).names}
    states = [name for name in ("qpos", "qvel") if name in held]
    known = [name for name in memories if name in held]
    arrays = read_arrays(path, (*names.values(), "actions", *states, *known))
    steps = {len(values) for values in arrays.values() if values.ndim}
    flat = {name: values.reshape(len(values), -1) if values.ndim > 2 and 1 in values.shape[1:]
            else values for name, values in arrays.items() if name not in known}  # fmt: skip
    if len(steps) != 1 or any(flat[name].ndim != 2 for name in (*names.values(), "actions")):
        shapes = ", ".join(f"{name} {values.shape}" for name, values in arrays.items())
        raise ConfigError(f"needs (T, n) observations and (T, na) actions, not {shapes}",
                          source=path)  # fmt: skip
    return RecordedRollout({each: flat[name] for each, name in names.items()}, flat["actions"],
                   **{name: flat[name] for name in states},
                   memories={name: arrays[name] for name in known})  # fmt: skip


def compare_rollout(policy: PolicyFile, source: Path) -> list[Finding]:
    """Return the findings of a rollout file about a policy's network and its observation.

    Raises ConfigError as `read_rollout`, and for observations or actions of another size.
    """
    inputs, memories = policy.observer.sizes, policy.network.memories()
    rollout = read_rollout(source, list(inputs), list(memories))
    given = {name: rows.shape[1] for name, rows in rollout.observations.items()}
    actions = rollout.actions.shape[1], len(policy.action)
    for name, size in inputs.items():
        if (given[name], actions[0]) != (size, actions[1]):
            raise ConfigError(f"has {given[name]} {name or 'observations'} and {actions[0]} "
                              f"actions, the description {size} and {actions[1]}",
                              source=source)  # fmt: skip
    return [*_network(policy, rollout), *_terms(policy, rollout)]


def _network(policy: PolicyFile, rollout: RecordedRollout) -> Iterator[Finding]:
    """Yield whether the network answers as it did, and remembers what it did."""
    network, worst = policy.network, 0.0
    apart = dict.fromkeys(rollout.memories, 0.0)
    network.reset()
    for step, action in enumerate(rollout.actions):
        given = {name: rows[step] for name, rows in rollout.observations.items()}
        if step == 0:
            policy.warm_up(given)
        before = network.memories()
        for name, rows in rollout.memories.items():
            if step:
                off = np.max(np.abs(before[name].ravel() - rows[step].ravel()))
                apart[name] = max(apart[name], float(off))
        network.remember({name: rows[step] for name, rows in rollout.memories.items()})
        worst = max(worst, float(np.max(np.abs(network.act(given)["action"] - action))))
    remembers = isinstance(network, OnnxNetwork) and bool(network.memories())
    network.reset()
    hint = ""
    if worst > SAME and remembers and not rollout.memories:
        hint = ("; it was asked from zeros: a rollout that begins later needs what it remembered "
                f"before each step, {', '.join(network.memories())} (T, …)")  # fmt: skip
    yield Finding("network", worst <= SAME, f"its actions differ by {worst:.1g} at most{hint}")
    for name, off in apart.items():
        yield Finding(f"memory {name}", off <= SAME, f"differs by {off:.1g} at most")


def _terms(policy: PolicyFile, rollout: RecordedRollout) -> Iterator[Finding]:
    """Yield each term of the observation, at the first place of each age."""
    for name, places in policy.observer.places().items():
        for place in places:
            where = f"{place.term.term} at {place.start}:{place.start + place.size}"
            where = f"{name}: {where}" if name else where
            if place.age:
                where += f", {place.age} steps ago"
            yield Finding(where, *_judged(place, name, policy, rollout))


def _judged(
    place: TermPlace, name: str, policy: PolicyFile, rollout: RecordedRollout
) -> tuple[bool | None, str]:
    """Return whether a term of an input is right, and what was found of it."""
    observed = rollout.observations[name][place.age + 1 :]
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
    return None, "undecided without states (qpos, qvel)"


def _expected(place: TermPlace, policy: PolicyFile, rollout: RecordedRollout) -> np.ndarray | None:
    """What a term showed from the step `age` + 1 on; None where that is not known."""
    states = rollout.qpos is not None and rollout.qvel is not None
    name = meaning(place.term)
    if name in COMMANDED or place.term.at_rest is not None:
        return None
    if not states and name not in ("last_action", "constant"):
        return None
    now = replace(place.term, history=1, lag=0)
    config = replace(policy.config, observations=(now,), history="term")
    joints = policy.joints
    alone = observer_of(policy.robot, config, joints)
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
    """Return the place at which a term lies in the observations; None where it lies nowhere."""
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
