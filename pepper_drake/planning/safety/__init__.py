"""Safety of joint commands: limits, checks, contact detection, stops."""
