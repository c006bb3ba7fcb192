"""Many shapes: what describes each, how well that finds its kind, and statistics over them."""

from unbend.collection._descriptor import DESCRIPTOR_VERSION, descriptor
from unbend.collection._retrieval import Retrieval, retrieval_measures
from unbend.collection._statistics import (
    LeftOut,
    MeanShape,
    Statistics,
    mean_shape,
    shape_statistics,
)

__all__ = [
    "DESCRIPTOR_VERSION",
    "LeftOut",
    "MeanShape",
    "Retrieval",
    "Statistics",
    "descriptor",
    "mean_shape",
    "retrieval_measures",
    "shape_statistics",
]
