"""What a robot can do of a motion, what makes a motion possible, and joins that are."""
