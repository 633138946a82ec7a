"""A database of your own: a locomotive with other ids, names and units, and no checksums.

    python own_database.py [DURATION_S]

Writes loco.dbc, loco.toml and loco.log, checks the log and replays it. A real log takes the place
of loco.log: here one is made from a simulated drive, as a gateway would translate it. `adhesion-can
init --dbc loco.dbc` guesses the same roles.
"""

import subprocess
import sys
from pathlib import Path

import can
import cantools

import adhesion_can
from adhesion_can.bus.database import packaged_path

AXLES = (1, 2, 3, 4)

DATABASE = """VERSION ""
NS_ :
BS_:
BU_: TCU
BO_ 1280 Odometer: 8 TCU
 SG_ Speed : 7|16@0+ (0.01,0) [0|120] "km/h" TCU
""" + "".join(
    f"""BO_ {1296 + axle} Drive{axle}: 8 TCU
 SG_ Wheel{axle} : 7|16@0+ (0.1,0) [0|3000] "rpm" TCU
 SG_ Force{axle} : 23|16@0- (0.02,0) [-600|600] "kN" TCU
"""
    for axle in AXLES
)
DATABASE += 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;\n'
DATABASE += 'BA_DEF_DEF_ "GenMsgCycleTime" 20;\n'
DATABASE += "".join(f'BA_ "GenMsgCycleTime" BO_ {1296 + axle} 10;\n' for axle in AXLES)

CONFIGURATION = """[vehicle]
axles = 4
wheel_radius_m = 0.625
axle_load_N = 245e3
wheelset_inertia_kgm2 = 200.0
train_mass_kg = 1.65e6

[bus]
database = "loco.dbc"                # beside this file

[roles]                              # unit and cycle are those of the database
vehicle_speed = "Odometer.Speed"
""" + "".join(
    f'"wheel_speed.{axle}" = "Drive{axle}.Wheel{axle}"\n'
    # Their sign counts braking as positive, so it is turned.
    f'"tractive_effort.{axle}" = {{ signal = "Drive{axle}.Force{axle}", sign = -1 }}\n'
    for axle in AXLES
)


def main(duration_s: float = 30.0) -> None:
    Path("loco.dbc").write_text(DATABASE)
    Path("loco.toml").write_text(CONFIGURATION)
    write_log(duration_s)
    command = str(Path(sys.executable).with_name("adhesion-can"))
    subprocess.run([command, "check", "loco.log", "--config", "loco.toml"], check=True)
    words = ["replay", "loco.log", "--config", "loco.toml", "--table", "setpoints.csv"]
    subprocess.run([command, *words], check=True)


def write_log(duration_s: float) -> None:
    """loco.log: a simulated drive on a wet rail, in the locomotive's messages."""
    ours = cantools.database.load_file(packaged_path())
    theirs = cantools.database.load_file("loco.dbc")
    wheels: dict[int, float] = {}
    with can.Logger("loco.log") as log:

        def write(frame: adhesion_can.Frame, name: str, values: dict[str, float]) -> None:
            message = theirs.get_message_by_name(name)
            data = message.encode(values)
            stamp, identifier = frame.t_us / 1e6, message.frame_id
            log.on_message_received(
                can.Message(stamp, identifier, is_extended_id=False, data=data, channel="can0")
            )

        for frame in adhesion_can.simulate("wet", duration_s).frames:
            message = ours.get_message_by_frame_id(frame.arbitration_id)
            values = message.decode(frame.data, decode_choices=False)
            if message.name == "VehicleSpeed":
                write(frame, "Odometer", {"Speed": values["VehicleSpeed"] * 3.6})
            for axle in AXLES:
                if f"WheelSpeed_Ax{axle}" in values:
                    wheels[axle] = values[f"WheelSpeed_Ax{axle}"] * 30 / 3.141592653589793
                effort = values.get(f"TractiveEffort_Ax{axle}")
                if effort is not None and axle in wheels:
                    write(
                        frame,
                        f"Drive{axle}",
                        {f"Wheel{axle}": wheels[axle], f"Force{axle}": -effort / 1e3},
                    )


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
