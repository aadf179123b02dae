"""QiMessaging: connections, the service directory, objects and their signatures."""
