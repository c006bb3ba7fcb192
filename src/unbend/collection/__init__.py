"""Many shapes: what describes each, how well that finds its kind, and statistics over them."""

from unbend.collection._descriptor import DESCRIPTOR_VERSION, descriptor
from unbend.collection._retrieval import Retrieval, retrieval_measures

__all__ = ["DESCRIPTOR_VERSION", "Retrieval", "descriptor", "retrieval_measures"]
