"""What all tests share: how hypothesis works here."""

from __future__ import annotations

import os

from hypothesis import HealthCheck, settings

# A busy machine must not fail a test: no deadline, and slow generation is no complaint. Where the tests decide
# whether a change lands they repeat; elsewhere each run looks at new examples.
settings.register_profile(
    "khepera-hil",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize="CI" in os.environ,
    print_blob=True,
)
settings.load_profile("khepera-hil")
