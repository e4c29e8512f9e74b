"""PPO training: configuration, runs, checkpoints and trained policies."""
