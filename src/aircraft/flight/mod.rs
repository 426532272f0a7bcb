//! An airplane over time: the `flight.json` document, earth, servos, autopilot, sensors (floor 4).
