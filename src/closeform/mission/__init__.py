"""Missions: stages of a scenario planned in order, evaluated and simulated. Start at `mission.mission`."""
