"""Write tests/data/hold_costs.json: the cost of passively safe plans from and to V-bar hold points.

    python tools/hold_costs.py

The file has the delta-v [m/s] of `avoid(..., cost="delta-v", drift=)` for each case of
tests/hold_transfers.py, one line per case.
"""

import json
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path.insert(0, str(TESTS))

import closeform as cf  # noqa: E402
from hold_transfers import hold_transfers  # noqa: E402


def main():
    costs = {}
    for case in hold_transfers():
        plan = cf.avoid(case.path, case.client, case.zone, drift=case.drift, cost="delta-v")
        costs[case.name] = round(plan.delta_v, 5)
    (TESTS / "data" / "hold_costs.json").write_text(json.dumps(costs, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
