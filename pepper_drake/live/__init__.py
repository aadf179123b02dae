"""Live teaching and reaching: the session, its page, its drawing, and scripted user input."""
