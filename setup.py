"""Maps the top-level folders to the packages poise.*; everything else is in pyproject.toml."""

from setuptools import find_packages, setup

FOLDERS = ("envs", "baselines", "training", "configs")

packages = ["poise"]
for folder in FOLDERS:
    packages.append(f"poise.{folder}")
    packages += [f"poise.{folder}.{name}" for name in find_packages(folder)]

setup(
    packages=packages,
    py_modules=["poise_command"],
    package_dir={"": "src", **{f"poise.{folder}": folder for folder in FOLDERS}},
)
