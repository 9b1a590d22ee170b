"""Fingerprints of descriptions, to compare one with another that no longer exists."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np


def fingerprint(description: Any) -> str:
    """SHA-256 of a description of dictionaries, sequences, numbers, texts and arrays."""
    text = json.dumps(description, sort_keys=True, default=_of_array)
    return hashlib.sha256(text.encode()).hexdigest()


def _of_array(values: Any) -> list[Any]:
    array = np.asarray(values)
    return [array.dtype.str, array.shape, hashlib.sha256(array.tobytes()).hexdigest()]
