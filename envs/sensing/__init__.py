"""What lies between a robot and its controller: sensors, motors, estimators, and how real they are."""
