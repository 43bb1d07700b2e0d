# SPDX-License-Identifier: BSD-3-Clause
"""A model is found by name in the folders of the model path, and by absolute path."""

from __future__ import annotations

from modular_framework_core.files.model_files import MODEL_FILE, model_file


def test_a_model_is_found_in_the_first_folder_that_contains_it(tmp_path):
    for name in ("first/cup", "second/cup", "second/plate"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / MODEL_FILE).touch()
    path = f"{tmp_path / 'first'}:{tmp_path / 'second'}"
    assert model_file("cup", path) == tmp_path / "first/cup" / MODEL_FILE
    assert model_file("plate", path) == tmp_path / "second/plate" / MODEL_FILE
    assert model_file("fork", path) == tmp_path / "first/fork" / MODEL_FILE


def test_an_absolute_path_needs_no_model_path(tmp_path):
    assert model_file(str(tmp_path), "") == tmp_path / MODEL_FILE
    assert model_file(str(tmp_path / "cup.sdf"), "") == tmp_path / "cup.sdf"
