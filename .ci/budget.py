"""Shows how long each step of the gate took, beside what it takes where budget was written.

    budget.py NAME <LINES

LINES: of each step the seconds that passed, those of a processor, and its name. NAME is the column of budget with
which they are compared, none if there is none. Machines differ, and what runs beside a step delays it. So processor
time is compared, and with the middle of all steps: those that have grown by a quarter more are named.
"""

import statistics
import sys
from pathlib import Path

BUDGET = Path(__file__).with_name("budget")
GROWN = 1.25
LEAST = 10  # seconds; what is shorter says nothing


def budget_of(name, text):
    """Returns {step: seconds} of one column."""
    columns, *rows = [line.split("  ") for line in text.splitlines() if not line.startswith("#")]
    if name not in columns:
        return {}
    return {row[-1]: float(row[columns.index(name)]) for row in rows if row[columns.index(name)] != "-"}


def grown(steps, budget):
    """Returns [(step, times)]: how many times longer than the budget says. steps: {name: seconds}."""
    ratios = {name: steps[name] / budget[name] for name in steps if budget.get(name, 0) >= LEAST}
    if not ratios:
        return []
    middle = statistics.median(ratios.values())
    return [(name, ratio / middle) for name, ratio in ratios.items() if ratio > GROWN * middle]


def minutes(seconds):
    return f"{int(seconds) // 60:3d}:{int(seconds) % 60:02d}"


def main(name, lines):
    rows = [line.rstrip("\n").split(" ", 2) for line in lines]
    budget = budget_of(name, BUDGET.read_text())
    print(" passed  processor" + "  budget" * bool(budget))
    for passed, used, step in rows:
        known = minutes(budget[step]) if step in budget else "     -" if budget else ""
        print(f"{minutes(float(passed))}  {minutes(float(used)):>9}  {known}  {step}")
    for step, times in grown({step: float(used) for _, used, step in rows}, budget):
        print(f"GROWN: {step} takes {times:.2f} times what .ci/budget says, other steps being as they are")


if __name__ == "__main__":
    main(sys.argv[1], sys.stdin)
