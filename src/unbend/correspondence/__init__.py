"""Uses of a map: evaluation, transfer, registration, morphing, similarity; files of matches."""

from unbend.correspondence._archive import read_match, write_match
from unbend.correspondence._evaluation import THRESHOLDS, Evaluation, Overlap, evaluate
from unbend.correspondence._morph import morph
from unbend.correspondence._morph import warn_of_units as warn_of_units
from unbend.correspondence._register import Registration, register, write_registration
from unbend.correspondence._register import check_template as check_template
from unbend.correspondence._similarity import aligned_cosine, similarity
from unbend.correspondence._transfer import (
    as_point_map,
    carry,
    transfer,
    transfer_landmarks,
    value_kind,
)
from unbend.correspondence._transfer import checked_numbers as checked_numbers
from unbend.correspondence._transfer import inverted as inverted

__all__ = [
    "THRESHOLDS",
    "Evaluation",
    "Overlap",
    "Registration",
    "aligned_cosine",
    "as_point_map",
    "carry",
    "evaluate",
    "morph",
    "read_match",
    "register",
    "similarity",
    "transfer",
    "transfer_landmarks",
    "value_kind",
    "write_match",
    "write_registration",
]
