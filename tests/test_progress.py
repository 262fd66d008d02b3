"""Work whose end is open says how far it is, and what is left of the part under way."""

import re
from concurrent.futures import ThreadPoolExecutor

from workbench.runtime.progress import ProgressReporter, StepReporter


def test_a_part_that_takes_long_says_how_much_is_left_of_it():
    lines: list[str] = []
    done = ProgressReporter(lines.append, "simulations", every=0.0).part(4)
    for one in range(4):
        done(one)
    assert [line.partition(",")[0] for line in lines] == [f"{n} simulations" for n in (1, 2, 3, 4)]
    assert re.fullmatch(r"1 simulations, about \d+ s left of these 4", lines[0])
    assert lines[-1] == "4 simulations"  # nothing is left


def test_parts_add_up_from_any_thread():
    lines: list[str] = []
    pace = ProgressReporter(lines.append, "simulations", every=0.0)

    def part(size: int) -> None:
        done = pace.part(size)
        for one in range(size):
            done(one)

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(part, [25, 50, 75, 100]))
    counts = sorted(int(line.split()[0]) for line in lines)
    assert counts == list(range(1, 251))


def test_what_is_soon_done_says_nothing():
    lines: list[str] = []
    done = ProgressReporter(lines.append, "simulations", every=3600.0).part(100)
    for one in range(100):
        done(one)
    assert lines == []


def test_each_of_a_known_number_of_steps_says_what_came_of_it_and_what_is_left():
    lines: list[str] = []
    progress = StepReporter(lines.append, 12)
    for name in ("first", "second"):
        progress.step(name)
    assert re.fullmatch(r"\[ 1/12\] first, about \d+ s left", lines[0])
    assert re.fullmatch(r"\[ 2/12\] second, about \d+ s left", lines[1])
