"""Where a result comes from: version and hashes, in every output."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from adhesion_can import __version__
from adhesion_can.config import Configuration
from adhesion_can.files import file_sha256
from adhesion_can.physics.estimate import Estimate


def provenance(configuration: Configuration, inputs: Sequence[Path] = ()) -> dict[str, Any]:
    """Version, and hashes of inputs, database, configuration and, where one is used, model."""
    model = configuration.model
    named = {} if model is None else {"model": {"path": model.where, "sha256": model.sha256}}
    return {
        "version": __version__,
        "inputs": [{"path": str(path), "sha256": file_sha256(path)} for path in inputs],
        "dbc": {"path": configuration.database.path.name, "sha256": configuration.database.sha256},
        "configuration": {"path": configuration.where, "sha256": configuration.sha256 or None},
        **named,
    }


def texts(origin: Mapping[str, Any]) -> dict[str, str]:
    """Provenance as the metadata of a file; what has no name in it is left away."""
    return {
        f"adhesion_can.{key}": value if isinstance(value, str) else json.dumps(value)
        for key, value in origin.items()
        if not isinstance(value, Mapping) or value["sha256"]
    }


def estimate_json(estimate: Estimate) -> dict[str, Any]:
    """An estimate as `identify --json` writes it; the std of what cannot be identified is null."""
    known = estimate.identifiable
    variances = estimate.covariance.diagonal()

    def number(value: float, std: float, told: bool) -> dict[str, float | None]:
        return {"value": value, "std": std if told and std < float("inf") else None}

    curve = {
        name: number(value, float(max(variance, 0.0)) ** 0.5, known.both)
        for name, value, variance in zip(("c1", "c2", "c3"), estimate.theta, variances, strict=True)
    }
    return {
        **curve,
        "mu_max": number(estimate.mu_max, estimate.mu_max_std, known.mu_max),
        "lambda_m": number(estimate.lambda_m, estimate.lambda_m_std, known.lambda_m),
        "noise_std": estimate.noise_std,
        "samples": estimate.samples,
        "identifiable": {"mu_max": known.mu_max, "lambda_m": known.lambda_m},
    }
