"""Control: feedback law, navigation accuracy, closed loop, and the tracking-error tube."""
