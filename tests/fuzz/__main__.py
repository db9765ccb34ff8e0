"""Fuzz one parser, or all, for minutes:  make fuzz ARGS="grbl --minutes 5"

Hypothesis by default; `--engine atheris` is guided by what of the code was reached, where atheris is installed. The one
rule: what is found ends the run with exit code 1, and its smallest form lies among the seeds as `crash-…`.
"""

import argparse
import hashlib
import random
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

from tests.fuzz.harnesses import HARNESSES, SEEDS, Harness, seeds
from tests.fuzz.inputs import inputs

MOST_SECONDS = 5.0
"""Of processor time for one input of a few thousand bytes: more is a finding, too."""
EXAMPLES = 500
"""In each round; between rounds the seed of the random numbers changes and the time is looked at."""


class TooSlowError(AssertionError):
    """An input that takes far too long."""


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="make fuzz", description="Fuzz the parsers.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(HARNESSES)}; none: all")
    parser.add_argument("--minutes", type=float, default=1.0, help="for each of them")
    parser.add_argument("--rounds", type=int, help=f"so many of {EXAMPLES} inputs each, however long they take")
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 32), help="to repeat a run")
    parser.add_argument("--engine", choices=["hypothesis", "atheris"], default="hypothesis")
    given_ = parser.parse_args(arguments)
    if unknown := set(given_.names) - set(HARNESSES):
        parser.error(f"no harness {', '.join(sorted(unknown))}; there are {', '.join(HARNESSES)}")
    names = given_.names or list(HARNESSES)
    if given_.engine == "atheris":
        return _guided(names, given_.minutes)
    return max(_tried(name, given_.minutes, given_.seed, given_.rounds) for name in names)


def _tried(name: str, minutes: float, first_seed: int, rounds: int | None = None) -> int:
    until, round_, inputs_tried = time.monotonic() + 60 * minutes, 0, 0
    while time.monotonic() < until if rounds is None else round_ < rounds:
        last, count, error = _round(name, first_seed + round_)
        inputs_tried, round_ = inputs_tried + count, round_ + 1
        if error is not None:
            print(f"{name}: {error!r}\n  kept as {_kept(name, last)}; seed {first_seed + round_ - 1}", file=sys.stderr)
            return 1
    print(f"{name}: {inputs_tried} inputs, nothing found (seed {first_seed})")
    return 0


def _round(name: str, number: int) -> tuple[bytes, int, Exception | None]:
    """The last input of a round (the smallest one that fails, where one does), how many there were, and the failure."""
    last, count = b"", 0

    @seed(number)
    @settings(
        max_examples=EXAMPLES,
        database=None,
        deadline=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
        report_multiple_bugs=False,
    )
    @given(inputs(seeds(name)))
    def tried(data: bytes) -> None:
        nonlocal last, count
        last, count = data, count + 1
        timed(HARNESSES[name], data)

    try:
        tried()
    except Exception as error:  # noqa: BLE001 - whatever a parser raises is what is looked for
        return last, count, error
    return last, count, None


def timed(harness: Harness, data: bytes) -> None:
    """Raises TooSlowError, or what the harness raises."""
    begun = time.process_time()
    harness(data)
    taken_s = time.process_time() - begun
    if taken_s > MOST_SECONDS:
        raise TooSlowError(f"{taken_s:.1f} s of processor time for {len(data)} bytes")


def _kept(name: str, data: bytes) -> Path:
    path = SEEDS / name / f"crash-{hashlib.sha256(data).hexdigest()[:10]}"
    path.write_bytes(data)
    return path


def _guided(names: Sequence[str], minutes: float) -> int:
    """libFuzzer ends the process at the first finding, and when its time is over: one harness a run."""
    try:
        import atheris
    except ImportError:
        print("atheris is not installed:  .venv/bin/pip install atheris", file=sys.stderr)
        return 2
    if len(names) != 1:
        print("atheris takes one harness a run; name it", file=sys.stderr)
        return 2
    [name] = names
    folder = SEEDS / name
    atheris.instrument_all()
    found = [
        "-max_len=4000",
        f"-max_total_time={int(60 * minutes)}",
        f"-artifact_prefix={folder}/",
        f"-seed_inputs={','.join(map(str, sorted(folder.iterdir())))}",
    ]
    atheris.Setup(["fuzz", *found], lambda data: timed(HARNESSES[name], data))
    atheris.Fuzz()
    return 0


if __name__ == "__main__":
    sys.exit(main())
