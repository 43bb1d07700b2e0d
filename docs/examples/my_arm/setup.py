# SPDX-License-Identifier: BSD-3-Clause
"""Installs the Python library of this package for catkin."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["my_arm"], package_dir={"": "src"}))
