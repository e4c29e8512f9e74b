"""PPO: what is trained, how, and what comes of it."""
