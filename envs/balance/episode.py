"""The record of an episode: fall, quiet time, effort, excursions; and the reward."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program, run
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays, SimViews
from poise.envs.physics.clock import Clock
from poise.envs.physics.kinematics import StateArrays, support_distance, update_support

from .mdp.reward import Rewards, sum_rewards
from .mdp.termination import Limits, has_diverged, has_fallen, uprightness


@dataclass(eq=False)
class Metrics(Block):
    """What an episode is judged by."""

    quiet_steps: Mutable[float]  # policy steps in a row that were quiet, with feet at rest
    fallen: Mutable[float]  # 1 after a fall
    energy: Mutable[float]  # ∫ Σ |τ q̇| dt [J]
    peak_torque: Mutable[float]  # largest |τ|/τ_max
    saturated: Mutable[float]  # sum over ticks of the fraction of motors at their limit
    ticks: Mutable[float]  # control ticks
    max_com: Mutable[float]  # largest distance of the CoM from the middle of the soles [m]
    max_capture: Mutable[float]  # the same of the capture point [m]
    min_cop_margin: Mutable[float]  # smallest distance of the CoP from the edge of the support [m]
    max_slide: Mutable[float]  # largest distance of a sole from where it started [m]
    root_force: Mutable[float]  # largest force of a soft root [N]
    root_moment: Mutable[float]  # largest moment of a soft root [N·m]
    last_moving: Mutable[float]  # time of the last policy step that was not quiet [s]
    failures: Mutable[float]  # control ticks at which the controller's solver failed
    positive_work: Mutable[float]  # ∫ Σ max(τ q̇, 0) dt [J]
    torque_variation: Mutable[float]  # sum over ticks of the mean over motors of |Δτ|/τ_max
    torque_time: Mutable[float]  # of the ticks that were accounted for [s]
    edge_contacts: Mutable[float]  # times that a foot came to touch an edge of the terrain
    terminated: Mutable[
        float
    ]  # 1 where the episode ended by a fall, or because the simulation diverged


@dataclass(eq=False)
class EpisodeArrays(Block):
    """The record that compiled steps write of the running episode."""

    action: Annotated[np.ndarray, "na"]
    last_action: Annotated[np.ndarray, "na"]
    observation: Annotated[np.ndarray, "no"]
    past: Annotated[np.ndarray, "past"]  # frames of an observation with a stride, else empty
    reward: Mutable[float]  # of the last policy step
    reward_terms: Annotated[np.ndarray, "terms"]  # weighted; their sum is the reward
    metrics: Metrics
    last_torque: Annotated[np.ndarray, "nu"]  # of the last control tick [N·m]
    root_wrench: Annotated[np.ndarray, 6]  # of a soft root in the last tick [N, N·m]
    sole_start: Annotated[np.ndarray, "nc", 2]
    sole_rest: Annotated[np.ndarray, "nc", 2]  # where they were when the running quiet time began
    edges: Annotated[np.ndarray, "nc"]  # 1 where a foot touched an edge in the last policy step
    steps: Mutable[int]  # policy steps since the reset
    running: Mutable[int]  # whether there may be another one
    ticks: Mutable[int]  # control ticks of the running policy step


@compiled
def _clear(m: Metrics):
    m.quiet_steps = m.fallen = m.energy = m.peak_torque = m.saturated = m.ticks = 0.0
    m.max_com = m.max_capture = m.max_slide = m.root_force = m.root_moment = 0.0
    m.last_moving = m.failures = m.positive_work = m.torque_variation = m.torque_time = 0.0
    m.edge_contacts = m.terminated = 0.0
    m.min_cop_margin = np.inf


@compiled
def begin_episode(s: StateArrays, e: EpisodeArrays):
    """Clear the record; feet are where they should stay."""
    e.action[:] = 0.0
    e.last_action[:] = 0.0
    e.reward = 0.0
    e.reward_terms[:] = 0.0
    _clear(e.metrics)
    e.root_wrench[:] = 0.0
    e.edges[:] = 0.0
    e.steps, e.running, e.ticks = 0, 1, 0
    for i in range(s.sole_point.shape[0]):
        e.sole_start[i, 0], e.sole_start[i, 1] = s.sole_point[i, 0], s.sole_point[i, 1]
    keep_rest(s, e)


@compiled
def record_tick(
    robot: RobotArrays, qvel: np.ndarray, tau: np.ndarray, period: float, e: EpisodeArrays
):
    """Account for one control tick with motor torques `tau` (nu,) at speeds `qvel` (nv,)."""
    m = e.metrics
    power, positive, saturated, change = 0.0, 0.0, 0.0, 0.0
    for i in range(tau.shape[0]):
        work = tau[i] * qvel[robot.motor_dofs[i]]
        power += abs(work)
        positive += max(work, 0.0)
        load = abs(tau[i]) / robot.torque_limit[i]
        m.peak_torque = max(m.peak_torque, load)
        saturated += 1.0 if load > 0.999 else 0.0
        change += abs(tau[i] - e.last_torque[i]) / robot.torque_limit[i]
        e.last_torque[i] = tau[i]
    m.energy += power * period
    m.positive_work += positive * period
    m.saturated += saturated / tau.shape[0]
    m.torque_variation += change / tau.shape[0] if m.ticks > 0.0 else 0.0
    m.torque_time += period
    m.ticks += 1.0


@dataclass(frozen=True, eq=False)
class Judge(Block):
    """All that the end of a policy step is judged by; the state is the true one."""

    robot: RobotArrays
    views: SimViews
    state: StateArrays
    clock: Clock
    limits: Limits
    rewards: Rewards
    episode: EpisodeArrays


@compiled
def judge_step(j: Judge):
    """Metrics and reward of the policy step that ends now, and whether it was the last."""
    s, e, m = j.state, j.episode, j.episode.metrics
    update_support(j.robot, s)
    diverged = has_diverged(j.views)
    fallen = diverged or has_fallen(j.robot, s, j.limits)
    over = diverged or (fallen and j.limits.terminates)
    m.fallen, m.terminated = 1.0 if fallen else 0.0, 1.0 if over else 0.0
    record_quiet(j, fallen)
    record_excursions(s, e)
    record_edges(s, e)
    e.reward = sum_rewards(j.rewards, fallen, diverged, e.reward_terms)
    e.steps += 1
    e.running = not over and e.steps < j.limits.max_steps


@compiled
def keep_rest(s: StateArrays, e: EpisodeArrays):
    """Feet are to stay where they are now."""
    for i in range(s.sole_point.shape[0]):
        e.sole_rest[i, 0], e.sole_rest[i, 1] = s.sole_point[i, 0], s.sole_point[i, 1]


@compiled
def sole_distance(s: StateArrays, places: np.ndarray) -> float:
    """Largest distance of a sole from its place (nc, 2) [m]."""
    largest = 0.0
    for i in range(places.shape[0]):
        dx, dy = s.sole_point[i, 0] - places[i, 0], s.sole_point[i, 1] - places[i, 1]
        largest = max(largest, np.sqrt(dx * dx + dy * dy))
    return largest


@compiled
def record_quiet(j: Judge, fallen: bool):
    """Count a step that was quiet: upright, slow, the CoM over the soles; or note its time.

    Soles that have moved too far since the count began, or in its last `quiet_steps`, let it begin
    again: a robot that skates is not at rest, however slow its CoM is.
    """
    s, e, m = j.state, j.episode, j.episode.metrics
    speed = np.sqrt(s.com_vel[0] ** 2 + s.com_vel[1] ** 2 + s.com_vel[2] ** 2)
    quiet = not fallen and speed < j.limits.quiet_speed
    quiet = quiet and uprightness(j.robot, s) > j.limits.quiet_cos_tilt
    quiet = quiet and support_distance(s, s.com[0], s.com[1]) > 0.0
    still = sole_distance(s, e.sole_rest) <= j.limits.quiet_slide
    m.quiet_steps = m.quiet_steps + 1.0 if quiet and still else 0.0
    if m.quiet_steps % j.limits.quiet_steps == 0.0:
        keep_rest(s, e)
    if not quiet:
        m.last_moving = j.clock.steps * j.robot.timestep


@compiled
def record_excursions(s: StateArrays, e: EpisodeArrays):
    """Keep the largest distances of CoM, capture point and soles, and the CoP's least margin."""
    m = e.metrics
    com_x, com_y = s.com[0] - s.origin[0], s.com[1] - s.origin[1]
    xi_x, xi_y = s.capture_point[0] - s.origin[0], s.capture_point[1] - s.origin[1]
    m.max_com = max(m.max_com, np.sqrt(com_x * com_x + com_y * com_y))
    m.max_capture = max(m.max_capture, np.sqrt(xi_x * xi_x + xi_y * xi_y))
    m.min_cop_margin = min(m.min_cop_margin, support_distance(s, s.cop[0], s.cop[1]))
    m.max_slide = max(m.max_slide, sole_distance(s, e.sole_start))


@compiled
def record_edges(s: StateArrays, e: EpisodeArrays):
    """Count the feet that have come to touch an edge."""
    for i in range(s.edges.shape[0]):
        if s.edges[i] > 0.5 and e.edges[i] < 0.5:
            e.metrics.edge_contacts += 1.0
        e.edges[i], s.edges[i] = s.edges[i], 0.0


@dataclass(frozen=True, eq=False)
class StepEnd(Block):
    """The block of all that follows the last physics step of a policy step."""

    judge: Judge
    report: Program  # what a controller reports to the terms that observe it
    observe: Program  # see `observer`


@compiled
def end_step(end: StepEnd):
    """Judge the step by the true state, and observe the estimated state."""
    judge_step(end.judge)
    run(end.report)
    run(end.observe)
