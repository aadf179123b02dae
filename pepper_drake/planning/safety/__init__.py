"""Joint commands that the robot may be given: limits, checks, contacts, stops."""
