"""The commands: use, one line of help and two examples of each."""

from collections.abc import Mapping
from dataclasses import dataclass

GROUPS: Mapping[str, str] = {
    "live": "on a bus, or in another tool",
    "recording": "on recordings and tables",
    "criticism": "what data say about the simulation",
    "set-up": "vehicle, database and shell",
}
"""Uses of the commands, with a few words each, in the order of the help."""


@dataclass(frozen=True, slots=True)
class Command:
    """Help of one command.

    Attributes:
        group: Use, a key of `GROUPS`.
        line: What it does, in a few words.
        first: Example: what a command line does, and the line without 'adhesion-can' in front.
        second: Another example.

    """

    group: str
    line: str
    first: tuple[str, str]
    second: tuple[str, str]


COMMANDS: Mapping[str, Command] = {
    "demo": Command(
        "live",
        "locomotive, service and creep controller on an embedded bus",
        ("watch it for 40 s, then open its report", "demo --open"),
        ("lines instead of the live view", "demo --headless --duration 20"),
    ),
    "run": Command(
        "live",
        "the service on a bus",
        (
            "with a log that 'replay' repeats",
            "run -i socketcan -c vcan0 --log run.log",
        ),
        (
            "your own messages; listen for a minute and send nothing",
            "run -i socketcan -c can0 --config mine.toml --dry-run --duration 60",
        ),
    ),
    "simulate": Command(
        "live",
        "a simulated locomotive, to a log or on a bus",
        (
            "a log with an effect that 'diagnose' finds",
            "simulate --scenario sweep --duration 240 --effect load_dependence --log drive.log",
        ),
        (
            "on a bus, following the setpoints of 'run'",
            "simulate --scenario dry-wet-dry --duration 30 --closed-loop -i socketcan -c vcan0",
        ),
    ),
    "monitor": Command(
        "live",
        "a live view of a bus or a recording; never sends",
        ("a bus", "monitor -i socketcan -c vcan0"),
        ("a recording, ten times as fast", "monitor drive.log --speed 10"),
    ),
    "control": Command(
        "live",
        "the reference creep controller on a bus",
        ("follow the service until Ctrl-C", "control -i socketcan -c vcan0"),
        (
            "drive the plan of 'diagnose --next-drive'",
            "control -i socketcan -c vcan0 --plan plan.toml",
        ),
    ),
    "export": Command(
        "live",
        "service, locomotive or controller as an FMU",
        ("the service, for the vehicle of a file", "export --fmu service s.fmu --config mine.toml"),
        (
            "a locomotive with a diagnosed cause, for Linux alone",
            "export --fmu locomotive l.fmu --model model.toml --platform linux64",
        ),
    ),
    "check": Command(
        "recording",
        "whether a recording is usable",
        ("signals, rates, faults and excitation", "check drive.log"),
        (
            "your own messages, with a page of the signals over time",
            "check drive.blf --config mine.toml --html check.html",
        ),
    ),
    "replay": Command(
        "recording",
        "the service over recordings",
        ("the setpoints, one per row", "replay drive.log --table setpoints.csv"),
        (
            "with the model of 'diagnose', and a page",
            "replay drive.log --model model.toml --html replay.html",
        ),
    ),
    "identify": Command(
        "recording",
        "one batch fit with standard errors",
        ("every curve family, for each surface", "identify drive.log --curve all"),
        (
            "a table whose slip is a percentage",
            "identify rig.csv --column slip=kappa,unit=percent",
        ),
    ),
    "convert": Command(
        "recording",
        "any recording, decoded with any database, to columns",
        ("one table of all signals", "convert drive.blf --dbc mine.dbc --out drive.parquet"),
        (
            "the speeds only, one row every 10 ms",
            "convert drive.log --dbc mine.dbc --signals '*Speed*' --raster 10ms --out v.csv",
        ),
    ),
    "fleet": Command(
        "recording",
        "many recordings to one Parquet data set, on a cluster",
        ("a folder of logs, on this machine", "fleet logs/ --out result/"),
        (
            "on a Dask cluster, the vehicle from the file's name",
            "fleet logs/ --vehicle 'loco([0-9]+)' --scheduler tcp://host:8786 --out result/",
        ),
    ),
    "diagnose": Command(
        "criticism",
        "what the simulation gets wrong, and why",
        (
            "the cause, the extended model and a page",
            "diagnose drive.log --extended model.toml --html diagnosis.html",
        ),
        (
            "the drive that distinguishes the remaining explanations",
            "diagnose drive.log --next-drive plan.toml",
        ),
    ),
    "evaluate": Command(
        "criticism",
        "test of a model on data that it has not seen",
        ("a second drive", "evaluate other.log --model model.toml"),
        ("with a page", "evaluate other.log --model model.toml --html evaluation.html"),
    ),
    "experiment": Command(
        "criticism",
        "the paper's experiments, every estimator side by side",
        ("one surface, data in sequence", "experiment 1"),
        ("two changes of the surface, ten runs", "experiment 3 --runs 10 --out results/"),
    ),
    "init": Command(
        "set-up",
        "a commented configuration from a database",
        ("asks for what names and units leave open", "init --dbc mine.dbc --out mine.toml"),
        (
            "without questions; what is not given says 'fill in'",
            "init --dbc mine.dbc --yes --wheel-radius 0.33 --axle-load 90e3 --out mine.toml",
        ),
    ),
    "calibrate": Command(
        "set-up",
        "wheel radii and speed offset from coasting",
        (
            "do the radii agree with it?",
            "calibrate drive.log --config mine.toml",
        ),
        (
            "write the configuration with the calibrated radii",
            "calibrate drive.log --config mine.toml --out calibrated.toml",
        ),
    ),
    "completion": Command(
        "set-up",
        "a shell script that completes commands and options",
        (
            "for bash",
            "completion bash > ~/.local/share/bash-completion/completions/adhesion-can",
        ),
        (
            "for fish",
            "completion fish > ~/.config/fish/completions/adhesion-can.fish",
        ),
    ),
}
"""The commands, those of a use together; the command's module in this package has its name."""


def example_lines(name: str) -> list[str]:
    """Examples of a command as a shell takes them, each below a comment."""
    command = COMMANDS[name]
    pairs = (command.first, command.second)
    return [line for what, words in pairs for line in (f"# {what}", f"adhesion-can {words}")]
