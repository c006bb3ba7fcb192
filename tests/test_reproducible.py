"""The same input gives the same bits, and nearly the same numbers wherever it is computed."""

import platform
from pathlib import Path

import pytest

from reproducible import ENGINES, KERNELS, TOLERANCES, differences, elsewhere, with_engine

PAGE = Path(__file__).parents[1] / "docs" / "numerical-honesty.md"


@pytest.fixture(scope="module")
def first():
    """Results of a process of one thread, which computed them twice, to the same bits."""
    return elsewhere(twice=True)


def test_another_process_of_two_threads_gives_the_same_bits(first):
    again, _ = elsewhere(OMP_NUM_THREADS="2", OPENBLAS_NUM_THREADS="2")
    assert {name for name in again if again[name].tobytes() != first[0][name].tobytes()} == set()
    assert again.keys() == TOLERANCES.keys()


@pytest.mark.parametrize("processor", KERNELS)
def test_kernels_of_other_processors_agree(first, processor):
    results, blas = first
    if not blas.startswith("openblas ") or platform.machine() not in ("x86_64", "AMD64"):
        pytest.skip(f"kernels can be chosen of OpenBLAS on x86 alone, and this is {blas}")
    if blas.endswith(processor):
        pytest.skip(f"the others are compared with those of {processor} already")
    if processor == "SkylakeX" and "avx512dq" not in Path("/proc/cpuinfo").read_text():
        pytest.skip("this processor cannot run those of SkylakeX")
    others, blas = elsewhere(OPENBLAS_CORETYPE=processor)
    assert blas.endswith(processor), blas
    check(differences(results, others))


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_that_factorise_agree(engine, first, monkeypatch):
    check(differences(first[0], with_engine(engine, monkeypatch.setattr)))


def test_the_page_states_the_tolerances():
    page = PAGE.read_text()
    assert [
        name for name, share in TOLERANCES.items() if f"| {name} | {share:g} |" not in page
    ] == []


def check(found):
    """Hold differences to what is stated."""
    assert {name: share for name, share in found.items() if not share <= TOLERANCES[name]} == {}
