"""The corpus of tools/fuzz without a fuzzer: seeds, and inputs that once broke the rule."""

import resource
from pathlib import Path

import pytest

from tests.fuzz.rule import LONGEST_S, MOST_MIB
from tests.fuzz.targets import TARGETS

CORPUS = Path(__file__).parent / "corpus"
INPUTS = sorted(path for path in CORPUS.glob("*/*") if path.is_file())


def resident_mib():
    """Most memory that this process ever had, MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@pytest.mark.timeout(4 * LONGEST_S)  # what an idle machine does in a tenth of that
@pytest.mark.parametrize("path", INPUTS, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_an_input_gives_a_value_or_an_error_of_ours(path):
    before = resident_mib()
    TARGETS[path.parent.name].run(path.read_bytes())
    assert resident_mib() - before < MOST_MIB


@pytest.mark.parametrize("data", [b"", b"\0", b"\xff" * 100, bytes(range(256))], ids=len)
@pytest.mark.parametrize("name", TARGETS)
def test_any_bytes_are_an_input(name, data):
    TARGETS[name].run(data)


def test_every_target_has_seeds_and_every_seed_a_target():
    assert {path.parent.name for path in INPUTS} == TARGETS.keys()


def test_the_corpus_is_small():
    assert sum(path.stat().st_size for path in INPUTS) < 64 << 10
