# SPDX-License-Identifier: BSD-3-Clause
"""Creates the engine of a result database: a SQLite file, or a server that SQLAlchemy addresses by a URL."""

from __future__ import annotations

import os
import sqlite3
import urllib.parse
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import URL, Connection, Engine, NullPool, create_engine, event, make_url
from sqlalchemy.exc import ArgumentError, NoSuchModuleError

from modular_framework_benchmark.results.errors import DatabaseMissingError, ResultsError

BUSY_TIMEOUT_S = 30.0
"""Wait of a write for another process: far longer than a report needs to read 100,000 episodes."""
BEGIN_OPTION = "sqlite_begin"
PIP_NAMES = {"psycopg": "psycopg[binary]", "psycopg2": "psycopg2-binary", "MySQLdb": "mysqlclient"}
"""Package names on PyPI of drivers whose module has a different name."""


@dataclass(frozen=True, slots=True)
class DatabaseAddress:
    """Address of a result database.

    Attributes:
        label: Name of the database in messages, without password.
        path: SQLite file; None for a server.
        url: URL of a server; None for a SQLite file.
    """

    label: str
    path: Path | None
    url: URL | None

    @property
    def identity(self) -> str:
        """Returns a text that identifies the database regardless of links, driver and user."""
        if self.url is None:
            return os.path.realpath(self.label)
        server = self.url.host or self.url.query.get("host") or "localhost"
        return f"{self.url.get_backend_name()}://{server}:{self.url.port or ''}/{self.url.database}"


def parse_address(target: str | Path) -> DatabaseAddress:
    """Parses the address of a database.

    Args:
        target: Path of a SQLite file, or SQLAlchemy URL such as `postgresql+psycopg://user@host/name`.

    Raises:
        ResultsError: The URL is invalid, or names a database in memory.
    """
    if "://" not in str(target):
        path = Path(target).expanduser().absolute()
        return DatabaseAddress(str(path), path, None)
    try:
        url = make_url(str(target))
    except ArgumentError as error:
        raise ResultsError(
            f"{target}: not a URL of a database ({error}); name a file, or DIALECT://USER@HOST/NAME"
        ) from error
    if url.get_backend_name() != "sqlite":
        return DatabaseAddress(url.render_as_string(hide_password=True), None, url)
    if not url.database or url.database == ":memory:":
        raise ResultsError(f"{target}: a database in memory is lost with the process; name a file")
    path = Path(url.database).expanduser().absolute()
    return DatabaseAddress(str(path), path, None)


def shown_target(target: str | Path) -> str:
    """Returns the address as the user gave it, without password."""
    return parse_address(target).label if "://" in str(target) else str(target)


def make_engine(address: DatabaseAddress, *, create: bool, read_only: bool, busy_timeout_s: float) -> Engine:
    """Creates the engine without connecting.

    Args:
        address: Address of the database.
        create: Whether to create a missing SQLite file.
        read_only: Whether to refuse writes.
        busy_timeout_s: Maximum wait for another process that writes the SQLite file [s].

    Raises:
        DatabaseMissingError: The SQLite file or its folder does not exist.
        ResultsError: The driver of the server's database is not installed.
    """
    if address.path is None:
        try:
            return create_engine(address.url or "", pool_pre_ping=True)
        except NoSuchModuleError as error:
            raise ResultsError(
                f"{address.label}: {error}; install the driver that the URL names, or begin the URL with one that "
                "SQLAlchemy knows, such as postgresql+psycopg://"
            ) from error
        except ImportError as error:
            driver = PIP_NAMES.get(error.name or "", error.name)
            raise ResultsError(
                f"{address.label}: {error}; install the driver that the URL names: ./install.sh exec pip install "
                f"'{driver}'"
            ) from error
    path = address.path
    if not path.parent.is_dir():
        raise DatabaseMissingError(f"{path}: there is no folder {path.parent}; make it, or name another file")
    if not create and not path.is_file():
        raise DatabaseMissingError(
            f"{path}: there is no such file; name a result database, or run the experiment first"
        )
    return _sqlite_engine(path, create, read_only, busy_timeout_s)


def _sqlite_engine(path: Path, create: bool, read_only: bool, busy_timeout_s: float) -> Engine:
    """Returns an engine that opens a connection per use, so that threads and forked processes share no file handle.

    Readers open the file for writing too if permitted, because only writers roll back the write of a killed process.
    """
    uri = f"file:{urllib.parse.quote(str(path))}?mode={'rwc' if create else 'rw'}"

    def connect() -> sqlite3.Connection:
        connection = sqlite3.connect(
            uri, uri=True, timeout=busy_timeout_s, isolation_level=None, check_same_thread=False
        )
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute("PRAGMA synchronous = FULL")
        if read_only:
            connection.execute("PRAGMA query_only = ON")
        return connection

    engine = create_engine("sqlite://", creator=connect, poolclass=NullPool)

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        connection.exec_driver_sql(connection.get_execution_options().get(BEGIN_OPTION, "BEGIN"))

    return engine
