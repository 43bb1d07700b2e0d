# SPDX-License-Identifier: BSD-3-Clause
"""Digests of the content that episodes run with, in text form, by combination of factor levels.

The text lists the digests of most combinations, and the other digests as DIGEST@COMBINATION. A text without
combinations, such as one digest, therefore holds for all.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Collection, Mapping
from functools import lru_cache

ABSENT_DIGEST = "-"
"""Digest of content that a combination does not use."""
FILE_PREFIX = "file "
"""First word of the description of a file; a combination may use more files as its trials draw more problems."""


def combination_key(configuration: Mapping[str, str]) -> str:
    """Returns a short text that identifies a combination of levels, given as level by factor."""
    return hashlib.sha256(json.dumps(sorted(configuration.items())).encode()).hexdigest()[:8]


def digests_text(digests: Mapping[str, Collection[str]]) -> str:
    """Returns the digests of some content as text.

    Args:
        digests: Digests by combination; none for a combination that does not use the content.
    """
    texts = {key: " ".join(sorted(level_digests)) or ABSENT_DIGEST for key, level_digests in digests.items()}
    counts = Counter(texts.values())
    usual = max(sorted(counts), key=lambda text: counts[text])
    others = [f"{digest}@{key}" for key in sorted(texts) if texts[key] != usual for digest in texts[key].split()]
    return " ".join([usual, *others])


@lru_cache(maxsize=4096)
def _parse_digests(text: str) -> tuple[frozenset[str], Mapping[str, frozenset[str]]]:
    usual, others = set[str](), dict[str, frozenset[str]]()
    for token in text.split():
        digest, _, key = token.partition("@")
        if key:
            others[key] = others.get(key, frozenset()) | ({digest} - {ABSENT_DIGEST})
        elif digest != ABSENT_DIGEST:
            usual.add(digest)
    return frozenset(usual), others


def digests_of(text: str, combination: str) -> frozenset[str]:
    """Returns the digests of a combination in the text of `digests_text`."""
    usual, others = _parse_digests(text)
    return others.get(combination, usual)


def all_digests(text: str) -> frozenset[str]:
    """Returns the digests of all combinations in the text of `digests_text`."""
    usual, others = _parse_digests(text)
    return usual.union(*others.values())
