"""The paper's experiments, sections 5 to 8, as commands: run, measured, shown (``khepera-hil paper``)."""
