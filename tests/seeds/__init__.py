"""The rows of docs/seeds.yaml: `python -m tests.seeds` runs them, `--write` makes docs/seeds.md."""
