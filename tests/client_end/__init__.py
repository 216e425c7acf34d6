"""The client's end of the wire: scripted lines, faulty lines, real pseudo-terminals."""
