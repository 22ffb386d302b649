"""Frames with their truth, on disk."""

from uwsim.dataset.store import open  # noqa: A004

__all__ = ["open"]
