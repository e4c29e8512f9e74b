"""A set of whole-body QPs from real push recoveries, in the files of `qpsolvers.Problem`.

From each trial of `recordings.py`, ticks spread evenly over the two seconds after the push begins,
or up to the fall.
"""

import io
import json
from collections.abc import Iterator, Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import numpy as np

from poise.baselines.registry import momentum_qp_config
from poise.baselines.solvers import QP
from poise.baselines.whole_body import formulation
from poise.baselines.whole_body.constraint_rows import torque_matrix
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.configs.errors import PoiseError
from poise.configs.files import check_new_folder, new_folder
from poise.configs.problems import out_of_range
from poise.configs.schema import to_dict
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.trials.push_limits import load_limits
from poise.training.running.provenance import commit, versions

from .recordings import PUSH_DURATION, RecordedTick, Recovery, recoveries

Form = Literal["reduced", "full"]
Manifest = dict[str, Any]  # manifest.json; templates/README.md has what it says
PER_TRIAL = 25  # problems
LIBRARIES = ("mujoco", "numpy", "numba", "scipy")


def qp_of(tick: RecordedTick, controller: MomentumQP, form: Form) -> dict[str, np.ndarray | None]:
    """The arrays of one file: those of `qpsolvers.Problem`, and how torques follow from x."""
    if form == "reduced":
        qp, T, offset = tick.reduced, tick.torque_matrix, tick.torque_offset
    else:
        state = tick.state
        points = [contact.rows(state) for contact in controller.contacts.values()]
        qp = formulation.build(
            state,
            tick.targets,
            controller.parameters,
            controller.tasks.values(),
            tick.cop_vel,
            points=points,
        )
        joints = controller.arrays.motor_dofs - 6
        T = np.zeros((len(joints), len(qp.g)))
        rows = torque_matrix(state, points)[joints]
        T[:, : rows.shape[1]] = rows
        offset = state.h[6:][joints]
    return {
        **problem_arrays(qp),
        "torque_matrix": T,
        "torque_offset": offset,
        "torque_limit": controller.arrays.torque_limit,
        "torques": tick.torques,
    }


def problem_arrays(qp: QP) -> dict[str, np.ndarray | None]:
    """P, q, G, h, A, b, lb, ub of `qpsolvers.Problem`; what there is none of is None.

    l == u becomes an equality; a row that picks one unknown becomes a bound of it; other rows
    become Gx ≤ h, the upper sides before the lower ones.
    """
    n = len(qp.g)
    equal = qp.l == qp.u
    picks = ~equal & (np.count_nonzero(qp.C, axis=1) == 1) & (qp.C.max(axis=1, initial=0.0) == 1.0)
    lb, ub = np.full(n, -np.inf), np.full(n, np.inf)
    for row in np.flatnonzero(picks):
        i = int(np.argmax(qp.C[row]))
        lb[i], ub[i] = max(lb[i], qp.l[row]), min(ub[i], qp.u[row])
    upper, lower = (np.isfinite(side) & ~equal & ~picks for side in (qp.u, qp.l))
    G, h = np.vstack([qp.C[upper], -qp.C[lower]]), np.concatenate([qp.u[upper], -qp.l[lower]])
    some = {
        "G": len(h) > 0, "h": len(h) > 0, "A": equal.any(), "b": equal.any(),
        "lb": picks.any(), "ub": picks.any(),
    }  # fmt: skip
    arrays = {"G": G, "h": h, "A": qp.C[equal], "b": qp.u[equal], "lb": lb, "ub": ub}
    return {"P": qp.H, "q": qp.g} | {k: a if some[k] else None for k, a in arrays.items()}


def write_qp_set(
    out: str | Path,
    *,
    count: int = 1000,
    seed: int = 0,
    form: Form = "reduced",
    robot: str = "humanoid",
    controller: str = "momentum-qp",
) -> Manifest:
    """Write a folder of `count` problems with manifest.json and README.md; returns the manifest.

    The same arguments give the same arrays. The folder appears when it is complete.

    Raises:
        ConfigError: an argument that is not valid, or a folder that is not empty.
        PoiseError: the folder cannot be written, or there are no problems to be had.
    """
    out = Path(out)
    if count < 1:
        raise out_of_range(count, field="count", least=1)
    if seed < 0:
        raise out_of_range(seed, field="seed", least=0)
    check_new_folder(out)
    body = load_robot(robot)
    limits = load_limits(body)
    config = momentum_qp_config(controller)
    writer = MomentumQP(body, config)
    manifest: Manifest = {
        "form": form, "count": count, "seed": seed,
        "robot": body.name, "robot_fingerprint": body.fingerprint,
        "joints": [body.joint_names[i] for i in body.motor_dofs - 6],
        "controller": to_dict(config),
        "push": {"body": push_bodies(body)[0], "duration": PUSH_DURATION, "limit": limits.scale},
        "commit": commit(), "versions": versions(LIBRARIES),
        "trials": [], "problems": [],
    }  # fmt: skip
    with new_folder(out) as part:
        _write_problems(part, manifest, recoveries(body, controller, limits, seed), writer)
        readme = resources.files(__package__) / "templates" / "README.md"
        (part / "README.md").write_text(readme.read_text("utf-8"), "utf-8")
        (part / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n", "utf-8")
    return manifest


def _write_problems(
    folder: Path, manifest: Manifest, trials: Iterator[Recovery], controller: MomentumQP
) -> None:
    count, form, problems = manifest["count"], manifest["form"], manifest["problems"]
    for number, trial in enumerate(trials):
        if number > 10 + count:
            raise PoiseError(
                f"{controller.robot.name}: its trials give no problems that are solved"
            )
        record = {
            "trial": number, "seed": trial.seed,
            "impulse": trial.push.impulse, "direction": trial.push.direction,
            "end": trial.end, "ticks": trial.met, "solved": len(trial.ticks),
        }  # fmt: skip
        manifest["trials"].append(record)
        wanted = min(PER_TRIAL, count - len(problems), len(trial.ticks))
        for i in np.linspace(0, len(trial.ticks) - 1, wanted).round().astype(int):
            tick = trial.ticks[i]
            name = f"qp{len(problems):05d}.npz"
            (folder / name).write_bytes(npz(qp_of(tick, controller, form)))
            time = round(tick.time - trial.push.start, 6)
            problems.append({"file": name, "trial": number, "time": time, "active": tick.active})
        if len(problems) == count:
            return


def npz(arrays: Mapping[str, np.ndarray | None]) -> bytes:
    """The content of a compressed .npz file; None becomes the object array that qpsolvers reads."""
    content = io.BytesIO()
    plain: dict[str, Any] = {name: np.array(array) for name, array in arrays.items()}
    np.savez_compressed(content, **plain)
    return content.getvalue()
