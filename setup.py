"""Installed by catkin (catkin_python_setup); not meant to be run by hand."""

from pathlib import Path

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import find_packages, setup

setup(
    **generate_distutils_setup(
        packages=find_packages(str(Path(__file__).resolve().parent / "src")),
        package_dir={"": "src"},
    )
)
