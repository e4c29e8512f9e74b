"""Ways to hand a controller's arrays to compiled code: `python -m tests.performance.handing_over`.

`assemble`, which fills the QP of a tick from nine nested groups of arrays, is compiled from the
same source for four ways: `Block` (a pointer, `envs/compiled/block.py`), Numba's StructRef and
jitclass, and named tuples. Each has a process of its own, without a cache of kernels: how long it
compiles, what a call takes from Python, and what from compiled code.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections import namedtuple
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

WAYS = ("block", "structref", "jitclass", "namedtuple")
CALLS = 20_000


def main() -> int:
    """A process for each way, which prints its row."""
    print("| way | compilation [s] | call from Python [µs] | from compiled code [µs] |", flush=True)
    print("| --- | --- | --- | --- |", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o777)  # no folder for kernels: they are compiled anew
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        command = [sys.executable, "-m", "tests.performance.handing_over"]
        for way in WAYS:
            subprocess.run([*command, way], env=environment, check=True)
    return 0


def measure(way: str) -> None:
    """Compile, call, and print the row."""
    import numba

    from poise.baselines.controller import Targets
    from poise.baselines.registry import load_controller
    from poise.baselines.whole_body.reduced_qp import assemble
    from poise.envs.physics.simulation import Simulation
    from poise.envs.robots.robot import load_robot

    robot = load_robot("humanoid")
    state = Simulation(robot).reset(pushes=())
    controller = load_controller("momentum-qp", robot)
    controller.reset(state)
    targets = Targets.standing(robot, state)
    controller.torques(state, targets)
    block = controller.assembly(state, targets)
    given = convert(block, MAKERS[way])
    found = numba.njit(nogil=True, error_model="numpy", fastmath=assemble.targetoptions["fastmath"])
    kernel = found(assemble.py_func)
    expected = block.workspace.H.copy()

    started = time.perf_counter()
    kernel(given)
    compilation = time.perf_counter() - started
    assert (block.workspace.H == expected).all()  # the same numbers, whoever holds them

    @numba.njit(nogil=True)
    def often(given: Any, count: int) -> None:
        for _ in range(count):
            kernel(given)

    often(given, 1)
    python = best(lambda: [kernel(given) for _ in range(CALLS)])
    inside = best(lambda: often(given, CALLS))
    print(f"| {way} | {compilation:.1f} | {python:.2f} | {inside:.2f} |", flush=True)


def best(play: Callable[[], object]) -> float:
    """Microseconds of a call, the least of five rounds."""
    times = []
    for _ in range(5):
        started = time.perf_counter()
        play()
        times.append(time.perf_counter() - started)
    return 1e6 * min(times) / CALLS


def convert(value: Any, make: Callable[[str, tuple[str, ...], list[Any]], Any] | None) -> Any:
    """The same members in another container; arrays are shared."""
    from poise.envs.compiled.block import Block

    if make is None or not isinstance(value, Block):
        return value
    names = tuple(field.name for field in fields(value))
    members = [convert(getattr(value, name), make) for name in names]
    return make(type(value).__name__, names, members)


def structref(name: str, names: tuple[str, ...], members: list[Any]) -> Any:
    """An instance of a new type of numba.experimental.structref."""
    from numba.core import types
    from numba.experimental import structref as numba_structref

    kind = numba_structref.register(type(name, (types.StructRef,), {}))
    proxy: Any = type(f"{name}Proxy", (numba_structref.StructRefProxy,), {})
    numba_structref.define_proxy(proxy, kind, names)
    return proxy(*map(plain, members))


def jitclass(name: str, names: tuple[str, ...], members: list[Any]) -> Any:
    """An instance of a new numba.experimental.jitclass."""
    import numba
    from numba.experimental import jitclass as numba_jitclass

    members = list(map(plain, members))
    scope: dict[str, Any] = {}
    arguments = ", ".join(f"a{k}" for k in range(len(names)))
    lines = "".join(f"\n    self.{each} = a{k}" for k, each in enumerate(names)) or "\n    pass"
    exec(f"def __init__(self, {arguments}):{lines}", scope)  # of the dataclass's own field names
    kind = type(name, (), {"__init__": scope["__init__"]})
    spec = [(each, numba.typeof(member)) for each, member in zip(names, members, strict=True)]
    return numba_jitclass(spec)(kind)(*members)


def tupled(name: str, names: tuple[str, ...], members: list[Any]) -> Any:
    """A named tuple."""
    return namedtuple(name, names)(*map(plain, members))


def plain(member: Any) -> Any:
    """Numbers of subclasses, such as `Kernel`, as Numba knows them."""
    return int(member) if isinstance(member, int) and not isinstance(member, bool) else member


MAKERS: dict[str, Any] = {
    "block": None, "structref": structref, "jitclass": jitclass, "namedtuple": tupled,
}  # fmt: skip

if __name__ == "__main__":
    sys.exit(main() if len(sys.argv) == 1 else measure(sys.argv[1]))
