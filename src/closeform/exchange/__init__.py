"""Readers and writers of ephemerides and messages."""
