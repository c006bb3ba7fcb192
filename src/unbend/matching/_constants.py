"""The numbers of the matcher that were set by hand, each with its reason.

What a single source of hypotheses needs, such as extremities, stands at the head of its own file.

Lengths are in units of the square root of a shape's area, data weights in units of 1 / area.
benchmarks/constants.py measures what halving and doubling each does to maps of public shapes.
"""

from __future__ import annotations

# How the matcher sees a body.
LIMB = 0.22  # Two points farther apart than this along the surface are on different limbs.
# Radius of the patches that maps are scored by; rough maps are smoothed over twice it. No limb is
# shorter, along a shorter piece of a boundary nothing was cut off, what returns this near is
# consistent, and what ends this near a boundary was cut off there.
PATCH = 0.08

# How hypotheses are made.
N_VERTICES = (400, 1000)  # Of the coarse and medium copies of a shape, on which they are tried.
FUNCTIONS = (6, 20)  # Eigenfunctions with which the search begins, every sign tried, and ends.
# Hypotheses that a stage keeps, or twice as many. Four times as many are begun, and more of parts.
BEAM = 4
SAMPLES = 300  # Points that represent a shape, far apart.
N_EXTREMITIES = 10  # Extremities of a shape at most, the most remote first.
LEFT_OUT = 0.04  # Cost of an extremity without a partner, as a relative deviation of lengths.

# How shapes are registered.
# Data weights, in steps of sqrt(10). Stiffness and a data weight balance over a length that is the
# inverse of its square root: from over half of sqrt(area), where parts slide as wholes, to a 55th.
# All of them let partial shapes slide; coarse copies begin with the third, and end with the fifth.
DATA_WEIGHTS = (3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)
STEPS = 8  # At each data weight.
MOMENTUM = 0.7  # Closest points are sought ahead of a slow slide, by this share of its last step.
# Length that a difference of normals of one counts as, while shapes move and at the end: normals
# keep a leg from catching the leg beside it, but differ between two meshes of one surface.
NORMAL_WEIGHTS = (0.1, 0.03)
EDGES = 2.0  # Places that are closer than so many mean edges count as the same.
SLACK = 0.3  # Mean edges beyond a boundary that still count as on the surface.
OUTLINE = 3.0  # A part that is missing may have an outline so many times the boundary's length.

# How maps are scored.
# So many times minus the logarithm of the share of a shape that has a partner are added to a cost:
# a small overlap that fits must not beat a large one.
WITHOUT = 0.12
# What a missed landmark adds: less than bending a body to a wrong one costs, as a rule, and more
# than a map saves that misses a right one.
MISSED = 0.08
NEARLY = 0.15  # Candidates that cost up to this share more than the least are nearly as good.
# Energy at which a map without disorder is as likely right as wrong, how fast that changes, how
# much energy a disorder of one counts as, and the lead, as a share of the energy, that makes the
# odds between two maps 2.7 to 1: fitted by benchmarks/confidence.py.
CONFIDENCE = (0.413, 0.051, 1.45, 0.0313)
PARTIAL_LEAD = 2.0  # So many times that lead it takes if a shape is partial: wrong maps fit parts.
# Where the second best costs less, shapes have few features, and a lead means less.
FEATURES = 0.08
# Maps that lead less than this apart, on average, are right together: a right map has a mean error
# below 0.08, and a good one has 0.02.
ALIKE = 0.06
# What a vertex's expected error adds up from: the gaps to its partner in both poses, the square
# root of what its patch leaves unexplained, the distance to where other maps lead, each as likely
# as it is, and what the confidence lacks of one. Fitted so that errors stay below it at nine
# vertices in ten; benchmarks/confidence.py measures how many do.
EXPECTED_ERROR = (0.95, 0.077, 1.9, 0.4)
# Logarithm of the ratio of two parts' areas at which a map's odds halve, if both are in one unit.
STRETCH = 0.5
DISORDER = (0.1, 0.3)  # Up to the first a finished map may be right for sure, from the second not.
# Share of the area, a limb's end. Less of it is no missing part, and different maps lead more of it
# to other limbs.
SMALLEST_PART = 0.03

# Floors of the arithmetic, which decide nothing.
DIGITS = 6  # of costs that are not rounding
