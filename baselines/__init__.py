"""Controllers: state and targets in, joint torques out."""

if __name__ == "baselines":
    raise ImportError("this folder is the package poise.baselines: write `import poise.baselines`")
