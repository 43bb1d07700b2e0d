# SPDX-License-Identifier: BSD-3-Clause
"""Tables of a result database: the tables of OMPL's Planner Arena, and additional tables.

Planner Arena shows every column of `runs` from the fourth as an attribute, and every column of `experiments` from the
thirteenth as a filter. Metrics are therefore columns of `runs` and factors are columns of `experiments`; all other data
of an episode is in tables that Planner Arena does not read.
"""

from __future__ import annotations

from sqlalchemy import (
    REAL,
    BigInteger,
    Boolean,
    Column,
    DateTime,
    Double,
    ForeignKey,
    Integer,
    MetaData,
    PrimaryKeyConstraint,
    String,
    Table,
    Text,
    UniqueConstraint,
)
from sqlalchemy.types import TypeEngine

SCHEMA_VERSION = 2
"""Version of the tables, incremented with a migration in `schema_upgrade` when older programs become incompatible."""

METADATA = MetaData()
REAL_NUMBER: TypeEngine[float] = Double().with_variant(REAL(), "sqlite")

EXPERIMENTS = Table(
    "experiments",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("name", String(512), nullable=False),
    Column("totaltime", REAL_NUMBER, nullable=False),
    Column("timelimit", REAL_NUMBER),
    Column("memorylimit", REAL_NUMBER),
    Column("runcount", Integer, nullable=False),
    Column("version", String(128), nullable=False),
    Column("hostname", String(1024), nullable=False),
    Column("cpuinfo", Text, nullable=False),
    Column("date", DateTime, nullable=False),
    Column("seed", BigInteger),
    Column("setup", Text, nullable=False),
)
PLANNER_CONFIGS = Table(
    "plannerConfigs",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("name", String(512), nullable=False),
    Column("settings", Text, nullable=False),
)
ENUMS = Table(
    "enums",
    METADATA,
    Column("name", String(512)),
    Column("value", Integer),
    Column("description", Text),
    PrimaryKeyConstraint("name", "value"),
)
DESCRIPTIONS = Table(
    "descriptions",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("name", String(512), nullable=False, unique=True),
    Column("digest", String(64), nullable=False),
    Column("content", Text, nullable=False),
    Column("added", REAL_NUMBER, nullable=False),
)
EPISODES = Table(
    "episodes",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("descriptionid", ForeignKey("descriptions.id"), nullable=False),
    Column("experimentid", ForeignKey("experiments.id"), nullable=False),
    Column("plannerid", ForeignKey("plannerConfigs.id"), nullable=False),
    Column("number", Integer, nullable=False),
    Column("key", Text, nullable=False),
    Column("trial", BigInteger, nullable=False),
    Column("seed", BigInteger, nullable=False),
    Column("configuration", Text, nullable=False),
    Column("settings", Text, nullable=False),
    UniqueConstraint("descriptionid", "key"),
    UniqueConstraint("descriptionid", "number"),
)
RUNS = Table(
    "runs",
    METADATA,
    Column("id", ForeignKey("episodes.id"), primary_key=True, autoincrement=False),
    Column("experimentid", ForeignKey("experiments.id"), nullable=False),
    Column("plannerid", ForeignKey("plannerConfigs.id"), nullable=False),
    Column("status", Integer, nullable=False),
    Column("success", Boolean, nullable=False),
    Column("wall_s", REAL_NUMBER, nullable=False),
    Column("simulated_s", REAL_NUMBER),
)
PROGRESS = Table(
    "progress",
    METADATA,
    Column("runid", ForeignKey("runs.id")),
    Column("time", REAL_NUMBER),
    PrimaryKeyConstraint("runid", "time"),
)
RECORDS = Table(
    "records",
    METADATA,
    Column("runid", ForeignKey("runs.id"), primary_key=True, autoincrement=False),
    Column("outcome", Text, nullable=False),
    Column("cause", Text, nullable=False),
    Column("begun", REAL_NUMBER, nullable=False),
    Column("folder", Text, nullable=False),
    Column("worker", Text, nullable=False),
    Column("snapshot", Text, nullable=False),
)
SPANS = Table(
    "spans",
    METADATA,
    Column("runid", ForeignKey("runs.id")),
    Column("place", Integer),
    Column("kind", Text, nullable=False),
    Column("name", Text, nullable=False),
    Column("started_s", REAL_NUMBER, nullable=False),
    Column("ended_s", REAL_NUMBER),
    Column("outcome", Text, nullable=False),
    Column("failed", Boolean, nullable=False),
    Column("reason", Text, nullable=False),
    PrimaryKeyConstraint("runid", "place"),
    sqlite_with_rowid=False,
)
SNAPSHOT_VALUES = Table(
    "snapshot_values",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("name", Text, nullable=False),
    Column("digest", String(64), nullable=False),
    Column("value", Text, nullable=False),
    UniqueConstraint("name", "digest"),
)
SCHEMA = Table("schema_version", METADATA, Column("version", Integer, nullable=False))
