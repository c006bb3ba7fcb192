"""The public names, as ``unbend/__init__.py`` has them."""

import subprocess
import sys

# None in sys.modules: the import fails as where the package is not installed.
CORE_INSTALL = """
import inspect, sys
optional = "sklearn matplotlib pygeodesic pooch fast_simplification lancedb dask distributed"
for package in [*optional.split(), "pyarrow"]:
    sys.modules[package] = None
import unbend
names = dict(inspect.getmembers(unbend))
assert set(unbend.__all__) <= set(names)
starred = {}
exec("from unbend import *", starred)
assert set(unbend.__all__) <= set(starred)
assert names["SpectralMDS"].__doc__
try:
    unbend.SpectralMDS(n_components=2)
except unbend.errors.MissingExtraError as error:
    assert "unbend[sklearn]" in str(error)
else:
    raise AssertionError("nothing was raised")
"""


def test_every_public_name_can_be_had_from_a_core_install():
    subprocess.run([sys.executable, "-W", "error", "-c", CORE_INSTALL], check=True)
