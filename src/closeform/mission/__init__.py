"""Missions: the stages of a scenario planned in order, judged, and simulated. Start at `mission.mission`."""
