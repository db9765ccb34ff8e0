"""`python -m bench [NAME...] [--only PART]`: all benchmarks one after the other, or those named.

Not the benchmarks. The one rule: what takes minutes says how far it is, and tells each part as it ends.
"""

import sys
import time
from functools import partial
from importlib import import_module

NAMES = ("streaming", "grbl", "wire", "reading", "toolpath", "frames", "instant", "memory", "load", "page", "soak")
ONLY = "--only"


def main(arguments: list[str]) -> int:
    """Runs them; 2 for a name or a part that is none."""
    names, only = _split(arguments)
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        print(f"There is no benchmark {unknown[0]!r}; there are: {', '.join(NAMES)}.", file=sys.stderr)
        return 2
    for name in names or NAMES:
        module = import_module(f"bench.{name}")
        parts: tuple[str, ...] = getattr(module, "PARTS", ())
        if strange := [part for part in only if part not in parts]:
            there_are = ", ".join(parts) or "none"
            print(f"{name} has no part {strange[0]!r}; there are: {there_are}.", file=sys.stderr)
            return 2
        began_at = time.monotonic()
        if parts:
            module.run(only, say=partial(print, flush=True))
        else:
            print(module.run())
        print(f"\n  ({time.monotonic() - began_at:.0f} s)\n", flush=True)
    return 0


def _split(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Names, and what stands behind each ONLY."""
    names: list[str] = []
    only: list[str] = []
    left = iter(arguments)
    for argument in left:
        if argument == ONLY:
            only.append(next(left, ""))
        else:
            names.append(argument)
    return names, only


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
