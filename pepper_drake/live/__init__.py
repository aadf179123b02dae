"""Teaching and reaching live: the session, its page, what is drawn, and scripts that press keys."""
