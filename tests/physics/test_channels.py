"""The catalogue of channels: one row a channel, and every role and attribute where it belongs."""

from dataclasses import fields

from adhesion_can.physics.channels import (
    CHANNEL_BY_NAME,
    CHANNELS,
    COVARIATES,
    ChannelOrigin,
    channel_label,
    channel_unit,
    model_channel,
)
from adhesion_can.physics.effects import Contact
from adhesion_can.physics.readings import PER_AXLE, SPEED_AIDS, Role

NO_COVARIATE = {
    Role.CHANNEL, *PER_AXLE, *SPEED_AIDS, Role.VEHICLE_SPEED, Role.SPEED_SOURCE, Role.DIRECTION
}  # fmt: skip


def test_names_and_labels_are_there_once():
    assert len(CHANNEL_BY_NAME) == len(CHANNELS)
    assert len({channel.label for channel in CHANNELS}) == len(CHANNELS)
    assert all(channel.name and channel.label for channel in CHANNELS)


def test_every_role_of_the_surroundings_is_a_covariate():
    assert set(COVARIATES) == set(Role) - NO_COVARIATE
    for role, name in COVARIATES.items():
        channel = CHANNEL_BY_NAME[name]
        assert (channel.role, channel.origin) == (role, ChannelOrigin.COVARIATE)
        assert channel.column == name
        assert channel.contact == ""


def test_channels_of_the_contact_are_attributes_of_it():
    attributes = [channel.contact for channel in CHANNELS if channel.contact]
    assert len(attributes) == len(set(attributes))
    assert set(attributes) < {field.name for field in fields(Contact)}


def test_units_and_labels_of_known_and_of_other_columns():
    assert channel_unit("rail_temperature_degC") == "degC"
    assert channel_label("rail_temperature_degC") == "rail temperature"
    assert channel_unit("slip_angle_deg") == ""
    assert channel_label("slip_angle_deg") == "slip_angle_deg"


def test_an_extended_model_has_what_a_contact_has_and_covariates():
    assert [model_channel(name) for name in ("axle_load", "time", "slip")] == [
        "load",
        "time_s",
        "slip",
    ]
    assert model_channel("position") == model_channel("tractive_effort") == ""
    assert model_channel("rain") == "rain"
    assert model_channel("slip_angle_deg") == "slip_angle_deg"
