"""Clearance of k-sigma ellipsoids from zones, certified between any two instants."""
