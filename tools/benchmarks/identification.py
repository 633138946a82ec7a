"""The tracker: how exact, how soon, how seldom wrong, how fast; each figure beside its target."""

from _accuracy import accuracy, slow
from _alarms import alarm_row, delay_row
from _cost import memory_row, time_row
from _driving import driving_row
from _low_excitation import excitation_row, variables_row
from _rows import add_seed_and_jobs, positive, row_parser, run_rows

ROWS = {
    "accuracy": accuracy,
    "delay": delay_row,
    "alarms": alarm_row,
    "driving": driving_row,
    "time": time_row,
    "memory": memory_row,
    "variables": variables_row,
    "slow": slow,
    "excitation": excitation_row,
}


def parsed():
    parser = row_parser("identification", ROWS)
    count, hours = positive(int), positive(float)
    add = parser.add_argument
    add("--runs", type=count, default=50, metavar="N",
        help="Monte-Carlo runs of accuracy and variables; four times as many for delay and "
        "excitation, a twelfth for slow (default 50)")  # fmt: skip
    add("--hours", type=hours, default=30.0, metavar="H",
        help="of 100 Hz data without a change, for alarms (default 30)")  # fmt: skip
    add("--driven-hours", type=hours, default=4.0, metavar="H",
        help="of simulated driving, for driving (default 4)")  # fmt: skip
    add("--soak-updates", type=count, default=200_000, metavar="N",
        help="over which the day of memory is spread (default 200000)")  # fmt: skip
    add_seed_and_jobs(parser, "processes; time and memory take one (default all)")
    return parser.parse_args()


def main():
    run_rows(ROWS, parsed())


if __name__ == "__main__":
    main()
