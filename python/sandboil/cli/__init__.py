"""The command `sandboil`."""

from .commands import app, main

__all__ = ["app", "main"]
