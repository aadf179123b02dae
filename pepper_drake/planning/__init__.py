"""From a hand's path to joint commands that can be checked before the arm moves."""
