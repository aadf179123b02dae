"""QiMessaging: connections, the service directory, objects and what they may be called with."""
