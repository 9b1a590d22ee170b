"""Fingerprints, to compare a description with another that no longer exists."""

from __future__ import annotations

import hashlib


def fingerprint(description: bytes) -> str:
    """SHA-256 of a description, as hexadecimal digits."""
    return hashlib.sha256(description).hexdigest()
