"""`python -m bench [NAME...]`: all benchmarks one after the other, or those named."""

import sys
import time
from importlib import import_module

NAMES = ("streaming", "grbl", "wire", "reading", "toolpath", "frames", "instant", "memory", "load", "page", "soak")


def main(names: list[str]) -> int:
    """Runs them; 2 for a name that is none."""
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        print(f"There is no benchmark {unknown[0]!r}; there are: {', '.join(NAMES)}.", file=sys.stderr)
        return 2
    for name in names or NAMES:
        began_at = time.monotonic()
        print(import_module(f"bench.{name}").run())
        print(f"\n  ({time.monotonic() - began_at:.0f} s)\n", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
