# SPDX-License-Identifier: BSD-3-Clause
"""Prints where the PyPI packages with the models of robots are, separated by semicolons.

The folders of example-robot-data and of pybullet_data, then the version of PyBullet.
"""

import importlib.metadata
from pathlib import Path


def folder_of(distribution: str, *ending: str) -> Path:
    """Returns the folder of the installed file whose path has this ending."""
    for file in importlib.metadata.files(distribution) or []:
        if file.parts[-len(ending) :] == ending:
            return Path(str(file.locate())).resolve().parent
    raise SystemExit(f"the PyPI package '{distribution}' has no file {'/'.join(ending)}; install requirements.txt")


print(
    folder_of("example-robot-data", "share", "example-robot-data", "package.xml"),
    folder_of("pybullet", "pybullet_data", "__init__.py"),
    importlib.metadata.version("pybullet"),
    sep=";",
)
