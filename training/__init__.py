"""Training, evaluation, benchmark, report and the command line."""

if __name__ == "training":
    raise ImportError("this folder is the package poise.training: write `import poise.training`")
