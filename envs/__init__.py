"""The world: robots, state, pushes and Gymnasium environments."""

if __name__ == "envs":
    raise ImportError("this folder is the package poise.envs: write `import poise.envs`")
