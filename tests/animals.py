"""Animals of our own, each made once for all tests: that takes longer than most of them."""

import functools

from unbend.datasets import make_biped, make_quadruped

dog = functools.cache(make_quadruped)
person = functools.cache(make_biped)
