"""A robot's motion as one optimum over the whole clip, with constraints of the user's."""
