"""Fleet-level diagnosis of a data set, and the files that it leaves beside the tables."""

import json
from collections.abc import Mapping
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from adhesion_can.fleet.dataset import DataSet, put
from adhesion_can.fleet.findings import FleetDiagnosis
from adhesion_can.fleet.overview import FleetOverview, summarise_fleet
from adhesion_can.fleet.places import open_place
from adhesion_can.fleet.pooled_diagnosis import diagnose_fleet
from adhesion_can.fleet.read_evidence import read_evidence
from adhesion_can.fleet.schema import FINDINGS, SEGMENTS, UNITS

JSON, TABLE, PAGE = "fleet.json", "fleet_findings.parquet", "fleet.html"
"""Names of the files in the folder of the data set."""
_OF_UNITS = (
    "unit_id", "vehicle", "line", "status", "error", "verdict", "latitude_deg", "longitude_deg",
)  # fmt: skip
_OF_SEGMENTS = (
    "unit_id", "vehicle", "day", "mu_max", "mu_max_std", "latitude_deg", "longitude_deg",
)  # fmt: skip


def diagnose_data_set(data: DataSet) -> FleetOverview:
    """Diagnose a fleet from its data set, no recording is read again.

    Args:
        data: Data set.

    Raises:
        InputError: The data set cannot be read.

    """
    diagnosis = diagnose_fleet(read_evidence(data))
    units = (row for rows in data.read_rows(UNITS, _OF_UNITS) for row in rows)
    segments = (row for rows in data.read_rows(SEGMENTS, _OF_SEGMENTS) for row in rows)
    return summarise_fleet(diagnosis, units, segments)


def write_results(data: DataSet, overview: FleetOverview, origin: Mapping[str, Any]) -> list[str]:
    """Write `fleet.json` and `fleet_findings.parquet`.

    Args:
        data: Data set.
        overview: Result of `diagnose_data_set`.
        origin: Further entries of `fleet.json`: commands to run next, version and hashes.

    Returns:
        Paths or URLs of the files.

    """
    document = {
        **overview.diagnosis.to_dict(),
        "estimates": [
            {name: getattr(estimate, name) for name in estimate.__slots__}
            for estimate in overview.estimates
        ],
        "failed": overview.failed,
        "verdicts": dict(overview.verdicts),
        **origin,
    }
    text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
    buffer = pa.BufferOutputStream()
    rows = pa.Table.from_pylist(finding_rows(overview.diagnosis), schema=FINDINGS.arrow())
    parquet.write_table(rows, buffer, compression="zstd")
    return [
        write_beside(data, JSON, (text + "\n").encode()),
        write_beside(data, TABLE, buffer.getvalue().to_pybytes()),
    ]


def finding_rows(diagnosis: FleetDiagnosis) -> list[dict[str, Any]]:
    """Rows of the table `fleet_findings`."""
    rows = []
    for finding in diagnosis.findings:
        row, pooled = finding.to_dict(), finding.pooled
        row["place"] = row.pop("where")
        del row["pooled"]
        row["pooled_value"] = None if pooled is None else pooled.value
        row["pooled_std"] = None if pooled is None else pooled.std
        rows.append(row)
    return rows


def write_beside(data: DataSet, name: str, content: bytes) -> str:
    """Write a file into the folder of the data set.

    Returns:
        Path or URL of the file.

    """
    place = open_place(data.out)
    inner = f"{place.inner.rstrip('/')}/{name}"
    put(place, inner, content)
    return place.full(inner)
