"""The service: input frames to setpoint frames, live on a bus or over recordings.

Read `core` first, the reference path frame by frame, and then its parts in the order of the data:
`schedule`, `inputs`, `estimation_loop`, `states`, `outputs`, `output_messages`. `live` runs a core
on a bus (`reconnecting_bus`, `receive_queue`, `echoes`), `replay` runs one over recordings;
`column_replay` is an optimisation of `replay`.
"""
