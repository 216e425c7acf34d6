"""Kinds of ports for pyserial's ``serial_for_url``: append this package's name to
``serial.protocol_handler_packages``, and ``emulator://`` is one of them."""
