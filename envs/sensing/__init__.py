"""Between a robot and its controller: sensors, motors, estimators, and how real they are."""
