"""A compiled loop over the points of a cloud: the Delaunay triangles around each of them."""

from __future__ import annotations

import numpy as np

from unbend._compiled import compiled

_SAME = 1e-8  # angles in radians, and ratios less 1, that are closer are equal but for rounding


@compiled
def _is_nearer(sizes, near, one, other):  # type: ignore[no-untyped-def]
    """Whether one neighbour is nearer than another, or as near and of a lower number."""
    if abs(sizes[one] - sizes[other]) <= _SAME * sizes[other]:
        return near[one + 1] < near[other + 1]
    return sizes[one] > sizes[other]


@compiled
def fans(inverse, near, flat):  # type: ignore[no-untyped-def]
    """Triangles of each point with two neighbours whose edges of its Voronoi cell meet.

    A neighbour has an edge of the cell if it is a vertex of the convex hull of the point and all
    neighbours, each at the inverse of its distance: ``inverse`` (m, k, 2), in the tangent plane. Of
    neighbours on one circle with the point, their numbers ``near`` (m, k + 1) alone decide which
    are joined, so that all points on the circle choose the same triangles. A point whose neighbours
    leave a gap of 180 degrees, but for ``flat`` radians, is on the boundary.

    Returns the faces (t, 3), the point itself first, and whether each point is on the boundary.
    """
    m, k = inverse.shape[:2]
    faces = np.empty((m * k, 3), np.int64)
    is_open = np.zeros(m, np.bool_)
    hull = np.empty(k + 1, np.int64)
    count = 0
    for i in range(m):
        point = near[i, 0]
        u, v = inverse[i, :, 0], inverse[i, :, 1]
        angles = np.arctan2(v, u)
        sizes = u * u + v * v
        order = np.argsort(angles)
        n = 0  # directions: of the neighbours in one of them, only the nearest counts
        for q in range(k):
            here = order[q]
            if n == 0 or angles[here] - angles[order[n - 1]] > _SAME:
                order[n] = here
                n += 1
            elif _is_nearer(sizes, near[i], here, order[n - 1]):
                order[n - 1] = here
        if n > 1 and angles[order[0]] + 2 * np.pi - angles[order[n - 1]] <= _SAME:
            n -= 1
            if _is_nearer(sizes, near[i], order[n], order[0]):
                order[0] = order[n]
                angles[order[0]] -= 2 * np.pi
        # Graham's scan. It starts behind the gap of a boundary, or else at the farthest vertex.
        start = 0
        for q in range(n):
            gap = angles[order[q]] - angles[order[(q + n - 1) % n]]
            if q == 0:
                gap += 2 * np.pi
            if gap > np.pi - flat:
                start, is_open[i] = q, True
            elif not is_open[i] and sizes[order[q]] > sizes[order[start]]:
                start = q
        size = 0
        for q in range(start, start + n + (not is_open[i])):
            c = order[q % n]
            while size > 1:
                a, b = hull[size - 2], hull[size - 1]
                x, y, z, w = u[b] - u[a], v[b] - v[a], u[c] - u[b], v[c] - v[b]
                turn = x * w - y * z
                slack = _SAME * np.sqrt((x * x + y * y) * (z * z + w * w))
                if turn > slack:
                    break
                ends = min(near[i, a + 1], near[i, c + 1])
                if turn >= -slack and min(point, near[i, b + 1]) < ends:
                    break
                size -= 1
            hull[size] = c
            size += 1
        for q in range(size - 1):
            faces[count, 0] = point
            faces[count, 1] = near[i, hull[q] + 1]
            faces[count, 2] = near[i, hull[q + 1] + 1]
            count += 1
    return faces[:count].copy(), is_open
