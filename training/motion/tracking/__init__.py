"""How far a robot is from the motion that it performs, policy step by policy step."""
