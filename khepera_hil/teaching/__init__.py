"""How a data set is recorded: teachers (joystick, keyboard, script), lessons, data sets (section 5.3)."""
