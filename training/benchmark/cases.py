"""From a suite to cases: every random draw depends on the seed and the case's number alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from poise.envs.pushes.push import Push
from poise.envs.pushes.sampler import push_bodies
from poise.envs.robots.ground import contact_friction
from poise.envs.robots.robot import Robot
from poise.training.statistics.fits import fit_logistic
from poise.training.suites.base import generator, start_seed
from poise.training.trials.push_limits import PushLimits

from .case import Case
from .suite import BenchmarkSuite

STANDARD = "standard"


class Cases:
    """The cases of a suite for a robot.

    Attributes:
        limits: the ankle limit that pushes are measured by.
        first: the first stage of the envelope.
        others: margins, factors and mix, in this order.
        standard: factor → level of the standard case, as text.
    """

    def __init__(self, suite: BenchmarkSuite, robot: Robot, seed: int):
        self.suite, self.robot, self.seed = suite, robot, seed
        self.limits = PushLimits(robot)  # without a table: the ankle limit
        self.bodies = push_bodies(robot)
        self._data = mujoco.MjData(robot.model)
        self._data.qpos[:] = robot.standing_qpos
        mujoco.mj_kinematics(robot.model, self._data)
        soles = [geom for sole in robot.soles for geom in sole.geom_ids]
        self.standard: dict[str, str] = {
            "duration": f"{suite.push_duration:g}",
            "body": self.bodies[0],
            "height": f"{self._height(self.bodies[0]):.2f}",
            "friction": f"{contact_friction(robot.model, robot.ground_geom_id, soles):g}",
            "delay": "0",
            "mass_error": "0",
            "pushes": "1",
        }
        self.first = self._first()
        self._second = len(self.first)  # number of the second stage's first case
        number = self._second + suite.envelope.directions * suite.envelope.trials
        self.others: list[Case] = []
        for part in (self._margin, self._factors, self._mix):
            self.others += part(number + len(self.others))

    def count(self, controllers: int) -> int:
        """Trials of all controllers."""
        second = self.suite.envelope.directions * self.suite.envelope.trials
        return controllers * (len(self.first) + second + len(self.others))

    def second(self, recovered: Mapping[int, bool]) -> list[Case]:
        """The second stage of a controller: around the rough J50 of its first stage.

        Args:
            recovered: number of a case of the first stage → whether it was recovered.
        """
        part = self.suite.envelope
        cases: list[Case] = []
        for angle in self._angles():
            here = [case for case in self.first if case.push and case.push.direction == angle]
            impulse = [case.push.impulse for case in here if case.push]
            rough = fit_logistic(impulse, [recovered[case.number] for case in here]).j50
            low, high = (1.0 - part.spread) * rough, (1.0 + part.spread) * rough
            number = self._second + len(cases)
            cases += self._spread(number, angle, low, high, part.trials, stage=2)
        return cases

    def _first(self) -> list[Case]:
        part = self.suite.envelope
        cases: list[Case] = []
        for angle in self._angles():
            limit = self.limits.ankle(angle, self.suite.push_duration)
            low, high = (share * limit for share in part.fractions)
            cases += self._spread(len(cases), angle, low, high, part.first_trials, stage=1)
        return cases

    def _spread(
        self, number: int, angle: float, low: float, high: float, count: int, stage: int
    ) -> list[Case]:
        """One impulse in each of `count` equal parts of [low, high]."""
        cases: list[Case] = []
        for part in range(count):
            share = (part + generator(self.seed, number).uniform()) / count
            push = self._push(angle, low + share * (high - low))
            cases.append(self._case(number, push, stage=stage))
            number += 1
        return cases

    def _margin(self, number: int) -> list[Case]:
        part = self.suite.margin
        cases: list[Case] = []
        for angle in part.directions if part else ():
            for level in part.levels:  # type: ignore[union-attr]
                push = self._push(angle, level * self.limits.ankle(angle, self.suite.push_duration))
                for _ in range(part.runs):  # type: ignore[union-attr]
                    cases.append(
                        self._case(number + len(cases), push, part="margin", level=f"{level:g}")
                    )
        return cases

    def _factors(self, number: int) -> list[Case]:
        """Cell by cell, the standard case first; all cells draw alike."""
        part = self.suite.factors
        if part is None:
            return []
        draws = self._stratified(number, part.trials, part.fractions)
        cases: list[Case] = []
        for factor, level, changes in self._cells():
            for k, (angle, fraction) in enumerate(draws):
                push = changes.get("push", {})
                duration = push.get("duration", self.suite.push_duration)
                impulse = fraction * self.limits.ankle(angle, duration)
                case = self._case(
                    number + len(cases), replace(self._push(angle, impulse), **push),
                    part="factors", factor=factor, level=level, **changes.get("case", {}),
                )  # fmt: skip
                cases.append(replace(case, seed=start_seed(self.seed, number + k)))
        return cases

    def _cells(self) -> list[tuple[str, str, dict[str, Any]]]:
        """Factor, level, and what it changes in the push and in the case."""
        assert self.suite.factors is not None
        levels = self.suite.factors.levels
        cells: list[tuple[str, str, dict[str, Any]]] = [(STANDARD, STANDARD, {})]
        cells += [("duration", f"{d:g}", {"push": {"duration": d}}) for d in levels.duration]
        bodies = self.bodies if levels.body else ()
        cells += [("body", body, {"push": {"body": body}}) for body in bodies]
        cells += [
            ("height", f"{h:.2f}", {"push": {"point": self._point(self.bodies[0], h)}})
            for h in levels.height
        ]
        for name in ("friction", "delay", "mass_error", "pushes"):
            values = getattr(levels, name)
            cells += [(name, f"{value:g}", {"case": {name: value}}) for value in values]
        return [cell for cell in cells if self.standard.get(cell[0]) != cell[1]]

    def _mix(self, number: int) -> list[Case]:
        part = self.suite.mix
        if part is None:
            return []
        cases: list[Case] = []
        for angle, fraction in self._stratified(number, part.trials, part.fractions):
            rng = generator(self.seed, number + len(cases))
            duration = float(np.exp(rng.uniform(*np.log(part.duration))))
            body = self.bodies[int(rng.integers(len(self.bodies)))]
            height = rng.uniform(*part.height)
            trunk = body == self.bodies[0]
            push = Push(
                body, self.suite.start, duration, fraction * self.limits.ankle(angle, duration),
                angle, point=self._point(body, height) if trunk else (0.0, 0.0, 0.0),
            )  # fmt: skip
            cases.append(
                self._case(
                    number + len(cases), push, part="mix",
                    friction=float(rng.uniform(*part.friction)),
                    delay=part.delay[int(rng.integers(len(part.delay)))],
                    mass_error=float(rng.uniform(*part.mass_error)),
                    pushes=2 if rng.uniform() < part.repeated else 1,
                )
            )  # fmt: skip
        return cases

    def _stratified(
        self, number: int, count: int, fractions: tuple[float, float]
    ) -> Sequence[tuple[float, float]]:
        """(direction, fraction) with one of each in each of `count` equal parts, shuffled."""
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, number, 2]))
        angles = 360.0 * (np.arange(count) + rng.uniform(size=count)) / count
        shares = (rng.permutation(count) + rng.uniform(size=count)) / count
        low, high = fractions
        return [(float(a), float(low + u * (high - low))) for a, u in zip(angles, shares)]  # noqa: B905

    def _angles(self) -> list[float]:
        count = self.suite.envelope.directions
        return [360.0 * k / count for k in range(count)]

    def _push(self, angle: float, impulse: float) -> Push:
        suite = self.suite
        return Push(self.bodies[0], suite.start, suite.push_duration, impulse, angle)

    def _case(self, number: int, push: Push, **fields: Any) -> Case:
        return Case(
            number, start_seed(self.seed, number), push, self.limits.fraction(push),
            interval=self.suite.interval, **fields,
        )  # fmt: skip

    def _height(self, body: str) -> float:
        """Of the body's centre of mass, standing, over that of the robot."""
        return float(self._data.xipos[self.robot.model.body(body).id, 2] / self.robot.height_com)

    def _point(self, body: str, height: float) -> tuple[float, float, float]:
        """Above the body's centre of mass at a height [of the CoM's], in the body's frame [m]."""
        axes = self._data.xmat[self.robot.model.body(body).id].reshape(3, 3)
        up = (height - self._height(body)) * self.robot.height_com
        x, y, z = (float(u) for u in axes.T @ [0.0, 0.0, up])
        return x, y, z
