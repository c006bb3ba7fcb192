import numpy as np

from unbend.mesh import edge_ends


def test_each_edge_is_named_once_and_loops_are_none():
    faces = np.array([[2, 1, 0], [1, 2, 3], [3, 3, 4]])
    np.testing.assert_array_equal(
        edge_ends(faces, 6), [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3], [3, 4]]
    )
    assert edge_ends(np.empty((0, 3), dtype=np.int64), 6).shape == (0, 2)
