"""The tree of a model's bodies."""

import mujoco


def lineage(model: mujoco.MjModel, body: int) -> list[int]:
    """A body, and those between it and the world, the nearest first."""
    found = []
    while body != 0:
        found.append(body)
        body = int(model.body_parentid[body])
    return found
