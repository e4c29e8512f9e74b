"""Models that MuJoCo takes and Poise cannot play: with numbers that are none, with a root
that does not float, with other things that move."""

import mujoco
import numpy as np

from poise.configs.errors import ConfigError, shown

from .description import RobotDescription
from .models.tree import lineage

LARGEST = 1e9  # of a number that the motion depends on, SI units
FREE = int(mujoco.mjtJoint.mjJNT_FREE)


def check_numbers(model: mujoco.MjModel, dynamics: tuple[str, ...]) -> None:
    """Raise ConfigError for numbers of the model that are not finite, and for another gravity than
    down.

    `dynamics` are the arrays that its motion depends on, which must not be huge either.
    """
    for name in (each for each in dir(model) if not each.startswith("_")):
        value = getattr(model, name)
        if isinstance(value, np.ndarray) and value.dtype.kind == "f":
            largest = LARGEST if name in dynamics else np.inf
            if not np.all(np.isfinite(value) & (np.abs(value) <= largest)):
                raise _wrong(f"{name} of the model must be finite and at most {LARGEST:g}")
    gravity = model.opt.gravity
    if not (np.all(gravity[:2] == 0.0) and 0.01 <= -gravity[2] <= 1000.0):
        raise _wrong(f"gravity must point down, 0.01 to 1000 m/s², not {gravity}")


def check_bodies(model: mujoco.MjModel, description: RobotDescription) -> None:
    """Raise ConfigError unless the root floats, it alone moves, all other joints are simple, and
    the feet hang on it. The text says what mends it."""
    bodies = {model.body(i).name: i for i in range(1, model.nbody)}
    named = {"root": description.root}
    named |= {f"feet[{i}].body": foot.body for i, foot in enumerate(description.feet)}
    for field, name in named.items():
        if name not in bodies:
            raise ConfigError(f"the model has no body {shown(name)}", field=field, choices=bodies)
    check_root(model, bodies[description.root])
    if int(mujoco.mjtJoint.mjJNT_BALL) in model.jnt_type:
        raise _wrong("ball joints are not supported")
    loops = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))
    if any(kind in loops for kind in model.eq_type[model.eq_active0.astype(bool)]):
        raise _wrong("closed kinematic loops (connect, weld) are not supported")
    for field, name in list(named.items())[1:]:
        line, root = lineage(model, bodies[name]), bodies[description.root]
        limb = line[: line.index(root)] if root in line else []
        if not np.any(model.body_jntnum[limb]):
            raise ConfigError(
                f"the body {shown(name)} is no limb of the root {description.root!r}", field=field
            )


def check_root(model: mujoco.MjModel, root: int) -> None:
    """Raise ConfigError unless the root floats by a free joint, and nothing else moves."""
    name, top = model.body(root).name, int(model.body_rootid[root])
    line = lineage(model, root)
    above = [i for i in range(model.njnt) if model.jnt_bodyid[i] in line]
    kinds = [int(model.jnt_type[joint]) for joint in above]
    floating = [model.body(model.jnt_bodyid[i]).name for i in range(model.njnt)
                if model.jnt_type[i] == FREE]  # fmt: skip
    if FREE in kinds and top != root:
        problem = (f"the root must be the body that has the free joint, which is "
                   f"{model.body(top).name!r}, not {name!r} on it")  # fmt: skip
    elif not above:
        problem = (f"nothing moves the root {name!r}, it is fixed to the world: give the body "
                   f"{model.body(top).name!r} a free joint, <freejoint/>")  # fmt: skip
    elif FREE not in kinds:
        problem = (f"the root {name!r} is moved by {_named(model, above)}: replace them by a free "
                   f"joint, <freejoint/>, of the body {model.body(top).name!r}")  # fmt: skip
    else:
        others = [i for i in range(model.njnt) if model.body_rootid[model.jnt_bodyid[i]] != root]
        if not others:
            return
        trees = dict.fromkeys(model.body(model.body_rootid[model.jnt_bodyid[i]]).name
                              for i in others)  # fmt: skip
        problem = (f"the model has moving parts other than the robot {name!r}: "
                   f"{', '.join(map(repr, trees))} ({_named(model, others)}): leave them out, or "
                   "name the robot's own file instead of a scene")  # fmt: skip
        floating = []
    raise ConfigError(problem, field="root", choices=floating or None)


def _named(model: mujoco.MjModel, joints: list[int]) -> str:
    """The joints, with their kinds, at most six."""
    kinds = {joint: mujoco.mjtJoint(int(model.jnt_type[joint])).name.removeprefix("mjJNT_").lower()
             for joint in joints[:6]}  # fmt: skip
    names = [f"the {kind} joint {model.joint(joint).name!r}" for joint, kind in kinds.items()]
    return ", ".join(names) + (f" and {len(joints) - 6} more" if len(joints) > 6 else "")


def _wrong(problem: str) -> ConfigError:
    return ConfigError(problem, field="source")
