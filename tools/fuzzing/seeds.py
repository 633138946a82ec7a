"""Seeds of the corpus, from the project's own writers and by hand: small and of every form.

`python tools/fuzzing/seeds.py` writes them to `tests/fuzz/corpus`.
"""

import gzip
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from adhesion_can.bus.frame import ADVANCE, STOP, Frame, Mark
from adhesion_can.config.model_file import model_text
from adhesion_can.estimation.extended.model import BaseCurve, ExtendedModel
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.physics.effects import ActiveEffect, effect_by_id
from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.physics.effects.formula import formula_of
from adhesion_can.recordings.candump import format_frame, format_mark
from adhesion_can.service.kept_state import KeptState, KeptSurface, state_to_text
from tests.recordings import test_blf_columns as blf_tests
from tests.recordings import test_trace_columns as trace_tests
from tests.recordings import wire_blf
from tests.wire import Bench

ROOT = Path(__file__).resolve().parents[2]
FRAMES = (
    Frame(1_700_000_000_123_456, 0x101, bytes(range(8)), "can0"),
    Frame(1_700_000_000_133_456, 0x18FEF100, b"\xff\x01", "vcan1", is_extended=True),
    Frame(1_700_000_000_143_456, 0x201, bytes(12), "can0", is_fd=True),
    Frame(1_700_000_000_153_456, 0x111, b"", "can0", is_remote=True),
    Frame(1_700_000_000_163_456, 0x88, b"", "can0", is_error=True),
    Mark(1_700_000_000_163_456, ADVANCE),
    Mark(1_700_000_000_173_456, STOP),
)
COLUMNS = (
    " (000.000000)  can0  123   [8]  11 22 33 44 55 66 77 88   '.\"3DUfw.'",
    " (2026-01-02 03:04:05.678901)  can1  RX - -  18FEF100   {9}  00 01 02 03 04 05 06 07",
    " (1700000000.100000)  can0  123  [12]  00 11 22 33 44 55 66 77 88 99 AA BB",
    " (000.000250)  can0  123   [0]  remote request",
    "  can0  123   [2]  11 22",
)
DBC = """VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 256 M: 8 A
 SG_ Mux M : 0|4@1+ (1,0) [0|15] "" B
 SG_ S m1 : 8|16@1- (0.5,-40) [-100|100] "km/h" B
 SG_ T m2 : 15|16@0+ (1,0) [0|0] "rpm" B
BO_ 2566844672 J: 8 Vector__XXX
 SG_ F : 0|32@1- (1,0) [0|0] "kN" Vector__XXX
SIG_VALTYPE_ 2566844672 F : 1;
SG_MUL_VAL_ 256 S Mux 1-3, 5-5;
CM_ SG_ 256 S "comment";
BA_DEF_ BO_ "E2EDataId" INT 0 65535;
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "E2EDataId" 0;
BA_ "E2EDataId" BO_ 256 257;
VAL_ 256 Mux 0 "zero" 1 "one" ;
"""
FAULTY = """VERSION ""
BO_ 256 M: 1 A
 SG_ S : 60|16@1- (1,0) [0|0] "" B
BO_ 257 N: 8 A
 SG_ S : 0|8@1+ (1,0) [0|0] "" B
 SG_ S : 8|8@1+ (1,0) [0|0] "" B
"""
KCD = """<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0"><Document/><Bus name="b">
<Message id="0x1" length="8" name="M"><Signal name="S" offset="8" length="16">
<Value slope="0.5" unit="V"/></Signal></Message></Bus></NetworkDefinition>"""
SYM = """FormatVersion=6.0 // Do not edit this line!
Title="t"
{SENDRECEIVE}
[M]
ID=100h
Len=8
Var=S unsigned 0,16 /f:0.5
"""
CONFIGURATION = """estimator = "tracker"
[vehicle]
axles = 2
wheel_radius_m = [0.46, 0.46]
axle_load_N = 130e3
wheelset_inertia_kgm2 = 120.0
[vehicle.geometry]
axles_per_bogie = [2]
pivot_distance_m = 8.4
axle_spacing_m = 2.6
coupler_height_m = 0.98
traction_height_m = 0.5
[bus]
database = "fuzz.dbc"
[roles]
vehicle_speed = { signal = "VehicleSpeed.VehicleSpeed", unit = "km/h", cycle_ms = 20 }
"wheel_speed.1" = { signal = "WheelSpeeds1.WheelSpeed_Ax1", channel = "can0", unit = "rpm" }
"tractive_effort.1" = { signal = "TractiveEffort1.TractiveEffort_Ax1", sign = -1 }
"""
SETTINGS = """[service]
hold_s = 2.0
restart_s = 30
[table]
slip = { column = "kappa", unit = "percent", sign = -1 }
[channels]
wind = { signal = "Environment.AirTemperature" }
[tracker]
[identifiability]
[sampling]
"""
HEADING = "time_s,slip,adhesion,speed_mps,axle,surface\n"
ROWS = "".join(f"{0.1 * i:.1f},{0.01 * i},{0.03 * i:.2f},10,{1 + i % 2},dry\n" for i in range(6))
GERMAN = "t [ms];kappa;Fx [kN];Fz [N]\n0;1,5;3,2;100000\n10;2,5;4,2;100000\n"
FORMULAS = (
    "1 + a * max(wind - b, 0) where a=0.1, b=5",
    "exp(-a * abs(slip)) / (1 + b * 'rail temp' ** 2) where a=1e-3, b=2",
    "1 + a * lag(tanh(speed - 3), tau) where a=0.1, tau=2",
    "sqrt(min(load, log(a))) where a=-1",
)


def model_texts() -> dict[str, str]:
    """Texts of models: effects of all kinds, a spline, another family of curves."""
    humidity, radius = effect_by_id("humidity"), effect_by_id("wheel_radius")
    effects = tuple(
        ActiveEffect(effect, tuple(p.typical for p in effect.parameters))
        for effect in (humidity, radius, formula_of("1 + a * max(wind - b, 0)", {"a": 0.1, "b": 5}))
    )
    knots, base = (0.0,) * 4 + (1.0,) * 4, (0.4, 30.0, 0.3)
    spline = Empirical("speed", "factor", knots, (0.0, 0.1, 0.1, 0.0))
    identity = tuple(tuple(float(i == j) for j in range(3)) for i in range(3))
    family = FAMILIES["magic_formula"]
    curve = BaseCurve(family, tuple(p.typical for p in family.parameters), None, (0.1, 0.2))
    provenance = {"version": "1", "command": "diagnose"}
    return {
        "effects": model_text(
            ExtendedModel(base, identity, effects, (None,) * 3, (spline,), None, provenance)
        ),
        "family": model_text(ExtendedModel(base, curve=curve)),
    }


def output_changes() -> dict[str, bytes]:
    """Changes of the output messages: message, kind of change, and what it becomes, by numbers."""
    size, cycle, far_start, order, sign = 0, 2, 7, 9, 10
    return {
        "own": bytes(octet for message in range(4) for octet in (message, size, 0)),
        "health": bytes([4, size, 0]),
        # A signal behind the first 8 bytes in the other byte order, and one with a sign.
        "moved": bytes([0, size, 3, 0, far_start, 3, 100, 0, 0, order, 3, 0, 0, sign, 5]),
        "cycles": bytes([1, cycle, 8, 2, cycle, 4, 3, cycle, 0, 4, cycle, 8]),
    }


def blf_files() -> dict[str, bytes]:
    """Objects of all kinds, packed and plain, over the edges of their containers."""
    _, content = blf_tests.small()
    plain = wire_blf.container(wire_blf.fd64(1, b"abc") + wire_blf.error(), method=0)
    return {"mixed": b"\xff" + content, "plain": b"\x01" + wire_blf.blf(plain)}


def seeds() -> dict[str, dict[str, bytes]]:
    """Seeds by target and name."""
    lines = [(format_mark if isinstance(f, Mark) else format_frame)(f) for f in FRAMES]
    drive = "".join(map(format_frame, Bench().drive(0, 30_000)))
    text = "".join(lines).encode()
    surfaces = tuple(KeptSurface((0.4, 30.0, 0.3), i, 1_699_999_999_000_000) for i in range(2))
    state = state_to_text(KeptState("vehicle", surfaces))
    bare = {key: value for key, value in json.loads(state).items() if key != "sha256"}
    models = model_texts()
    return {
        "candump_line": {
            **{f"log{i}": line.encode() for i, line in enumerate(lines)},
            **{f"columns{i}": line.encode() for i, line in enumerate(COLUMNS)},
        },
        "candump_text": {
            "log": b"\x20\0" + text,
            "eager": b"\x7f\x01" + drive.encode(),
            "columns": b"\x20\x01" + "\n".join(COLUMNS * 2).encode(),
            "gzip": b"\x20\x01" + gzip.compress(text, mtime=0),
        },
        "blf": blf_files(),
        "asc": {"vector": b"\x01" + trace_tests.vector(1).encode()},
        "trc": {
            f"peak{version.replace('.', '')}": b"\x01" + trace_tests.peak(version, 1).encode()
            for version in trace_tests.TRC
        },
        "database": {"good": DBC.encode(), "faulty": FAULTY.encode()},
        "outputs": output_changes(),
        "other_database": {"kcd": b"\0" + KCD.encode(), "sym": b"\x02" + SYM.encode()},
        "decoding": {
            "plain": bytes([0, 0, 8, 2, 1, 4, 255, 2]) * 6,
            "multiplexed": bytes([0, 3, 0, 0, 16, 0, 0, 8, 1, 36, 4, 2, 0, 1, 16, 2, 47, 6, 3]) * 3,
        },
        "acceptance": {"cycle": bytes([100, 0, 0, 0, 1, 16, 0, 16, 0, 16, 0, 1]) * 8},
        "counter": {"in_order": b"".join(bytes([1, 10, 100, i]) for i in range(15))},
        "secoc": {"changed": bytes([1, 1, 0, 0, 0, 8, *range(8), 0, 5, 7, 3]) * 3},
        "configuration": {"vehicle": CONFIGURATION.encode(), "settings": SETTINGS.encode()},
        "model": {name: text.encode() for name, text in models.items()},
        "formula": {f"form{i}": text.encode() for i, text in enumerate(FORMULAS)},
        "state": {"whole": state.encode(), "bare": json.dumps(bare).encode()},
        "table": {
            "commas": b"\0" + (HEADING + ROWS).encode(),
            "german": b"\x01" + GERMAN.encode(),
            "gzip": b"\0" + gzip.compress((HEADING + ROWS).encode(), mtime=0),
            "commented": b"\0# slip adhesion\n# slip;adhesion\n1;2\n3;4\n",
            "late": b"\x03time_s,slip,mu\n0,1,2\n0.5,2,3\n1,2,4\n",
        },
        "choice": {"all": b"slip=kappa,unit=percent,sign=-1,late_s=0.5"},
        "service": {
            "drive": bytes([7, 20, 100, 0, 2, 1, 0, 0, 1, 1]) * 3,
            "marks": bytes([0, 3, 100, 0, 2, 1, 210, 224, 0, 50, 230, 2, 253, 0, 1, 1, 10, 230, 3]),
            "sealed": bytes([0, 50, 10, 100, 0, *range(8), 10, 200, 1, 2, 3, 4, 8, *range(8)]) * 4,
        },
    }


def main() -> None:
    """Write the seeds."""
    for target, named in seeds().items():
        folder = ROOT / "tests" / "fuzz" / "corpus" / target
        folder.mkdir(parents=True, exist_ok=True)
        for name, data in named.items():
            (folder / name).write_bytes(data)


if __name__ == "__main__":
    main()
