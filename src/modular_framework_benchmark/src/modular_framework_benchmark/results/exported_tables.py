# SPDX-License-Identifier: BSD-3-Clause
"""Exports results as CSV or Parquet files."""

from __future__ import annotations

import re
from enum import Enum
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.results.errors import ExportError
from modular_framework_benchmark.results.json_records import description_to_json

DESCRIPTION_KEY = b"modular_framework_benchmark.experiment"
"""Metadata key of a Parquet file for the description of the experiment as JSON."""


class TableFormat(Enum):
    """File format of exported tables; the value is the file extension."""

    CSV = "csv"
    PARQUET = "parquet"


def export_tables(results: ExperimentResults, folder: Path, table_format: TableFormat) -> list[Path]:
    """Writes the episodes and the spans of an experiment to one file each.

    Missing values are empty in CSV and null in Parquet. The description of the experiment is in the metadata of a
    Parquet file, and in a separate file for CSV.

    Args:
        results: Results of the experiment.
        folder: Folder of the files, created if missing.
        table_format: Format of the files.

    Returns:
        Paths of the files.

    Raises:
        ExportError: A file exists already, or is not writable.
    """
    stem = file_stem(results.description.name)
    description = description_to_json(results.description)
    paths = [folder / f"{stem}_{each}.{table_format.value}" for each in ("episodes", "spans")]
    if table_format is TableFormat.CSV:
        paths.append(folder / f"{stem}.json")
    refuse_present(paths)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, frame in zip(paths, (results.episodes, results.spans), strict=False):
            _write(frame, path, table_format, description)
        if table_format is TableFormat.CSV:
            paths[-1].write_text(description, encoding="utf-8")
    except OSError as error:
        raise ExportError(f"{folder}: the export stopped ({error}); free space, or name another folder") from error
    return paths


def file_stem(name: str) -> str:
    """Returns the name of an experiment in a form that is valid in file names."""
    return re.sub(r"[^\w.-]+", "_", name).strip(".") or "experiment"


def refuse_present(paths: list[Path]) -> None:
    """Refuses to overwrite files.

    Raises:
        ExportError: Files exist already; the error lists them.
    """
    present = [str(path) for path in paths if path.exists()]
    if present:
        raise ExportError(f"{', '.join(present)}: already exists; remove it, or name another folder")


def _write(frame: pd.DataFrame, path: Path, table_format: TableFormat, description: str) -> None:
    table = pa.Table.from_pandas(frame, preserve_index=False)
    if table_format is TableFormat.CSV:
        pyarrow.csv.write_csv(table, path)
        return
    metadata = {**(table.schema.metadata or {}), DESCRIPTION_KEY: description.encode()}
    pyarrow.parquet.write_table(table.replace_schema_metadata(metadata), path)
