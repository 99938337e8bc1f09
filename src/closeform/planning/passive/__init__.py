"""Loss of thrust in plans of any cost: certificate, close approaches, and starts of two impulses."""
