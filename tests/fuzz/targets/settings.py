"""Files of settings: configuration, extended model with its formulas, and kept state."""

import json
from hashlib import sha256
from math import isfinite

import numpy as np

from adhesion_can.config.load import load_configuration
from adhesion_can.config.model_file import model_text, read_model
from adhesion_can.physics.effects import ActiveEffect, Contact, LagStates, compute_change
from adhesion_can.physics.effects.expression import ExpressionError
from adhesion_can.physics.effects.formula import CONTACT_CHANNELS, parse_formula
from adhesion_can.service.kept_state import (
    MOST_SURFACES,
    StateError,
    state_from_text,
    state_to_text,
)
from tests.fuzz.rule import file_of, value_or_refusal

_ROWS = 5
_NOW_US, _MOST_AGE_S = 1_700_000_000_000_000, 3600.0


def configuration(data):
    """A configuration file: settings for a vehicle that has axles and wheels."""
    found = value_or_refusal(load_configuration, file_of("fuzz.toml", data))
    if found is not None:
        assert found.vehicle.axles >= 1
        value_or_refusal(found.require_identification)


def model(data):
    """A model file: written again it reads alike, and its effects give factors."""
    found = value_or_refusal(read_model, file_of("model.toml", data))
    if found is None:
        return
    again = read_model(file_of("again.toml", model_text(found).encode()))
    assert again == found
    names = {name for active in found.actives for name in active.effect.requires.covariates}
    _require_factors(found.in_contact, names)


def formula(data):
    """A formula as a user writes it: it gives a factor or none, and nothing is executed."""
    text = data.decode("utf-8", "replace")
    found = value_or_refusal(parse_formula, text, own=(ExpressionError,))
    if found is not None:
        values = tuple(parameter.typical for parameter in found.parameters)
        names = set(found.channels) - CONTACT_CHANNELS.keys()
        _require_factors([ActiveEffect(found, values)], names)


def _require_factors(actives, names):
    """Factors of contacts in the shape of the contacts; they may be NaN or infinite."""
    slip = np.linspace(-0.1, 0.1, _ROWS)
    contact = Contact(
        slip=slip,
        creep_speed=10.0 * slip,
        speed=np.full(_ROWS, 10.0),
        load=np.linspace(2e5, 2.4e5, _ROWS),
        time_s=0.02 * np.arange(_ROWS),
        axle=np.ones(_ROWS),
        place=np.ones(_ROWS),
        adhesion=0.2 * np.sign(slip),
        covariates={name: np.arange(_ROWS) - 1.0 for name in names},
    )
    change = compute_change(actives, contact, LagStates())
    assert np.broadcast_to(change.factor, slip.shape).dtype == np.float64
    assert change.slip.shape == slip.shape


def state(data):
    """A state file, as it is and with the checksum that it should have."""
    text = data.decode("utf-8", "replace")
    _require_state(text)
    try:
        document = json.loads(text)
        whole = json.dumps(document, sort_keys=True)
    except (ValueError, RecursionError):
        return
    if not isinstance(document, dict) or "sha256" in document:
        return
    _require_state(json.dumps({**document, "sha256": sha256(whole.encode()).hexdigest()}))


def _require_state(text):
    found = value_or_refusal(
        state_from_text, text, "vehicle", _NOW_US, _MOST_AGE_S, own=(StateError,)
    )
    if found is not None:
        assert all(isfinite(value) for theta in found.curves for value in theta)
        assert len(found.surfaces) <= MOST_SURFACES
        assert state_from_text(state_to_text(found), "vehicle", _NOW_US, _MOST_AGE_S) == found
