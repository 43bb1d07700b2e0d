# SPDX-License-Identifier: BSD-3-Clause
"""Finds the SDF file of a model by name."""

from __future__ import annotations

import os
from pathlib import Path

MODEL_FILE = "model.sdf"


def model_file(model: str, model_path: str) -> Path:
    """Returns the SDF file of a model; the file may not exist.

    Args:
        model: Name of the model's folder, or absolute path of this folder or of an SDF file.
        model_path: Folders of models, separated by colons; the first folder that contains the model counts.
    """
    path = Path(model)
    if path.is_absolute() and not path.is_dir():
        return path
    folders = [folder for folder in model_path.split(os.pathsep) if folder] or [""]
    files = [Path(folder) / model / MODEL_FILE for folder in folders]
    return next((file for file in files if file.is_file()), files[0])
