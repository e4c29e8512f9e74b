"""How a robot stands: posture, rest, holding torques, one leg, stability."""
