"""training/benchmarking/diagnosis: what is found in a trial's course, and the words for it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.physics.pushes.push import Kick, Push
from poise.training.benchmarking.diagnosis import diagnosis
from poise.training.benchmarking.diagnosis.diagnosis import (
    Diagnosis,
    _capture,
    _foothold,
    _saturated,
    distance_outside_polygon,
    touching_body,
)
from poise.training.benchmarking.diagnosis.record import CourseRecord, TrialCourse
from poise.training.benchmarking.diagnosis.words import (
    cause,
    diagnosis_of,
    losses,
    losses_text,
    push_text,
    why,
)
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.table import outcome_cells
from poise.training.benchmarking.trials.trial import Trial
from tests.support.shared import robot

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
ENV = SimpleNamespace(
    config=SimpleNamespace(policy_period=0.02), robot=SimpleNamespace(motor_names=("hip", "ankle"))
)


@pytest.fixture(autouse=True)
def legs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both motors of `ENV` are of legs."""
    real = diagnosis.bearing
    monkeypatch.setattr(
        diagnosis, "bearing", lambda body: True if body is ENV.robot else real(body)
    )


def course(rows: int = 10) -> TrialCourse:
    """Two soles that stand still on a square, nothing at its limit."""
    return TrialCourse(
        time=0.02 * np.arange(rows),
        load=np.zeros((rows, 2)),
        capture_point=np.full((rows, 2), 0.5),
        supports=[SQUARE] * rows,
        contacts=np.ones((rows, 2), dtype=bool),
        soles=np.zeros((rows, 2, 2)),
        foothold=np.full((rows, 2), np.nan),
        swinging=np.full(rows, -1),
        failures=np.zeros(rows),
    )


@pytest.mark.parametrize(
    ("point", "distance"),
    [((0.5, 0.5), 0.0), ((1.0, 1.0), 0.0), ((2.0, 0.5), 1.0), ((2.0, 2.0), 2**0.5),
     ((0.5, -0.25), 0.25)],
)  # fmt: skip
def test_the_distance_outside_is_that_from_the_nearest_edge_or_corner(
    point: tuple[float, float], distance: float
) -> None:
    """Whichever way round the corners go."""
    for polygon in (SQUARE, SQUARE[::-1]):
        assert distance_outside_polygon(polygon, np.array(point)) == pytest.approx(distance)


def test_the_first_motor_at_its_limit_after_the_push() -> None:
    """For two policy steps in a row; a motor that was full before the push does not count, and one
    that is full for a moment neither."""
    found = course()
    found.load[0:3, 1], found.load[4, 0], found.load[5:9, 1], found.load[6:8, 0] = (
        1.0,
        1.0,
        1.0,
        1.0,
    )
    told = _saturated(ENV, found, start=0.04)
    assert told == {"saturated_motor": "ankle", "saturated_from": 0.1, "saturated_time": 0.08}
    assert _saturated(ENV, course(), start=0.0) == {}


def test_the_capture_point_leaves_for_the_last_time() -> None:
    found = course()
    found.capture_point[3:5, 0], found.capture_point[7:, 0] = 1.4, (1.1, 1.3, 1.2)
    assert _capture(found) == {"capture_left": 0.14, "capture_outside": pytest.approx(0.3)}
    found.capture_point[9] = 0.5
    assert _capture(found) == {}


def test_a_sole_that_slips_and_a_foothold_that_is_missed() -> None:
    """Whichever comes first after the push; a foot that lands where it was to is neither."""
    found = course()
    found.soles[6:, 1, 0] = 0.04
    assert _foothold(found, 0.0) == {"foothold": "slipped", "foothold_time": 0.12,
                                     "foothold_error": 0.04}  # fmt: skip
    found.contacts[3:5, 0], found.swinging[3:5], found.foothold[3:5] = False, 0, (0.3, 0.0)
    found.soles[5:, 0, 0] = 0.2
    assert _foothold(found, 0.0) == {"foothold": "missed", "foothold_time": 0.1,
                                     "foothold_error": pytest.approx(0.1)}  # fmt: skip
    found.soles[5:, 0, 0] = 0.29
    assert _foothold(found, 0.0)["foothold"] == "slipped"
    assert _foothold(found, 0.13)["foothold_time"] == 0.14


def test_a_trial_that_is_lost_says_why() -> None:
    """A push that no feet in place hold: motors are full, then the capture point is gone. What is
    written reads back."""
    agent = load_agent("momentum-qp", robot(), duration=3.0, pushes=None)
    push = Push("torso", 0.5, 0.1, 30.0, 0.0)
    outcome = run_trial(agent, Trial(0, 1, (push,)))
    assert outcome.fallen and outcome.loss in ("height", "tilt", "contact")
    assert outcome.saturated_motor in robot().motor_names and outcome.capture_outside > 0.05
    assert 0.5 < outcome.saturated_from < outcome.capture_left < outcome.fall_time
    line = {name: "" if v is None else str(v) for name, v in outcome_cells(outcome).items()}
    assert vars(diagnosis_of(line)).items() <= vars(outcome).items()
    assert why(outcome, outcome.fall_time).startswith("fell: ")
    assert not diagnosis.bearing(robot())[robot().motor_names.index("right_shoulder1")]
    if outcome.loss == "contact":
        assert touching_body(agent.env) == outcome.loss_body


def test_the_course_of_a_trial_is_kept_row_by_row() -> None:
    record = CourseRecord()
    agent = load_agent("zero", robot(), duration=2.0, pushes=None)
    agent = replace(agent, env=TorqueBalanceEnv(robot(), duration=0.1, pushes=None))
    outcome = run_trial(agent, Trial(0, 1), record)
    kept = record.course()
    assert len(kept.time) == 6 and kept.load.shape == (6, robot().model.nu)
    assert kept.contacts.any() and kept.load.max() == 0.0
    assert why(Diagnosis()) == "" and outcome.loss == "not quiet"


def test_words() -> None:
    """In the order of time; older results say nothing."""
    found = Diagnosis("contact", "pelvis", "left_ankle_y", 0.62, 0.34, 0.84, 0.21, "missed", 1.12,
                      0.08, 0.7)  # fmt: skip
    assert why(found, 1.94) == (
        "fell: pelvis touched the ground at 1.94 s. Before: left_ankle_y at its torque limit from "
        "0.62 s, for 0.34 s; no solution of its QP from 0.70 s on; capture point outside of the "
        "support for good from 0.84 s, by 0.21 m at most; a foothold missed by 0.08 m at 1.12 s."
    )
    assert cause(found, 2) == "ankle_y at its torque limit, then a foothold missed"
    assert cause(replace(found, foothold="slipped"), 2).endswith("its steps were not enough")
    early = replace(found, foothold="slipped", foothold_time=0.7)
    assert cause(early, 2).endswith("a foot slipped")
    plain = replace(found, foothold=None, failures_from=None)
    assert cause(plain, 0) == "ankle_y at its torque limit, then no planned step"
    assert cause(plain, None) == "ankle_y at its torque limit"
    after = replace(plain, saturated_from=0.85)  # the capture point left at 0.84 s
    assert cause(after, None) == "capture point outside of the support"
    assert cause(after, 1) == "ankle_y at its torque limit, then one step was not enough"
    assert cause(replace(plain, failures_from=0.5), 1).startswith("QP without a solution, then one")
    late = replace(plain, failures_from=0.9, saturated_motor=None, saturated_from=None)
    assert cause(late, None) == "capture point outside of the support"
    calm = replace(late, capture_left=None, failures_from=None)
    assert cause(calm, 0) == "no motor of the legs at its torque limit, then no planned step"
    assert "from 0.90 s on, when it was falling already" in why(late)
    early = replace(late, failures_from=0.8)
    assert cause(early, 0) == "QP without a solution, then no planned step"
    assert "falling already" not in why(early)
    assert cause(replace(plain, hardware="ankle motors too hot"), 0).startswith("ankle motors too")
    counted = losses([(plain, 0), (found, 2), (plain, 0), (Diagnosis(), 0)])
    assert losses_text(counted) == (
        "of 3 losses 2: ankle_y at its torque limit, then no planned step; "
        "1: ankle_y at its torque limit, then a foothold missed"
    )
    fixed = losses([(plain, 0)], stepping=False)
    assert fixed == [{"cause": "ankle_y at its torque limit", "trials": 1}]
    assert why(diagnosis_of({})) == "" and losses_text([]) == ""
    assert push_text(Push("torso", 1.0, 0.1, 20.0, 90.0)) == (
        "a push of 20.0 N·s in 0.10 s on torso towards 90° (left), at 1.00 s"
    )
    assert push_text(Kick(1.0, 0.5, -44.0)).startswith("a kick of 0.50 m/s towards -44° (forward r")
