"""Controllers and policies outside of an environment: readings of a robot in, torques out."""
