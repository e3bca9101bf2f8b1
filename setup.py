"""Installed by catkin (catkin_python_setup); not meant to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        packages=[
            "node_support",
            "imagenex_852_driver",
            "imagenex_852_driver.emulator",
            "imagenex_852_driver.protocol",
            "sonar_processing",
            "mlsm_manager",
            "mlsm_manager.mapping",
            "mlsm_manager.matching",
            "sonar_simulator",
        ],
        package_dir={"": "src"},
    )
)
