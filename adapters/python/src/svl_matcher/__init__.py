"""Stereo matchers in Python for svl, and what svl writes as arrays and data frames."""

from .reading import Pair, read, report
from .serving import Request, matcher, serve

__all__ = ["Pair", "Request", "matcher", "read", "report", "serve"]
