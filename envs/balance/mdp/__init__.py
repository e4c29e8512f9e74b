"""What an environment observes, rewards and ends on: terms in tables, compiled."""
