"""Files made to harm: chains without an end, sizes that are not there, much from few bytes."""

import gzip
import io
import struct
from contextlib import redirect_stderr, redirect_stdout

import numpy as np
import pytest

from adhesion_can.cli.main import main
from adhesion_can.errors import TableError
from adhesion_can.recordings.mf4_links import LinkError, require_sound_links
from adhesion_can.recordings.tables import parquet_file
from adhesion_can.recordings.tables import text as table_text
from adhesion_can.recordings.tables.sample_table import is_table, read_table
from tests.fuzz.mutants import mutant, play, seeds
from tests.recordings.test_mf4 import group, logged, unsorted_logging

pytest.importorskip("asammdf")


def places(data):
    return [at for at in range(0, len(data) - 24, 8) if data[at : at + 2] == b"##"]


def changed_links(data):
    """Each of the first links of each block leads to the block itself."""
    for at in places(data):
        links = struct.unpack_from("<Q", data, at + 16)[0]
        for place in range(min(links, 6)):
            mutant = bytearray(data)
            struct.pack_into("<Q", mutant, at + 24 + 8 * place, at)
            yield f"{data[at + 2 : at + 4].decode()} {place}", bytes(mutant)


def table_seed():
    return seeds(".mf4")[1]


@pytest.mark.costly
@pytest.mark.timeout(600)
def test_every_link_of_an_mf4_may_lead_back():
    found = [(name, play(".mf4", data)) for name, data in changed_links(table_seed())]
    assert len(found) > 40
    assert {outcome.status for _, outcome in found} <= {0, 1, 2}
    slow = {name: outcome.seconds for name, outcome in found if outcome.seconds > 5}
    assert not slow


@pytest.mark.parametrize("kind", [b"DG", b"CG", b"CN", b"FH"])
def test_a_chain_without_an_end_is_named(tmp_path, kind):
    data = bytearray(table_seed())
    at = data.index(b"##" + kind)
    struct.pack_into("<Q", data, at + 24, at)
    path = tmp_path / "a.mf4"
    path.write_bytes(data)
    with pytest.raises(LinkError, match=rf"the {kind.decode()} block at {at}: its chain is a loop"):
        require_sound_links(path)
    assert play(".mf4", bytes(data)).status == 2


def test_a_chain_of_several_blocks_may_not_close(tmp_path):
    data = bytearray(table_seed())
    first, *_, last = (at for at in places(data) if data[at : at + 4] == b"##CN")
    for at in places(data):
        if data[at : at + 4] == b"##CN" and not any(data[at + 24 : at + 32]):
            struct.pack_into("<Q", data, at + 24, first if at != first else last)
    path = tmp_path / "a.mf4"
    path.write_bytes(data)
    with pytest.raises(LinkError, match="its chain is a loop"):
        require_sound_links(path)


def test_a_block_that_cannot_hold_what_it_claims_is_named(tmp_path):
    data = bytearray(table_seed())
    at = data.index(b"##DZ")
    struct.pack_into("<Q", data, at + 24 + 8, 2**40)
    path = tmp_path / "a.mf4"
    path.write_bytes(data)
    with pytest.raises(LinkError, match=f"the DZ block at {at} cannot hold {2**40} bytes"):
        require_sound_links(path)


@pytest.mark.parametrize("number", range(4))
def test_sound_files_have_sound_links(tmp_path, number):
    path = tmp_path / "a.mf4"
    path.write_bytes(seeds(".mf4")[number])
    require_sound_links(path)


def test_other_loggers_files_have_sound_links(tmp_path):
    require_sound_links(unsorted_logging(tmp_path / "a.mf4", 50))
    parts = (group(30_000, seed=n, bus=n, DataBytes="(64,)u1") for n in range(8))
    require_sound_links(logged(tmp_path / "b.mf4", *parts))


def test_an_archive_is_no_measurement(tmp_path):
    path = tmp_path / "a.mf4"
    path.write_bytes(b"PK\3\4" + bytes(200))
    with pytest.raises(LinkError, match="does not start like an MDF file"):
        require_sound_links(path)


def test_channels_of_several_lengths_are_no_table():
    data = mutant(".mf4", 19_811_195)
    assert "differ in length" in play(".mf4", data).lines[0]


# --- what unpacks to much ------------------------------------------------------------------------


def test_a_packed_table_may_hold_no_more_than_tables_do(tmp_path, monkeypatch):
    monkeypatch.setattr(table_text, "ALWAYS_READ", 1 << 20)
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(b"time_s,slip,adhesion\n" + b"0,0,0\n" * 400_000))
    with pytest.raises(TableError, match="more than 1 MiB of text"):
        read_table(path)
    numbers = np.random.default_rng(1).normal(size=(40_000, 3)).tolist()
    text = "time_s,slip,adhesion\n" + "".join(f"{a},{b},{c}\n" for a, b, c in numbers)
    assert len(text) > 2 << 20
    path.write_bytes(gzip.compress(text.encode()))
    assert read_table(path).rows == 40_000


def test_a_parquet_file_of_one_number_is_no_table(tmp_path, monkeypatch):
    pa = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    monkeypatch.setattr(parquet_file, "ALWAYS_READ", 1000)
    path = tmp_path / "a.parquet"
    zeros = np.zeros(1_000_000)
    parquet.write_table(pa.table(dict.fromkeys(("slip", "adhesion"), zeros)), path)
    assert path.stat().st_size < 20_000
    with pytest.raises(TableError, match="2000000 cells in a file of"):
        read_table(path)


@pytest.mark.costly
def test_a_matlab_file_of_zeros_takes_no_gigabyte(tmp_path):
    from scipy.io import savemat

    path = tmp_path / "a.mat"
    savemat(path, {"slip": np.zeros(90_000_000)}, do_compression=True)
    assert is_table(path)
    with pytest.raises(TableError, match=r"memory|not readable"):
        read_table(path)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("number", ["1e300", "-1e300", "1e31", "1e999"])
@pytest.mark.parametrize("command", ["check", "identify", "diagnose"])
def test_numbers_that_nobody_measures_are_none(tmp_path, number, command):
    rng = np.random.default_rng(1)
    lines = ["time_s,slip,adhesion,speed_mps,other"]
    for k in range(400):
        slip = rng.uniform(0, 0.2)
        mu = 0.4 * (1 - np.exp(-60 * slip)) - 0.3 * slip + rng.normal(0, 0.01)
        cells = [f"{k * 0.02:.2f}", f"{slip:.6f}", f"{mu:.6f}", f"{20 + k % 7}", f"{rng.random()}"]
        if k % 50 == 7:
            cells[1 + k // 50 % 4] = number
        lines.append(",".join(cells))
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n")
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        assert main([command, str(path)]) == 0
    assert err.getvalue() == ""
