"""YAML data: robots, controllers, training runs, suites and shipped policies."""

if __name__ == "configs":
    raise ImportError("this folder is the package poise.configs: write `import poise.configs`")
