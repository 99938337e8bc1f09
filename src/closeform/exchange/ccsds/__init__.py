"""CCSDS messages: orbits (OEM, OPM, OCM), attitudes (AEM) and conjunctions (CDM)."""
