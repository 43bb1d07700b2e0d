# SPDX-License-Identifier: BSD-3-Clause
"""Installs the library with pip into any environment, and with catkin into the workspace."""

from setuptools import setup

setup(
    name="mbf_method",
    version="0.1.0",
    description="Serves a method of any Python environment to the Modular Benchmarking Framework",
    license="BSD-3-Clause",
    packages=["mbf_method", "mbf_method.templates"],
    package_dir={"": "src"},
    python_requires=">=3.8",
    install_requires=["msgpack>=1.0", "numpy", "websockets>=13.1"],
)
