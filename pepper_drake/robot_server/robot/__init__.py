"""The simulated robot behind the services: joints, base and sensors, in its own process."""
