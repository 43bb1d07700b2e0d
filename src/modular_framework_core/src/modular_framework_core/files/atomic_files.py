# SPDX-License-Identifier: BSD-3-Clause
"""Writes files atomically and reads text files. Pipes and devices are refused, because reading them may block."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import uuid
from pathlib import Path

MAX_BYTES = 256 * 1024 * 1024
"""Maximum size of a text file."""


def write_atomically(path: Path, content: str | bytes, mode: int = 0o666) -> None:
    """Writes a file atomically. On failure the old file is unchanged and no temporary file remains.

    Args:
        path: Path of the file in an existing folder.
        content: New content; text is encoded as UTF-8.
        mode: Permissions before the umask.

    Raises:
        OSError: The file cannot be written; the message names the file.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    temporary = path.with_name(f".writing_{uuid.uuid4().hex}{path.suffix}")
    try:
        if path.exists() and not path.is_file():
            raise OSError(errno.EINVAL, "it exists and is not a regular file")
        handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        os.replace(temporary, path)
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror}; free space, or name another folder", str(path)) from error
    except ValueError as error:
        raise OSError(f"{str(path)!r} is not a valid path: {error}") from error
    finally:
        with contextlib.suppress(OSError, ValueError):  # after a success, os.replace has moved the temporary file
            temporary.unlink()


def read_text(path: Path) -> str:
    """Reads a text file.

    Raises:
        OSError: The file cannot be read, is not a regular file, or is too large; the message names the file.
        UnicodeDecodeError: The file is not UTF-8.
    """
    try:
        status = path.stat()
    except ValueError as error:
        raise OSError(f"{str(path)!r} is not a valid path: {error}") from error
    if not stat.S_ISREG(status.st_mode):
        raise OSError(f"{path} is not a regular file; name a text file")
    if status.st_size > MAX_BYTES:
        raise OSError(f"{path} has {status.st_size} bytes, at most {MAX_BYTES} are allowed; split the file")
    return path.read_text(encoding="utf-8")
