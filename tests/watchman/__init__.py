"""The night watchman on the robot (sections 9 and 10)."""
