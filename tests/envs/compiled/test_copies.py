"""envs/compiled/copies.py: copies go on like their originals, and move nothing but themselves."""

from __future__ import annotations

import copy
import functools
import gc
import multiprocessing
import os
import pickle
import signal
import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.plugins import PluginController
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.configs.errors import PoiseError
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.balance.vector.scheduler import StepSchedule
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import CompiledStep, address_of
from poise.envs.compiled.jit import compiled
from poise.envs.physics.simulation import Simulation
from tests.support.copied import BEFORE, KEEPS_TO_ITSELF, KINDS, digest, env_of, outcome, play_env
from tests.support.shared import robot
from tests.support.weekly import daily

PATIENCE = 120.0  # [s] until a process counts as hung
OF_CONTROLLERS = [name for name in KINDS if name.startswith("env of ")]  # alike but for these
PLAYED = [*(name for name in KINDS if name not in OF_CONTROLLERS), *daily(OF_CONTROLLERS)]


def pickled(it: Any) -> Any:
    return pickle.loads(pickle.dumps(it))


WAYS = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": pickled,
    "twice": lambda it: copy.deepcopy(pickled(pickled(it))),
}


def ways(name: str) -> list[str]:
    """A shallow copy of what is not ours, a wrapper or a dictionary, holds the same environment.

    Environments of packaged controllers differ in these alone: the two ways that hold the others.
    """
    if name.startswith("env of "):
        return ["copy", "twice"]
    ours = KINDS[name][1].__name__ != "play_loop" and name != "wrapped"
    return [way for way in WAYS if ours or way != "copy"]


@pytest.fixture(scope="module", autouse=True)
def left_behind() -> Iterator[None]:
    """What imports and other tests have left is not searched for garbage again for every kind."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


class Played(NamedTuple):
    """One of a kind and its copies, made in the midst of its work and gone on with.

    Attributes:
        data: it, pickled then.
        expected: how the original goes on.
        seen: way of copying → how the copy goes on.
        apart: way of copying → whether arrays overlap as in the original, and none of its own.
    """

    data: bytes
    expected: str
    seen: dict[str, str]
    apart: dict[str, bool]


@functools.cache
def played(name: str) -> Played:
    """Copies are played before the original, after it, and when it is gone."""
    it = KINDS[name][0]()
    data = pickle.dumps(it)
    twins = {way: WAYS[way](it) for way in ways(name)}
    mine = arrays_in(it)
    apart = {way: is_apart(mine, twin) for way, twin in twins.items() if way != "copy"}
    first, *others = twins
    seen = {first: outcome(name, twins[first])}
    expected = outcome(name, it)
    del it, mine
    gc.collect()
    seen |= {way: outcome(name, twins[way]) for way in others}
    return Played(data, expected, seen, apart)


@pytest.mark.parametrize("name", PLAYED)
def test_a_copy_goes_on_like_the_original(name):
    """To the last bit, when the original has gone on or is gone; and it does not move it."""
    _, expected, seen, _ = played(name)
    assert "Error" not in expected, expected
    assert seen == dict.fromkeys(ways(name), expected)


@pytest.mark.parametrize("name", PLAYED)
def test_what_shares_memory_shares_it_in_the_copy(name):
    """The same arrays overlap in the same way, and none overlaps one of the original."""
    apart = played(name).apart
    assert apart and apart == dict.fromkeys(apart, True)


def arrays_in(it: Any, path: str = "", known: dict[int, Any] | None = None) -> dict[str, Any]:
    """Every array, MuJoCo's too, by where it is found first."""
    known = {} if known is None else known
    if id(it) in known or isinstance(it, (type, str, bytes, int, float)):
        return {}
    known[id(it)] = it  # its id stays taken meanwhile
    if isinstance(it, np.ndarray) and not it.dtype.hasobject:
        return {path: it} if it.size else {}
    if isinstance(it, mujoco.MjData):
        return {f"{path}.{name}": getattr(it, name) for name in ("qpos", "qvel", "xpos", "ctrl")}
    parts: dict[str, Any] = {}
    if isinstance(it, dict):
        parts = {f"[{key!r}]": each for key, each in it.items()}
    elif isinstance(it, (list, tuple)):
        parts = {f"[{k}]": each for k, each in enumerate(it)}
    elif type(it).__module__.startswith(("poise.", "gymnasium.")) and hasattr(it, "__dict__"):
        parts = {f".{key}": each for key, each in vars(it).items()}
    found = {}
    for key, each in parts.items():
        found |= arrays_in(each, path + key, known)
    return found


def memory(array: np.ndarray) -> tuple[int, int]:
    """Its first byte, and the one after its last."""
    reach = [(size - 1) * step for size, step in zip(array.shape, array.strides, strict=True)]
    first = array.__array_interface__["data"][0]
    low, high = (sum(bound(each, 0) for each in reach) for bound in (min, max))
    return first + low, first + high + array.itemsize


def sharing(arrays: dict[str, np.ndarray]) -> set[tuple[str, str, int]]:
    """Which of them overlap, and how far apart they begin."""
    spans = sorted((*memory(array), path) for path, array in arrays.items())
    pairs = set()
    for i, (start, end, path) in enumerate(spans):
        for begin, _, other in spans[i + 1 :]:
            if begin >= end:
                break
            first, second = sorted((path, other))
            pairs.add((first, second, begin - start))
    return pairs


def is_apart(mine: dict[str, Any], twin: Any) -> bool:
    """Whether the arrays of a copy overlap as the original's, and none of these."""
    theirs = {path: array for path, array in arrays_in(twin).items() if path in mine}
    assert len(theirs) > 0.9 * len(mine)
    if sharing(theirs) != sharing({path: mine[path] for path in theirs}):
        return False
    spans = [(*memory(array), False) for array in mine.values()]
    spans += [(*memory(array), True) for array in theirs.values()]
    last, whose = 0, False
    for start, end, copied in sorted(spans):
        if start < last and copied != whose:
            return False
        last, whose = max(last, end), copied
    return True


def play_all(data: dict[str, bytes], connection: Any) -> None:
    """In another process: how those that were pickled go on."""
    connection.send({name: outcome(name, pickle.loads(each)) for name, each in data.items()})


@pytest.mark.weekly
def test_pickles_go_on_alike_in_a_spawned_process():
    """Where all addresses are others."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    data = {name: played(name).data for name in KINDS}
    worker = context.Process(target=play_all, args=(data, theirs), daemon=True)
    worker.start()
    theirs.close()
    assert ours.poll(PATIENCE)
    seen = ours.recv()
    worker.join(PATIENCE)
    assert worker.exitcode == 0
    assert seen == {name: played(name).expected for name in KINDS}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_goes_on_alike():
    """Each on its own, vector environments with threads of their own."""
    names = [name for name in KINDS if not name.startswith("env of ")]
    its = {name: KINDS[name][0]() for name in names}
    ours, theirs = multiprocessing.Pipe()
    child = os.fork()
    if child == 0:
        signal.alarm(int(PATIENCE))  # rather than for ever
        theirs.send({name: outcome(name, it) for name, it in its.items()})
        os._exit(0)
    theirs.close()
    seen = {name: outcome(name, it) for name, it in its.items()}
    assert ours.poll(PATIENCE)
    assert ours.recv() == seen
    assert os.waitpid(child, 0)[1] == 0
    assert seen == {name: played(name).expected for name in names}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", [*KEEPS_TO_ITSELF, "daqp"])
def test_solvers_that_keep_their_memory_to_themselves_say_so(name, way):
    """Within an episode; after its start a copy goes on like the original."""
    controller: Any = MomentumQPConfig(solver="daqp") if name == "daqp" else name
    env = env_of(ResidualBalanceEnv, controller=controller)
    env.reset(seed=1)
    twin = WAYS[way](env)
    expected = digest(play_env(env))
    assert digest(play_env(twin)) == expected
    with pytest.raises(PoiseError, match="cannot be copied within an episode"):
        WAYS[way](env)


def numbers(data: mujoco.MjData) -> dict[str, bytes]:
    """All that it holds, but for the hash of the model's source, which MuJoCo does not pickle."""
    found = {}
    for name in dir(data):
        value = None if name.startswith("_") or name == "signature" else getattr(data, name)
        if isinstance(value, (int, float, np.ndarray)):
            found[name] = np.asarray(value).tobytes()
    return found


@pytest.mark.parametrize("way", WAYS)
def test_a_copy_has_all_of_the_data(way):
    """Contacts, forces and counts of the last step, too."""
    simulation, qpos = Simulation(robot()), robot().standing_qpos.copy()
    qpos[7] = robot().joint_range[0, 1] + 0.02  # a joint limit is at work
    simulation.reset(qpos, np.full(robot().model.nv, 0.1))
    simulation.step(0.1 * robot().torque_limit, 3)
    before, after = (numbers(each.data) for each in (simulation, WAYS[way](simulation)))
    assert len(before) > 100 and simulation.data.nl > 0
    assert before == after


@pytest.mark.parametrize("way", WAYS)
def test_an_open_window_is_not_copied(way):
    """Nor is what draws without one: the copy makes one of its own."""
    env = env_of(TorqueBalanceEnv)

    class Renderer:
        viewer: Any = None

    env._renderer = Renderer()
    assert WAYS[way](env)._renderer is None and env._renderer is not None
    env._renderer.viewer = object()
    with pytest.raises(PoiseError, match="close"):
        WAYS[way](env)


OWN = """
import copy

class Own:
    period = 0.004

    def __init__(self, robot):
        self.robot, self.state, self.ticks = robot, None, 0

    def __deepcopy__(self, memo):
        twin = Own.__new__(Own)
        vars(twin).update(copy.deepcopy(vars(self), memo))
        return twin

    def reset(self, state):
        self.state, self.ticks = state, 0

    def torques(self, state, targets):
        self.ticks += 1
        return 0.01 * self.ticks * self.state.qpos[7:] * self.robot.torque_limit
"""


def play_own(data: bytes, connection: Any) -> None:
    """In another process, which has not seen the file yet."""
    before = set(sys.modules)
    env = pickle.loads(data)
    news = [name for name in set(sys.modules) - before if "outside" in name]
    connection.send((digest(play_env(env)), len(news)))


def test_a_controller_from_outside_is_copied_with_its_environment(tmp_path):
    """What it holds of the simulation is that of the copy; a new process finds its class."""
    (tmp_path / "own.py").write_text(OWN)
    env = env_of(ResidualBalanceEnv, controller=f"{tmp_path}/own.py:Own")
    env.reset(seed=1)
    for _ in range(BEFORE):
        env.step(np.zeros(4))
    data, twins = pickle.dumps(env), [make(env) for make in WAYS.values()]
    assert all(type(twin.controller) is PluginController for twin in twins)
    expected = digest(play_env(env))
    assert [digest(play_env(twin)) for twin in twins] == [expected] * len(twins)
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    worker = context.Process(target=play_own, args=(data, theirs), daemon=True)
    worker.start()
    theirs.close()
    assert ours.poll(PATIENCE)
    assert ours.recv() == (expected, 1)
    worker.join(PATIENCE)


def test_environments_of_one_list_share_what_they_shared():
    """Two that have one robot; an array that both of two owners hold."""
    first = env_of(ResidualBalanceEnv)
    second = ResidualBalanceEnv(first.robot)
    for make in (copy.deepcopy, pickled):
        one, two = make([first, second])
        assert one.robot is two.robot is not first.robot
        assert one.simulation.data.model is one.robot.model
        assert one.controller.robot is one.robot


def test_turns_are_not_copied():
    """They hold nothing but addresses."""
    env = env_of(TorqueBalanceEnv)
    env.reset(seed=1)
    step = env.compiled_step()
    assert isinstance(step, CompiledStep)
    turns = StepSchedule(np.array([step.row()]), 1)
    for make in WAYS.values():
        with pytest.raises(PoiseError, match="addresses"):
            make(turns)


def test_kernels_without_a_name_are_not_pickled():
    """No other process could find them; a copy in this one shares them."""
    env = env_of(TorqueBalanceEnv)

    @compiled
    def nothing(block):
        pass

    address = address_of(nothing, env.scales)
    assert isinstance(env.scales, Block) and copy.deepcopy(address) == address
    with pytest.raises(PoiseError, match="nothing"):
        pickle.dumps(address)


def test_a_copy_keeps_the_room_around_its_arrays():
    """Or sums in its compiled code might be added up in another order, see `guarded_zeros`."""
    for kind in (TorqueBalanceEnv, ResidualBalanceEnv):
        env = env_of(kind)
        for make in WAYS.values():
            twin = make(env)
            for name in ("observation", "reward", "reward_terms"):
                before, after = (each.episode.named()[name] for each in (env, twin))
                assert after.base is not None and after.base.size == before.base.size
