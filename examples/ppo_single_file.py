"""PPO in one file on poise/ResidualStep-v0, after Schulman et al. 2017.

    python examples/ppo_single_file.py                          # 15 minutes on two cores
    python examples/ppo_single_file.py --minutes 5 --log-std 0  # what too much noise does

Only Gymnasium, NumPy and torch: to read, to change, and to check that the environment needs
nothing of its own. The policy is judged without noise on pushes that it never trained on, before
(the controller alone) and after. `poise train` is what trains the shipped policies.
"""

import argparse
import time

import gymnasium
import numpy as np
import torch
from gymnasium.wrappers.vector import NormalizeObservation, RecordEpisodeStatistics
from torch import nn
from torch.distributions import Normal

import poise  # noqa: F401  (registers the environments)

HELD_OUT = 1_000_000  # seeds of the pushes that judge
#: pushes around what the controller recovers from half of the time, with its J50 by direction:
#: weaker ones teach nothing, and from stronger ones nothing recovers
J50 = [27.0, 22.9, 22.5, 19.6, 18.1, 19.1, 30.0, 25.9, 26.7, 25.9, 30.0, 19.1, 18.1, 19.6, 22.5,
       22.9]  # fmt: skip
ENVIRONMENT = {
    "duration": 4.0,
    "smoothing": 0.03,  # [s]
    "gate": 0.06,  # [m] of the capture point: a robot at rest is left to the controller
    "residual": {"com": 0.1, "cop": 0.06, "foothold": 0.25, "time": 0.12, "torque": 0.6},
    "pushes": {
        "magnitude": [0.8, 1.35],
        "unit": "controller_fraction",
        "limit_table": {"directions": [22.5 * k for k in range(16)], "impulses": J50},
        "bodies": ["torso"],
        "duration": [0.1, 0.1],
        "start": [0.2, 0.4],
    },
    "reward": {"alive": 1.0, "velocity": 0.5, "upright": 0.5, "quiet": 0.5, "com": 0.1,
               "capture": 0.1, "posture": 0.1, "effort": 0.02, "action": 0.05, "action_rate": 0.2,
               "fall": 20.0},
}  # fmt: skip


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0], formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--env", default="poise/ResidualStep-v0", help="others: by their defaults")
    parser.add_argument("--steps", type=int, default=500_000, help="environment steps in all")
    parser.add_argument("--minutes", type=float, default=15.0, help="of training, at most")
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--threads", type=int, default=2)
    modes = ("vector_entry_point", "sync", "async")  # threads, one after the other, processes
    parser.add_argument("--mode", default=modes[0], choices=modes)
    parser.add_argument("--rollout", type=int, default=96, help="steps per environment")
    parser.add_argument("--epochs", type=int, default=4)
    parser.add_argument("--minibatches", type=int, default=4)
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--gamma", type=float, default=0.985)
    parser.add_argument("--gae-lambda", type=float, default=0.95)
    parser.add_argument("--clip", type=float, default=0.2)
    parser.add_argument("--log-std", type=float, default=-1.7, help="of the first policy")
    parser.add_argument("--trials", type=int, default=256, help="held-out pushes; 0: none")
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args()


class Agent(nn.Module):
    """A Gaussian policy and a value function, two networks."""

    def __init__(self, observations: int, actions: int, log_std: float):
        super().__init__()
        self.actor = network(observations, actions)
        self.critic = network(observations, 1)
        self.log_std = nn.Parameter(torch.full((actions,), log_std))
        with torch.no_grad():  # the first policy is the controller alone
            self.actor[-1].weight.zero_()
            self.actor[-1].bias.zero_()

    def policy(self, observation: torch.Tensor) -> Normal:
        return Normal(self.actor(observation), self.log_std.exp())

    def value(self, observation: torch.Tensor) -> torch.Tensor:
        return self.critic(observation).squeeze(-1)


def network(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs, 128), nn.ELU(), nn.Linear(128, 64), nn.ELU(), nn.Linear(64, outputs)
    )


class Rollout:
    """What `length` steps of n environments gave. Rows are times, columns environments.

    Gymnasium's vector environments reset on the step after an episode's end: that step ignores
    the action and is no experience (`valid` is False). The observation before it is the true
    last one of its episode, so time limits are bootstrapped from the right state.
    """

    def __init__(self, length: int, env: gymnasium.vector.VectorEnv):
        n = env.num_envs
        observations = env.single_observation_space.shape[0]
        actions = env.single_action_space.shape[0]
        self.observations = torch.zeros(length + 1, n, observations)
        self.actions = torch.zeros(length, n, actions)
        self.log_probs = torch.zeros(length, n)
        self.rewards = torch.zeros(length, n)
        self.terminated = torch.zeros(length, n)
        self.done = torch.zeros(length, n)
        self.valid = torch.zeros(length, n, dtype=torch.bool)

    def advantages(self, values: torch.Tensor, gamma: float, lam: float) -> torch.Tensor:
        """Generalised advantage estimation; `values` has one row more than the rewards."""
        advantages, following = torch.zeros_like(self.rewards), 0.0
        for t in reversed(range(len(self.rewards))):
            target = self.rewards[t] + gamma * (1.0 - self.terminated[t]) * values[t + 1]
            following = target - values[t] + gamma * lam * (1.0 - self.done[t]) * following
            advantages[t] = following
        return advantages


def collect(env, agent: Agent, rollout: Rollout, observation: np.ndarray, fresh: np.ndarray):
    """Fill the rollout; `fresh` marks environments whose next step only resets them."""
    returns, successes = [], []
    low, high = env.single_action_space.low, env.single_action_space.high
    for t in range(len(rollout.rewards)):
        rollout.observations[t] = torch.as_tensor(observation, dtype=torch.float32)
        rollout.valid[t] = torch.as_tensor(~fresh)
        with torch.no_grad():
            policy = agent.policy(rollout.observations[t])
            action = policy.sample()
        observation, reward, terminated, truncated, info = env.step(
            np.clip(action.numpy(), low, high)
        )
        fresh = terminated | truncated
        rollout.actions[t] = action
        rollout.log_probs[t] = policy.log_prob(action).sum(-1)
        rollout.rewards[t] = torch.as_tensor(reward, dtype=torch.float32)
        rollout.terminated[t] = torch.as_tensor(terminated, dtype=torch.float32)
        rollout.done[t] = torch.as_tensor(fresh, dtype=torch.float32)
        if "episode" in info:
            returns.extend(info["episode"]["r"][info["_episode"]])
            successes.extend(info["is_success"][info["_episode"]])
    rollout.observations[-1] = torch.as_tensor(observation, dtype=torch.float32)
    return observation, fresh, returns, successes


def update(agent: Agent, optimizer: torch.optim.Optimizer, rollout: Rollout, args) -> None:
    """Some epochs of clipped policy gradient and value regression on the rollout."""
    with torch.no_grad():
        values = agent.value(rollout.observations)
    advantages = rollout.advantages(values, args.gamma, args.gae_lambda)
    use = rollout.valid
    observations, actions = rollout.observations[:-1][use], rollout.actions[use]
    log_probs, gains = rollout.log_probs[use], advantages[use]
    targets = gains + values[:-1][use]
    gains = (gains - gains.mean()) / (gains.std() + 1e-8)
    for _ in range(args.epochs):
        for batch in torch.randperm(len(gains)).chunk(args.minibatches):
            log_prob = agent.policy(observations[batch]).log_prob(actions[batch]).sum(-1)
            ratio = (log_prob - log_probs[batch]).exp()
            clipped = ratio.clamp(1.0 - args.clip, 1.0 + args.clip)
            policy_loss = -torch.min(ratio * gains[batch], clipped * gains[batch]).mean()
            value_loss = (agent.value(observations[batch]) - targets[batch]).pow(2).mean()
            optimizer.zero_grad()
            (policy_loss + 0.5 * value_loss).backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


def make(args: argparse.Namespace) -> gymnasium.vector.VectorEnv:
    """The environments, whose observations are normalised by running statistics."""
    known = ENVIRONMENT if args.env.endswith("ResidualStep-v0") else {}
    threads = {"threads": args.threads} if args.mode == "vector_entry_point" else {}
    env = gymnasium.make_vec(
        args.env, num_envs=args.envs, vectorization_mode=args.mode, **threads, **known
    )
    return NormalizeObservation(RecordEpisodeStatistics(env))


def judge(agent: Agent, statistics, args: argparse.Namespace, noise: bool = False) -> np.ndarray:
    """Whether each of about `args.trials` held-out pushes was recovered from, by the mean action.

    Environment i meets its own pushes in its own order, so any two policies meet the same ones.
    """
    env = make(args)
    env.obs_rms, env.update_running_mean = statistics, False
    each = -(-args.trials // args.envs)
    recovered = [[] for _ in range(args.envs)]
    observation, _ = env.reset(seed=HELD_OUT + args.seed)
    low, high = env.single_action_space.low, env.single_action_space.high
    while min(len(own) for own in recovered) < each:
        with torch.no_grad():
            policy = agent.policy(torch.as_tensor(observation, dtype=torch.float32))
            action = (policy.sample() if noise else policy.mean).numpy()
        observation, _, fell, ended, info = env.step(np.clip(action, low, high))
        for i in np.flatnonzero(fell | ended):
            recovered[i].append(bool(info["is_success"][i]))
    env.close()
    return np.array([own[:each] for own in recovered]).ravel()


def main() -> None:
    args = arguments()
    torch.manual_seed(args.seed)
    torch.set_num_threads(1)
    env = make(args)
    agent = Agent(
        env.single_observation_space.shape[0], env.single_action_space.shape[0], args.log_std
    )
    optimizer = torch.optim.Adam(agent.parameters(), lr=args.learning_rate, eps=1e-5)
    rollout = Rollout(args.rollout, env)
    if args.trials:
        before, noisy = (judge(agent, env.obs_rms, args, noise) for noise in (False, True))
        print(f"before: {before.mean():.0%} of {len(before)} held-out pushes recovered by action 0,"
              f" {noisy.mean():.0%} with the noise of exploration on it", flush=True)  # fmt: skip
    observation, _ = env.reset(seed=args.seed)
    fresh = np.zeros(args.envs, dtype=bool)
    per_rollout, start = args.rollout * args.envs, time.perf_counter()
    for steps in range(per_rollout, args.steps + per_rollout, per_rollout):
        for group in optimizer.param_groups:
            group["lr"] = args.learning_rate * max(1.0 - (steps - per_rollout) / args.steps, 0.0)
        observation, fresh, returns, successes = collect(env, agent, rollout, observation, fresh)
        update(agent, optimizer, rollout, args)
        spent = time.perf_counter() - start
        episodes = (
            f"return {np.mean(returns):6.1f}  recovered {np.mean(successes):4.0%}"
            if returns
            else "no episode ended"
        )
        print(f"{steps:>9,} steps  {episodes}  {steps / spent:,.0f} steps/s", flush=True)
        if spent > 60.0 * args.minutes:
            break
    if args.trials:
        after = judge(agent, env.obs_rms, args)
        print(f"after {spent / 60.0:.1f} min: {after.mean():.0%} of the same {len(after)} pushes, "
              f"{(after & ~before).sum()} gained, {(before & ~after).sum()} lost")  # fmt: skip
    env.close()


if __name__ == "__main__":
    main()
