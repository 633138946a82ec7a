"""Drives in readings and in frames, and a master of slaves in one process."""

from math import nan

from adhesion_can.api.simulation import build_run_settings, make_simulation
from adhesion_can.bus.receiver import decode
from adhesion_can.fmu.variables import Causality
from adhesion_can.service.core import ServiceCore


def in_phase(config, seconds, seed=1, scenario="dry-wet-dry"):
    """Frames of a drive whose messages are in phase, by stamp, µs."""
    settings = build_run_settings(scenario, seconds, seed, (), config)
    simulation = make_simulation(settings, config, slot_us=0)
    frames = [*simulation.first_frames()]
    frames += [frame for step in simulation.run() for frame in step]
    by_stamp = {}
    for frame in frames:
        by_stamp.setdefault(frame.t_us, []).append(frame)
    return by_stamp


def replayed(config, by_stamp):
    """Outputs of the service by due time, from the frames."""
    found = {}
    core = ServiceCore(config, on_setpoint=found.__setitem__)
    for frames in by_stamp.values():
        for frame in frames:
            core.feed(frame)
    return found


def readings_by_name(config, frames):
    """Values of the readings of some frames by the names of the slaves' variables."""
    messages = {message.plan.frame_id: message for message in config.messages}
    values = {}
    for frame in frames:
        if frame.arbitration_id not in messages:
            continue
        for reading in decode(messages[frame.arbitration_id], frame).values:
            suffix = f"_{reading.axle}" if reading.axle else ""
            values[f"{reading.role.value}{suffix}"] = (
                nan if reading.value is None else reading.value
            )
    return values


def starts(slave):
    """Start values of a slave's variables by name."""
    return {one.name: one.start for one in slave.variables}


def stepped(slave, changes, until_us, step_us, **parameters):
    """Outputs of a slave after each step by time, µs, and at the start.

    Args:
        slave: The slave.
        changes: Changed inputs by time, µs.
        until_us: End, µs.
        step_us: Length of a step, µs.
        parameters: Values of parameters.

    """
    values = {**starts(slave), **parameters}
    found = {0: slave.setup(values, 0)}
    for t_us in range(0, until_us, step_us):
        values.update(changes.get(t_us, {}))
        found[t_us + step_us] = slave.step(t_us, t_us + step_us, values)
    return found


def coupled(slaves, seconds, step_us=2000, **parameters):
    """Share of the steps in TRACKING and mean adhesion used, of slaves in this process."""
    values = [{**starts(slave), **parameters} for slave in slaves]
    outputs = {}
    for slave, own in zip(slaves, values, strict=True):
        outputs |= slave.setup(own, 0)
    tracking = used = 0.0
    steps = round(seconds * 1e6 / step_us)
    inputs = [
        [one.name for one in slave.variables if one.causality is Causality.INPUT]
        for slave in slaves
    ]
    for number in range(steps):
        for own, names in zip(values, inputs, strict=True):
            own.update({name: outputs[name] for name in names if name in outputs})
        outputs = {}
        for slave, own in zip(slaves, values, strict=True):
            outputs |= slave.step(number * step_us, (number + 1) * step_us, own)
        tracking += outputs["status"] == 1.0
        used += outputs["true_adhesion_used"]
    return tracking / steps, used / steps
