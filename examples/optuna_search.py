"""Settings of PPO searched by Optuna: python examples/optuna_search.py [TRIALS [STEPS]]

Needs pip install -e '.[optuna]' in a checkout. A trial trains the configuration quick for STEPS and
is worth what its best evaluation recovers of the held-out pushes.
"""

import csv
import sys
from dataclasses import replace
from pathlib import Path

import optuna

from poise.training import TrainConfig, train, train_config

trials = int(sys.argv[1]) if len(sys.argv) > 1 else 20
steps = int(sys.argv[2]) if len(sys.argv) > 2 else 200_000
quick = train_config("quick")


def config(trial: optuna.Trial) -> TrainConfig:
    """Return the settings of a trial."""
    ppo = replace(
        quick.ppo,
        n_envs=min(quick.ppo.n_envs, max(steps // 96, 1)),
        learning_rate=trial.suggest_float("learning_rate", 1e-4, 3e-3, log=True),
        actor_rate=trial.suggest_float("actor_rate", 0.1, 1.0),
        log_std_init=trial.suggest_float("log_std_init", -2.5, -1.0),
    )
    evaluation = replace(quick.evaluation, trials=min(quick.evaluation.trials, steps))
    return replace(quick, steps=steps, ppo=ppo, evaluation=evaluation)


def recovered(trial: optuna.Trial) -> float:
    """Return the rate of held-out pushes that the best policy of a run recovers."""
    run = Path(f"runs/optuna/{trial.number}")
    train(config(trial), run, progress=False)
    with (run / "evaluations.csv").open(newline="") as file:
        return max(float(row["recovered"]) for row in csv.DictReader(file))


study = optuna.create_study(direction="maximize")
study.optimize(recovered, n_trials=trials)
print(study.best_value, study.best_params)
