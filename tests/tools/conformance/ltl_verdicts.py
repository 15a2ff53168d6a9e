"""What `rv_ltl`, which Scenic uses, says of temporal formulas at each sample of a trace. Runs in the environment that
has it and not `scenicq`.

One JSON object a line on standard input, {"formula": [operator, operands...] or the number of an atom, "trace": truth
values of the atoms for each sample}; for each the verdicts after all its samples on standard output.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import rv_ltl


def formula(written: Any, atoms: dict[int, Any]) -> Any:
    """The formula of `rv_ltl`, whose atoms must be the same objects where they are the same."""
    if isinstance(written, int):
        return atoms.setdefault(written, rv_ltl.Atomic(identifier=str(written)))
    return getattr(rv_ltl, written[0].capitalize())(*(formula(each, atoms) for each in written[1:]))


def main() -> None:
    """Answer with verdicts."""
    for line in sys.stdin:
        pair = json.loads(line)
        monitor = formula(pair["formula"], {}).create_monitor()
        verdicts: list[bool] = []
        for sample in pair["trace"]:
            monitor.update({str(number): value for number, value in enumerate(sample)})
            verdicts.append(monitor.evaluate().is_truthy)
        print(json.dumps(verdicts))


if __name__ == "__main__":
    main()
