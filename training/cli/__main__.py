"""`python -m poise.training.cli`, where no script is installed."""

from . import main

main()
