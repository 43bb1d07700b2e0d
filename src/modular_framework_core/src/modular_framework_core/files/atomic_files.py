# SPDX-License-Identifier: BSD-3-Clause
"""Writes files atomically, and reads text files that users name; refuses pipes and devices, on which a read blocks."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import uuid
from pathlib import Path

MAX_BYTES = 256 * 1024 * 1024
"""Largest file that is read."""


def write_atomically(path: Path, content: str | bytes, mode: int = 0o666) -> None:
    """Writes a file atomically: on failure the old file stays as it was, and no temporary file is left in its folder.

    Args:
        path: The file; its folder exists.
        content: The new content; text is encoded as UTF-8.
        mode: Its permissions, of which the umask takes away.

    Raises:
        OSError: It cannot be written; names the file.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    temporary = path.with_name(f".writing_{uuid.uuid4().hex}{path.suffix}")
    try:
        if path.exists() and not path.is_file():
            raise OSError(errno.EINVAL, "it is there already, and no regular file")
        handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        os.replace(temporary, path)
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror}; free space, or name another folder", str(path)) from error
    except ValueError as error:
        raise OSError(f"{str(path)!r} is no path of a file: {error}") from error
    finally:
        with contextlib.suppress(OSError, ValueError):  # os.replace has moved it already when the write succeeded
            temporary.unlink()


def read_text(path: Path) -> str:
    """Reads a text file.

    Raises:
        OSError: The file cannot be read, is not a regular file (a pipe blocks), or is too large; names the file.
        UnicodeDecodeError: The file is not UTF-8.
    """
    try:
        status = path.stat()
    except ValueError as error:
        raise OSError(f"{str(path)!r} is no path of a file: {error}") from error
    if not stat.S_ISREG(status.st_mode):
        raise OSError(f"{path} is no regular file; name a file with text in it")
    if status.st_size > MAX_BYTES:
        raise OSError(f"{path} has {status.st_size} bytes; allowed are {MAX_BYTES}; split it")
    return path.read_text(encoding="utf-8")
