"""Retrieval measures, worked by hand."""

import json

import numpy as np
import pytest

from unbend.collection import retrieval_measures
from unbend.errors import InputError


def one_query(*hits: int, others: int = 0):
    """A query before a list whose entries are of its class (1) or not (0), nearest first."""
    listed = [*hits, *[0] * others]
    return retrieval_measures([np.arange(len(listed))], listed, [1])


def test_one_list_worked_by_hand():
    # R = 3, found at the ranks 1, 4 and 6 of 8.
    found = one_query(1, 0, 0, 1, 0, 1, 0, 0)
    assert found.nearest_neighbor == 1
    assert found.first_tier == pytest.approx(1 / 3)
    assert found.second_tier == pytest.approx(3 / 3)
    # Of all 8, precision 3/8 and recall 1.
    assert found.e_measure == pytest.approx(2 / (8 / 3 + 1))
    ideal = 1 + 1 / np.log2(2) + 1 / np.log2(3)
    assert found.dcg == pytest.approx((1 + 1 / 2 + 1 / np.log2(6)) / ideal)
    assert found.map == pytest.approx((1 + 2 / 4 + 3 / 6) / 3)
    # A third is found at rank 1, two thirds (from 35 %) at rank 4, the last (from 70 %) at 6.
    expected = [1] * 6 + [2 / 4] * 7 + [3 / 6] * 7
    np.testing.assert_allclose(found.precision, expected)
    np.testing.assert_allclose(found.recall, np.arange(5, 101, 5) / 100)


def test_the_first_page_is_32_shapes():
    # 2 of R = 4 among the first 32: precision 2/32, recall 2/4.
    found = one_query(1, *[0] * 30, 1, 1, 1, others=6)
    assert found.e_measure == pytest.approx(2 / (32 / 2 + 4 / 2))


def test_a_perfect_order_of_twenty_has_the_e_measure_that_contests_report():
    found = one_query(*[1] * 19, others=400)
    assert (found.nearest_neighbor, found.first_tier, found.dcg, found.map) == (1, 1, 1, 1)
    assert found.e_measure == pytest.approx(0.745, abs=5e-4)


def test_a_collection_asks_with_each_of_its_shapes_but_for_itself():
    # a a b b on a line; distances from each to the others:
    #   0: a1 b3 b9    1: a1 b2 b8    3: a2 a3 b6    9: b6 a8 a9
    places = np.array([0.0, 1.0, 3.0, 9.0])
    found = retrieval_measures(abs(places[:, None] - places), list("aabb"))
    assert found.nearest_neighbor == pytest.approx(3 / 4)
    assert found.first_tier == pytest.approx(3 / 4)  # R = 1: the nearest alone
    assert found.second_tier == pytest.approx(3 / 4)  # the other b is the third of its list
    assert found.map == pytest.approx((1 + 1 + 1 / 3 + 1) / 4)
    assert found.dcg == pytest.approx((3 + 1 / np.log2(3)) / 4)
    assert found.n_queries == 4


def test_who_is_alone_is_in_the_way_but_does_not_ask():
    places = np.array([0.0, 1.0, 0.4])
    found = retrieval_measures(abs(places[:, None] - places), ["a", "a", "alone"])
    assert found.n_queries == 2
    assert found.nearest_neighbor == 0
    assert found.second_tier == 1


def test_a_shape_can_be_kept_from_the_copy_of_it_that_asks():
    found = retrieval_measures([[np.nan, 2, 1], [1, np.nan, 2]], ["a", "a", "b"], ["a", "a"])
    assert found.nearest_neighbor == 0.5
    assert found.map == pytest.approx((1 / 2 + 1) / 2)


def test_shapes_without_label_neither_ask_nor_are_found():
    places = np.array([0.0, 0.1, 1.0, 3.0, 9.0, 9.1])
    apart, labelled = abs(places[:, None] - places), [0, 2, 3, 4]
    found = retrieval_measures(apart, ["a", None, "a", "b", "b", None])
    expected = retrieval_measures(apart[np.ix_(labelled, labelled)], list("aabb"))
    assert str(found.to_dict()) == str(expected.to_dict())


class NotAvailable:
    """As NA of pandas: what it is compared with does not matter."""

    def __eq__(self, other):
        return self

    def __bool__(self):
        raise TypeError("boolean value of NA is ambiguous")


@pytest.mark.parametrize("missing", [float("nan"), NotAvailable()])
def test_labels_that_pandas_has_as_missing_are_none(missing):
    apart = np.random.default_rng(0).random((8, 8))
    labels = np.array(["a", "b", None, "a", None, "b", "a", "b"], dtype=object)
    expected = retrieval_measures(apart, labels)
    given = np.array([missing if label is None else label for label in labels], dtype=object)
    assert str(retrieval_measures(apart, given).to_dict()) == str(expected.to_dict())
    assert str(retrieval_measures(apart, given.tolist()).to_dict()) == str(expected.to_dict())
    expected = retrieval_measures(apart, labels, labels)
    assert str(retrieval_measures(apart, given, given).to_dict()) == str(expected.to_dict())


@pytest.mark.parametrize("kind", [np.int64, np.float64, np.bool_])
def test_labels_may_be_a_list_of_numpys_numbers(kind):
    apart = np.random.default_rng(0).random((4, 4))
    labels = [kind(one) for one in (0, 1, 0, 1)]
    expected = retrieval_measures(apart, np.array(labels)).to_dict()
    assert str(retrieval_measures(apart, labels).to_dict()) == str(expected)


def test_of_equals_the_first_comes_first():
    assert one_query(0, 1).nearest_neighbor == 0
    assert retrieval_measures([[3.0, 3.0]], [0, 1], [1]).nearest_neighbor == 0
    # The last of 50 near ones, between which 50 far ones stand.
    assert retrieval_measures([[1.0, 2.0] * 50], [*[0] * 98, 1, 0], [1]).map == 1 / 50


def test_everything_goes_into_json():
    kept = json.loads(json.dumps(one_query(1, 0).to_dict()))
    assert list(kept)[:6] == [
        "nearest_neighbor",
        "first_tier",
        "second_tier",
        "e_measure",
        "dcg",
        "map",
    ]
    assert len(kept["precision"]) == len(kept["recall"]) == 20


@pytest.mark.parametrize(
    ("distances", "labels", "message"),
    [
        (np.zeros((2, 2)), list("aab"), r"shape \(2, 2\) do not fit 3 queries and 3 shapes"),
        (np.zeros((2, 2)), list("ab"), "nothing to find"),
    ],
)
def test_what_cannot_be_measured_is_refused(distances, labels, message):
    with pytest.raises(InputError, match=message):
        retrieval_measures(distances, labels)
