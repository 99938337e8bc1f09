"""The search of lost craft for each other: sensor, schedule, locks, and the gathering."""
