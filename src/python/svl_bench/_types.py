"""Types that several modules use, and those of svl's JSON."""

from __future__ import annotations

import os
from typing import Any, Optional, TypedDict, Union

PathLike = Union[str, "os.PathLike[str]"]


class Parameter(TypedDict):
    """A parameter of an algorithm, as in "v5:max_disparity=64"."""

    name: str
    unit: str
    default: Union[bool, float, str, None]
    min: Union[bool, float, None]
    max: Union[bool, float, None]
    description: str


class Algorithm(TypedDict):
    """An algorithm of svl."""

    name: str
    aliases: list[str]
    summary: str
    paper: str
    parameters: list[Parameter]


class Usability(TypedDict):
    """If svl can use a source, what it has, and what is missing, each with its cure."""

    is_usable: bool
    pairs: Optional[int]
    geometry: Optional[str]
    distortion_model: Optional[str]
    is_calibrated: bool
    truths: list[str]
    missing: list[str]
    doubts: list[dict[str, Any]]


class Info(TypedDict, total=False):
    """What `svl info --json` says: docs/recording.md. A folder has no more than the first five."""

    usability: Usability
    is_intact: Optional[bool]
    duration_ns: Optional[str]
    first_pairs: Optional[dict[str, Any]]
    no_pairs: str
    topics: list[dict[str, Any]]
    header: dict[str, Any]
    gaps: list[dict[str, Any]]
    clocks: dict[str, Any]


class Change(TypedDict):
    """A metric in both reports: other - base, its interval, and if it is told apart from chance."""

    metric: str
    base: float
    other: float
    difference: float
    interval: Optional[list[float]]
    cases: list[dict[str, int]]
    judgement: str


class ComparedAlgorithm(TypedDict, total=False):
    """An algorithm of both reports."""

    algorithm: str
    other_algorithm: str
    pairs: int
    blocks: int
    frames: dict[str, int]
    metrics: list[Change]


class Comparison(TypedDict, total=False):
    """Two reports, as `svl compare --json` has them: docs/scoring.md."""

    conclusion: str
    verdict: str
    base: str
    other: str
    area: str
    algorithms: list[ComparedAlgorithm]
    method: dict[str, str]
    cautions: list[str]
