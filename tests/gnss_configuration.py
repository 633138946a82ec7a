"""A configuration of a bus with a speed by satellites and an acceleration, and no radar."""

from pathlib import Path

PACKAGED = Path(__file__).resolve().parents[1] / "dbc" / "adhesion.dbc"
FIRST = "BO_ 257 WheelSpeeds1"
MESSAGE = """BO_ 1280 Satellites: 8 LOCO
 SG_ Speed : 16|16@1+ (0.01,0) [0|655.34] "km/h" ADHESION
 SG_ Acceleration : 32|16@1- (0.0001,0) [-3.2767|3.2767] "g" ADHESION

"""
SATELLITES_ID, CYCLE_MS, DATA_ID = 1280, 1000, 0x500
PER_AXLE = {
    "wheel_speed": ("WheelSpeeds", "WheelSpeed"),
    "tractive_effort": ("TractiveEffort", "TractiveEffort"),
    "axle_load": ("AxleLoads", "AxleLoad"),
}


def write_gnss_configuration(folder: Path, *roles: str) -> Path:
    """Write database and configuration; returns the path of the latter.

    Args:
        folder: Folder for the files.
        roles: Lines of further roles.
    """
    text = PACKAGED.read_text(encoding="utf-8").replace(FIRST, MESSAGE + FIRST)
    text += f'BA_ "GenMsgCycleTime" BO_ {SATELLITES_ID} {CYCLE_MS};\n'
    text += f'BA_ "E2EDataId" BO_ {SATELLITES_ID} {DATA_ID};\n'
    (folder / "satellites.dbc").write_text(text, encoding="utf-8")
    per_axle = [
        f'{role}.{axle} = "{message}{1 + (axle - 1) // 3}.{signal}_Ax{axle}"'
        for role, (message, signal) in PER_AXLE.items()
        for axle in range(1, 7)
    ]
    lines = ["[bus]", 'database = "satellites.dbc"', "[observed_speed]", "enabled = true"]
    lines += ["gnss_std = 0.03"]
    path = folder / "gnss.toml"
    text = "\n".join([*lines, "[roles]", *roles, *per_axle])
    path.write_text(text + "\n", encoding="utf-8")
    return path
