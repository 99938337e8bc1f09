"""Search for lost spacecraft in deep space: schedules, locks, certified proofs, and gathering."""
