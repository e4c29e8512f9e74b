"""The optimum over a whole clip: a sequence of quadratic programs."""

from collections.abc import Callable

from poise.configs.errors import PoiseError

from .problem import Cost, Problem
from .stance import plant

MOST, TRUST = 25, 0.3  # programs, and the largest move of a joint in the first [rad]
LEAST_TRUST = 2e-3  # [rad] that ends it
SHARES = (1.0, 0.5, 0.25, 0.1)  # of a step that are tried
ENOUGH, MET = 1e-3, 0.02  # decreases that end it: of the cost, relative; of the penalties


def optimise(problem: Problem, progress: Callable[[int, Cost], None] | None = None) -> None:
    """Move the postures of the problem's scene to a minimum of its cost.

    Each program gives displacements; the largest of their shares 1, ½, ¼ and 0.1 is taken that
    lowers the cost once the soles have been led to their places. The trust region shrinks by half
    where less than the whole was good, and doubles otherwise.

    Raises PoiseError if OSQP breaks down in the first program.
    """
    scene, cost = problem.scene, problem.cost()
    trust, solved = TRUST, 0
    while solved < MOST and trust > LEAST_TRUST:
        step = problem.step(trust)
        if step is None:
            if solved == 0:
                raise PoiseError("OSQP finds no solution of the first program of the clip")
            break
        solved += 1
        before, share, found = scene.qpos.copy(), 0.0, cost
        for tried in SHARES:
            for frame in problem.inner.tolist():
                scene.displace(frame, tried * step[frame])
            plant(scene, problem.stance, problem.inner)
            found = problem.cost()
            if found.whole < cost.whole:
                share = tried
                break
            scene.move(before.copy())
        if share == 0.0:
            trust *= 0.25
            continue
        enough = cost.whole - found.whole < ENOUGH * cost.whole
        enough &= cost.lacking - found.lacking < MET
        cost = found
        if progress is not None:
            progress(solved, cost)
        if enough:
            break
        trust = min(2.0 * trust, TRUST) if share == 1.0 else 0.5 * trust
